"""Values of the watch over a hanger."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Literal

from shm.values.kinds import NAN, BoolArray, FloatArray, Plane
from shm.values.posterior import Averaged
from shm.values.rounding import NINETY_PERCENT, rounded_percent

if TYPE_CHECKING:
    from shm.values import Hanger, ModalTest

End = Literal["deck", "arch"]

TENSION = "tension"
FREQUENCY = "frequency "
"""Begins the names of frequencies that are watched by themselves: `frequency transverse 1`."""
ENOUGH_MISTAKES = 3
"""Tests in a row with the same mode wrong: at one mistake in 25 modes by chance once in 15,000."""
ENOUGH_FITS = 6
"""Tests in a row that must have such a mode right before it is over: one that is wrong in every
other test is told once in 65 tests, and with three it would be once in 25."""
ENOUGH_AGAINST = 3  # tests: of two a bad day may be to blame
OF_ONE_VISIT = timedelta(days=1.5)
"""Judgement: tests that far apart or nearer share wind, sensors, loads and operator."""
_INFORMED = 0.7  # judgement: half of the prior's variance is gone (1 / sqrt 2)


@dataclass(frozen=True)
class QuantityKind:
    """Names and units of one kind of watched quantity.

    A small shift is `percent_a_unit` times as many percent of the quantity.
    """

    noun: str
    shift_unit: Literal["fraction", "decades"]
    percent_a_unit: float
    unmoved: str

    @property
    def is_ratio(self) -> bool:
        """Return True if shifts are fractions of the quantity."""
        return self.shift_unit == "fraction"


_KINDS = {
    TENSION: QuantityKind("tension", "fraction", 100.0, "about 0 %"),
    FREQUENCY: QuantityKind("frequency", "fraction", 100.0, "about 0 %"),
    "": QuantityKind("end stiffness", "decades", 100 * math.log(10), "about 1.00 times"),
}
"""By how their names begin, the first that fits. What else may move frequencies is no quantity of a
hanger but a cause: an effect of the catalogue with `over_time`."""


def kind_of(quantity: str) -> QuantityKind:
    return next(kind for begins, kind in _KINDS.items() if quantity.startswith(begins))


def is_frequency(quantity: str) -> bool:
    """Return True if a quantity is a frequency of a structure without a model."""
    return kind_of(quantity) is _KINDS[FREQUENCY]


def is_ratio(quantity: str) -> bool:
    """Return True if shifts are fractions of the quantity, as for tension and frequencies."""
    return kind_of(quantity).is_ratio


def threshold_of(quantity: str, hanger: Hanger) -> float:
    """Return the shift of which its owner must know: a fraction of the tension, or decades."""
    limits = hanger.thresholds
    if quantity == TENSION:
        return limits.tension_shift_fraction
    if is_frequency(quantity):  # it goes with the root of a stiffness, as with a tension's
        return limits.tension_shift_fraction / 2
    return limits.stiffness_shift_decades


@dataclass(frozen=True, eq=False)
class WatchedQuantity:
    """One thing that may move: the tension, or the stiffness of an end in the model class.

    `name` is `tension` or that of a spring's parameter, such as `log10_k1`; `end` and `plane` say
    where it acts, None where they do not tell it apart. Where frequencies cannot say which end of a
    plane moves, both are one quantity, `transverse_end_stiffness` for instance: that of two springs
    alike, 2/(1/k_deck + 1/k_arch), both of which move by the same decades. `parameters` are those
    of the model class that move. The watch works in a `coordinate` in which frequencies change
    nearly linearly, 0 at the baseline: of the tension the logarithm of its ratio to the baseline's;
    of a spring the change of the mean log frequency. `coordinates` (m,), ascending, and `values`
    (m,) map it to the tension in N or to log10 of the stiffness; `baseline` is the value at 0.
    `step_sd` is the standard deviation of a change, if there is one, before any data, in the
    coordinate. `scale_sd` is by what share of itself a shift may be off, as the baseline is.
    `unit` is that of the tension or of the stiffness; empty where it is not known.
    """

    name: str
    baseline: float
    coordinates: FloatArray
    values: FloatArray
    step_sd: float
    end: End | None = None
    plane: Plane | None = None
    parameters: tuple[str, ...] = ()
    scale_sd: float = 0.0
    unit: str = ""


@dataclass(frozen=True, eq=False)
class ModeReading:
    """One test mode by mode: log frequencies (modes,) of the baseline's modes beside the model's.

    `values` (modes,) are linear in the coordinates, by the slopes at the baseline for all tests
    (record 0037). `variances` are infinite of a mode that the test lacks, or that is taken for a
    mistaken one (`mistaken`). `per_kelvin` (modes,) is what a kelvin does to each as steel softens,
    taken off where the temperature is known.
    """

    values: FloatArray
    variances: FloatArray
    per_kelvin: FloatArray
    mistaken: BoolArray


@dataclass(frozen=True, eq=False)
class Reading:
    """Likelihood of the watched quantities of a hanger from one test, without any prior.

    Its log likelihood at coordinates x (q,) is -(x - mean)' information (x - mean) / 2, of the
    errors that differ from test to test: what all tests share, the model's error above all, cancels
    in every comparison and is left out. `information` (q, q) is singular where a test cannot tell
    quantities apart; `mean` (q,) is then 0 along what it does not see. `modes`
    is the same mode by mode, `amplitude` the excitation over the reference (NaN: not known).
    """

    test: str
    time: datetime
    temperature_c: float
    mean: FloatArray
    information: FloatArray
    modes: ModeReading | None = None
    amplitude: float = NAN


@dataclass(frozen=True)
class Drift:
    """Shift of one quantity from its baseline, with the probability that it matters.

    `quantity` is `tension` (shift as a fraction of the baseline) or a parameter such as
    `log10_k1` (shift in decades), given that it has changed at all: where nothing was called this
    is no finding. `probability` is that of a shift beyond `threshold`, up or down, that nothing has
    changed being weighed with the rest.
    `value` is what the state over time says at the test, its swing with the temperature taken out.
    """

    hanger: int
    test: str
    time: datetime
    quantity: str
    baseline: float
    value: float
    shift_mean: float
    shift_sd: float
    threshold: float
    probability: float

    def may_be_beyond(self, way: float) -> bool:
        """Return True if the 90 % interval passes the threshold on the side of sign `way`."""
        shift = math.copysign(1, way) * self.shift_mean
        return shift + NINETY_PERCENT * self.shift_sd >= self.threshold

    @property
    def is_clearly_beyond(self) -> bool:
        """Return True if the complete 90 % interval lies beyond the threshold, given a change."""
        return abs(self.shift_mean) - NINETY_PERCENT * self.shift_sd >= self.threshold


@dataclass(frozen=True)
class Moved:
    """One quantity as that which has changed, alone or with others.

    `probability` is that it did, given that something has changed; several may move together, so
    that these add to more than 1. The shift (a fraction of the tension, decades of a stiffness) is
    that if it did. `together` are the quantities that move with it in the likeliest change of it:
    the planes of an end, all ends. `alike` are those of which a change without it explains the data
    as well: a log Bayes factor below 3.
    """

    quantity: str
    probability: float
    shift_mean: float
    shift_sd: float
    end: End | None = None
    plane: Plane | None = None
    alike: tuple[str, ...] = ()
    together: tuple[str, ...] = ()


@dataclass(frozen=True)
class Change:
    """Result of the sequential test after one test of a hanger.

    `evidence_years` is the Shiryaev-Roberts statistic in years of this hanger; a change is called
    once it exceeds `limit_years`, which is the mean time to a false call, or less than it.
    `probability` is that of any change since the baseline, `sudden` that it was a step and no
    ramp, given a change. `began_after` and `began_by` hold the beginning with 90 % probability.
    `moved` is everything that may have changed, the likeliest first. `outlier_probability` is that
    of this test's reading being a blunder. `material_probability` is that the change moves a first
    frequency, or the mean of a plane, by more than the watch is asked to tell; less is not called.
    `against_baseline` tests agree with each other and not with a baseline of so few tests that it
    may be the odd one; 0 where it is not so.
    """

    evidence_years: float
    limit_years: float
    probability: float
    sudden: float
    began_after: datetime
    began_by: datetime
    moved: tuple[Moved, ...]
    outlier_probability: float = NAN
    material_probability: float = 1.0
    against_baseline: int = 0

    @property
    def is_baseline_alone(self) -> bool:
        """Return True if the baseline is the most probable reason of the misfit."""
        return self.against_baseline >= ENOUGH_AGAINST and not self.called

    @property
    def called(self) -> bool:
        """Return True if the evidence exceeds its limit and the change is not negligible."""
        return self.evidence_years > self.limit_years and self.material_probability > 0.5


@dataclass(frozen=True)
class CreepRate:
    """Creep rate of the tension, a fraction per year; `prior_sd` is the sd before any test.

    Relaxation at such a rate is reported, and is no alarm.
    """

    mean: float
    sd: float
    prior_sd: float

    @property
    def is_known(self) -> bool:
        """Return True if the tests, and not the prior, determine the value."""
        return math.isfinite(self.mean) and self.sd < _INFORMED * self.prior_sd

    @property
    def words(self) -> str:
        """`Tension relaxes by 0.30 ± 0.10 % a year.`; empty where the rate is not known."""
        if not self.is_known:
            return ""
        half = NINETY_PERCENT * self.sd
        if abs(self.mean) <= half:
            return f"Tension creeps by {rounded_percent(self.mean, half, '+')} a year, if at all."
        verb = "relaxes" if self.mean < 0 else "grows"
        return f"Tension {verb} by {rounded_percent(abs(self.mean), half)} a year."


@dataclass(frozen=True)
class RepeatedMistake:
    """A mode that was taken for a mistaken one in `tests` tests in a row that have it, `since`.

    Once it is notable it stays so until it was right in several tests in a row, of which there have
    been `fits`; `tests` counts on. `is_misfit` where more modes of the test were wrong than can be
    misnamed: then it is the test that does not fit.
    """

    plane: Plane
    order: int
    since: datetime
    tests: int
    fits: int = 0
    is_misfit: bool = False

    def __str__(self) -> str:
        return f"{self.plane} {self.order}"

    @property
    def is_notable(self) -> bool:
        """Return True if it recurs: numbered wrongly each time, or a real change."""
        return self.tests >= ENOUGH_MISTAKES


@dataclass(frozen=True, eq=False)
class WatchedTest:
    """The watch after one test: shifts of all quantities and what the sequential test says.

    `creep_per_year` is None where it is not known: a change that may have come is not told from it,
    and former versions did not keep it.
    `mistaken` are the modes that this test, and maybe those before it, have wrong.
    """

    test: str
    time: datetime
    temperature_c: float
    drifts: tuple[Drift, ...]
    change: Change
    creep_per_year: CreepRate | None = None
    mistaken: tuple[RepeatedMistake, ...] = ()

    @property
    def is_unexplained(self) -> bool:
        """Return True if no state of the baseline's model explains the modes of this test."""
        return any(each.is_misfit and not each.fits for each in self.mistaken)

    @property
    def published_drifts(self) -> tuple[Drift, ...]:
        """Return the drifts as they are reported.

        What is clearly beyond its threshold where a change is called is as probable as that it
        moved. Of a test that no state explains no shift is known, unless one is probable.
        """
        return tuple(map(self._reported, self.drifts))

    def _reported(self, drift: Drift) -> Drift:
        moved = {each.quantity: each.probability for each in self.change.moved}
        if self.change.called:
            if not drift.is_clearly_beyond:
                return drift
            probability = max(drift.probability, moved.get(drift.quantity, 0.0))
            return replace(drift, probability=probability)
        if self.is_unexplained and drift.probability < 0.5:
            return replace(drift, value=NAN, shift_mean=NAN, shift_sd=NAN, probability=NAN)
        return drift


@dataclass(frozen=True)
class TemperatureCoefficient:
    """Temperature coefficient of a quantity: a fraction or decades per kelvin, with its sd.

    `prior_sd` is the sd before any test, about 0: as long as `sd` is hardly less, the tests say
    next to nothing of it.
    """

    quantity: str
    mean: float
    sd: float
    prior_sd: float = NAN

    @property
    def is_known(self) -> bool:
        """Return True if the tests, and not the prior, determine the value."""
        return math.isfinite(self.mean) and not self.sd > _INFORMED * self.prior_sd


AlertKind = Literal[
    "sudden change", "slow drift", "beyond threshold", "repeat the test", "tests disagree",
    "check the modes", "check the baseline", "gap", "held", "limit", "silent", "test", "resolved",
]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Beside:
    """Tests next to the newest, the nearest first: as they `came` in, and as they are `dated`.

    Those that came may be `held` (their names) for their clock alone: what they measured counts.
    Tests that are not watched yet are left out; each is asked of in its turn. Those `of_works`
    (their names) were passed over within a maintenance window, and so have told nothing.
    """

    came: tuple[Sequence[ModalTest], Sequence[ModalTest]] = ((), ())
    dated: tuple[Sequence[ModalTest], Sequence[ModalTest]] = ((), ())
    held: Collection[str] = ()
    of_works: Collection[str] = ()


@dataclass(frozen=True)
class CrossedLimit:
    """The limit that its owner sets and that a tension is beyond, in N."""

    side: Literal["above", "below"]
    tension_n: float


@dataclass(frozen=True)
class Alert:
    """A shift that its owner should know of. `key` makes its delivery idempotent.

    `kinds` are the rules that raised it; `change` is None where the sequential test had no part.
    A `held` one says that a test is held until a person has looked, and what it would mean.
    A `test` alert is no finding: it shows that a hook works. `tension` is that by the test,
    averaged over the model classes; None where the alert does not say. `limit` is the one that it
    is beyond; None of other alerts, and of those that shm 1.0.0 stored.

    A `resolved` one says that the condition of the alert has ended whose key it has, with
    `:resolved` behind it. Where one message tells of several hangers, `alerts` are theirs.
    """

    key: str
    hanger: int
    test: str
    time: datetime
    message: str
    drifts: tuple[Drift, ...]
    kinds: tuple[AlertKind, ...] = ()
    change: Change | None = None
    tension: Averaged | None = None
    alerts: tuple[Alert, ...] = ()
    limit: CrossedLimit | None = None
