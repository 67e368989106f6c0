from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from shm.identify.contract import FREQUENCY_FLOOR
from shm.identify.estimation.spread import frequency_sd, jackknife_sd, smooth_sds


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


def test_a_deviation_that_is_small_by_chance_is_held_up_by_its_neighbours() -> None:
    """(4 s^2 + 1 median^2)/5 for five hits; what neighbours agree on stays."""
    alike = np.full(6, 3.0)
    np.testing.assert_allclose(smooth_sds(alike, 5), alike)
    alike[2] = 0.03
    assert smooth_sds(alike, 5)[2] == pytest.approx(np.sqrt((4 * 0.03**2 + 3.0**2) / 5))
    np.testing.assert_array_equal(smooth_sds(alike, 2), alike)


def test_moderated_deviations_of_few_hits_make_fewer_false_outliers() -> None:
    """Normal errors of 16 modes from 5 hits: beyond 4 stated standard deviations."""
    rng = np.random.default_rng(1)
    hits = rng.standard_normal((5, 16, 2000)) * np.geomspace(10, 1, 16)[:, None]
    mean = hits.mean(axis=0)
    sds = jackknife_sd((hits.sum(axis=0) - hits) / 4)
    steady = np.array([smooth_sds(own, 5) for own in sds.T]).T
    raw, better = (np.mean(np.abs(mean / each) > 4) for each in (sds, steady))
    assert better < 0.4 * raw
    assert 0.75 < np.mean((mean / steady) ** 2) < 1.1
