"""Results as points of InfluxDB's line protocol: record 0027 says which, and why none doubles."""

from __future__ import annotations

import math
import re
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

from shm.pipeline.bridge_reporting import hanger_summaries
from shm.report.formatting import Interval
from shm.report.hanger_status import Status
from shm.report.hanger_summary import HangerSummary
from shm.store import Store, StoredAlert, Workspace
from shm.store.journal import find_newest_entry
from shm.store.point_outbox import PointOutbox, key_of
from shm.store.posteriors import list_trend
from shm.store.streams import list_pooled
from shm.values import Hanger, Mode
from shm.values.messages import URGENCIES, Lead

Value = float | int | str
HANGER, TEST, MODE, HOUR, ALERT = "shm_hanger", "shm_test", "shm_mode", "shm_hour", "shm_alert"
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_REPEATED = timedelta(days=1)
"""An unchanged state is sent again so often, or no panel of a day would show it."""
_HOURS_REVIEWED = timedelta(days=7)
"""Hours that come late, or are pooled again, change what was sent; older ones are left."""
_SPECIAL_IN_TAG, _SPECIAL_IN_TEXT = re.compile(r"([,= \\])"), re.compile(r'(["\\])')


@dataclass(frozen=True)
class Point:
    """Values of one measurement at one time; unknown numbers are left out."""

    measurement: str
    tags: Mapping[str, str]
    fields: Mapping[str, Value]
    time: datetime

    @property
    def series(self) -> str:
        """Return measurement and tags, as a line begins."""
        tags = (f",{name}={_tag(text)}" for name, text in sorted(self.tags.items()) if text)
        return self.measurement + "".join(tags)

    @property
    def nanoseconds(self) -> int:
        return (self.time - _EPOCH) // timedelta(microseconds=1) * 1000

    @property
    def key(self) -> str:
        """Return what makes it the same point to a database: it replaces what it had."""
        return key_of(self.series, self.nanoseconds)

    @property
    def line(self) -> str:
        """Return it in the line protocol; empty where no field is known."""
        known = (f"{name}={_value(value)}" for name, value in self.fields.items() if _known(value))
        text = ",".join(known)
        return text and f"{self.series} {text} {self.nanoseconds}"


def _tag(text: str) -> str:
    return _SPECIAL_IN_TAG.sub(r"\\\1", " ".join(text.split()))


def _known(value: Value) -> bool:
    return isinstance(value, str) or math.isfinite(value)


def _value(value: Value) -> str:
    if isinstance(value, str):
        text = _SPECIAL_IN_TEXT.sub(r"\\\1", " ".join(value.split()))
        return f'"{text}"'
    return f"{int(value)}i" if isinstance(value, int) else repr(float(value))


def summary_fields(summary: HangerSummary) -> dict[str, Value]:
    """Return the headline of a hanger, as every face shows it; empty before anything is known.

    A tension that the modes do not determine is left out, as it is from figures. Levels count
    from 0: of `state` in the order Baseline only, No change, Cannot judge, Check, Watch, Alert.
    """
    message = summary.message
    if message.status is None:
        return {}
    levels = list(reversed(Status))
    return {
        **(_interval("tension", "_n", summary.tension_n) if summary.is_determined else {}),
        **_interval("change", "", summary.change),
        "state": message.status.value,
        "state_level": levels.index(message.status),
        "urgency": message.urgency,
        "urgency_level": URGENCIES.index(message.urgency),
        "open_alerts": summary.open_alerts,
        "message": message.lead.words,
    }


def _interval(name: str, unit: str, interval: Interval | None) -> dict[str, Value]:
    """Return mean and 90 % interval as fields; empty where it is not known."""
    if interval is None:
        return {}
    ends = {"": interval.mean, "_low": interval.low, "_high": interval.high}
    return {f"{name}{end}{unit}": value for end, value in ends.items()}


@dataclass
class Progress:
    """Results looked at for one database since the daemon began; made anew, all is."""

    tests: set[int] = field(default_factory=set)
    journal: int = -1


def queue_results(
    outbox: PointOutbox,
    target: str,
    workspace: Workspace,
    store: Store,
    now: datetime,
    progress: Progress,
) -> int:
    """Queue for a database all that is new or changed; return how many points."""
    look, newest = _Look(outbox, target, workspace, store, now), find_newest_entry(store)
    points = [*look.headlines(), *alert_points(store.alerts.list_all(), look.tags)]
    lines: dict[str, str] = {}
    for hanger in workspace.bridge.hangers:
        points += look.hours(hanger)
        if newest != progress.journal:
            of_tests = list(look.tests(hanger, progress.tests))
            points += of_tests
            lines |= look.no_longer_counted(hanger, {each.key for each in of_tests})
    lines |= {point.key: point.line for point in points if point.line}
    queued = outbox.queue(target, lines, now)
    ends: dict[str, int] = {}
    for point in points:
        if point.measurement == HANGER or "stream" in point.tags:
            ends[point.series] = max(point.nanoseconds, ends.get(point.series, 0))
    reviewed_ns = 2 * (_HOURS_REVIEWED // timedelta(microseconds=1)) * 1000
    outbox.forget(target, {series: end - reviewed_ns for series, end in ends.items()})
    progress.journal = newest
    return queued


@dataclass(frozen=True)
class _Look:
    """Results that one database may lack at one time."""

    outbox: PointOutbox
    target: str
    workspace: Workspace
    store: Store
    now: datetime

    @property
    def tags(self) -> dict[str, str]:
        return {"bridge": self.workspace.bridge.name}

    def tags_of(self, hanger: Hanger) -> dict[str, str]:
        return {**self.tags, "hanger": str(hanger.id)}

    def headlines(self) -> Iterator[Point]:
        """Yield the state of each hanger where it differs from the last one, or that is old."""
        for summary in hanger_summaries(self.workspace, self.store, self.now):
            fields = summary_fields(summary)
            point = Point(HANGER, self.tags_of(summary.hanger), fields, self.now)
            content, sent_at = self.last_sent(point)
            if content != point.line.rpartition(" ")[0] or self.now - sent_at >= _REPEATED:
                yield point

    def last_sent(self, point: Point) -> tuple[str, datetime]:
        """Return what was queued last of a point's series, and its time; 1970 where nothing was."""
        line = self.outbox.latest(self.target, point.series)
        content, _, at_ns = line.rpartition(" ")
        return content, _EPOCH + timedelta(microseconds=int(at_ns or 0) / 1000)

    def tests(self, hanger: Hanger, looked_at: set[int]) -> Iterator[Point]:
        """Yield the tests that count, each with the tension by it alone; and their modes."""
        tags, trend = self.tags_of(hanger), list_trend(self.store, hanger)
        for each in trend:
            tension = Interval.of_averaged(each.averaged)
            fields: dict[str, Value] = {
                **({} if tension.is_wide else _interval("tension", "_n", tension)),
                "temperature_c": each.temperature_c,
                "model": each.model,
                "counts": 1,
            }
            yield Point(TEST, {**tags, "test": each.test}, fields, each.time)
        new = {each.test_id for each in trend} - looked_at
        for stored in self.store.tests.list_all(hanger.id, new) if new else ():
            yield from mode_points(stored.test.modes, {**tags, "test": stored.test.id}, stored.time)
        looked_at |= new

    def no_longer_counted(self, hanger: Hanger, counted: Container[str]) -> dict[str, str]:
        """Return a line for each test that was sent and counts no longer, by its key."""
        series = Point(TEST, self.tags_of(hanger), {}, self.now).series
        keys = (key.rpartition(" ") for key in self.outbox.list_keys(self.target, f"{series},"))
        return {
            f"{of_test} {at_ns}": f"{of_test} counts=0i {int(at_ns)}"
            for of_test, _, at_ns in keys
            if f"{of_test} {at_ns}" not in counted
        }

    def hours(self, hanger: Hanger) -> Iterator[Point]:
        """Yield the hours of permanent sensors that were not sent, and the last days' again."""
        of_hanger = self.tags_of(hanger)
        for stream in self.workspace.bridge.streams:
            if stream.hanger != hanger.id:
                continue
            tags = {**of_hanger, "stream": stream.name}
            _, newest = self.last_sent(Point(HOUR, tags, {}, self.now))
            since = max(_EPOCH, newest - _HOURS_REVIEWED)
            for each in list_pooled(self.store, hanger.id, "hour", since, self.now):
                fields: dict[str, Value] = {
                    **_shift("tension_shift", each.tension_shift, each.tension_shift_sd),
                    **_shift("compensated_shift", each.compensated_shift, each.compensated_sd),
                    "temperature_c": each.temperature_c,
                    "wind_m_s": each.wind_m_s,
                    "level_m_s2": each.level_m_s2,
                    "windows": each.windows,
                }
                yield Point(HOUR, tags, fields, each.start)
                yield from mode_points(each.modes, tags, each.start)


def _shift(name: str, mean: float, sd: float) -> dict[str, Value]:
    return _interval(name, "", Interval.normal(mean, sd))


def mode_points(modes: Iterable[Mode], tags: Mapping[str, str], time: datetime) -> Iterator[Point]:
    """Yield the frequency and damping of each mode of a test or an hour."""
    for mode in modes:
        fields = {
            "frequency_hz": mode.frequency_hz,
            "frequency_sd_hz": mode.frequency_sd_hz,
            "damping_ratio": mode.damping_ratio,
        }
        yield Point(MODE, {**tags, "plane": mode.plane, "order": str(mode.order)}, fields, time)


def alert_points(alerts: Iterable[StoredAlert], tags: Mapping[str, str]) -> Iterator[Point]:
    """Yield the beginning and the end of each alert, which a panel shows as annotations."""
    for each in alerts:
        lead = Lead.of(each.alert.message)
        of_alert = {**tags, "hanger": str(each.alert.hanger), "alert": str(each.id)}
        fields: dict[str, Value] = {
            "title": f"Hanger {each.alert.hanger}: {', '.join(each.alert.kinds)}",
            "text": lead.words,
            "urgency": lead.urgency,
            "urgency_level": URGENCIES.index(lead.urgency),
            "in_force": 1,
        }
        yield Point(ALERT, {**of_alert, "event": "raised"}, fields, each.raised_at)
        if ended := each.resolution:
            over: dict[str, Value] = {"text": f"Ended: {ended.why}", "in_force": 0}
            yield Point(ALERT, {**of_alert, "event": "ended"}, {**fields, **over}, ended.at)
