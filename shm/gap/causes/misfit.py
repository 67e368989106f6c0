"""Doubts that the tests are of this hanger as described: orders that look wrong, and misfit.

No effect imitates a slip of whoever numbered the modes. Where no explanation comes near, a cause,
its size and a tension would be named after the least bad of wrong models.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import BadInput
from shm.gap.causes.search import Attribution
from shm.gap.hypotheses.contract import Fit, Hypothesis
from shm.gap.hypotheses.problem import GapProblem
from shm.gap.hypotheses.target import Target
from shm.inference.problem.data_checks import taut_string_tension_n
from shm.inference.sampler.density import Peak, find_peaks
from shm.values import PLANES, IntArray
from shm.values.posterior import NO_TENSION_PERCENT
from shm.values.rounding import force_unit

FAR_BETTER = 10.0
"""What other numbers must gain in log evidence on all that was tried: slips are rare."""

_SHIFTS = {1: "one higher", -1: "one lower"}


def doubt_orders(problem: GapProblem, attribution: Attribution) -> tuple[str, ...]:
    """Return a remark where the hanger alone explains the modes far better under other orders.

    Tried are orders one higher or lower, all or from one mode on, and one mode that is none of the
    hanger's, of either plane or of both alike.
    """
    if attribution.leads == "no gap":
        return ()
    most = -np.inf
    best: tuple[_Numbering, Peak] | None = None
    for each in _numberings(problem):
        if each.problem.near_misfit < problem.near_misfit:  # a fit costs forty times as much
            peak = _peak(each.problem)
            log_evidence = peak.log_evidence + each.log_dropped
            if log_evidence > most:
                most, best = log_evidence, (each, peak)
    if best is None or most < max(e.log_evidence for e in attribution.tried) + FAR_BETTER:
        return ()
    numbering, peak = best
    return (
        f"The orders look wrong: were {numbering.words}, the hanger alone would fit better than "
        f"any cause does now{_tension(numbering.problem, peak)}. {numbering.asked} If so, number "
        "them again and repeat the diagnosis.",
    )


@dataclass(frozen=True, eq=False)
class _Numbering:
    """The same frequencies by other orders, in `words`; `dropped` are taken for none of its own."""

    words: str
    problem: GapProblem
    asked: str = "Was the lowest mode missed, or one counted that is none?"
    dropped: int = 0

    @property
    def log_dropped(self) -> float:
        """A frequency of something else may lie anywhere within two decades, here."""
        return -self.dropped * float(np.log(np.log(100.0)))


def _numberings(problem: GapProblem) -> Iterator[_Numbering]:
    """Yield other orders of a plane, or of both at once.

    All modes one higher or lower; one mode missed between the others; one counted that is none.
    """
    design = problem.design
    planes = np.unique(design.frequency_plane).tolist()
    for these in [[plane] for plane in planes] + ([planes] if len(planes) > 1 else []):
        inside = np.isin(design.frequency_plane, these)
        both, plane = len(these) > 1, PLANES[these[0]]
        every = "the modes of both planes" if both else f"the {plane} modes"
        for shift, how in _SHIFTS.items():
            order = design.frequency_order + shift * inside
            if order.min() > 0:
                yield _Numbering(f"{every} numbered {how}", _numbered(problem, order))
        label = "both planes'" if both else f"the {plane}"
        for first in np.unique(design.frequency_order[inside]).tolist():
            above = inside & (design.frequency_order > first)
            if not above.any():
                continue
            up = _numbered(problem, design.frequency_order + above)
            asked = f"Was a mode missed between {first} and {first + 1}?"
            yield _Numbering(f"{label} modes above {first} numbered one higher", up, asked)
            remaining = ~(inside & (design.frequency_order == first))
            down = _numbered(problem.part(remaining), (design.frequency_order - above)[remaining])
            yield _Numbering(
                f"{label} mode {first} left out and those above numbered one lower",
                down,
                "Is that mode a damper's, the deck's or another neighbour's?",
                int(np.sum(~remaining)),
            )


def _numbered(problem: GapProblem, order: IntArray) -> GapProblem:
    design = replace(problem.design, frequency_order=order)
    observations = replace(problem.observations, design=design)
    return GapProblem(problem.model, problem.tests, observations)


def _peak(problem: GapProblem) -> Peak:
    """Return the peak of the hanger alone."""
    return find_peaks(Target(problem, Hypothesis()), problem.near)[0]


def _tension(problem: GapProblem, peak: Peak) -> str:
    """Return the tension that these orders stand for in words; nothing of a bar without any."""
    if not problem.hanger.nominal_tension_n:
        return ""
    tension_n = float(problem.tension_n(Hypothesis(), peak.z[None])[0])
    return f", at {tension_n / 1e3:.0f} kN"


def refuse_misfit(problem: GapProblem, attribution: Attribution, reasons: Sequence[str]) -> None:
    """Raise BadInput where even the best explanation misses the frequencies by far.

    `reasons` are sentences on what is wrong with the data. Tried are no gap and each effect and
    pair that was fitted, without excluded outliers.
    """
    fits = [each.fit for each in attribution.tried if not each.hypothesis.flexible]
    fitted = [fit for fit in fits if fit and np.isfinite(problem.misfit_percent(fit))]
    best = min(fitted, key=problem.misfit_percent)
    misfit = problem.misfit_percent(best)
    if misfit <= NO_TENSION_PERCENT:
        return
    hanger, over_tests = problem.hanger, _range_over_tests(problem, attribution.baseline)
    name = best.hypothesis.name.replace("_", " ") or f"the baseline {problem.model.name}"
    raise BadInput(
        f"no explanation fits the frequencies of hanger {hanger.id}: the best, {name}, misses them "
        f"by {misfit:.0f} % (root mean square){over_tests}. "
        "No cause can be named, and no tension given. "
        + " ".join((*reasons, *_compare_with_string(problem))),
        remedy="Check that all tests are of this hanger, the orders of the modes, and diameter, "
        "length and nominal tension.",
    )


def _range_over_tests(problem: GapProblem, baseline: Fit) -> str:
    """Return how far the baseline misses the lowest and the highest test, if there are several."""
    design = problem.design
    apart = (problem.observations.value - baseline.predicted)[: design.frequencies]
    names = [each.test for each in design.conditions]
    by_test = {
        names[test]: 100 * float(np.expm1(apart[design.frequency_test == test].mean()))
        for test in np.unique(design.frequency_test)
    }
    if len(by_test) < 2:
        return ""
    low, high = min(by_test, key=by_test.__getitem__), max(by_test, key=by_test.__getitem__)
    return (
        f"; the baseline misses test {low} by {by_test[low]:+.0f} % and test {high} by "
        f"{by_test[high]:+.0f} %"
    )


def _compare_with_string(problem: GapProblem) -> tuple[str, ...]:
    """Return the tension of a taut string with these frequencies, beside the nominal one."""
    hanger, design = problem.hanger, problem.design
    if not hanger.nominal_tension_n:
        return ()
    frequency_hz = np.exp(problem.observations.value[: design.frequencies])
    tension_n = taut_string_tension_n(
        frequency_hz.tolist(), design.frequency_order.tolist(), hanger
    )
    return (
        "A taut string with these frequencies carries "
        f"{force_unit(tension_n).with_unit(tension_n)},"
        f" {tension_n / hanger.nominal_tension_n:.2g} times the nominal tension.",
    )
