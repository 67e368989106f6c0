"""What a test shows of a change, and whether it is a blunder, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal, multivariate_t

from shm.watch.engine.limits import LIMITS
from shm.watch.engine.persistence import Seen, fraction_shown, outlier_probability

RNG = np.random.default_rng(5)
MODES = 6
ERRORS = RNG.uniform(0.5, 2.0, MODES) * 1e-6
CHANGE, OTHER = RNG.normal(size=(2, MODES)) * 1e-2
REST = 0.7 * CHANGE + 3.0 * OTHER + np.sqrt(ERRORS) * RNG.normal(size=MODES)


def shown(covariance: np.ndarray) -> tuple[float, float]:
    """Return the fraction of CHANGE that REST shows, and its sd."""
    found = fraction_shown(CHANGE[None], REST[None], covariance[None], ERRORS[None])
    return float(found[0][0]), float(found[1][0])


def test_what_scatters_without_bound_is_an_unknown_beside_the_change() -> None:
    columns = np.column_stack([CHANGE, OTHER])
    weighted = columns / ERRORS[:, None]
    inverse = np.linalg.inv(columns.T @ weighted)
    fraction, sd = shown(np.diag(ERRORS) + 1e4 * np.outer(OTHER, OTHER))
    assert fraction == pytest.approx((inverse @ weighted.T @ REST)[0], rel=1e-5)
    assert sd == pytest.approx(np.sqrt(inverse[0, 0]), rel=1e-5)


def test_scatter_along_the_change_itself_leaves_what_a_test_shows() -> None:
    without = np.diag(ERRORS) + 0.3 * np.outer(OTHER, OTHER)
    assert shown(without + 0.5 * np.outer(CHANGE, CHANGE)) == pytest.approx(shown(without))


def test_a_blunder_is_of_student_s_distribution() -> None:
    values = np.array([np.zeros(MODES), np.linspace(0.0022, 0.0076, MODES)])
    seen = Seen(values, np.tile(ERRORS, (2, 1)), np.zeros((2, MODES, 0)), 1e-3 * np.eye(MODES),
                np.ones(MODES))  # fmt: skip
    covariance = np.diag(2 * ERRORS + 2e-6)
    wide = multivariate_t(np.zeros(MODES), LIMITS.wider**2 * covariance, LIMITS.persistence_tail)
    blunder = 0.01 * wide.pdf(values[1])
    sound = 0.99 * multivariate_normal(np.zeros(MODES), covariance).pdf(values[1])
    found = outlier_probability(seen, np.array([True, True]), 1, 0.01)
    assert 0.01 < found < 0.99
    assert found == pytest.approx(blunder / (blunder + sound))
