"""From the store to what a report is made of."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

import shm
from shm.errors import NothingThere, ShmError
from shm.identify import identify
from shm.inference import UpdateOptions, refresh
from shm.inference.reference_level import at_level
from shm.models import build
from shm.pipeline.adopting import gap_watch
from shm.pipeline.bridge_reporting import hanger_summaries, pattern_or_why
from shm.pipeline.diagnosing import latest_diagnosis
from shm.pipeline.lineage import (
    IDENTIFY_SETTINGS,
    discarded_of_baselines,
    identify_lineage,
    read_limits,
    redescribed,
    settings_words,
    test_lineage,
)
from shm.pipeline.steps import identify_options
from shm.pipeline.watching import dated_tests
from shm.read.sandbox import peek_test, read_test
from shm.report.contents import (
    Deed,
    HangerReport,
    ModalTestReport,
    TensionAtLevel,
    TrendRow,
)
from shm.report.formatting import Interval
from shm.report.hanger_report import StructureReport
from shm.report.states import NOTHING_WATCHED, Period, StatesOverTime, states_over_time
from shm.store import (
    Baseline,
    EventKind,
    HangerEvent,
    Store,
    StoredAlert,
    StoredTest,
    TrendPoint,
    Workspace,
)
from shm.store.alerts import count_open_alerts, list_hanger_events
from shm.store.posteriors import find_latest_trends, list_trend
from shm.store.tests import (
    count_tests,
    list_baseline_tests,
    list_undated_names,
    load_frequency_response,
)
from shm.store.watch import list_detections
from shm.values import Hanger, ResponsePoint, WatchedTest
from shm.values.stated_tension import averaged_now
from shm.watch import WatchOptions, watch_hanger
from shm.watch.words.alert_text import watch_words

log = logging.getLogger(__name__)


def hanger_report(
    workspace: Workspace,
    store: Store,
    hanger_id: int,
    generated_at: datetime,
    period: Period | None = None,
    *,
    is_brief: bool = False,
) -> HangerReport:
    """All that the store knows of a hanger, for its report; its states over time take a second.

    Of a `period`, tests, trend and alerts are those that lie in it. One that `is_brief` lacks what
    only figures and tables show. Raises BadInput for an unknown hanger, NothingThere before its
    first test is through and where none lies in the period.
    """
    hanger = workspace.bridge.hanger(hanger_id)
    report = hanger_now(workspace, store, hanger, _trend(store, hanger, period), generated_at)
    report = replace(report, period=period, at_level=_at_level(workspace, report))
    if is_brief:
        return report
    latest = store.tests.named(hanger_id, report.latest.id)
    return replace(
        report,
        alerts=tuple(each for each in report.alerts if period is None or period.holds(each.time)),
        inspections=tuple(e for e in report.inspections if period is None or period.holds(e.at)),
        deeds=tuple(each for each in report.deeds if period is None or period.holds(each.at)),
        frequency_response=load_frequency_response(store, latest),
        hits=_hit_places(workspace, store, latest),
        states=hanger_states(
            workspace, store, hanger, store.watch.baseline(hanger_id, report.posterior.model)
        ),
        neighbours=pattern_or_why(workspace, store)[0] if report.now.called else None,
    )


def _at_level(workspace: Workspace, report: HangerReport) -> TensionAtLevel | None:
    """Return the tension by the latest test at the reference level; None where none is set."""
    settings, known = workspace.settings, report.posterior
    level = settings.reference_level
    if not level:
        return None
    at = TensionAtLevel(level, level * settings.reference_force_n)
    try:
        test = at_level(report.latest, level)
        model = build(known.model, report.hanger, settings.priors)
        moved = refresh([test], model, known, UpdateOptions(settings.samples, settings.seed))
    except ShmError as reason:
        return replace(at, reason=str(reason))
    averaged = averaged_now(moved, report.selection, report.hanger.limits)
    return replace(at, tension_n=Interval.of_averaged(averaged))


def _hit_places(workspace: Workspace, store: Store, test: StoredTest) -> tuple[ResponsePoint, ...]:
    """Return where the hammer hit, as the header of the test's file says; none without that."""
    recording = store.recordings.get(test.recording_id)
    try:
        with workspace.archive.opened(recording.file) as path:
            looks = peek_test(path, read_limits(workspace.settings))
    except ShmError as reason:  # dropped by retention, or frequencies were given
        log.info("places of hits of test %s: %s", test.test.id, reason.message)
        return ()
    force = (c for look in looks for c in look.channels if c.quantity == "force")
    return tuple(dict.fromkeys(ResponsePoint("hit", c.plane, c.x_m) for c in force))


def structure_report(
    workspace: Workspace, store: Store, number: int, generated_at: datetime
) -> StructureReport:
    """All that the store knows of a structure without a model."""
    structure, baseline = workspace.bridge.tested(number), store.watch.baseline(number)
    of_baseline = list_baseline_tests(store, baseline) if baseline else ()
    watched, alerts = _watched_against(store, baseline), store.alerts.list_all(number)
    latest = count_tests(store).get(number)
    levels = baseline.posterior if baseline else None
    return StructureReport(
        bridge=workspace.bridge.name,
        structure=structure,
        tests=latest.tests if latest else 0,
        latest=latest.time if latest else None,
        baseline_since=min((test.time for test in of_baseline), default=None),
        baseline_hz=dict(zip(levels.names, levels.samples[0].tolist(), strict=True))
        if levels
        else {},
        statement=watch_words(watched, structure),
        drifts=watched[-1].drifts if watched else (),
        alerts=tuple(stored.alert for stored in alerts),
        open_alerts=count_open_alerts(store).get(number, 0),
        undated=list_undated_names(store).get(number, ()),
        generated_at=generated_at,
        version=shm.__version__,
    )


def hanger_now(
    workspace: Workspace,
    store: Store,
    hanger: Hanger,
    trend: Sequence[TrendPoint],
    generated_at: datetime,
) -> HangerReport:
    """A hanger at the last of its `trend`, at least one; without what takes more than a blink.

    Those are its frequency response, its states over time and what moved over the bridge.
    """
    latest = store.tests.named(hanger.id, trend[-1].test)
    posterior = store.posteriors.get(hanger.id, latest.test.id)
    selection, baseline = (
        store.posteriors.selection(hanger.id),
        store.watch.baseline(hanger.id, posterior.model),
    )
    in_force = store.watch.baseline(hanger.id)
    watch = gap_watch(store, hanger.id)
    watched, alerts = _watched_against(store, baseline), store.alerts.list_all(hanger.id)
    (now,) = hanger_summaries(workspace, store, generated_at, [hanger])
    return HangerReport(
        bridge=workspace.bridge.name,
        letterhead=workspace.bridge.letterhead,
        now=now,
        tests=(latest.test,),
        posterior=posterior,
        generated_at=generated_at,
        version=shm.__version__,
        trend=tuple(_trend_row(point) for point in trend),
        baseline=baseline.posterior if baseline else None,
        selection=selection.selection if selection else None,
        alerts=tuple(stored.alert for stored in alerts),
        acknowledged=_acknowledged(alerts),
        quality=latest.quality,
        diagnosis=latest_diagnosis(store, hanger),
        gap_watch=str(watch) if watch else "",
        drift_watch=watch_words(watched, hanger),
        creep=watched[-1].creep_per_year if watched else None,
        lineage={**test_lineage(store, latest), **_baseline_words(baseline)},
        settings={**settings_words(workspace.settings), **_changed(store, hanger)},
        redescribed=redescribed(hanger, in_force),
        discarded=discarded_of_baselines(store).get(hanger.id, ()),
        inspections=store.notes.list_all(hanger.id),
        deeds=_deeds(store, hanger, trend),
    )


DEED_WORDS = {
    EventKind.BASELINE: "baseline set",
    EventKind.ADOPTED: "effect adopted",
    EventKind.UNDONE: "adoption undone",
}


def _deeds(store: Store, hanger: Hanger, trend: Sequence[TrendPoint]) -> tuple[Deed, ...]:
    """Return what people set and adopted, each where the trend shows it."""

    def shown_at(event: HangerEvent) -> datetime:
        """Return the event's time; of a baseline, that of its last test."""
        if event.kind is not EventKind.BASELINE:
            return event.at
        baseline = store.watch.baseline(hanger.id, number=event.id)
        names = baseline.posterior.tests if baseline else ()
        return max((each.time for each in trend if each.test in names), default=event.at)

    return tuple(
        Deed(DEED_WORDS[event.kind], shown_at(event), f"by {event.who}: {event.why}")
        for event in list_hanger_events(store, hanger.id)
        if event.kind in DEED_WORDS
    )


def _changed(store: Store, hanger: Hanger) -> dict[str, str]:
    """Return what holds of a hanger instead of what `bridge.toml` says."""
    current = store.settings.list_current().values()
    return {f"changed: {each.key}": str(each) for each in current if each.is_of(hanger.id)}


def _trend_row(point: TrendPoint) -> TrendRow:
    """The row of one test from its numbers, without its samples."""
    return TrendRow(
        test=point.test,
        model=point.model,
        tension_n=Interval.of_averaged(point.averaged),
        stiffness={name: Interval.of_summary(each) for name, each in point.stiffness.items()},
        time=point.taken_at,
        temperature_c=point.temperature_c,
    )


def _trend(store: Store, hanger: Hanger, period: Period | None) -> tuple[TrendPoint, ...]:
    points = list_trend(store, hanger, period.since if period else None)
    if points:
        return points
    latest = find_latest_trends(store, [hanger]).get(hanger.id)
    if latest is None:
        raise NothingThere(
            f"no test of hanger {hanger.id} has been through updating yet.",
            remedy="Take recordings in with `shm ingest FILE`, or see `shm status`.",
        )
    raise NothingThere(
        f"no test of hanger {hanger.id} lies in the period {period}.",
        remedy=f"Its latest is {latest.test} of {latest.time:%Y-%m-%d}: ask for a longer period.",
    )


def _baseline_words(baseline: Baseline | None) -> dict[str, str]:
    if baseline is None:
        return {}
    tests = ", ".join(baseline.posterior.tests)
    document = {"baseline": f"{tests}; set {baseline.set_at:%Y-%m-%d} by {baseline.who}"}
    check = baseline.posterior.baseline_check
    if check is None:
        return {**document, "baseline_check": "not made: the baseline is of a former version"}
    if check.left_out:
        document["left_out_of_the_baseline"] = "; ".join(check.left_out)
    if check.unchecked:
        document["baseline_check"] = f"could not be made: {check.unchecked}"
    return document


def _acknowledged(alerts: Sequence[StoredAlert]) -> dict[str, str]:
    """Return who took note of an alert, or that it ended, when and why, by its key."""
    noted = {each.alert.key: each.acknowledgement or each.resolution for each in alerts}
    ended = {each.alert.key for each in alerts if each.resolution and not each.acknowledgement}
    return {
        key: f"{'ended: ' * (key in ended)}{note.who}, {note.at:%Y-%m-%d}: {note.why}"
        for key, note in noted.items()
        if note
    }


def _watched_against(store: Store, baseline: Baseline | None) -> tuple[WatchedTest, ...]:
    """The watches that call a change, and the latest one."""
    found = list_detections(store, baseline.hanger, baseline.id) if baseline else ()
    return tuple(each.watched for each in found)


def hanger_states(
    workspace: Workspace, store: Store, hanger: Hanger, baseline: Baseline | None
) -> StatesOverTime:
    """The states over time of a hanger since its baseline; empty where it has none."""
    if baseline is None:
        return NOTHING_WATCHED
    since_baseline, later = dated_tests(store, baseline)
    years = workspace.settings.false_call_years
    options = WatchOptions.of(hanger.assumptions, limit_years=years)
    known = {
        each.watched.test: each.watched for each in store.watch.list_all(hanger.id, baseline.id)
    }
    watched = watch_hanger(baseline.posterior, since_baseline, later, hanger, options, known)
    return states_over_time(watched, hanger)


def modal_test_report(
    workspace: Workspace, store: Store, hanger_id: int, name: str
) -> ModalTestReport:
    """Return how a stored test came to its modes: its raw file is identified once more.

    Raises NothingThere for an unknown test and for one whose modes a file gave.
    """
    hanger = workspace.bridge.hanger(hanger_id)
    stored = store.tests.named(hanger_id, name)
    recording = store.recordings.get(stored.recording_id)
    if load_frequency_response(store, stored) is None and not stored.quality:
        raise NothingThere(
            f"{recording.file.file_name} gave the modes of {name}, not what they come from.",
            remedy="Ask for a test that was identified here.",
        )
    with workspace.archive.opened(recording.file) as path:
        read = read_test(path, read_limits(workspace.settings))
    # The file is read through a passing link, whose name would tell nobody anything.
    records = [replace(each, source=recording.file.file_name) for each in read]
    options = identify_options(workspace.settings, workspace.bridge)
    found = identify(records, options, test_id=name, hanger=hanger)
    if identify_lineage(recording, hanger_id, workspace) != stored.lineage:
        note = "identified again: settings, description or version differ from those of the store"
        found = replace(found, notes=(*found.notes, note))
    return ModalTestReport(
        found,
        records,
        hanger,
        bridge=workspace.bridge.name,
        lineage=test_lineage(store, stored),
        settings=settings_words(workspace.settings, IDENTIFY_SETTINGS),
        version=shm.__version__,
    )
