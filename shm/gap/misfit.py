"""Refuse to diagnose tests that no explanation comes near: of another hanger, or wrongly described.

A cause, its size and a tension would be named after the least bad of wrong models.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.errors import BadInput
from shm.gap.contract import Fit
from shm.gap.numbering import doubt_orders
from shm.gap.outliers import Cleared
from shm.gap.problem import GapProblem
from shm.inference.data_checks import taut_string_tension_n
from shm.values.posterior import NO_TENSION_PERCENT
from shm.values.rounding import force_unit


def refuse_misfit(found: Cleared, reasons: Sequence[str]) -> None:
    """Raise BadInput where even the best explanation misses the frequencies by far.

    `reasons` are sentences on what is wrong with the data. Tried are no gap and each effect and
    pair that was fitted, without excluded outliers.
    """
    problem = found.problem
    fits = [each.fit for each in found.attribution.tried if not each.hypothesis.flexible]
    fitted = [fit for fit in fits if fit and np.isfinite(problem.misfit_percent(fit))]
    best = min(fitted, key=problem.misfit_percent)
    misfit = problem.misfit_percent(best)
    if misfit <= NO_TENSION_PERCENT:
        return
    hanger, over_tests = problem.hanger, _range_over_tests(problem, found.attribution.baseline)
    name = best.hypothesis.name.replace("_", " ") or f"the baseline {problem.model.name}"
    raise BadInput(
        f"no explanation fits the frequencies of hanger {hanger.id}: the best, {name}, misses them "
        f"by {misfit:.0f} % (root mean square){over_tests}. "
        "No cause can be named, and no tension given. "
        + " ".join(
            (*doubt_orders(problem, found.attribution), *reasons, *_compare_with_string(problem))
        ),
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
        f"A taut string with these frequencies carries {force_unit(tension_n).told(tension_n)}, "
        f"{tension_n / hanger.nominal_tension_n:.2g} times the nominal tension.",
    )
