from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from shm.identify.finding.jackknife import FREQUENCY_FLOOR, frequency_sd, jackknife_sd


def _without_each(values: np.ndarray) -> np.ndarray:
    return np.array([np.delete(values, index).mean() for index in range(len(values))])


@pytest.mark.parametrize("hits", [3, 5, 10])
def test_of_a_mean_it_is_the_standard_error_widened_to_student(hits: int) -> None:
    """Of a mean it is s/sqrt(n), times Student's 95 % quantile over the normal one."""
    values = np.random.default_rng(hits).normal(size=hits)
    wide = stats.t.ppf(0.95, hits - 1) / stats.norm.ppf(0.95)
    expected = values.std(ddof=1) / np.sqrt(hits) * wide
    assert jackknife_sd(_without_each(values)) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("hits", [3, 4, 8])
def test_ninety_per_cent_intervals_cover_ninety_per_cent(hits: int) -> None:
    rng = np.random.default_rng(1)
    inside = 0
    for _ in range(2000):
        values = rng.normal(size=hits)
        inside += abs(values.mean()) < 1.645 * float(jackknife_sd(_without_each(values)))
    assert inside / 2000 == pytest.approx(0.9, abs=0.025)


def test_below_three_hits_it_is_unknown_not_zero() -> None:
    assert np.isnan(jackknife_sd(np.array([1.0, 1.1])))
    assert np.isnan(jackknife_sd(np.empty((0, 3)))).all()


def test_below_three_hits_a_frequency_gets_the_stated_floor() -> None:
    assert frequency_sd(50.0, np.array([50.0, 50.1])) == pytest.approx(50.0 * FREQUENCY_FLOOR)
    assert frequency_sd(50.0, np.array([50.0, 50.0, 50.0])) == 0.0


def test_it_works_column_by_column() -> None:
    estimates = np.random.default_rng(2).normal(size=(6, 4))
    np.testing.assert_allclose(
        jackknife_sd(estimates), [jackknife_sd(column) for column in estimates.T]
    )
