"""The closed form of the Shiryaev-Roberts statistic, against densities written out in full."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from shm.values import FloatArray
from shm.watch.causes import DetectedChange, Direction, Layout
from shm.watch.change_point import (
    LOG_SHARES,
    RAMP,
    SIZES,
    STEP,
    Evidence,
    evidence_of,
    sums_of,
)

BASELINE = 3


@dataclass(frozen=True, eq=False)
class Example:
    """Tests (T,) of n modes and q quantities in full: `columns` (T, n, z), `noise` (T, K, n, n)."""

    layout: Layout
    years: FloatArray
    columns: FloatArray
    values: FloatArray
    variances: FloatArray
    scatter: FloatArray
    directions: tuple[Direction, ...]
    called: tuple[DetectedChange, ...] = ()

    @cached_property
    def evidence(self) -> Evidence:
        return self.thinned(60)

    def thinned(self, most: int) -> Evidence:
        sums = sums_of(self.columns, self.values, self.variances, self.scatter)
        return evidence_of(
            sums, self.years, BASELINE, self.layout, self.directions, self.called, most
        )

    @property
    def measured(self) -> FloatArray:
        return np.isfinite(self.variances).ravel()

    def covariance(self, k: int) -> FloatArray:
        """Of everything measured, were nothing to change: noise, levels, covariates, calls."""
        tests, n = self.values.shape
        found = np.zeros((tests * n, tests * n))
        for t in range(tests):
            own = slice(t * n, (t + 1) * n)
            known = np.where(np.isfinite(self.variances[t]), self.variances[t], 1.0)
            found[own, own] = self.scatter[t, k] + np.diag(known)
        null = self.columns[:, :, self.layout.null].reshape(tests * n, -1)
        found += null * self.layout.prior_sd[self.layout.null] ** 2 @ null.T
        for told in self.called:
            prior = np.linalg.inv(told.precision)
            for weight in self.courses(told.first, told.years, told.is_ramp):
                moved = self.moved(weight)
                found += moved @ prior @ moved.T
        return found[np.ix_(self.measured, self.measured)]

    def courses(self, first: int, since: float, is_ramp: bool) -> list[FloatArray]:
        after = np.arange(len(self.years)) >= first
        return [after.astype(float), *([after * (self.years - since)] if is_ramp else [])]

    def moved(self, weight: FloatArray) -> FloatArray:
        """What a unit of each of n + q columns does, all tests (T n, n + q)."""
        part = self.columns[:, :, self.layout.change]
        return np.asarray((weight[:, None, None] * part).reshape(-1, part.shape[2]))

    def of_change(self, beginning: int, kind: int, d: int, size: int) -> FloatArray:
        since = self.years[beginning - 1]
        weight = self.courses(beginning, since, kind == RAMP)[-1]
        return (self.moved(weight) @ self.directions[d].factor * SIZES[size])[self.measured]

    def log_density(self, covariance: FloatArray) -> float:
        seen = self.values.ravel()[self.measured]
        return float(multivariate_normal(np.zeros(len(seen)), covariance).logpdf(seen))


def direction(factor: Sequence[Sequence[float]], *, may_ramp: bool = True) -> Direction:
    return Direction("tension", np.array(factor), (0,), math.log(0.4), may_ramp)


def small_world(called: tuple[DetectedChange, ...] = ()) -> Example:
    """Three modes, two quantities, a covariate, two scatters, a mode that was missed at times."""
    rng = np.random.default_rng(4)
    tests, n, q = 9, 3, 2
    slopes = rng.standard_normal((n, q))
    kelvin = rng.standard_normal(tests)
    columns = np.concatenate(
        [
            np.tile(np.eye(n), (tests, 1, 1)),
            np.tile(slopes, (tests, 1, 1)),
            kelvin[:, None, None] * slopes[:, :1],
        ],
        axis=2,
    )
    variances = rng.uniform(0.5, 2.0, (tests, n))
    variances[2, 1] = variances[5, 0] = variances[7, :2] = np.inf
    along = rng.standard_normal((n, 1))
    scatter = np.array([0.5, 2.0])[:, None, None] * (along @ along.T)
    values = rng.standard_normal((tests, n)) + np.array([0.0, 1.0, -1.0])
    values[6:] += slopes @ [1.5, -0.5]
    factors = [[[0.0, 0], [0, 0], [0, 0], [0.7, 0], [0.5, 0.6]], [[0.4], [0.2], [0.1], [0], [0]]]
    return Example(
        layout=Layout(n, q, np.array([2.0, 2, 2, 0.7, 0.7, 0.3])),
        years=np.cumsum(rng.uniform(0.05, 0.3, tests)),
        columns=columns,
        values=np.where(np.isfinite(variances), values, 0.0),
        variances=variances,
        scatter=np.tile(scatter, (tests, 1, 1, 1)),
        directions=(direction(factors[0]), direction(factors[1], may_ramp=False)),
        called=called,
    )


CALLED = DetectedChange(4, 0.6, True, np.diag([4.0, 9.0, 4.0, 1.0, 2.0]))
STEPPED = DetectedChange(4, 0.6, False, np.diag([4.0, 9.0, 4.0, 1.0, 2.0]))


@pytest.mark.parametrize("called", [(), (STEPPED,), (CALLED,), (STEPPED, CALLED)])
def test_every_mass_is_that_of_the_dense_gaussian_likelihood(
    called: tuple[DetectedChange, ...],
) -> None:
    example = small_world(called)
    evidence = example.evidence
    covariances = [example.covariance(k) for k in range(2)]
    nulls = [example.log_density(each) for each in covariances]

    assert evidence.log_null == pytest.approx(nulls - logsumexp(nulls), abs=1e-5)
    assert evidence.beginnings.tolist() == list(range(5 if called else BASELINE, 9))
    for (at, k, kind, d, size), mass in np.ndenumerate(evidence.log_mass):
        chosen = example.directions[d]
        if kind == RAMP and not chosen.may_ramp:
            assert mass == -math.inf
            continue
        beginning = int(evidence.beginnings[at])
        change = example.of_change(beginning, kind, d, size)
        dense = example.log_density(covariances[k] + change @ change.T) - logsumexp(nulls)
        waited = math.log(example.years[beginning] - example.years[beginning - 1])
        prior = chosen.log_prior + LOG_SHARES[size] - math.log(1 + chosen.may_ramp)
        assert mass == pytest.approx(dense + waited + prior, abs=1e-5)


def test_the_size_of_a_change_is_that_of_the_dense_gaussian_posterior() -> None:
    example = small_world()
    seen = example.values.ravel()[example.measured]

    for index in [(2, 0, STEP, 0, 0), (3, 1, RAMP, 0, 1), (5, 1, STEP, 1, 1)]:
        at, k, kind, d, size = index
        change = example.of_change(int(example.evidence.beginnings[at]), kind, d, size)
        gain = change.T @ np.linalg.inv(example.covariance(k) + change @ change.T)
        unit = SIZES[size] * example.directions[d].factor
        done = example.evidence.progress(at) if kind == RAMP else 1.0
        ((mean, root),) = example.evidence.changes_at([index])
        left = np.eye(change.shape[1]) - gain @ change
        assert mean == pytest.approx(done * unit @ gain @ seen, abs=1e-6)
        assert root @ root.T == pytest.approx(done**2 * unit @ left @ unit.T, abs=1e-6)


YEARS = np.cumsum(np.random.default_rng(9).uniform(0.02, 0.15, 14))
WATCHED_YEARS = float(YEARS[-1] - YEARS[BASELINE - 1])
SCATTERS = np.array([0.5, 1.5])


def unchanged(seed: int, k: int) -> Example:
    """Nothing happens, by the second or the first scatter; changes are looked for that no one test
    could show: the statistic's mean is then not that of a few large values."""
    rng = np.random.default_rng(seed)
    tests, n = len(YEARS), 2
    columns = np.tile(np.array([[1.0, 0, 0.5], [0, 1.0, 0.4]]), (tests, 1, 1))
    levels = 3.0 * rng.standard_normal(n)
    values = levels + rng.standard_normal((tests, n)) * math.sqrt(0.5 + SCATTERS[k])
    return Example(
        layout=Layout(n, 1, np.array([3.0, 3.0, 0.2])),
        years=YEARS,
        columns=columns,
        values=values,
        variances=np.full((tests, n), 0.5),
        scatter=np.tile(SCATTERS[:, None, None] * np.eye(n), (tests, 1, 1, 1)),
        directions=(direction([[0.0], [0.0], [0.3]]), direction([[0.15], [0.0], [0.0]])),
    )


@pytest.mark.parametrize("most", [60, 6])
def test_without_change_the_statistic_grows_by_a_year_in_a_year(most: int) -> None:
    # The prior of scatters is even, that of all directions 0.8: the mean is 0.8 of the time. Its
    # standard error follows from the sample; at 300 hangers it is 0.3 % of the time.
    found = np.array([unchanged(seed, seed % 2).thinned(most).log_statistic for seed in range(300)])
    statistic = np.exp(found)
    error = statistic.std() / math.sqrt(len(statistic))

    assert error < 0.01 * WATCHED_YEARS
    assert statistic.mean() == pytest.approx(0.8 * WATCHED_YEARS, abs=3 * error)
    assert statistic.std() > 0.03 * WATCHED_YEARS
