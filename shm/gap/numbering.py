"""Modes whose orders look wrong: a slip of whoever numbered them, which no effect imitates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from shm.gap.attribution import Attribution
from shm.gap.fit import baseline_fit, with_remainder
from shm.gap.problem import GapProblem
from shm.values import PLANES

FAR_BETTER = 10.0
"""What other numbers must gain in log evidence on all that was tried: slips are rare."""

_SHIFTS = {0: "", 1: "one higher", -1: "one lower"}

Shifts = tuple[int, ...]


def misnumbered(problem: GapProblem, attribution: Attribution) -> tuple[str, ...]:
    """A remark where the baseline explains the modes far better under other orders, else none.

    Tried are orders one higher or lower, of either plane or both. A remainder, which costs time,
    is tried only with those that the baseline alone fits better than the orders as they are.
    """
    if attribution.leads == "no gap":
        return ()
    rng = np.random.default_rng(0)  # for the draws of fits, which are not used
    found = [
        (_evidence(other, rng), shifts, other)
        for shifts, other in _renumbered(problem)
        if baseline_fit(other, rng).log_evidence > attribution.baseline.log_evidence
    ]
    if not found:
        return ()
    log_evidence, shifts, other = max(found, key=lambda each: each[0])
    if log_evidence < max(each.log_evidence for each in attribution.tried) + FAR_BETTER:
        return ()
    return (
        f"The orders look wrong: were {_told(shifts)}, the baseline alone would fit better than "
        f"any cause does now{_tension(other, rng)}. Was the lowest mode missed, or one counted "
        f"that is none? If so, number them anew and diagnose again.",
    )


def _renumbered(problem: GapProblem) -> Iterator[tuple[Shifts, GapProblem]]:
    """The same frequencies with other orders in either plane or both."""
    design = problem.design
    planes = np.unique(design.frequency_plane)
    for chosen in product(_SHIFTS, repeat=len(planes)):
        shifts = np.zeros(len(PLANES), dtype=int)
        shifts[planes] = chosen
        order = design.frequency_order + shifts[design.frequency_plane]
        if shifts.any() and order.min() > 0:
            observations = replace(
                problem.observations, design=replace(design, frequency_order=order)
            )
            yield tuple(shifts), GapProblem(problem.hanger, problem.baseline, observations)


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
