"""Gap problems of simulated tests, and fits of chosen hypotheses to them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.gap.contract import Fit, Hypothesis
from shm.gap.observations import observed
from shm.gap.posterior import Target
from shm.gap.problem import GapProblem
from shm.gap.sampling import approximate
from shm.gap.scan import scan
from shm.gap.search import fit_alone
from shm.inference.linear import Linear
from shm.inference.posterior import find_peaks
from shm.models import MODELS, AsMade
from shm.values import Hanger, ModalTest


def make_problem(tests: Sequence[ModalTest], hanger: Hanger, baseline: str = "beam1") -> GapProblem:
    return GapProblem(AsMade(MODELS[baseline](hanger)), tests, observed(tests, hanger))


def fit_hypothesis(problem: GapProblem, hypothesis: Hypothesis, draws: int = 100) -> Fit:
    """Fit the baseline, or one effect by normal distributions on its peaks."""
    rng = np.random.default_rng(1)
    baseline = fit_alone(problem, rng, draws)
    if not hypothesis.effects:
        return baseline
    linear = Linear(problem.likelihood(Hypothesis()), baseline.slopes)
    starts = scan(problem, baseline, linear, hypothesis).starts(problem, baseline)
    target = Target(problem, hypothesis)
    return approximate(target, find_peaks(target, starts), draws, rng, 0.0)
