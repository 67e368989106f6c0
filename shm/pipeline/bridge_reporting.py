"""From the store to what a report of the whole bridge is made of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime

import shm
from shm.errors import NothingThere
from shm.report import Interval
from shm.report.bridge.content import BridgeReport, HangerLine
from shm.report.states import called_words
from shm.report.summary import status_of
from shm.store import Baseline, Store, StoredWatch, Workspace
from shm.values import NAN, Drift, Hanger
from shm.watch.neighbours import BridgePattern, bridge_pattern, shifts_of


def bridge_report(workspace: Workspace, store: Store, generated_at: datetime) -> BridgeReport:
    """All that the store knows of a bridge; raises NothingThere before any test is through."""
    hangers = workspace.bridge.hangers
    alerts = [alert for alert in store.alerts() if alert.acknowledgement is None]
    lines = tuple(
        _line(store, hanger, sum(each.alert.hanger == hanger.id for each in alerts))
        for hanger in hangers
    )
    if all(line.tension_n is None for line in lines):
        raise NothingThere(
            "no test of any hanger has been through updating yet.",
            remedy="Take recordings in with `shm ingest FILE`, or see `shm status`.",
        )
    pattern, why_not = _pattern_or_why(store, [hanger.id for hanger in hangers])
    return BridgeReport(
        workspace.bridge.name, lines, pattern, why_not, generated_at, shm.__version__
    )


def _pattern_or_why(store: Store, order: Sequence[int]) -> tuple[BridgePattern | None, str]:
    try:
        return stored_pattern(store, order), ""
    except NothingThere as reason:
        return None, f"Over the bridge nothing can be compared: {reason.message}"


def _line(store: Store, hanger: Hanger, open_alerts: int) -> HangerLine:
    history = store.history(hanger.id)
    if not history:
        return HangerLine(hanger, None, open_alerts=open_alerts)
    latest, posterior = history[-1]
    baseline = store.baseline(hanger.id, posterior.model)
    watches = _watches(store, baseline)
    called = [each.watched.change for each in watches if each.watched.change.called]
    is_first = baseline is None or baseline.posterior.tests == posterior.tests
    return HangerLine(
        hanger,
        status_of(
            latest_drifts(store, hanger.id, posterior.model),
            hanger,
            is_first=is_first,
            is_called=bool(called),
        ),
        latest.time,
        Interval.of_samples(posterior.tension_n),
        "; ".join(called_words(change) for change in called),
        open_alerts,
    )


def latest_drifts(store: Store, hanger: int, model: str | None = None) -> tuple[Drift, ...]:
    """The shifts of a hanger's latest test from the baseline in force.

    None where no test has been compared with it, as after the hanger was given a new one.
    """
    watches = _watches(store, store.baseline(hanger, model))
    return watches[-1].watched.drifts if watches else ()


def _watches(store: Store, baseline: Baseline | None) -> Sequence[StoredWatch]:
    return store.watches(baseline.hanger, baseline.id) if baseline else ()


def stored_pattern(store: Store, order: Sequence[int]) -> BridgePattern:
    """The pattern over the hangers, in their `order` along the bridge, from their latest watches.

    Raises NothingThere where fewer than three of them can be compared.
    """
    baselines = {hanger: store.baseline(hanger) for hanger in order}
    watched = {hanger: _watches(store, baseline) for hanger, baseline in baselines.items()}
    drifts = {
        hanger: [drift for watch in watches for drift in watch.watched.drifts]
        for hanger, watches in watched.items()
    }
    changes = {
        hanger: watches[-1].watched.temperature_c - _before_c(store, baselines[hanger])
        for hanger, watches in watched.items()
        if watches
    }
    return bridge_pattern(shifts_of(drifts, order, temperature_changes_k=changes), order)


def _before_c(store: Store, baseline: Baseline | None) -> float:
    """Mean temperature of the baseline's tests; NaN where none is known."""
    tests = store.tests_of(baseline) if baseline else ()
    temperatures = [each.test.temperature_c for each in tests]
    known = [value for value in temperatures if math.isfinite(value)]
    return sum(known) / len(known) if known else NAN
