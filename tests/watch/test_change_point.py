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
from shm.watch.engine.causes import DetectedChange, Direction, Layout
from shm.watch.engine.change_point import (
    LOG_SHARES,
    RAMP,
    SIZES,
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
