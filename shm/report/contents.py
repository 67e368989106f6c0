"""What each kind of report is made from: one frozen value, complete at birth."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

from shm.bridge.description import NO_LETTERHEAD, Letterhead
from shm.models import end_stiffness
from shm.report.formatting import Interval
from shm.report.hanger_status import (
    BridgeMessage,
    HangerMessage,
    Known,
    Status,
    bridge_message,
    hanger_message,
)
from shm.report.states import NOTHING_WATCHED, Period, StatesOverTime
from shm.values import (
    NAN,
    Alert,
    Averaged,
    BridgeDiagnosis,
    Change,
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
from shm.values.bar_description import BarDescription, describe_bar, list_sensors
from shm.values.messages import Lead
from shm.values.notes import Note
from shm.values.rounding import ForceUnit, force_unit
from shm.values.stated_tension import averaged_now, selection_now

if TYPE_CHECKING:  # `shm status` lists hangers and identifies nothing
    from shm.identify import Dropped, Hit, Identification
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
    """The row of one test of `hanger` and its posterior, averaged over the classes compared."""
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


@dataclass(frozen=True, eq=False)
class HangerReport:
    """All that a report of one hanger says.

    `posterior` and `frequency_response` are those of the latest test, the last of `tests`, which
    stand oldest first like `trend`. `drifts` are those of the latest test from the baseline in
    force, `alerts` all of the hanger; `acknowledged` says by an alert's key who took note of it.
    `lineage` names where the numbers come from: checksums, settings, files. `quality` is that of
    the latest test, empty where it was not checked; `diagnosis` the latest of its gap. `gap_watch`
    says in a sentence how the gap has gone since an effect was adopted, `drift_watch` what the
    sequential test has detected since the baseline, `called` these changes, `creep`
    how fast the tension creeps. `states` are empty
    where the hanger has no baseline. `neighbours` is what moved over the whole bridge, None where
    nothing is called. Of a `period`, `tests`, `trend` and `alerts` are those that lie in it.
    `settings` are those that decide the numbers, each with its unit. `redescribed` says what of the
    hanger's description has changed since the baseline, where that moves results; `discarded` names
    the tests of the baseline that count no more. `warnings` are the open ones, `standing` the
    alerts whose condition has not ended, `notes` what people did about these; `inspections`
    what they wrote, the latest first; `unwatched` says that nothing has looked at it for long;
    `undated` names the tests that are dated by their receipt. `known` is what home page and
    `shm status` decide the state from; None: it follows from these.
    """

    bridge: str
    hanger: Hanger
    tests: tuple[ModalTest, ...]
    posterior: Posterior
    generated_at: datetime
    version: str
    trend: tuple[TrendRow, ...] = ()
    baseline: Posterior | None = None
    selection: Selection | None = None
    drifts: tuple[Drift, ...] = ()
    alerts: tuple[Alert, ...] = ()
    acknowledged: Mapping[str, str] = field(default_factory=dict)
    frequency_response: FrequencyResponse | None = None
    lineage: Mapping[str, str] = field(default_factory=dict)
    quality: tuple[QualityCheck, ...] = ()
    diagnosis: Diagnosis | None = None
    gap_watch: str = ""
    drift_watch: str = ""
    creep: CreepRate | None = None
    states: StatesOverTime = NOTHING_WATCHED
    called: tuple[Change, ...] = ()
    neighbours: BridgePattern | None = None
    period: Period | None = None
    settings: Mapping[str, str] = field(default_factory=dict)
    redescribed: tuple[str, ...] = ()
    discarded: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    standing: tuple[Alert, ...] = ()
    notes: tuple[str, ...] = ()
    inspections: tuple[Note, ...] = ()
    unwatched: Lead | None = None
    undated: tuple[str, ...] = ()
    letterhead: Letterhead = NO_LETTERHEAD
    known: Known | None = None

    @property
    def is_called(self) -> bool:
        """Whether a change was detected since the baseline."""
        return bool(self.called)

    @property
    def latest(self) -> ModalTest:
        return self.tests[-1]

    @property
    def bar(self) -> BarDescription:
        """The bar, with the sensors of the latest test."""
        return describe_bar(self.hanger, list_sensors(self.latest, self.frequency_response))

    @property
    def predicted(self) -> tuple[PredictedFrequency, ...]:
        """The predictions for the latest test, where the posterior is of several."""
        measured = {(mode.plane, mode.order): mode.frequency_hz for mode in self.latest.modes}
        return tuple(
            row
            for row in self.posterior.predicted
            if math.isnan(row.measured_hz)
            or math.isclose(row.measured_hz, measured.get((row.plane, row.order), NAN))
        )

    @cached_property
    def compared(self) -> Selection:
        """The model classes as they are by the latest test."""
        return selection_now(self.posterior, self.selection)

    @cached_property
    def averaged(self) -> Averaged:
        """The tension over all model classes by the latest test: the headline."""
        return self.compared.averaged(self.hanger.limits)

    @property
    def tension_n(self) -> Interval:
        """The same, absolute."""
        return Interval.of_averaged(self.averaged)

    @property
    def baseline_tension_n(self) -> Interval | None:
        """The baseline's tension; None where no earlier test forms one."""
        if self.baseline is None or self.baseline.tests == self.posterior.tests:
            return None
        return Interval.of_averaged(averaged_now(self.baseline, self.selection))

    @property
    def tension_unit(self) -> ForceUnit:
        """The one unit of this tension and the baseline's, so that they compare at a glance."""
        both = (self.tension_n, self.baseline_tension_n)
        return force_unit(*(each.mean for each in both if each))


def message(data: HangerReport) -> HangerMessage:
    """What is said first of the hanger."""
    return hanger_message(
        data.known
        or Known(
            data.hanger,
            data.averaged,
            data.latest.time or data.generated_at,
            data.latest.id,
            data.baseline_tension_n is None,
            data.drifts,
            data.called,
            data.standing,
            data.warnings,
            data.notes,
            data.unwatched,
        )
    )


def status(data: HangerReport) -> Status:
    """The state in a word; of a hanger with a test it is known."""
    return message(data).status or Status.UNCLEAR


def of_nominal(tension_n: Interval, hanger: Hanger) -> Interval | None:
    """The tension in percent of the nominal one; None where the hanger has none."""
    nominal_n = hanger.nominal_tension_n
    return tension_n.scaled(100 / nominal_n) if nominal_n > 0 else None


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


@dataclass(frozen=True)
class Course:
    """What became of a hanger in the period of the report.

    `change` is that of the tension from the first test of the period to the last, as a fraction;
    None where it has fewer than two.
    """

    tests: int = 0
    alerts: int = 0
    change: Interval | None = None


@dataclass(frozen=True)
class HangerLine:
    """A hanger as the report of its bridge shows it.

    `tension_n` is that of its latest test, None before the first, `averaged` all that is said of
    it; `drift` that of its tension since its baseline, None where nothing was compared; `called`
    says in a few words what was called since; `open_alerts` is `store.alerts.open_counts`.
    `course` is None without a period; `warnings` are the open ones; `undated` names the tests that
    are dated by their receipt. `sensors` are those of the latest test, or those that stay.
    """

    hanger: Hanger
    message: HangerMessage
    latest: datetime | None = None
    tension_n: Interval | None = None
    called: str = ""
    open_alerts: int = 0
    drift: Drift | None = None
    test: str = ""
    model: str = ""
    course: Course | None = None
    baseline_tension_n: Interval | None = None
    averaged: Averaged | None = None
    warnings: tuple[str, ...] = ()
    undated: tuple[str, ...] = ()
    sensors: tuple[ResponsePoint, ...] = ()

    @property
    def bar(self) -> BarDescription:
        """The bar, with these sensors."""
        return describe_bar(self.hanger, self.sensors)

    @property
    def status(self) -> Status | None:
        return self.message.status

    @property
    def of_nominal(self) -> Interval | None:
        """The tension in percent of the nominal one."""
        return of_nominal(self.tension_n, self.hanger) if self.tension_n else None

    @property
    def is_hardly_known(self) -> bool:
        """Whether the interval of the tension is so wide that a shift could hardly be seen."""
        return self.tension_n is not None and self.tension_n.is_wide


def hangers_unit(lines: Iterable[HangerLine]) -> ForceUnit:
    """The one unit of all their tensions, so that they compare at a glance."""
    return force_unit(*(line.tension_n.mean for line in lines if line.tension_n))


@dataclass(frozen=True)
class BridgeReport:
    """All that a report of a bridge says; `why_no_pattern` stands where there is no pattern."""

    bridge: str
    hangers: tuple[HangerLine, ...]
    pattern: BridgePattern | None
    why_no_pattern: str
    generated_at: datetime
    version: str
    period: Period | None = None
    lineage: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)

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
    not at hand. `band_hz` is where modes were looked for; None where nobody says. `lineage` names
    what it was made from, as in a hanger's report; who made the sheet when is empty where unsaid.
    """

    __test__: ClassVar[bool] = False  # Told to pytest, which takes every `Test...` for a test.

    identification: Identification
    records: Sequence[Recording | FrequencyResponse] = ()
    hanger: Hanger | None = None
    band_hz: tuple[float, float] | None = None
    bridge: str = ""
    lineage: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
    generated_at: datetime | None = None
    version: str = ""

    @property
    def recordings(self) -> tuple[Recording, ...]:
        return tuple(record for record in self.records if isinstance(record, Recording))

    @property
    def bar(self) -> BarDescription:
        """The bar, with the sensors of the test."""
        found = self.identification
        sensors = list_sensors(found.test, found.frequency_response, self.records)
        return describe_bar(self.hanger, sensors)

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes by plane and order."""
        return self.identification.test.modes

    @property
    def hits(self) -> tuple[Hit, ...]:
        return self.identification.hits

    @property
    def used_hits(self) -> tuple[Hit, ...]:
        return tuple(hit for hit in self.hits if hit.used)

    @property
    def dropped(self) -> tuple[Dropped, ...]:
        return self.identification.dropped

    @property
    def channel_faults(self) -> dict[str, str]:
        """Why a channel was left out, by its name."""
        prefix = "channel "
        return {
            each.what.removeprefix(prefix): each.reason
            for each in self.dropped
            if each.what.startswith(prefix)
        }
