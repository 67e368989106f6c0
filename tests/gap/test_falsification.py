"""Error-domain falsification: bounds in closed form, and what they keep of known truths."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from shm.gap.contract import Hypothesis
from shm.gap.fit import baseline_fit
from shm.gap.observations import observed
from shm.gap.problem import GapProblem
from shm.gap.residuals import Bounds, error_bounds
from tests.helpers.gap_campaigns import campaign
from tests.helpers.hangers import HANGER_3


def problem(seed: int = 0, sd: float = 2e-4) -> GapProblem:
    return GapProblem(HANGER_3, "beam1", observed(campaign(seed=seed, sd=sd), HANGER_3))


def test_without_loads_the_bounds_are_sidaks_intervals() -> None:
    """Of n normal data all lie within z = ppf((1 + 0.95^(1/n)) / 2) sds with 95 %."""
    bounds = error_bounds(problem(sd=1e-3))
    width = norm.ppf((1 + 0.95 ** (1 / len(bounds.width))) / 2) * 1e-3
    # Stated sds are known to a fifth and model errors of 5e-4 come on top: hardly wider.
    assert np.all((width < bounds.width) & (bounds.width < 2 * width))


def test_what_repeats_is_followed_and_the_rest_is_held_against_the_bounds() -> None:
    loads = np.array([[1.0], [1.0], [1.0]])
    bounds = Bounds(np.full(3, 0.03), loads)
    assert bounds.keep(np.array([0.5, 0.51, 0.49]))
    assert not bounds.keep(np.array([0.5, 0.6, 0.49]))


@pytest.mark.parametrize("seed", range(3))
def test_the_truth_stays_and_a_mode_ten_bounds_off_does_not(seed: int) -> None:
    """The truth predicts data that err by their sds and 2e-5; the baseline holds it."""
    whole = problem(seed)
    bounds = error_bounds(whole)
    fit = baseline_fit(whole, np.random.default_rng(1))
    assert fit.hypothesis == Hypothesis()
    residual = whole.observations.value - fit.predicted
    assert bounds.keep(residual)
    residual[3] += 10 * bounds.width[3]
    assert not bounds.keep(residual)
