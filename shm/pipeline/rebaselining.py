"""Comparing a hanger with itself anew: the tests since a day become its baseline.

After works on a hanger, or once a shift was looked into and accepted, the old baseline has nothing
more to say. The tests since then are updated jointly in the class in force, as the first ones were;
tests after that are watched against the result. What was compared with the old baseline stays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime

from shm.errors import NothingThere
from shm.inference import update
from shm.inference.options import Progress, silent
from shm.models import build
from shm.pipeline.calibrating import checked, options_of
from shm.pipeline.lineage import update_terms
from shm.store import Baseline, Stage, Store, StoredTest, Workspace
from shm.values import Change, Hanger
from shm.watch.events import EventKind, is_explained


@dataclass(frozen=True)
class Order:
    """Who wants a hanger compared with itself as it is since when, and why.

    With a `kind` of event only the alerts that it explains are resolved.
    """

    since: datetime
    why: str
    who: str
    kind: EventKind | None = None


def rebaseline(
    workspace: Workspace,
    store: Store,
    hanger: Hanger,
    order: Order,
    at: datetime,
    progress: Progress = silent,
) -> Baseline:
    """Updates the tests since then jointly and has later tests compared with them.

    Raises NothingThere where the hanger has no baseline, or no test as young as that has been
    worked through; BadInput where the class in force cannot describe the tests; StoreBusy where
    another baseline came in meanwhile.
    """
    before = store.watch.baseline(hanger.id)
    if before is None:
        raise NothingThere(
            f"hanger {hanger.id} has no baseline yet, and so none to replace.",
            remedy="Take in its first tests with `shm ingest FILE`.",
        )
    chosen = _since(store, hanger, order.since)
    model = before.posterior.model
    terms, lineage = update_terms(hanger, [model], chosen, workspace.settings)
    measured = [test.test for test in chosen]
    check = checked(measured, hanger, terms)
    posterior = update(
        check.kept_of(measured),
        build(model, hanger, terms.priors),
        options_of(terms, hanger),
        progress,
        warm_start=before.posterior,
    )
    posterior = replace(posterior, baseline_check=check)
    why = f"{order.kind.name}: {order.why}" if order.kind else order.why
    record, explained = (order.who, why, order.since), None
    if order.kind is not None:
        explained = [
            each.id
            for each in store.alerts.list_all(hanger.id)
            if is_explained(each.alert, order.kind, order.since)
        ]
    return store.watch.rebaseline(before, posterior, chosen, record, lineage, at, explained)


def changes_within(store: Store, hanger: int, since: datetime) -> tuple[Change, ...]:
    """The changes called of a hanger that lie among its tests since then: a baseline of these would
    be made of two states."""
    times = [test.time for test in store.tests.list_all(hanger) if test.time >= since]
    return tuple(
        each
        for each in store.watch.detected_changes().get(hanger, ())
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
            remedy="Hit it first and take the test in with `shm ingest FILE`, or give an earlier "
            "--since.",
        )
    return tuple(found)
