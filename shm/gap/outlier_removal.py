"""The attribution of a gap with gross errors set aside, and what is told of these.

So are modes whose orders look wrong: a slip of whoever numbered them, which no effect imitates.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from shm.gap.attribution import Attribution, answered, attributed, more_thorough
from shm.gap.contract import Fit, GapOptions
from shm.gap.fit import baseline_fit, with_remainder
from shm.gap.outliers import (
    SURE,
    GrossError,
    LeftOut,
    acts_alone,
    at,
    gross_errors,
)
from shm.gap.problem import GapProblem
from shm.inference.options import Progress, silent
from shm.values import NAN, PLANES, IntArray, Outlier, Residual, effect_label

_ROUNDS = 2  # judgement: one error may hide another
_LIKELIER_THAN_NOT = 0.5  # even odds


@dataclass(frozen=True, eq=False)
class Cleared:
    """The attribution of those frequencies `rows` (indices) of `whole` that `problem` keeps.

    `aside` are the others, `doubted` at most one of those kept: more likely than not a gross error,
    but not surely. `otherwise` is the cause that would lead, were none of `aside` one; "" for none.
    `misnumbered` is a remark where the orders look wrong. `first` is the attribution of all
    frequencies.
    """

    whole: GapProblem
    problem: GapProblem
    rows: IntArray
    attribution: Attribution
    aside: tuple[GrossError, ...] = ()
    doubted: tuple[GrossError, ...] = ()
    otherwise: str = ""
    misnumbered: tuple[str, ...] = ()
    first: Attribution | None = None

    def seen(self, error: GrossError, fit: Fit) -> LeftOut:
        """A frequency seen from the other data that are kept, to which `fit` was fitted."""
        rows = np.union1d(self.rows, [error.row])
        index = int(np.searchsorted(rows, error.row))
        return at(self.whole.part(rows).without_shape(index), fit, index)

    def expected(self, error: GrossError, fit: Fit) -> tuple[float, float]:
        """By how much its logarithm lies above what is expected so, and the standard deviation."""
        deviation, sd = self.seen(error, fit).expected
        return float(deviation[0]), float(sd[0])


def exclude_outliers(
    whole: GapProblem, options: GapOptions, rng: np.random.Generator, progress: Progress = silent
) -> Cleared:
    """Attribute the gap, and where that leaves gross errors, attribute it again without them.

    Where the last attribution expects one of them as it was measured, the first one applies.
    """
    every = np.arange(whole.design.frequencies)
    first = found = Cleared(whole, whole, every, attributed(whole, options, rng, progress))
    for _ in range(_ROUNDS):
        errors = gross_errors(whole, found.rows, found.attribution, rng)
        sure = [each for each in errors if each.probability >= SURE]
        rest = [each for each in errors if _LIKELIER_THAN_NOT <= each.probability < SURE]
        found = replace(found, doubted=tuple(rest))
        if not sure:
            break
        rows = np.setdiff1d(found.rows, [each.row for each in sure])
        part = whole.part(rows)
        again = attributed(part, options, rng, lambda label, _: progress(label, 1.0))
        found = Cleared(whole, part, rows, again, (*found.aside, *sure))
    found = found if all(_stands(found, each) for each in found.aside) else first
    wrong = misnumbered(found.problem, found.attribution)
    return replace(found, first=first.attribution, misnumbered=wrong)


def search_further(found: Cleared) -> Cleared:
    """Search thoroughly what the first search leaves open, and weigh that an outlier acts alone.

    Among many pairs there always is one that takes a gross error for its own: outliers must be
    excluded before. Where the orders look wrong nothing is searched: they must be put right first.
    """
    last = found.attribution if found.misnumbered else more_thorough(found.attribution)
    otherwise = _led_before(found.first or found.attribution, last)
    done = replace(found, attribution=last, otherwise=otherwise)
    # No gap stands only as far as what was set aside was a slip and no part that acts alone.
    slips = np.prod([1 - _alone(done, each, last.baseline) for each in done.aside])
    return replace(done, attribution=last.with_unknown(1 - float(slips)))


def _alone(found: Cleared, error: GrossError, fit: Fit) -> float:
    deviation, _ = found.expected(error, fit)
    share = found.problem.hanger.assumptions.gross_error_share.value
    return acts_alone(found.whole.design, found.problem.design, error.row, deviation, share)


def _led_before(first: Attribution, last: Attribution) -> str:
    """The effect that led at first, if it leads no more, and where it acts.

    Pairs are none: among many there always is one that takes a gross error for its own.
    """
    led, leads = first.leading, last.leading
    if led is None or led.is_pair or (leads and leads.effect == led.effect):
        return ""
    return effect_label(led.effect, led.best.hypothesis.at)


def _stands(found: Cleared, error: GrossError) -> bool:
    """Whether the attribution without it still does not expect the frequency."""
    seen = found.seen(error, answered(found.attribution)[0][1])
    gross = seen.gross_given_rest
    return bool(gross[0] > seen.ordinary_given_rest[0])


def outliers(found: Cleared, errors: Sequence[GrossError], fit: Fit) -> tuple[Outlier, ...]:
    """Gross errors with what `fit`, the answer, expects in their place."""
    return tuple(_outlier(found, each, fit) for each in errors)


def _outlier(found: Cleared, error: GrossError, fit: Fit) -> Outlier:
    design, observations = found.whole.design, found.whole.observations
    deviation, sd = found.expected(error, fit)
    measured_hz = float(np.exp(observations.value[error.row]))
    expected_hz = measured_hz * float(np.exp(-deviation))
    own = float(np.nan_to_num(observations.sd[error.row]))
    return Outlier(
        plane=PLANES[design.frequency_plane[error.row]],
        order=int(design.frequency_order[error.row]),
        test=design.conditions[design.frequency_test[error.row]].test,
        measured_hz=measured_hz,
        expected_hz=expected_hz,
        expected_sd_hz=expected_hz * float(np.sqrt(max(sd**2 - own**2, 0.0))),
        probability=error.probability,
        acts_alone=_alone(found, error, fit) if error in found.aside else 0.0,
    )


def with_outliers(
    found: Cleared, kept: Sequence[Residual], before: Fit, after: Fit | None
) -> tuple[Residual, ...]:
    """The residuals of the frequencies `kept` and of those set aside, in the order of the data.

    These have no share in the misfit, since it is that of the others.
    """
    rows = dict(zip(found.rows.tolist(), kept, strict=True))
    rows |= {each.row: _residual(found, each, before, after) for each in found.aside}
    return tuple(rows[row] for row in sorted(rows))


def _residual(found: Cleared, error: GrossError, before: Fit, after: Fit | None) -> Residual:
    (told,) = outliers(found, [error], before)
    deviation, sd = found.expected(error, before)
    left = NAN if after is None else found.expected(error, after)[0]
    percent, after_percent = (100 * float(np.expm1(each)) for each in (deviation, left))
    own = told.plane, told.order, told.test, told.measured_hz, told.expected_hz
    return Residual(*own, percent, deviation / sd, 0.0, after_percent)


FAR_BETTER = 10.0
"""What other numbers must gain in log evidence on all that was tried: slips are rare."""

_SHIFTS = {0: "", 1: "one higher", -1: "one lower"}

Shifts = tuple[int, ...]


def misnumbered(problem: GapProblem, attribution: Attribution) -> tuple[str, ...]:
    """A remark where the baseline explains the modes far better under other orders, else none.

    Tried are orders one higher or lower, all or from one mode on, and one mode that is none of the
    hanger's, of either plane or both. A remainder, which costs time, is tried only with those that
    the baseline alone fits better than the orders as they are.
    """
    if attribution.leads == "no gap":
        return ()
    rng = np.random.default_rng(0)  # for the draws of fits, which are not used
    least = attribution.baseline.log_evidence
    found = [
        (_evidence(each.problem, rng) + each.log_dropped, each)
        for each in (*_shifted(problem), *_from_one_on(problem))
        if each.problem.near_misfit < problem.near_misfit  # a fit costs forty times as much
        if baseline_fit(each.problem, rng).log_evidence + each.log_dropped > least
    ]
    if not found:
        return ()
    log_evidence, best = max(found, key=lambda each: each[0])
    if log_evidence < max(each.log_evidence for each in attribution.tried) + FAR_BETTER:
        return ()
    return (
        f"The orders look wrong: were {best.told}, the baseline alone would fit better than "
        f"any cause does now{_tension(best.problem, rng)}. {best.asked} If so, number them anew "
        f"and diagnose again.",
    )


@dataclass(frozen=True, eq=False)
class _Numbering:
    """The same frequencies by other orders, `dropped` of them taken for none of the hanger's."""

    told: str
    problem: GapProblem
    asked: str = "Was the lowest mode missed, or one counted that is none?"
    dropped: int = 0

    @property
    def log_dropped(self) -> float:
        """A frequency of something else may lie anywhere within two decades, here."""
        return -self.dropped * float(np.log(np.log(100.0)))


def _shifted(problem: GapProblem) -> Iterator[_Numbering]:
    """All modes of either plane, or of both, numbered one higher or lower."""
    design = problem.design
    planes = np.unique(design.frequency_plane)
    for chosen in product(_SHIFTS, repeat=len(planes)):
        shifts = np.zeros(len(PLANES), dtype=int)
        shifts[planes] = chosen
        order = design.frequency_order + shifts[design.frequency_plane]
        if shifts.any() and order.min() > 0:
            yield _Numbering(_told(tuple(shifts)), _numbered(problem, order))


def _from_one_on(problem: GapProblem) -> Iterator[_Numbering]:
    """One mode missed between the others, or one counted that is none; in one plane or both."""
    design = problem.design
    planes = np.unique(design.frequency_plane).tolist()
    for these in [[plane] for plane in planes] + ([planes] if len(planes) > 1 else []):
        inside = np.isin(design.frequency_plane, these)
        own = "both planes'" if len(these) > 1 else f"the {PLANES[these[0]]}"
        for first in np.unique(design.frequency_order[inside]).tolist():
            above = inside & (design.frequency_order > first)
            if not above.any():
                continue
            up = _numbered(problem, design.frequency_order + above)
            asked = f"Was a mode missed between {first} and {first + 1}?"
            yield _Numbering(f"{own} modes above {first} numbered one higher", up, asked)
            kept = ~(inside & (design.frequency_order == first))
            down = _numbered(problem.part(kept), (design.frequency_order - above)[kept])
            yield _Numbering(
                f"{own} mode {first} left out and those above numbered one lower",
                down,
                "Is that mode a damper's, the deck's or another neighbour's?",
                int(np.sum(~kept)),
            )


def _numbered(problem: GapProblem, order: IntArray) -> GapProblem:
    design = replace(problem.design, frequency_order=order)
    return GapProblem(
        problem.hanger, problem.baseline, replace(problem.observations, design=design)
    )


def _evidence(problem: GapProblem, rng: np.random.Generator) -> float:
    """The log evidence of the baseline, or of it with a remainder where that is more."""
    alone = baseline_fit(problem, rng)
    return max(alone.log_evidence, with_remainder(problem, alone, rng).log_evidence)


def _told(shifts: Shifts) -> str:
    """The planes that are numbered otherwise, and how."""
    by_plane = {plane: _SHIFTS[shift] for plane, shift in zip(PLANES, shifts, strict=True) if shift}
    if len(by_plane) == len(PLANES) and len(set(by_plane.values())) == 1:
        return f"the modes of both planes numbered {by_plane[PLANES[0]]}"
    return " and ".join(f"the {plane} modes numbered {how}" for plane, how in by_plane.items())


def _tension(problem: GapProblem, rng: np.random.Generator) -> str:
    """The tension that these orders stand for; nothing of a bar without any."""
    if not problem.hanger.nominal_tension_n:
        return ""
    fit = baseline_fit(problem, rng)
    tension_n = float(problem.tension_n(fit.hypothesis, fit.z[None])[0])
    return f", at {tension_n / 1e3:.0f} kN"


def set_aside(outliers: Sequence[Outlier], otherwise: str = "") -> tuple[str, ...]:
    """Of frequencies that were done without; `otherwise` would cause them, were they right."""
    told = tuple(
        f"{_measured(each)}, is set aside as a gross error (probability {_probability(each)}): "
        f"{_expected(each)}. A wrong mode, a tone or a slip; look at the recording again."
        f"{_acts_alone(each)}"
        for each in outliers
    )
    if not told or not otherwise:
        return told
    right = "it prove right" if len(told) == 1 else "they prove right"
    return (*told, f"Should {right}, {otherwise} is the likeliest cause: repeat the test.")


def doubtful(outliers: Sequence[Outlier]) -> tuple[str, ...]:
    """Of frequencies that may be gross errors, but were kept."""
    return tuple(
        f"{_measured(each)}, may be a gross error (probability {_probability(each)}): "
        f"{_expected(each)}. It is kept, and the answer may lean on it; look at the recording "
        f"again."
        for each in outliers
    )


def _acts_alone(outlier: Outlier) -> str:
    if not outlier.acts_alone:
        return ""
    return (
        f" Or a part that only this mode's swing reaches, such as a guide with play or a crack "
        f"that opens ({outlier.acts_alone:.2f}): test again with softer and with harder hits."
    )


def _measured(outlier: Outlier) -> str:
    mode = f"{outlier.plane.capitalize()} {outlier.order} of test {outlier.test}"
    return f"{mode}, {outlier.measured_hz:g} Hz"


def _expected(outlier: Outlier) -> str:
    sd_hz = outlier.expected_sd_hz
    digits = max(0, 1 - math.floor(math.log10(sd_hz))) if sd_hz > 0 else 3
    return f"the other data expect {outlier.expected_hz:.{digits}f} +- {sd_hz:.{digits}f} Hz"


def _probability(outlier: Outlier) -> str:
    return f"{outlier.probability:.2f}" if outlier.probability < 0.995 else "over 0.99"
