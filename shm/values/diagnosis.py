"""Values of a gap diagnosis."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from shm.values.kinds import NAN, Plane
from shm.values.leading import MIN_NO_GAP_PROBABILITY, find_leading_cause, sum_group_probability
from shm.values.rounding import tension_words
from shm.values.showing import Displayable, front, line
from shm.values.verdict import GapVerdict, judge

if TYPE_CHECKING:
    from pandas import DataFrame

Leads = Literal["cause", "no gap", "unexplained"]
_AND = " + "
NO_GAP = "no gap"
"""The name of the baseline without any effect."""


def effect_label(effect: str, at: str) -> str:
    """Return `sag (longitudinal)` for an effect and its place; everywhere is not named."""
    place = at.removeprefix("everywhere").removeprefix(", ")
    return effect.replace("_", " ") + (f" ({place})" if place else "")


def joined(names: Iterable[str]) -> str:
    """Return the effects of a pair, or their places, as one text."""
    return _AND.join(names)


def parted(name: str) -> tuple[str, ...]:
    """Return the names that `joined` made one."""
    return tuple(name.split(_AND))


@dataclass(frozen=True)
class Residual:
    """A measured frequency beside the baseline's best prediction of it.

    `residual_percent` is measured over predicted, less 1; `z` is in standard deviations of the
    identification and of what the baseline leaves open; `share` is its part of the misfit.
    `after_percent` is the same residual with the leading cause in the model, `held_out_percent`
    with that cause fitted without this mode (NaN where it was not held out). `after_z` is
    `after_percent` in standard deviations of the stated errors and of what repeats, NaN where no
    error is stated.
    """

    plane: Plane
    order: int
    test: str
    measured_hz: float
    predicted_hz: float
    residual_percent: float
    z: float
    share: float
    after_percent: float = NAN
    held_out_before_percent: float = NAN
    held_out_after_percent: float = NAN
    after_z: float = NAN


@dataclass(frozen=True)
class Trend:
    """Trend of the gap over a `condition`.

    It is `temperature`, `amplitude`, `order`, `added mass` or `plane` (from transverse to
    longitudinal).

    `slope_percent` is the change of the mean residual over the condition's range, with its
    standard deviation; `share` is the part of the misfit that goes with the condition.
    """

    condition: str
    slope_percent: float
    slope_sd_percent: float
    share: float


@dataclass(frozen=True)
class GapPlace:
    """Most probable place of a local cause of one `kind`, and what it explains.

    Kinds are `point mass`, `lateral spring`, `section loss` and `flexible end` (0 or the length).

    `x_m` is the likeliest place, `low_m` to `high_m` holds it with 90 % probability were it of this
    kind; `share` is the part of the misfit that it explains. `profile` holds (x_m, density).
    """

    kind: str
    x_m: float
    low_m: float
    high_m: float
    share: float
    profile: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class EffectEstimate:
    """One parameter of a cause: posterior mean, standard deviation and 90 % interval, in `unit`."""

    name: str
    unit: str
    mean: float
    sd: float
    q05: float
    q95: float


@dataclass(frozen=True)
class Cause:
    """One effect of the catalogue, or a pair, as an explanation of the gap.

    `effect` is the name, or two joined by ` + `, and `at` where the likeliest variant acts.
    `log_bayes_factor` compares it with the baseline, averaged over its variants; `log_fit` is what
    the best fit gains in log likelihood and `log_occam` what its evidence pays for free parameters;
    they are NaN of a cause that a scan has left far behind.
    `group` is the index of the group of causes that the data cannot tell apart, None for none.
    `method` is how far it was taken: `screened`, `normal` or `sampled`. `also_at` are other places
    at which it is about as likely.
    """

    effect: str
    at: str
    probability: float
    log_bayes_factor: float
    log_fit: float
    log_occam: float
    parameters: tuple[EffectEstimate, ...]
    method: Literal["screened", "normal", "sampled", "emcee"]
    group: int | None = None
    also_at: tuple[str, ...] = ()

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects of the catalogue that it holds, one or two."""
        return parted(self.effect)

    @property
    def places(self) -> tuple[str, ...]:
        """Return the place of each of its effects."""
        return self.each_at(self.at)

    def each_at(self, at: str) -> tuple[str, ...]:
        """Return the place of each effect from `at`; a single place is that of both."""
        found = parted(at)
        return found if len(found) == len(self.effects) else (at,) * len(self.effects)


@dataclass(frozen=True)
class Shrinkage:
    """Root mean square of the frequency residuals before and after, in and out of the fit."""

    rms_before_percent: float
    rms_after_percent: float
    held_out_before_percent: float
    held_out_after_percent: float


@dataclass(frozen=True)
class Outlier:
    """A frequency that belongs neither to the model nor to any effect: a blunder, most likely.

    `expected_hz` is what the other data say with its standard deviation; `probability` is that of
    the blunder. The diagnosis sets it aside. `acts_alone` is how probable it then is that it was no
    blunder, but something that acts on this mode alone, such as a guide that its swing meets.
    """

    plane: Plane
    order: int
    test: str
    measured_hz: float
    expected_hz: float
    expected_sd_hz: float
    probability: float
    acts_alone: float = 0.0


@dataclass(frozen=True)
class TensionEstimate:
    """Posterior of the tension under one explanation: mean, sd, 90 % and 95 % intervals."""

    mean: float
    sd: float
    q05: float
    q95: float
    q025: float = NAN
    q975: float = NAN


MEASUREMENT_HOURS: Mapping[str, float] = MappingProxyType(
    {
        "repeat": 1.0,
        "level": 1.0,
        "other plane": 1.0,
        "more modes": 1.0,
        "known mass": 2.0,
        "sensors": 3.0,
        "temperature": 8.0,
        "lift-off": 16.0,
    }
)
"""What kinds of measurement cost, in hours of a crew (judgement): an hour a test where the crew is,
another season's way anew, a jack and its crew for two days. `[measurement_hours]` has the owner's.
"""


@dataclass(frozen=True)
class NextMeasurement:
    """A measurement that would tell causes apart, and the log Bayes factor to expect of it."""

    what: str
    separates: tuple[str, str]
    expected_log_bayes_factor: float


@dataclass(frozen=True)
class Diagnosis(Displayable):
    """Differences of a hanger between baseline and measurement, their causes and consequences.

    `causes` holds every effect that these data could show, best first, and the pairs that were
    tried; their probabilities, `no_gap_probability` and `unexplained_probability` add to 1.
    `fit_p_value` is the posterior predictive p-value of the leading explanation. `invisible` names
    the effects that these data cannot show, and why; `left_out` those that were taken out of the
    catalogue. `remarks` say in words what is wrong with the data and what it does to the answer.
    `outliers` are frequencies that were set aside. Hits moved the sensors by `widest_swing_m` at
    most; what acts only beyond, such as a guide with more play, is not visible. `slenderness` is
    L sqrt(T/EI) of the baseline: about 10 of a bar, above 100 of a string. `effective_draws` is the
    least effective sample size of the fits that the answer rests on. Both are NaN in documents of
    former versions.
    """

    hanger: int | None
    baseline: str
    tests: tuple[str, ...]
    where: tuple[Residual, ...]
    trends: tuple[Trend, ...]
    places: tuple[GapPlace, ...]
    no_gap_probability: float
    unexplained_probability: float
    causes: tuple[Cause, ...]
    groups: tuple[tuple[str, ...], ...]
    invisible: tuple[tuple[str, str], ...]
    left_out: tuple[str, ...]
    fit_p_value: float
    model_error_percent: float
    shrinkage: Shrinkage
    tension_before_n: TensionEstimate
    tension_after_n: TensionEstimate
    next_measurements: tuple[NextMeasurement, ...]
    remarks: tuple[str, ...]
    seed: int
    seconds: float
    outliers: tuple[Outlier, ...] = ()
    widest_swing_m: float = NAN
    slenderness: float = NAN
    effective_draws: float = NAN

    @property
    def verdict(self) -> GapVerdict:
        """Return what this diagnosis claims: the one decision that every report states."""
        return judge(self)

    def claim(self, cause: Cause) -> float:
        """Return the probability of a cause and of those that the data cannot tell from it."""
        return sum_group_probability(cause, self.causes)

    @property
    def leads(self) -> Leads:
        """Return whether a cause leads, no gap, or something unknown.

        The unknown does, too, where an excluded frequency may be no blunder.
        """
        if self.leading is not None:
            return "cause"
        alone = max((each.acts_alone for each in self.outliers), default=0.0)
        is_open = not self.no_gap_probability >= MIN_NO_GAP_PROBABILITY
        return "unexplained" if is_open or alone >= MIN_NO_GAP_PROBABILITY else "no gap"

    @property
    def leading(self) -> Cause | None:
        """Return the most probable cause of the most probable group; None where none leads."""
        return find_leading_cause(
            self.no_gap_probability, self.unexplained_probability, self.causes
        )

    def __repr__(self) -> str:
        verdict, tension = self.verdict, self.tension_after_n
        text = verdict.outcome.value.lower()
        if verdict.claim is not None:
            leading = verdict.claim.leading
            text = f"{text}: {effect_label(leading.effect, leading.at)}"
        tension_text = tension_words(tension.mean, tension.q05, tension.q95)
        return line("Diagnosis", self.hanger, f"{text}, {tension_text}")

    def to_dataframe(self) -> DataFrame:
        """Return the causes, a row a cause: the table of `shm.export.causes`."""
        table: DataFrame = front().export.causes(self)
        return table
