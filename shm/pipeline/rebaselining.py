"""Comparing a hanger with itself anew: the tests since a day become its baseline.

After works on a hanger, or once a shift was looked into and accepted, the old baseline has nothing
more to say. The tests since then are updated jointly in the class in force, as the first ones were;
tests after that are watched against the result. What was compared with the old baseline stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from shm.errors import BadInput, NothingThere
from shm.inference import update
from shm.inference.options import Progress, silent
from shm.models import build
from shm.pipeline.lineage import update_terms
from shm.pipeline.steps import options_of
from shm.pipeline.watching import dated_tests
from shm.store import Baseline, Stage, Store, StoredAlert, StoredTest, Workspace
from shm.store.watch import list_detected_changes
from shm.values import Change, Hanger
from shm.values.rounding import force_unit
from shm.watch.baseline_check import check_baseline
from shm.watch.engine.readings import Reader
from shm.watch.repair_check import EventKind, Unrepaired, is_explained, unrepaired
from shm.watch.watching import accepted_baseline_tests


@dataclass(frozen=True)
class Order:
    """Request to compare a hanger with itself since a time, by whom and why.

    With a `kind` of event only the alerts that it explains are resolved.
    """

    since: datetime
    why: str
    who: str
    kind: EventKind | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """A new baseline, and what it makes of the hanger's alerts.

    `within` are changes among its tests, `accepted` what of the alerts it takes for normal;
    `explained` are the numbers of alerts that it has ended, `left` of those that stay open.
    """

    made: Baseline
    within: tuple[Change, ...]
    accepted: tuple[Unrepaired, ...]
    explained: tuple[int, ...]
    left: tuple[int, ...]

    @property
    def warning(self) -> str:
        """That it mixes two states; empty where it does not."""
        if not self.within:
            return ""
        day = f"{max(each.began_by for each in self.within):%Y-%m-%d}"
        return (
            f"These tests lie on both sides of a change that was called (by {day}): the baseline "
            f"mixes two states. For that after it give `--since {day}`."
        )

    @property
    def sentences(self) -> tuple[str, ...]:
        """Return sentences on what holds from now on."""
        tension_n, made = self.made.posterior.tension_n, self.made
        unit = force_unit(float(tension_n.mean()))
        tension, count = unit.of(tension_n), len(made.posterior.tests)
        tests = "one test" if count == 1 else f"{count} tests"
        lines = [
            f"Hanger {made.hanger} is compared with its {tests} since {made.since:%Y-%m-%d} from "
            f"now on: {tension.mean():.4g} {unit.name} (sd {tension.std(ddof=1):.2g} {unit.name})."
        ]
        lines += [
            f"Its tests still show what alert {each.alert} reported ({each.words}): from now on "
            "that is taken for its normal state."
            for each in self.accepted
        ]
        lines += [f"Alert {each} is explained by it and resolved." for each in self.explained]
        if self.left:
            notes = ", ".join(f"`shm alerts ack {each}`" for each in self.left)
            lines.append(f"Alerts of it are still open. Take note of them: {notes}.")
        return tuple(lines)


def set_baseline(
    workspace: Workspace,
    store: Store,
    hanger: Hanger,
    order: Order,
    at: datetime,
    progress: Progress = silent,
) -> Outcome:
    """Updates the tests since then jointly and has later tests compared with them.

    Raises NothingThere where the hanger has no baseline, or no test as young as that has been
    worked through; BadInput where the class in force cannot describe the tests, or where works are
    to have put right what the tests still show; StoreBusy where another baseline came in meanwhile.
    """
    before, kind = store.watch.baseline(hanger.id), order.kind
    if before is None:
        raise NothingThere(
            f"hanger {hanger.id} has no baseline yet, and so none to replace.",
            remedy="Take in its first tests with `shm ingest FILE`.",
        )
    chosen = _since(store, hanger, order.since)
    is_accepted = kind is None or kind.accepts
    shown = (
        _still_shown(store, hanger, order) if kind is None or kind.is_remedy or is_accepted else ()
    )
    if kind is not None and kind.is_remedy and not is_accepted:
        _refuse_unrepaired(shown, hanger, order)
    within = changes_within(store, hanger.id, order.since)
    numbers = [each.id for each in _explained(store, hanger, order)] if kind else None
    model = before.posterior.model
    terms, lineage = update_terms(hanger, [model], chosen, workspace.settings)
    measured = [test.test for test in chosen]
    check = check_baseline(measured, hanger)
    posterior = update(
        check.accepted_tests(measured),
        build(model, hanger, terms.priors),
        options_of(terms, hanger),
        progress,
        warm_start=before.posterior,
    )
    posterior = replace(posterior, baseline_check=check)
    why = f"{kind.name}: {order.why}" if kind else order.why
    record = (order.who, why, order.since)
    made = store.watch.rebaseline(before, posterior, chosen, record, lineage, at, numbers)
    alerts = store.alerts.list_all(hanger.id)
    explained = [each.id for each in alerts if _is_explained_by(each, made)] if kind else []
    left = tuple(each.id for each in alerts if each.is_open)
    return Outcome(made, within, shown if is_accepted else (), tuple(explained), left)


def _is_explained_by(stored: StoredAlert, made: Baseline) -> bool:
    """Return True if a new baseline has ended an alert, and nobody had taken note of it before."""
    noted = stored.acknowledgement
    return noted is not None and (noted.who, noted.at) == (made.who, made.set_at)


def _still_shown(store: Store, hanger: Hanger, order: Order) -> tuple[Unrepaired, ...]:
    """Return what tests of a request still show of the alerts that it ends.

    Each against the baseline that it was raised against: a later one may hold the loss already.
    """
    since = [(each.test, each.time) for each in _since(store, hanger, order.since)]
    tests = {each.test.id: each.test for each in store.tests.list_all(hanger.id)}
    kind = order.kind
    restores = kind is None or kind.restores or kind.accepts
    found: list[Unrepaired] = []
    explained = _explained(store, hanger, order)
    for number in dict.fromkeys(each.baseline_id for each in explained):
        before = store.watch.baseline(hanger.id, number=number)
        if before is None:
            continue
        accepted = accepted_baseline_tests(before.posterior, dated_tests(store, before)[0])
        of_baseline = [test for test, _ in accepted]
        reader = Reader(before.posterior, of_baseline, hanger)
        announced = [
            (each.id, each.alert, tests.get(each.alert.test))
            for each in explained
            if each.baseline_id == number
        ]
        found += unrepaired((reader, of_baseline), announced, since, hanger, restores=restores)
    return tuple(found)


def _explained(store: Store, hanger: Hanger, order: Order) -> list[StoredAlert]:
    """The standing alerts that an order explains; all, where it names no kind of event."""
    return [
        each
        for each in store.alerts.list_all(hanger.id, standing=True)
        if order.kind is None or is_explained(each.alert, order.kind, order.since)
    ]


def _refuse_unrepaired(left: Sequence[Unrepaired], hanger: Hanger, order: Order) -> None:
    if not left or order.kind is None:
        return
    listed = "; ".join(f"alert {each.alert}: {each.words}" for each in left)
    raise BadInput(
        f"hanger {hanger.id} is not {order.kind.name} by its tests since {order.since:%Y-%m-%d}: "
        f"against the former baseline there is still {listed}. Nothing was changed.",
        remedy="Test it after the works and give their day as --since. If it is to stay so, say "
        '--kind "accepted as it is".',
    )


def changes_within(store: Store, hanger: int, since: datetime) -> tuple[Change, ...]:
    """The changes called of a hanger that lie among its tests since then: a baseline of these would
    be made of two states."""
    times = [test.time for test in store.tests.list_all(hanger) if test.time >= since]
    return tuple(
        each
        for each in list_detected_changes(store).get(hanger, ())
        if times and min(times) <= each.began_after and max(times) >= each.began_by
    )


def _since(store: Store, hanger: Hanger, since: datetime) -> tuple[StoredTest, ...]:
    """Tests of then and later that have been watched: those on their way are later ones."""
    tests = store.tests.list_all(hanger.id)
    found = [test for test in tests if test.time >= since and test.stage is Stage.WATCHED]
    if not found:
        latest = f"its latest is of {tests[-1].time:%Y-%m-%d}" if tests else "it has none at all"
        raise NothingThere(
            f"hanger {hanger.id} has no test since {since:%Y-%m-%d} that has been worked through; "
            f"{latest}.",
            remedy="Test it first and send in the recording, or choose an earlier day.",
        )
    return tuple(found)
