"""From the store to what a report of the whole bridge is made of; open warnings of its hangers.

Nothing here imports what computes: `shm status` asks it, too.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

import shm
from shm.bridge import example_words
from shm.errors import NothingThere
from shm.pipeline.controls import campaign_warnings, control_charts
from shm.pipeline.lineage import discarded_of_baselines, redescribed, settings_words, software
from shm.pipeline.stream_health import blind_hangers, heard
from shm.report.formatting import Interval
from shm.report.hanger_status import findings, still_detected
from shm.report.hanger_summary import HangerSummary, LatestTest, PeriodSummary
from shm.report.open_warnings import (
    discarded,
    nearly_slack,
    open_warnings,
    passed_over,
    redescription_words,
    standing_out,
)
from shm.store import (
    BaselineGlance,
    Silence,
    Store,
    StoredAlert,
    StoredWatch,
    TrendPoint,
    Workspace,
)
from shm.store.alerts import count_open_alerts, describe_silence, silenced_until
from shm.store.posteriors import find_latest_trends, list_baselines_in_force, list_trend
from shm.store.tests import count_tests, list_undated_names, load_frequency_response
from shm.store.watch import (
    find_latest_watches,
    list_detected_changes,
    list_diagnosed_hangers,
)
from shm.values import TENSION, Change, Drift, Hanger, ResponsePoint, Summary, WatchedTest
from shm.values.bar_description import list_sensors
from shm.values.messages import WEEK, Lead
from shm.watch.words.alert_text import called_words, look_again

if TYPE_CHECKING:
    from shm.report.contents import BridgeReport
    from shm.report.states import Period
    from shm.watch.neighbours import BridgePattern, HangerShift


def bridge_report(
    workspace: Workspace, store: Store, generated_at: datetime, period: Period | None = None
) -> BridgeReport:
    """All that the store knows of a bridge, and what lies in a `period`.

    Raises NothingThere before any test is through, and where none lies in the period.
    """
    from shm.report.contents import BridgeReport  # `shm status` does without the engine it brings

    hangers = workspace.bridge.hangers
    lines = hanger_summaries(workspace, store, generated_at)
    if all(line.tension_n is None for line in lines):
        raise NothingThere(
            "no test of any hanger has been through updating yet.",
            remedy="Take recordings in with `shm ingest FILE`, or see `shm status`.",
        )
    courses = _courses(store, hangers, period) if period else {}
    if period and not any(course.tests for course in courses.values()):
        latest = find_latest_trends(store, hangers)
        newest = max(latest.values(), key=lambda point: point.time)
        raise NothingThere(
            f"no test of any hanger lies in the period {period}.",
            remedy=f"The latest is {newest.test} of hanger {newest.hanger}, "
            f"{newest.time:%Y-%m-%d}: ask for a longer period.",
        )
    charts = control_charts(workspace, store)
    pattern, why_not = pattern_or_why(workspace, store)
    return BridgeReport(
        workspace.bridge.name,
        tuple(
            replace(
                line,
                sensors=_sensors(workspace, store, line),
                course=courses.get(line.hanger.id),
            )
            for line in lines
        ),
        pattern,
        why_not,
        generated_at,
        shm.__version__,
        period,
        {"software": software()},
        settings_words(workspace.settings),
        charts,
    )


def _sensors(workspace: Workspace, store: Store, line: HangerSummary) -> tuple[ResponsePoint, ...]:
    """Return the sensors of a hanger's latest test; before the first those that stay on it."""
    if line.latest:
        stored = store.tests.named(line.hanger.id, line.latest.name)
        return list_sensors(stored.test, load_frequency_response(store, stored))
    streams = [each for each in workspace.bridge.streams if each.hanger == line.hanger.id]
    return tuple(ResponsePoint(c.name, c.plane, c.x_m) for each in streams for c in each.channels)


def hanger_summaries(
    workspace: Workspace, store: Store, now: datetime, hangers: Sequence[Hanger] = ()
) -> tuple[HangerSummary, ...]:
    """Return the state of each of `hangers`, or of all along the bridge; it reads no samples."""
    hangers = hangers or workspace.bridge.hangers
    state = HangersNow(workspace, store, hangers, now)
    return tuple(state.summary(hanger) for hanger in hangers)


def unwatched(
    workspace: Workspace, hanger: int, latest: datetime, blind: Mapping[int, Lead], now: datetime
) -> Lead | None:
    """That the sensors of a hanger say nothing, or that its latest test was too long ago."""
    since = now - latest
    if hanger in blind or since <= timedelta(days=workspace.settings.quiet_days):
        return blind.get(hanger)
    state = f"Hanger {hanger}: not tested for {since.days} days."
    return Lead(state, f"{look_again(workspace.bridge.tested(hanger))} {WEEK}.")


def notes_of(
    standing: Sequence[StoredAlert], silences: tuple[Silence, ...], hanger: int, now: datetime
) -> tuple[str, ...]:
    """Return what people did about the alerts of a hanger that stand."""
    noted = [(each.id, each.acknowledgement) for each in standing if each.alert.kinds != ("test",)]
    until = silenced_until(silences, hanger, now) if noted else None
    return (
        *(
            f"Alert {id_} was acknowledged by {note.who} on {note.at:%Y-%m-%d}."
            for id_, note in noted
            if note is not None
        ),
        *([f"Hooks are silenced until {until:%Y-%m-%d %H:%M} UTC."] if until else []),
    )


class HangersNow:
    """State of all hangers by the store, asked in a few queries without any samples."""

    def __init__(
        self, workspace: Workspace, store: Store, hangers: Sequence[Hanger], now: datetime
    ):
        self.workspace, self._store, self.now = workspace, store, now
        self._have_diagnosis = list_diagnosed_hangers(store)
        self.latest = find_latest_trends(store, hangers)
        # Those of neighbours too: one may stand out.
        self.baselines = list_baselines_in_force(store, workspace.bridge.hangers)
        self.watches = find_latest_watches(store, hangers)
        self.called = list_detected_changes(store, hangers)
        self.open_alerts = count_open_alerts(store)
        self.standing = defaultdict[int, list[StoredAlert]](list)
        for each in store.alerts.list_all(_only(hangers), standing=True):
            self.standing[each.alert.hanger].append(each)
        silences = store.silences.list_all()
        self.works = [each for each in silences if each.is_maintenance]
        self.silences = tuple(each for each in silences if not each.is_over(now))
        self.streams = heard(workspace, store, now)
        self.blind = blind_hangers(self.streams)
        self.undated = list_undated_names(store)
        self.charts = control_charts(workspace, store)
        self._discarded = discarded_of_baselines(store)
        self.tests = count_tests(store)

    def summary(self, hanger: Hanger) -> HangerSummary:
        """Return the state of a hanger, as every face shows it."""
        point, baseline = self.latest.get(hanger.id), self.baselines.get(hanger.id)
        found = self.watches.get(hanger.id)
        watched, called = found.watched if found else None, self.called.get(hanger.id, ())
        standing, blind = self.standing.get(hanger.id, ()), self.blind.get(hanger.id)
        control = next((each for each in self.charts if each.hanger.id == hanger.id), None)
        days, at = self.workspace.settings.campaign_days, point.time if point else None
        example = [words] if (words := example_words(hanger)) else []
        doubts = campaign_warnings(self.charts, hanger, at, days)
        return HangerSummary(
            hanger,
            LatestTest(point.test, point.time, point.averaged, point.model) if point else None,
            baseline.averaged if baseline else None,
            is_first=point is not None and (baseline is None or point.test in baseline.tests),
            drifts=watched.published_drifts if watched else (),
            called=still_detected(called, watched, hanger),
            detected="; ".join(called_words(change) for change in called),
            standing=findings(each.alert for each in standing),
            open_alerts=self.open_alerts.get(hanger.id, 0),
            warnings=(*example, *doubts, *self._warnings(hanger, baseline, watched)),
            notes=notes_of(standing, self.silences, hanger.id, self.now),
            unwatched=unwatched(self.workspace, hanger.id, point.time, self.blind, self.now)
            if point
            else blind,
            undated=self.undated.get(hanger.id, ()),
            diagnosed=self._diagnosed(hanger, watched, called, standing),
            control=control,
            tests=self.tests[hanger.id].tests if hanger.id in self.tests else 0,
        )

    def _diagnosed(
        self,
        hanger: Hanger,
        watched: WatchedTest | None,
        called: Sequence[Change],
        standing: Sequence[StoredAlert],
    ) -> str:
        if hanger.id not in self._have_diagnosis:
            return ""
        # Few hangers are diagnosed, and the words of a diagnosis take long to import.
        from shm.pipeline.diagnosing import describe_diagnosis, last_change

        baseline = self.baselines.get(hanger.id)
        began_by = last_change(self._store, hanger, baseline, watched, called, standing)
        return describe_diagnosis(self._store, hanger, began_by)

    def _warnings(
        self, hanger: Hanger, baseline: BaselineGlance | None, watched: WatchedTest | None
    ) -> tuple[str, ...]:
        """Return the open warnings of a hanger that has a baseline."""
        if baseline is None:
            return ()
        tensions = {id_: each.averaged.tension_n for id_, each in self.baselines.items()}
        others = (
            redescription_words(hanger, redescribed(hanger, baseline)),
            discarded(hanger, self._discarded.get(hanger.id, ())),
            self._slackness(hanger, tensions[hanger.id], watched),
            self._passed_over(hanger, baseline, watched),
        )
        neighbours = standing_out(hanger, self.workspace.bridge.hangers, tensions)
        return open_warnings(hanger, baseline.check, neighbours, watched, others)

    def _slackness(self, hanger: Hanger, then: Summary, watched: WatchedTest | None) -> str:
        point, level = self.latest.get(hanger.id), hanger.thresholds.alert_probability
        if point is None or watched is None:
            return ""
        is_reported = any(d.quantity == TENSION and d.probability >= level for d in watched.drifts)
        return nearly_slack(hanger, then, point.averaged.tension_n, is_reported=is_reported)

    def _passed_over(
        self, hanger: Hanger, baseline: BaselineGlance, watched: WatchedTest | None
    ) -> str:
        """Return that the latest test was passed over for planned works."""
        point = self.latest.get(hanger.id)
        if point is None or point.test in baseline.tests:
            return ""
        if watched is not None and watched.time >= point.time:
            return ""
        windows = [each for each in self.works if each.covers(hanger.id, point.time)]
        return passed_over(hanger, describe_silence(windows[-1])) if windows else ""


def _only(hangers: Sequence[Hanger]) -> int | None:
    """The number of the hanger where it is but one."""
    return hangers[0].id if len(hangers) == 1 else None


def _courses(store: Store, hangers: Sequence[Hanger], period: Period) -> dict[int, PeriodSummary]:
    """Return what became of each hanger in the period."""
    raised = Counter(
        each.alert.hanger for each in store.alerts.list_all() if period.holds(each.alert.time)
    )
    return {
        hanger.id: _course(list_trend(store, hanger, period.since), raised[hanger.id])
        for hanger in hangers
    }


def _course(points: Sequence[TrendPoint], alerts: int) -> PeriodSummary:
    if len(points) < 2:
        return PeriodSummary(len(points), alerts)
    first, last = (Interval.of_averaged(points[at].averaged) for at in (0, -1))
    return PeriodSummary(len(points), alerts, last.since(first))


def pattern_or_why(workspace: Workspace, store: Store) -> tuple[BridgePattern | None, str]:
    """Return what moved over the bridge, or why nothing can be compared."""
    try:
        return stored_pattern(store, [hanger.id for hanger in workspace.bridge.hangers]), ""
    except NothingThere as reason:
        return None, f"Over the bridge nothing can be compared: {reason.message}"


def stored_pattern(store: Store, order: Sequence[int]) -> BridgePattern:
    """The pattern over the hangers, in their `order` along the bridge, from their latest watches.

    Raises NothingThere where fewer than three of them can be compared.
    """
    # It is loaded where it is sought: who lists the hangers does without.
    from shm.watch.words.neighbours_words import bridge_pattern

    return bridge_pattern(hanger_shifts(store, order), order)


def hanger_shifts(store: Store, order: Sequence[int]) -> tuple[HangerShift, ...]:
    """The latest known shift of each hanger that has one, in their `order` along the bridge."""
    from shm.watch.neighbours import shifts_of

    latest = find_latest_watches(store)
    compared = [latest[hanger] for hanger in order if hanger in latest]
    drifts = {each.hanger: _known_drifts(store, each) for each in compared}
    return shifts_of(drifts, order)


def _known_drifts(store: Store, latest: StoredWatch) -> Sequence[Drift]:
    """Return those of the latest test; of all, where its shift of the tension is not known."""
    drifts = latest.watched.published_drifts
    if any(each.quantity == TENSION and math.isfinite(each.shift_mean) for each in drifts):
        return drifts
    watches = store.watch.list_all(latest.hanger, latest.baseline_id)
    return [drift for watch in watches for drift in watch.watched.published_drifts]
