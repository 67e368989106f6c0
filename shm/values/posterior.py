"""Results of inference: posteriors, selections, and how well the tests of a baseline agree."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from shm.values.hanger import Hanger, Limits
from shm.values.kinds import NAN, FloatArray, Plane
from shm.values.modes import ModalTest
from shm.values.rounding import force_unit, tension_words, two_digits
from shm.values.showing import Displayable, front, line

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True)
class MistakenMode:
    """A mode that is left out of a baseline: in `test`, measured and as it was expected, in Hz."""

    test: str
    plane: Plane
    order: int
    measured_hz: float
    expected_hz: float

    def __str__(self) -> str:
        return (
            f"{self.plane} {self.order} of test {self.test}: measured {self.measured_hz:.4g} Hz, "
            f"expected {self.expected_hz:.4g} Hz"
        )


@dataclass(frozen=True)
class MistakenTest:
    """A test that is left out of a baseline as a whole, and why."""

    test: str
    why: str

    def __str__(self) -> str:
        return f"test {self.test}: {self.why}"


@dataclass(frozen=True)
class BaselineCheck:
    """Modes and tests excluded from a baseline, and its misfit.

    `misfit` is a clause, empty where the baseline fits. `unchecked` says why mistakes could not
    have been found, empty where they could.
    """

    modes: tuple[MistakenMode, ...] = ()
    tests: tuple[MistakenTest, ...] = ()
    misfit: str = ""
    unchecked: str = ""

    def without_mistakes(self, test: ModalTest) -> ModalTest:
        """Return a test of the baseline without the modes that are left out."""
        out = {(each.plane, each.order) for each in self.modes if each.test == test.id}
        if not out:
            return test
        modes = tuple(
            mode for mode in test.modes if mode.irregular or (mode.plane, mode.order) not in out
        )
        return replace(test, modes=modes)

    def accepted_tests(self, tests: Sequence[ModalTest]) -> tuple[ModalTest, ...]:
        """Return the tests without the modes and the tests that are left out."""
        return tuple(self.without_mistakes(test) for test in tests if not self.leaves_out(test.id))

    def leaves_out(self, test: str) -> bool:
        """Return True if a test is excluded completely."""
        return any(each.test == test for each in self.tests)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Each thing that is left out, with the reason."""
        return (*map(str, self.tests), *map(str, self.modes))


ENOUGH_EFFECTIVE = 200
"""Effective draws from which on a 90 % interval's ends are right to 0.15 of its half width."""

MOST_MISFIT_PERCENT = 1.0
"""Beyond it, predictions are off by more than tolerances of manufacture move any frequency."""

NO_TENSION_PERCENT = 10.0
"""Beyond it no bar of such a description has these modes, whatever holds its ends."""

MOST_R_HAT = 1.1
"""Gelman and Rubin (1992)."""

CONTRADICTS_FROM_SD = 3.0
"""Of sound hangers one in some hundred comes so far off."""

EMCEE = "emcee"
"""The sampler of Foreman-Mackey et al. (2013), as `Posterior.method` names it."""

DECIDING_SHARE, _NARROW = 0.5, 0.05
"""Judgement: of the variance of ln tension, what matters more than all else; and a half width of
the interval that asks for nothing more."""

FAR_FROM_NOMINAL = 2.0
"""Factor (judgement): lift-offs differ from drawings by 5 to 30 %."""

WITHOUT_MODEL = "frequencies"
"""Stands for the class of a posterior of a structure without a model: frequencies as measured."""

_DO_NOT_USE, _SAMPLER_FAILED = "Do not use this tension.", "The sampler failed"
_ENDS_DECIDE, _ORDERS_DECIDE = "The ends decide", "The orders decide"
DIAGNOSE = "; `shm gap diagnose` finds the cause"
"""Of a caveat: what a diagnosis that was made replaces."""
_MISSES = "misses the measured frequencies"
_INCLINATION_DECIDES, _SAMPLED_BY_EMCEE = "The inclination decides", "Sampled by emcee"
COUNTED_ONCE, LEFT_OUT = "Counted once", "Left out"
OTHER_UNIT = "The frequencies look given in"
_NO_FAULTS = (_ENDS_DECIDE, _INCLINATION_DECIDES, _SAMPLED_BY_EMCEE, COUNTED_ONCE, LEFT_OUT)
_MESSAGES_GIVEN_ONCE = (
    _ENDS_DECIDE,
    _ORDERS_DECIDE,
    _MISSES,
    "The description does not fit",
    "The tension that was read contradicts the frequencies",
)


@dataclass(frozen=True, eq=False)
class Prior:
    """Independent uniform priors: `lower` and `upper` have shape (parameters,)."""

    names: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True)
class Summary:
    """One quantity of a posterior in numbers; `q05` and `q95` bound 90 % of it."""

    mean: float
    sd: float
    q05: float
    q50: float
    q95: float

    @classmethod
    def of(cls, samples: FloatArray) -> Self:
        """Return the summary of equally weighted draws, shape (samples,)."""
        q05, q50, q95 = np.quantile(samples, [0.05, 0.5, 0.95])
        spread = float(samples.std(ddof=1))
        return cls(float(samples.mean()), spread, float(q05), float(q50), float(q95))


@dataclass(frozen=True)
class PredictedFrequency:
    """A frequency with the uncertainty of the parameters (thesis 4.14) beside its measurement."""

    plane: Plane
    order: int
    mean_hz: float
    sd_hz: float
    measured_hz: float


@dataclass(frozen=True, eq=False)
class Posterior(Displayable):
    """Samples of one model class's parameters given modal tests, and its evidence.

    `samples` (samples, parameters) are equally weighted draws; `log_likelihood` (samples,).
    `most_probable` (parameters,) has the largest posterior density. `r_hat` compares independent
    batches of draws, the worst parameter (1 is converged). `sampler` is what was asked for, empty
    where it is not known, and `method` what gave the draws: `importance`, or `emcee` where it was
    asked for or importance sampling failed; of earlier versions `tmcmc`, `re-weighted`, `ensemble`
    or `textbook`.
    `priors` are those of the `thesis` or of the hanger's `description`. The tension's draws are
    absolute: they hold the uncertainty of the description. `repeatability_sd_n` is the standard
    deviation, in N, with which a test tells a change of it while the bar stays as it is.
    `at_bounds` are parameters of which many draws lie at an end of their prior; `misfit_percent`
    is the root mean square of predicted over measured frequencies less 1; `log_occam` the log
    evidence less the largest log likelihood, never above 0 where the sampler did its work.
    `tension_of_other_orders_n` is the tension with modes that are all numbered one higher or one
    lower, nearer to the nominal one, where that fits as well; NaN where it does not.
    `tension_of_other_ends_n` is that of other ends in posteriors of version 1.0, NaN in others.
    `description_off_sd` is by how many of its standard deviations the description would be off,
    `reading_off_sd` by how many a tension that was read is off what the frequencies say.
    `remarks` say in words what `shm.inference.problem.data_checks` changed in the tests, or doubts.
    `taut_string_tension_n` is what a string without bending stiffness with these frequencies would
    carry, `stated_error_percent` the root mean square of the errors stated of frequencies; NaN
    where unknown.
    `inclination_share_of_variance` is the part of the variance of ln tension that the inclination
    explains where it is a parameter but not stated, `ends_share_of_variance` the part that the
    stiffness and mass of ends explain where `ends` is not stated; NaN where they are.
    `units` (parameters,) are those of the parameters, of the quantity itself where a parameter is
    its log10, and `1` of a ratio; empty where they are not known.
    `baseline_check` is what was found of the tests of a baseline before it was made of them; None
    of any other posterior, and of a baseline by a former version.
    """

    model: str
    hanger: int | None
    names: tuple[str, ...]
    samples: FloatArray
    log_likelihood: FloatArray
    most_probable: FloatArray
    nominal_tension_n: float
    log_evidence: float
    log_evidence_sd: float
    effective_sample_size: float
    r_hat: float
    evaluations: int
    predicted: tuple[PredictedFrequency, ...]
    tests: tuple[str, ...]
    seed: int
    seconds: float
    method: str = "tmcmc"
    priors: str = "thesis"
    repeatability_sd_n: float = NAN
    at_bounds: tuple[str, ...] = ()
    misfit_percent: float = NAN
    log_occam: float = NAN
    tension_of_other_ends_n: float = NAN
    tension_of_other_orders_n: float = NAN
    description_off_sd: float = NAN
    reading_off_sd: float = NAN
    baseline_check: BaselineCheck | None = None
    units: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    taut_string_tension_n: float = NAN
    stated_error_percent: float = NAN
    sampler: str = ""
    inclination_share_of_variance: float = NAN
    ends_share_of_variance: float = NAN

    @property
    def caveats(self) -> tuple[str, ...]:
        """Return the caveats of this posterior, worst first; empty if there is none."""
        faults = self.faults
        # What no other line is worth reading beside, and then what says that there is no answer.
        first = [each for each in faults if each.startswith(OTHER_UNIT)]
        failed = [each for each in faults if each.startswith(_SAMPLER_FAILED)]
        # What was not used of the data comes before what the rest of them says.
        changed = [each for each in self.remarks if each.startswith(_NO_FAULTS)]
        asked = (*self._statements_that_would_help, *self._emcee_reason)
        return tuple(dict.fromkeys((*first, *failed, *changed, *faults, *asked)))

    @property
    def faults(self) -> tuple[str, ...]:
        """Return the caveats that mean an error, not only a wide posterior."""
        found = []
        string = self._compare_with_string()
        if self.effective_sample_size < min(ENOUGH_EFFECTIVE, len(self.samples)):
            found.append(
                f"{_SAMPLER_FAILED}: {self.effective_sample_size:.0f} effective draws of "
                f"{len(self.samples)}, {ENOUGH_EFFECTIVE} are needed. {_DO_NOT_USE}"
            )
        if self.r_hat > MOST_R_HAT:
            found.append(
                f"{_SAMPLER_FAILED}: its parts disagree (R-hat {self.r_hat:.2g}, below "
                f"{MOST_R_HAT:g} is needed). {_DO_NOT_USE}"
            )
        if self.log_occam > 0:
            found.append(
                f"The evidence is wrong: its log Occam factor is {self.log_occam:.1f}, above 0. "
                "Do not compare this model class with others."
            )
        # A spring at an end of its range is an end that is clamped or turns freely: no fault.
        cut_off = [name for name in self.at_bounds if not name.startswith("log10_k")]
        if cut_off:
            names = ", ".join(cut_off)
            found.append(
                f"At the bound of its prior: {names}. The interval is cut off there. Check the "
                f"description, its units and the orders of the modes.{string}"
            )
        found += self._other_orders
        if not self.fits:
            found.append(self._tell_misfit("" if cut_off else string))
        if self.reading_off_sd > CONTRADICTS_FROM_SD:
            found.append(
                "The tension that was read contradicts the frequencies, by "
                f"{self.reading_off_sd:.0f} standard deviations. Check the reading, its unit, and "
                f"the description. {_DO_NOT_USE}"
            )
        if self.description_off_sd > CONTRADICTS_FROM_SD:
            found.append(
                "The description does not fit: its section, density, modulus and length would be "
                f"off by {self.description_off_sd:.0f} of their standard deviations. Check "
                f"diameter, length and material{DIAGNOSE}."
            )
        found += [each for each in self.remarks if not each.startswith(_NO_FAULTS)]
        return tuple(found)

    @property
    def _other_orders(self) -> tuple[str, ...]:
        """Return that other orders fit as well; nothing of frequencies in another unit."""
        other_n = self.tension_of_other_orders_n
        in_other_unit = any(each.startswith(OTHER_UNIT) for each in self.remarks)
        if math.isnan(other_n) or (in_other_unit and self.misfit_percent > NO_TENSION_PERCENT):
            return ()
        return (
            f"{_ORDERS_DECIDE}: numbered one higher or lower the modes fit as well or better, with "
            f"a tension of {force_unit(other_n).with_unit(other_n)}, nearer to the nominal one. "
            "Find the first mode of each plane.",
        )

    @property
    def fits(self) -> bool:
        """Return False where frequencies are missed by more than tolerances and stated errors."""
        return not self.misfit_percent > max(MOST_MISFIT_PERCENT, self.stated_error_percent)

    def _tell_misfit(self, string: str) -> str:
        """Return by how much the frequencies are missed; `string` is said where that is far."""
        by_far = f" {_DO_NOT_USE}{string}" if self.misfit_percent > NO_TENSION_PERCENT else ""
        return (
            f"{self.model} {_MISSES} by {self.misfit_percent:.1f} % (root mean square): the "
            "description or the model class does not fit this hanger. Check the "
            f"orders of the modes and the description{DIAGNOSE}.{by_far}"
        )

    def _compare_with_string(self) -> str:
        """Return what a taut string would carry, where that is far from the nominal tension."""
        string_n, nominal_n = self.taut_string_tension_n, self.nominal_tension_n
        if not (math.isfinite(string_n) and nominal_n > 0):
            return ""
        ratio = string_n / nominal_n
        if 1 / FAR_FROM_NOMINAL < ratio < FAR_FROM_NOMINAL:
            return ""
        return (
            f" A taut string would need {force_unit(string_n).with_unit(string_n)},"
            f" {two_digits(ratio)} times the nominal: check nominal_tension_n, its unit, the "
            "orders."
        )

    @property
    def _statements_that_would_help(self) -> tuple[str, ...]:
        """Return which keys of the description would narrow the tension's interval most."""
        if self.model == WITHOUT_MODEL or self._half_width < _NARROW:
            return ()
        found = []
        if self.inclination_share_of_variance > DECIDING_SHARE:
            found.append(
                f"{_INCLINATION_DECIDES} more than half of the interval. State "
                "`inclination_deg` of this hanger (90 is vertical)."
            )
        if self.ends_share_of_variance > DECIDING_SHARE:
            found.append(
                f"{_ENDS_DECIDE} more than half of the interval. State `ends` of this hanger: "
                "fork where they turn on a pin, else socket, plate, threaded or welded."
            )
        return tuple(found)

    @property
    def _half_width(self) -> float:
        """Return half of the 90 % interval of the tension over its median."""
        low, middle, high = np.quantile(self.tension_n, [0.05, 0.5, 0.95])
        return float((high - low) / (2 * middle)) if middle > 0 else math.inf

    @property
    def _emcee_reason(self) -> tuple[str, ...]:
        """Return why emcee gave the draws, where it did."""
        if self.method != EMCEE:
            return ()
        if self.sampler == EMCEE:
            return (f"{_SAMPLED_BY_EMCEE}, because it was asked for.",)
        return (
            f"{_SAMPLED_BY_EMCEE}, because importance sampling of {self.model} was not reliable "
            f"here: a few draws had most of the weight. Trust the evidence of {self.model} less "
            "than its error says.",
        )

    def parameter(self, name: str) -> FloatArray:
        """Return samples of one parameter, shape (samples,)."""
        return self.samples[:, self.names.index(name)]

    def unit(self, name: str) -> str:
        """Return the unit of one parameter, of its quantity where it is a log10; empty: unknown."""
        return dict(zip(self.names, self.units, strict=False)).get(name, "")

    @property
    def tension_n(self) -> FloatArray:
        """Samples of the tension, shape (samples,)."""
        return self.parameter("theta_F") * self.nominal_tension_n

    def __repr__(self) -> str:
        if self.model == WITHOUT_MODEL:
            n_modes = len(self.names)
            modes = "1 measured frequency" if n_modes == 1 else f"{n_modes} measured frequencies"
            return line("Posterior", self.hanger, f"{modes}, no model")
        tension = Selection((self,), (1.0,)).averaged.tension_n
        text = f"{self.model}, {tension_words(tension.mean, tension.q05, tension.q95)}"
        return line("Posterior", self.hanger, text)

    def to_dataframe(self) -> DataFrame:
        """Return the draws, a row a draw: the table of `shm.export.samples`."""
        table: DataFrame = front().export.samples(self)
        return table

    def to_arviz(self, tests: Sequence[ModalTest] = (), hanger: Hanger | None = None) -> Any:
        """Return the data set that ArviZ computes with.

        The arguments are those of `shm.export.inference_data`.

        Example:
            >>> arviz.summary(posterior.to_arviz())
        """
        return front().export.inference_data(self, tests, hanger)


@dataclass(frozen=True)
class Averaged:
    """The tension over all model classes, each with its probability: what a report leads with.

    `tension_n` is absolute, `repeatability_sd_n` that of the most probable class, in N.
    `probability_above_limit` and `probability_slack` are those of a tension beyond the hanger's
    limits (the thesis's robust reliability, 4.18), NaN where the owner sets none. `caveats` are
    what keeps it from being taken at its word.
    """

    tension_n: Summary
    repeatability_sd_n: float
    probability_above_limit: float = NAN
    probability_slack: float = NAN
    caveats: tuple[str, ...] = ()

    @property
    def faults(self) -> tuple[str, ...]:
        """Return the caveats that say that something is wrong, as `Posterior.faults` does."""
        return tuple(each for each in self.caveats if not each.startswith(_NO_FAULTS))

    @property
    def is_usable(self) -> bool:
        """Return False if a caveat says that this tension must not be used."""
        return not any(_DO_NOT_USE in each for each in self.caveats)

    @property
    def has_converged(self) -> bool:
        """Return False if a caveat says that the sampler failed."""
        return not any(_SAMPLER_FAILED in each for each in self.caveats)


@dataclass(frozen=True, eq=False)
class Selection(Displayable):
    """Model classes compared on the same tests, most probable first."""

    posteriors: tuple[Posterior, ...]
    probabilities: tuple[float, ...]

    @property
    def selected(self) -> Posterior:
        return self.posteriors[0]

    @property
    def tension_n(self) -> FloatArray:
        """Draws (samples,) of the tension over all classes, each as often as it is probable."""
        count = len(self.selected.samples)
        share = np.cumsum(np.array(self.probabilities) / sum(self.probabilities))
        ends = np.append(0, np.round(count * share).astype(int))
        parts = [
            posterior.tension_n[np.arange(low, high) % len(posterior.samples)]
            for posterior, low, high in zip(self.posteriors, ends[:-1], ends[1:], strict=True)
        ]
        return np.concatenate(parts)

    @property
    def averaged(self) -> Averaged:
        """Return the tension over all classes together; see `averaged_with` for limits."""
        return self.averaged_with(Limits())

    def averaged_with(self, limits: Limits | None) -> Averaged:
        """Return the same with the probabilities of a tension beyond a hanger's `limits`."""
        draws, limits = self.tension_n, limits or Limits()
        above, slack = limits.tension_max_n, limits.tension_min_n
        likely = [p for p, w in zip(self.posteriors, self.probabilities, strict=True) if w > 0.05]
        return Averaged(
            Summary.of(draws),
            self.selected.repeatability_sd_n,
            float(np.mean(draws > above)) if math.isfinite(above) else NAN,
            float(np.mean(draws < slack)) if math.isfinite(slack) else NAN,
            _distinct([each for posterior in likely for each in posterior.caveats]),
        )


def _distinct(caveats: Sequence[str]) -> tuple[str, ...]:
    """Return each caveat once, in order; of those that differ in a number, the first."""
    found: dict[str, str] = {}
    for each in caveats:
        head = each.partition(":")[0].partition(", by ")[0]
        found.setdefault(next((m for m in _MESSAGES_GIVEN_ONCE if m in head), each), each)
    return tuple(found.values())
