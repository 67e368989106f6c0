"""Conditions that end, and planned works, through the whole flow with the sampler's stand-in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest

from shm.pipeline import steps
from shm.pipeline.ending import why_over
from shm.store import Stage, Workspace
from shm.store.missing import missing_rows
from shm.values import Alert
from tests.helpers import quick_update
from tests.helpers.any_bar import take_any_bar
from tests.helpers.flows import Clock, Postman, a_flow, receive_all
from tests.helpers.nouns import NOW, a_drift, a_watched_test
from tests.helpers.workspaces import START, make_workspace, write_test


@pytest.fixture
def bridge(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    take_any_bar(monkeypatch)
    for verb in ("update", "refresh", "select"):
        monkeypatch.setattr(steps, verb, getattr(quick_update, verb))
    return make_workspace(tmp_path / "bridge", hooks={"mail": ["true"]})


def take(workspace: Workspace, postman: Postman, day: float, tension: float) -> None:
    path = workspace.spool / f"d{day:g}.modes.json"
    write_test(path, workspace, day=day, tension=tension)
    clock = Clock(START + timedelta(days=day, hours=1))
    with a_flow(workspace, clock=clock, notifier=postman) as flow:
        receive_all(flow)
        flow.drain()
        flow.drain()


def test_a_tension_that_comes_back_resolves_its_alert(bridge: Workspace) -> None:
    postman = Postman()
    for day, tension in ((0, 1.0), (30, 0.8), (60, 0.8)):
        take(bridge, postman, day, tension)
    # The first asks to repeat the test that fits none before it.
    (raised,) = {key for _, key in postman.told if "repeat-the-test" not in key}
    for day in (90, 120, 150):
        take(bridge, postman, day, 1.0)
    assert ("mail", f"{raised}:resolved") in postman.told
    with bridge.store() as store:
        (found,) = (each for each in store.alerts.list_all() if each.alert.key == raised)
        assert found.resolution is not None
        assert found.resolution.who == "shm"
        with store.engine.connect() as connection:
            assert missing_rows(connection) == ()


def test_tests_within_a_maintenance_window_raise_nothing_and_the_first_after_it_says_so(
    bridge: Workspace,
) -> None:
    postman = Postman()
    take(bridge, postman, 0, 1.0)
    with bridge.store() as store:
        period = START + timedelta(days=10), START + timedelta(days=50)
        store.silences.make(3, period, "Ann", "new pin", START, is_maintenance=True)
    for day in (20, 40):
        take(bridge, postman, day, 0.5)
    assert postman.told == []
    with bridge.store() as store:
        assert store.alerts.list_all() == ()
        assert [test.stage for test in store.tests.list_all(3)] == [Stage.WATCHED] * 3
        with store.engine.connect() as connection:
            assert missing_rows(connection) == ()
    take(bridge, postman, 60, 0.8)
    take(bridge, postman, 90, 0.8)
    # The first asks to repeat the test that fits none before it.
    assert [key.split(":")[1] for _, key in postman.told] == ["repeat-the-test", "two-tests-agree"]
    with bridge.store() as store:
        raised = store.alerts.list_all()[-1]
    said = raised.alert.message
    assert "Planned works lie in between (new pin)" in said
    assert f"--since {period[1]:%Y-%m-%d}" in said


@pytest.mark.parametrize("days", [(40,), (20, 40)])
def test_a_loss_that_lasts_beyond_a_maintenance_window_is_told_once_at_the_first_test_after_it(
    bridge: Workspace, days: Sequence[int]
) -> None:
    postman = Postman()
    take(bridge, postman, 0, 1.0)
    with bridge.store() as store:
        period = START + timedelta(days=10), START + timedelta(days=50)
        store.silences.make(3, period, "Ann", "new pin", START, is_maintenance=True)
    for day in days:
        take(bridge, postman, day, 0.8)
    assert postman.told == []
    for day in (60, 90, 120, 150):
        take(bridge, postman, day, 0.8)
    with bridge.store() as store:
        (raised,) = (each.alert for each in store.alerts.list_all())
    assert [key for _, key in postman.told] == [raised.key]
    assert raised.test == "d60"
    assert "Planned works lie in between (new pin)" in raised.message


@pytest.mark.parametrize(
    ("probability", "is_over"), [(0.01, True), (0.6, False), (float("nan"), False)]
)
def test_a_shift_has_ended_below_half_the_level_and_never_where_that_is_unknown(
    bridge: Workspace, probability: float, is_over: bool
) -> None:
    told = replace(a_drift("t1"), shift_mean=-0.08, threshold=0.05)
    alert = Alert("k", 3, "t1", NOW, "fell", (told,), ("beyond threshold",))
    later = a_watched_test("t2")
    later = replace(
        later,
        time=NOW + timedelta(days=1),
        drifts=(replace(told, test="t2", shift_mean=-0.01, probability=probability),),
    )
    hanger = bridge.bridge.hangers[0]
    assert bool(why_over(alert, later, hanger, gap_stands=False)) is is_over
    assert not why_over(alert, replace(later, time=NOW), hanger, gap_stands=False)
    assert not why_over(replace(alert, drifts=()), later, hanger, gap_stands=False)
