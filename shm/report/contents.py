"""The data of each kind of report: one frozen value, complete at birth."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

from shm.bridge.description import NO_LETTERHEAD, Letterhead
from shm.report.formatting import Interval
from shm.report.hanger_status import BridgeMessage, Status, bridge_message
from shm.report.hanger_summary import HangerSummary, LatestTest
from shm.report.states import NOTHING_WATCHED, Period, StatesOverTime
from shm.values import (
    NAN,
    Alert,
    Averaged,
    BridgeDiagnosis,
    CreepRate,
    Diagnosis,
    Drift,
    FrequencyResponse,
    Hanger,
    ModalTest,
    Mode,
    Posterior,
    PredictedFrequency,
    QualityCheck,
    Recording,
    ResponsePoint,
    Selection,
)
from shm.values.bar_description import BarDescription, describe_bar, list_hits, list_sensors
from shm.values.notes import Note
from shm.values.rounding import ForceUnit, force_unit
from shm.values.stated_tension import averaged_now, selection_now

if TYPE_CHECKING:  # `shm status` lists hangers and identifies nothing
    from shm.identify import Dropped, Hit, Identification
    from shm.watch.control_chart import ControlChart
    from shm.watch.neighbours import BridgePattern


@dataclass(frozen=True)
class TrendRow:
    """One test in the history of a hanger.

    `tension_n` is averaged over the model classes, as the headline is. `stiffness` holds log10 of
    the end stiffness of each plane in N m/rad, as the watch compares it: the common stiffness of
    both ends, which frequencies alone cannot tell apart.
    """

    test: str
    model: str
    tension_n: Interval
    stiffness: Mapping[str, Interval] = field(default_factory=dict)
    time: datetime | None = None
    temperature_c: float = NAN


def trend_row(
    posterior: Posterior, test: ModalTest, hanger: Hanger, selection: Selection | None = None
) -> TrendRow:
    """Return the row of one test of `hanger`, its posterior averaged over the classes."""
    from shm.models import end_stiffness  # it opens all classes; `shm status` has no trend

    return TrendRow(
        test=test.id,
        model=posterior.model,
        tension_n=Interval.of_averaged(averaged_now(posterior, selection)),
        stiffness={
            name: Interval.of_samples(samples)
            for name, samples in end_stiffness(posterior, hanger).items()
        },
        time=test.time,
        temperature_c=test.temperature_c,
    )


@dataclass(frozen=True)
class Dated:
    """A row of the trend whose time is known."""

    time: datetime
    row: TrendRow


@dataclass(frozen=True)
class Deed:
    """Hold an act of a person on the hanger, such as `baseline set`, and by whom and why."""

    kind: str
    at: datetime
    why: str


@dataclass(frozen=True)
class TensionAtLevel:
    """The tension by the latest test at a level of its hits, in N, or why it is not known."""

    level: float
    force_n: float
    tension_n: Interval | None = None
    reason: str = ""


@dataclass(frozen=True, eq=False)
class HangerReport:
    """All that a report of one hanger says.

    `now` is the state of the hanger as every face shows it. `posterior` and `frequency_response`
    and `hits`, the places where it was hit, are those of the latest test, the last of
    `tests`, which stand oldest first like `trend`.
    `alerts` are all of the hanger; `acknowledged` says by an alert's key who took note of it.
    `lineage` names where the numbers come from: checksums, settings, files. `quality` is that of
    the latest test, empty where it was not checked; `diagnosis` the latest of its gap. `gap_watch`
    says in a sentence how the gap has gone since an effect was adopted, `drift_watch` what the
    sequential test has detected since the baseline, `creep` how fast the tension creeps. `states`
    are empty where the hanger has no baseline. `neighbours` is what moved over the whole bridge,
    None where nothing is detected. Of a `period`, `tests`, `trend` and `alerts` are those that lie
    in it. `settings` are those that decide the numbers, each with its unit. `redescribed` says what
    of the hanger's description has changed since the baseline, where that moves results;
    `discarded` names the tests of the baseline that count no more. `inspections` are what people
    wrote, the latest first, `deeds` what they set and adopted. `at_level` is None where no
    reference level is set.
    """

    bridge: str
    now: HangerSummary
    tests: tuple[ModalTest, ...]
    posterior: Posterior
    generated_at: datetime
    version: str
    trend: tuple[TrendRow, ...] = ()
    baseline: Posterior | None = None
    selection: Selection | None = None
    alerts: tuple[Alert, ...] = ()
    acknowledged: Mapping[str, str] = field(default_factory=dict)
    frequency_response: FrequencyResponse | None = None
    hits: tuple[ResponsePoint, ...] = ()
    lineage: Mapping[str, str] = field(default_factory=dict)
    quality: tuple[QualityCheck, ...] = ()
    diagnosis: Diagnosis | None = None
    gap_watch: str = ""
    drift_watch: str = ""
    creep: CreepRate | None = None
    states: StatesOverTime = NOTHING_WATCHED
    neighbours: BridgePattern | None = None
    period: Period | None = None
    settings: Mapping[str, str] = field(default_factory=dict)
    redescribed: tuple[str, ...] = ()
    discarded: tuple[str, ...] = ()
    inspections: tuple[Note, ...] = ()
    deeds: tuple[Deed, ...] = ()
    at_level: TensionAtLevel | None = None
    letterhead: Letterhead = NO_LETTERHEAD

    @property
    def hanger(self) -> Hanger:
        return self.now.hanger

    @property
    def status(self) -> Status:
        """Return the state in a word; of a hanger with a test it is known."""
        return self.now.status or Status.UNCLEAR

    @property
    def drifts(self) -> Sequence[Drift]:
        """Return those of the latest test from the baseline in force."""
        return self.now.drifts

    @property
    def latest(self) -> ModalTest:
        return self.tests[-1]

    @property
    def bar(self) -> BarDescription:
        """Return the bar, with the sensors of the latest test."""
        sensors = list_sensors(self.latest, self.frequency_response)
        return describe_bar(self.hanger, sensors, self.hits)

    @property
    def predicted(self) -> tuple[PredictedFrequency, ...]:
        """Return the predictions for the latest test, where the posterior is of several."""
        measured = {(mode.plane, mode.order): mode.frequency_hz for mode in self.latest.modes}
        return tuple(
            row
            for row in self.posterior.predicted
            if math.isnan(row.measured_hz)
            or math.isclose(row.measured_hz, measured.get((row.plane, row.order), NAN))
        )

    @property
    def misfits_percent(self) -> list[tuple[PredictedFrequency, Interval]]:
        """Return predicted over measured frequency less one of each measured mode, in percent.

        The interval is that of prediction and measurement together; of the prediction alone where
        the measurement came without a standard deviation.
        """
        sds_hz = {(mode.plane, mode.order): mode.frequency_sd_hz for mode in self.latest.modes}
        return [
            (each, _misfit(each, sds_hz.get((each.plane, each.order), math.nan)))
            for each in self.predicted
            if math.isfinite(each.measured_hz)
        ]

    @property
    def dated_trend(self) -> list[Dated]:
        """Return the rows of the trend with a time, oldest first."""
        rows = [Dated(row.time, row) for row in self.trend if row.time is not None]
        return sorted(rows, key=lambda row: row.time)

    @cached_property
    def compared(self) -> Selection:
        """Return the model classes as they are by the latest test."""
        return selection_now(self.posterior, self.selection)

    @cached_property
    def by_latest_test(self) -> Averaged:
        """Return the tension that the latest test gives by itself, over all model classes."""
        return self.compared.averaged_with(self.hanger.limits)

    @property
    def averaged(self) -> Averaged:
        """Return the headline: the best estimate since the last change, over all classes."""
        return self.now.tension or self.by_latest_test

    @property
    def tension_n(self) -> Interval:
        """Return the same, absolute."""
        return Interval.of_averaged(self.averaged)

    @property
    def baseline_tension_n(self) -> Interval | None:
        """Return the baseline's tension; None where no earlier test forms one."""
        return None if self.now.is_baseline else self.now.baseline_n

    @property
    def tension_unit(self) -> ForceUnit:
        """Return the one unit of all tensions, so that they compare at a glance."""
        known = (self.tension_n, self.baseline_tension_n, Interval.of_averaged(self.by_latest_test))
        return force_unit(*(each.mean for each in known if each))


def _misfit(each: PredictedFrequency, measured_sd_hz: float) -> Interval:
    sd_hz = math.hypot(each.sd_hz, measured_sd_hz if math.isfinite(measured_sd_hz) else 0.0)
    off = Interval.normal(each.mean_hz - each.measured_hz, sd_hz)
    return off.scaled(100 / each.measured_hz)


def summary_of(
    hanger: Hanger,
    test: ModalTest,
    posterior: Posterior,
    baseline: Posterior | None = None,
    selection: Selection | None = None,
) -> HangerSummary:
    """Return the state of a hanger of which a test, its posterior and a baseline are all.

    Of a test without a time the age is not known; it is taken to be new.
    """
    is_first = baseline is None or baseline.tests == posterior.tests
    tension = averaged_now(posterior, selection, hanger.limits)
    return HangerSummary(
        hanger,
        LatestTest(test.id, test.time or datetime.now(UTC), tension, posterior.model),
        averaged_now(baseline, selection, hanger.limits) if baseline else None,
        is_first,
    )


@dataclass(frozen=True)
class DiagnosisSheet:
    """A gap diagnosis with its hanger, and bridge and sensors of the tests where known."""

    diagnosis: Diagnosis
    hanger: Hanger
    bridge: str = ""
    sensors: tuple[ResponsePoint, ...] = ()

    @property
    def bar(self) -> BarDescription:
        """The bar, with these sensors."""
        return describe_bar(self.hanger, self.sensors)


@dataclass(frozen=True)
class BridgeDiagnosisSheet:
    """A joint diagnosis of several hangers, with the bridge's name and bars where known."""

    diagnosis: BridgeDiagnosis
    bridge: str = ""
    bars: tuple[BarDescription, ...] = ()


def hangers_unit(lines: Iterable[HangerSummary]) -> ForceUnit:
    """Return the one unit of all their tensions, so that they compare at a glance."""
    return force_unit(*(line.tension_n.mean for line in lines if line.tension_n))


@dataclass(frozen=True)
class BridgeReport:
    """All that a report of a bridge says; `why_no_pattern` stands where there is no pattern."""

    bridge: str
    hangers: tuple[HangerSummary, ...]
    pattern: BridgePattern | None
    why_no_pattern: str
    generated_at: datetime
    version: str
    period: Period | None = None
    lineage: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
    controls: tuple[ControlChart, ...] = ()

    @property
    def message(self) -> BridgeMessage:
        return bridge_message({line.hanger.id: line.message for line in self.hangers})

    @property
    def worst(self) -> Status | None:
        """The status of the hanger that is worst off; None before the first test."""
        return self.message.status


@dataclass(frozen=True, eq=False)
class ModalTestReport:
    """One identified test as a person checks it.

    `records` are those it came from, in the order in which they were given; empty where they are
    not at hand. `lineage` names what it was made from, as in a hanger's report; who made the sheet
    when is empty where unsaid.
    """

    __test__: ClassVar[bool] = False  # Told to pytest, which takes every `Test...` for a test.

    identification: Identification
    records: Sequence[Recording | FrequencyResponse] = ()
    hanger: Hanger | None = None
    bridge: str = ""
    lineage: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
    generated_at: datetime | None = None
    version: str = ""

    @property
    def band_hz(self) -> tuple[float, float] | None:
        """Return where modes were looked for; None where nobody says."""
        return self.identification.band_hz

    @property
    def recordings(self) -> tuple[Recording, ...]:
        return tuple(record for record in self.records if isinstance(record, Recording))

    @property
    def bar(self) -> BarDescription:
        """The bar, with the sensors of the test."""
        found = self.identification
        sensors = list_sensors(found.test, found.frequency_response, self.records)
        return describe_bar(self.hanger, sensors, list_hits(self.records))

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes by plane and order."""
        return self.identification.test.modes

    @property
    def hits(self) -> tuple[Hit, ...]:
        return self.identification.hits

    @property
    def located_hits(self) -> list[tuple[int, Hit]]:
        """Return the hits whose records are at hand, each with its number from 1."""
        numbered = enumerate(self.hits, 1)
        return [(number, hit) for number, hit in numbered if hit.record < len(self.recordings)]

    @property
    def used_hits(self) -> tuple[Hit, ...]:
        return tuple(hit for hit in self.hits if hit.used)

    @property
    def dropped(self) -> tuple[Dropped, ...]:
        return self.identification.dropped

    @property
    def channel_faults(self) -> dict[str, str]:
        """Return why a channel was left out, by its name."""
        prefix = "channel "
        return {
            each.what.removeprefix(prefix): each.reason
            for each in self.dropped
            if each.what.startswith(prefix)
        }
