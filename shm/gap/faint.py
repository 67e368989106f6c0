"""Faint second causes: beside a large effect they may be no more than its own law's error.

A real effect does not follow the catalogue to the letter, and the larger it is, the better the data
show by how much. What is left then often looks like a small effect of another kind. Where the
second cause of a pair moves the data by little against the first, it counts for the most part as
the law of the first.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.gap.chances import Family
from shm.gap.contract import Fit, Hypothesis, NoiseNode
from shm.gap.likelihood import Likelihood
from shm.gap.problem import GapProblem
from shm.models.effects import EFFECTS
from shm.values import FloatArray

FAINT = 0.075
"""A second cause is faint that moves the data by less than this share of what the first does."""
LAW_TO_CAUSE = 5.0
"""Odds that a faint second cause is the first one's law. In blind trials eight pairs so faint were
one effect and none was two; of ten with a second cause of up to a fifth, eight were two."""


def without_faint(
    problem: GapProblem, baseline: Fit, kinds: Sequence[Family], chances: FloatArray
) -> FloatArray:
    """The probabilities (families,) with those of pairs given to the one effect that they lean on.

    A fault of the law is the same in all tests: what differs from test to test is a cause. To an
    effect that was not worth a fit nothing is given: its law is not nearly right.
    """
    moved = chances.copy()
    plain = [i for i, kind in enumerate(kinds) if not kind.flexible]
    alone = {kinds[i].name: i for i in plain if kinds[i].effects == 1 and kinds[i].best.fit}
    for i in plain:
        leant_on = _leant_on(problem, baseline, kinds[i].best.fit)
        if leant_on in alone:
            share = chances[i] * LAW_TO_CAUSE / (1 + LAW_TO_CAUSE)
            moved[i] -= share
            moved[alone[leant_on]] += share
    return moved


def _leant_on(problem: GapProblem, baseline: Fit, fit: Fit | None) -> str | None:
    """The name of the larger effect of a pair whose other one is faint; None where none is."""
    if fit is None or len(fit.hypothesis.effects) != 2:
        return None
    moves = [_added(problem, baseline, fit, index) for index in (0, 1)]
    large = int(np.argmax(moves))
    (name, _), (second, variant) = fit.hypothesis.effects[large], fit.hypothesis.effects[1 - large]
    differs = bool(EFFECTS[second].follows or variant.test)
    return None if differs or moves[1 - large] > FAINT * moves[large] else name


def _added(problem: GapProblem, baseline: Fit, fit: Fit, index: int) -> float:
    """By how many standard deviations one effect of a pair moves the data beside the other one.

    Beyond what the baseline's own parameters can follow.
    """
    shift = fit.predicted - problem.predicted_with(fit, [1 - index])
    least = min(problem.likelihood(Hypothesis()).nodes, key=lambda node: node.model_error)
    return float(np.sqrt(max(_beyond(shift, baseline, least), 0.0)))


def _beyond(shift: FloatArray, baseline: Fit, errors: NoiseNode) -> float:
    """The square of a shift (data,), in standard deviations, beyond what the baseline's parameters
    can follow."""
    columns = np.column_stack([baseline.slopes, shift])[None]
    products = Likelihood([errors]).gram(columns)[0, 0]
    inner, outer = products[:-1, :-1] + np.eye(len(baseline.z)), products[:-1, -1]
    return float(products[-1, -1] - outer @ np.linalg.solve(inner, outer))
