"""From the store to what a report is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

import shm
from shm.errors import NothingThere
from shm.identify import identify
from shm.pipeline.adopting import gap_watch
from shm.pipeline.bridge_reporting import stored_pattern
from shm.pipeline.steps import identify_options
from shm.pipeline.terms import identify_lineage, read_limits
from shm.pipeline.watching import dated_tests
from shm.read.apart import read_test
from shm.report import HangerReport, TestSheet, trend_row
from shm.report.states import NOTHING_WATCHED, StatesOverTime, states_over_time
from shm.store import Baseline, Store, StoredAlert, StoredTest, Workspace
from shm.values import Drift, Hanger, WatchedTest
from shm.watch import WatchOptions, watch_hanger
from shm.watch.neighbours import BridgePattern
from shm.watch.wording import watch_words


def hanger_report(
    workspace: Workspace, store: Store, hanger_id: int, generated_at: datetime
) -> HangerReport:
    """All that the store knows of a hanger, for its report; its states over time take a second.

    Raises BadInput for an unknown hanger, NothingThere before its first test is through.
    """
    hanger = workspace.bridge.hanger(hanger_id)
    history = store.history(hanger_id)
    if not history:
        raise NothingThere(
            f"no test of hanger {hanger_id} has been through updating yet.",
            remedy="Take recordings in with `shm ingest FILE`, or see `shm status`.",
        )
    latest, posterior = history[-1]
    selection, baseline = store.selection(hanger_id), store.baseline(hanger_id, posterior.model)
    diagnosis, watch = store.latest_diagnosis(hanger_id), gap_watch(store, hanger_id)
    watched = _watched_against(store, baseline)
    is_called = any(each.change.called for each in watched)
    alerts = store.alerts(hanger_id)
    return HangerReport(
        bridge=workspace.bridge.name,
        hanger=hanger,
        tests=tuple(stored.test for stored, _ in history),
        posterior=posterior,
        generated_at=generated_at,
        version=shm.__version__,
        trend=tuple(trend_row(each, stored.test, hanger) for stored, each in history),
        baseline=baseline.posterior if baseline else None,
        selection=selection.selection if selection else None,
        drifts=_drifts(watched, latest.test.id),
        alerts=tuple(stored.alert for stored in alerts),
        acknowledged=_acknowledged(alerts),
        frequency_response=store.frequency_response(latest),
        quality=latest.quality,
        diagnosis=diagnosis.diagnosis if diagnosis else None,
        gap_watch=str(watch) if watch else "",
        drift_watch=watch_words(watched),
        states=hanger_states(workspace, store, hanger, baseline),
        is_called=is_called,
        neighbours=_neighbours(workspace, store) if is_called else None,
        lineage={
            "input_sha256": latest.lineage.input_sha256,
            "settings_sha256": latest.lineage.settings_sha256,
            "version": latest.lineage.version,
        },
    )


def _drifts(watched: Sequence[WatchedTest], test: str) -> tuple[Drift, ...]:
    """The shifts of a test from the baseline in force; none where it was compared with another."""
    return next((each.drifts for each in watched if each.test == test), ())


def _acknowledged(alerts: Sequence[StoredAlert]) -> dict[str, str]:
    """Who took note of an alert, when and why, by its key."""
    noted = {each.alert.key: each.acknowledgement for each in alerts}
    return {
        key: f"{note.who}, {note.at:%Y-%m-%d}: {note.why}" for key, note in noted.items() if note
    }


def _watched_against(store: Store, baseline: Baseline | None) -> tuple[WatchedTest, ...]:
    if baseline is None:
        return ()
    found = store.watches(baseline.hanger, baseline.id)
    return tuple(each.watched for each in found)


def _neighbours(workspace: Workspace, store: Store) -> BridgePattern | None:
    """What moved over the bridge; None where fewer than three hangers can be compared."""
    try:
        return stored_pattern(store, [hanger.id for hanger in workspace.bridge.hangers])
    except NothingThere:
        return None


def hanger_states(
    workspace: Workspace, store: Store, hanger: Hanger, baseline: Baseline | None
) -> StatesOverTime:
    """The states over time of a hanger since its baseline; empty where it has none."""
    if baseline is None:
        return NOTHING_WATCHED
    since_baseline, later = dated_tests(store, baseline)
    options = WatchOptions(limit_years=workspace.settings.false_call_years)
    watched = watch_hanger(baseline.posterior, since_baseline, later, hanger, options)
    return states_over_time(watched, hanger)


def test_sheet(workspace: Workspace, store: Store, hanger_id: int, name: str) -> TestSheet:
    """How a stored test came to its modes: its raw file is identified once more.

    Raises NothingThere for an unknown test and for one whose modes a file gave.
    """
    hanger = workspace.bridge.hanger(hanger_id)
    stored = _stored_test(store, hanger_id, name)
    recording = store.recording(stored.recording_id)
    if store.frequency_response(stored) is None and not stored.quality:
        raise NothingThere(
            f"{recording.file.file_name} gave the modes of {name}, not what they come from.",
            remedy="Ask for a test that was identified here.",
        )
    with workspace.archive.opened(recording.file) as path:
        records = read_test(path, read_limits(workspace.settings))
    options = identify_options(workspace.settings, workspace.bridge)
    found = identify(records, options, test_id=name, hanger=hanger)
    if identify_lineage(recording, hanger_id, workspace) != stored.lineage:
        note = "identified anew: settings, description or version differ from those of the store"
        found = replace(found, notes=(*found.notes, note))
    return TestSheet(found, records, hanger, (options.band_low_hz, options.band_high_hz))


def _stored_test(store: Store, hanger_id: int, name: str) -> StoredTest:
    tests = {stored.test.id: stored for stored in store.tests(hanger_id)}
    if name not in tests:
        latest = ", ".join(list(tests)[-3:]) or "none"
        raise NothingThere(
            f"no test {name} of hanger {hanger_id} is stored.", remedy=f"The latest: {latest}."
        )
    return tests[name]
