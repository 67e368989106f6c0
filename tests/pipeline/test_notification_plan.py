"""Which hook is told what and when: silences, groups, escalation, resolutions; a clock that stands
where it is put, and a store that is opened anew as after a kill.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest

from shm.bridge import Hook
from shm.errors import UsageError
from shm.pipeline import Flow
from shm.pipeline.courier import after_works, quiet_until, works_before
from shm.store import Silence, Workspace
from shm.values import Alert
from tests.helpers.flows import Clock, a_flow
from tests.helpers.nouns import NOW, a_drift
from tests.helpers.outboxes import raise_alike
from tests.helpers.workspaces import make_workspace

HANGERS = tuple(range(1, 51))
HOUR = 3600.0


class Inbox:
    """A hook's other end; fails as often as it is told to."""

    def __init__(self) -> None:
        self.had: list[tuple[str, Alert]] = []
        self.failures = 0

    def __call__(self, hook: Hook, alert: Alert) -> None:
        self.had.append((hook.name, alert))
        if self.failures:
            self.failures -= 1
            raise RuntimeError("no answer")

    def of(self, hook: str) -> list[Alert]:
        return [alert for name, alert in self.had if name == hook]


@pytest.fixture
def clock() -> Clock:
    return Clock(NOW)


@pytest.fixture
def inbox() -> Inbox:
    return Inbox()


@pytest.fixture
def bridge(tmp_path: Path) -> Workspace:
    return make_bridge(tmp_path, range(1, 9))


def make_bridge(tmp_path: Path, hangers: Sequence[int]) -> Workspace:
    """Hangers alike, a hook `mail`, and a hook `boss` that hears after an hour."""
    settings = {"alert_grouping_seconds": 60.0, "hook_backoff_seconds": 5.0}
    hooks = {"mail": ["true"], "boss": ["true"]}
    made = make_workspace(tmp_path / "bridge", hangers=hangers, settings=settings, hooks=hooks)
    described = Path(made.bridge.source)
    text = described.read_text().replace(
        'name = "boss"', 'name = "boss"\nescalation_after_seconds = 3600'
    )
    described.write_text(text)
    return made.reopened()


def raise_on(workspace: Workspace, clock: Clock, hangers: Sequence[int], action: str = "") -> None:
    hooks = [hook.name for hook in workspace.bridge.hooks]
    raise_alike(workspace, hangers, hooks, clock(), action=action)


def look(workspace: Workspace, clock: Clock, inbox: Inbox) -> None:
    """One life of a daemon that looks once and is begun anew the next time."""
    with a_flow(workspace, clock=clock, notifier=inbox) as flow:
        _work(flow)


def _work(flow: Flow) -> None:
    while flow.advance():
        for future in flow.under_way:
            future.exception(10)


def live(workspace: Workspace, clock: Clock, inbox: Inbox, seconds: float, step: float) -> None:
    end = clock() + timedelta(seconds=seconds)
    while clock() < end:
        clock.pass_by(step)
        look(workspace, clock, inbox)


def states(workspace: Workspace, hook: str) -> set[str]:
    with workspace.store() as store:
        found = store.alerts.list_deliveries()
        return {each.state.value for each in found if each.hook == hook}


# ---------------------------------------------------------------- groups


@pytest.mark.slow
def test_fifty_hangers_that_move_alike_are_one_message_that_lists_all(
    tmp_path: Path, clock: Clock, inbox: Inbox
) -> None:
    bridge = make_bridge(tmp_path, HANGERS)
    for hanger in HANGERS:
        raise_on(bridge, clock, [hanger])
        clock.pass_by(2.0)
    live(bridge, clock, inbox, 300.0, 20.0)
    (told,) = inbox.of("mail")
    assert [each.hanger for each in told.alerts] == list(HANGERS)
    assert len({each.key for each in told.alerts}) == 50
    assert told.message.startswith("50 hangers: tension fell: 1, 2, 3,")
    assert "largest 8.5 % at hanger 50" in told.message
    assert states(bridge, "mail") == {"delivered"}


def test_a_message_keeps_its_alerts_and_key_through_failures_and_lives(
    bridge: Workspace, clock: Clock, inbox: Inbox
) -> None:
    raise_on(bridge, clock, [1, 2, 3])
    inbox.failures = 2
    clock.pass_by(61.0)
    look(bridge, clock, inbox)
    raise_on(bridge, clock, [4])
    live(bridge, clock, inbox, 40.0, 10.0)
    keys = {each.key for each in inbox.of("mail")}
    assert keys == {"hanger-1:h1-1:and-2-more"}
    assert len(inbox.of("mail")) == 3
    assert states(bridge, "mail") == {"delivered", "waiting"}


# ---------------------------------------------------------------- escalation


def test_what_nobody_acknowledged_is_escalated_once_within_a_minute_of_its_time(
    bridge: Workspace, clock: Clock, inbox: Inbox
) -> None:
    raise_on(bridge, clock, [7])
    live(bridge, clock, inbox, HOUR - 600.0, 300.0)
    live(bridge, clock, inbox, 590.0, 59.0)
    assert inbox.of("boss") == []
    live(bridge, clock, inbox, 70.0, 10.0)
    assert [each.key for each in inbox.of("boss")] == ["hanger-7:h7-1"]
    live(bridge, clock, inbox, 2 * HOUR, 600.0)
    assert len(inbox.of("boss")) == len(inbox.of("mail")) == 1


def test_what_was_acknowledged_in_time_is_never_escalated(
    bridge: Workspace, clock: Clock, inbox: Inbox
) -> None:
    raise_on(bridge, clock, [7])
    live(bridge, clock, inbox, 600.0, 60.0)
    with bridge.store() as store:
        store.alerts.acknowledge(1, "Ann", "on my way", clock())
    live(bridge, clock, inbox, 2 * HOUR, 600.0)
    assert inbox.of("boss") == []
    assert states(bridge, "boss") == {"not needed"}


# ---------------------------------------------------------------- quiet hours


@pytest.fixture
def quiet(bridge: Workspace) -> Workspace:
    """The same, quiet from ten to six in Berlin, in May two hours before UTC."""
    return _quiet(bridge, "22:00-06:00", "Europe/Berlin")


def _quiet(workspace: Workspace, hours: str, zone: str) -> Workspace:
    described = Path(workspace.bridge.source)
    text = described.read_text().replace("command =", f'quiet_hours = "{hours}"\ncommand =')
    described.write_text(text.replace("[bridge]", f'[bridge]\ntime_zone = "{zone}"'))
    return workspace.reopened()


def test_in_quiet_hours_what_is_urgent_goes_and_the_rest_goes_grouped_at_their_end(
    quiet: Workspace, clock: Clock, inbox: Inbox
) -> None:
    clock.pass_by(8.5 * HOUR)  # 22:30 in Berlin
    raise_on(quiet, clock, [1, 4])
    raise_on(quiet, clock, [3], action="Repeat the hammer test today.")
    live(quiet, clock, inbox, 90.0, 30.0)
    assert [each.hanger for each in inbox.of("mail")] == [3]
    with quiet.store() as store:
        waits = {
            each.alert.hanger: until and f"{until:%H:%M %Z}"
            for each in store.alerts.list_deliveries()
            if each.hook == "mail"
            for until in [quiet_until(each, quiet.bridge.hooks, clock())]
        }
        store.alerts.acknowledge(2, "Ann", "seen", clock())
    assert waits == {1: "06:00 CEST", 3: None, 4: "06:00 CEST"}
    live(quiet, clock, inbox, HOUR, 600.0)
    assert [each.hanger for each in inbox.of("boss")] == [3]
    raise_on(quiet, clock, [2])
    live(quiet, clock, inbox, 6 * HOUR, HOUR)
    clock.now = NOW + timedelta(hours=15.99)  # half a minute before six
    look(quiet, clock, inbox)
    assert len(inbox.of("mail")) == 1
    live(quiet, clock, inbox, 120.0, 30.0)
    assert [one.hanger for one in inbox.of("mail")[1].alerts] == [1, 2]
    assert states(quiet, "mail") == {"delivered", "not needed"}
    live(quiet, clock, inbox, HOUR, 600.0)  # an hour after somebody could know of them
    assert [one.hanger for one in inbox.of("boss")[1].alerts] == [1, 2]


# ---------------------------------------------------------------- silences


def _silence(
    workspace: Workspace, clock: Clock, hanger: int | None, begins: float, ends: float,
    *, works: bool = False,
) -> Silence:  # fmt: skip
    at = clock()
    period = (at + timedelta(seconds=begins), at + timedelta(seconds=ends))
    with workspace.store() as store:
        return store.silences.make(hanger, period, "Ann", "new pin", at, is_maintenance=works)


def test_what_is_acknowledged_or_resolved_in_a_silence_is_told_to_nobody(
    bridge: Workspace, clock: Clock, inbox: Inbox
) -> None:
    _silence(bridge, clock, None, 0.0, 1000.0)
    raise_on(bridge, clock, [7, 8])
    clock.pass_by(100.0)
    with bridge.store() as store:
        store.alerts.acknowledge(1, "Ann", "seen", clock())
        store.alerts.resolve(2, "Ann", "pin replaced", clock())
    live(bridge, clock, inbox, 2 * HOUR, 300.0)
    assert inbox.had == []
    assert states(bridge, "mail") == states(bridge, "boss") == {"not needed"}


# ---------------------------------------------------------------- resolutions


def test_who_was_told_of_an_alert_is_told_once_that_it_is_resolved(
    bridge: Workspace, clock: Clock, inbox: Inbox
) -> None:
    raise_on(bridge, clock, [7])
    live(bridge, clock, inbox, 90.0, 30.0)
    with bridge.store() as store:
        found = store.alerts.resolve(1, "Ann", "pin replaced", clock())
        assert found.acknowledgement is not None
        with pytest.raises(UsageError, match="resolved already"):
            store.alerts.resolve(1, "Ann", "again", clock())
    live(bridge, clock, inbox, 2 * HOUR, 120.0)
    raised, resolved = inbox.of("mail")
    assert (resolved.key, resolved.kinds) == (f"{raised.key}:resolved", ("resolved",))
    assert resolved.message.startswith("Hanger 7: alert 1 is resolved. No action is needed.")
    assert inbox.of("boss") == []


# ---------------------------------------------------------------- planned works


def test_the_first_alert_after_works_says_so_and_how_to_accept(clock: Clock) -> None:
    period = clock() - timedelta(days=3), clock() - timedelta(days=1)
    works = Silence(1, None, *period, True, "Ann", "new pins", clock())
    alert = Alert("k", 7, "t", clock(), "Hanger 7: tension fell.", (a_drift("t"),))
    assert works_before(alert, [works], []) == works
    told = after_works(alert, works).message
    assert told.startswith("Hanger 7: tension fell. Planned works lie in between (new pins)")
    assert f"shm drift rebaseline --hanger 7 --since {period[1]:%Y-%m-%d}" in told
    assert works_before(alert, [replace(works, is_maintenance=False)], []) is None
    assert works_before(alert, [works], [replace(alert, key="another")]) is None
    before = [replace(alert, key="another", time=period[0])]
    assert works_before(alert, [works], before) == works
