"""Local levels with a temperature regressor, filtered and smoothed for many parameters at once.

Harvey, Forecasting, Structural Time Series Models and the Kalman Filter (1989), chapters 2 to 4;
Durbin and Koopman, Time Series Analysis by State Space Methods (2012), sections 4.3 and 4.4 for the
recursions, 4.10 for tests that see some directions only.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy

from shm.values import FloatArray

_WIDEST = 4.0  # prior sds: beyond lies 1 in 16,000
_STEP = 0.1  # prior sds: rounding is some 1e-9 of a misfit, so curvatures are known to 1e-6
_SLOPE_STEP = 1e-4  # rounding and curvature then each spoil a slope by some 1e-5
_DRAWS = 32  # judgement: bands of few tests change by less than their own scatter with more


@dataclass(frozen=True, eq=False)
class Course:
    """What the model needs of n tests of q quantities, arrays only.

    `seen` (n, q) are the readings along `directions` (n, q, q; a row each, of any length), NaN
    along those not seen; `variance` (n, q) their errors'; `warmth_k` (n,) the temperature above
    the reference, 0 where unknown; `extra_variance` (n, q) of each coordinate, for temperatures
    not known; `inflation` (n,) of the whole noise, for outliers; `years` (n - 1,) between tests;
    `jump_variance` (n, q) of the level just before each test, at the first that of its prior.
    `coefficient_sd` (q,) is of the temperature coefficients' prior about 0. `rate`, `scatter` (q,)
    are prior medians; logarithms of both have the prior sds `rate_log_sd`, `scatter_log_sd`.
    """

    seen: FloatArray
    directions: FloatArray
    variance: FloatArray
    warmth_k: FloatArray
    extra_variance: FloatArray
    inflation: FloatArray
    years: FloatArray
    jump_variance: FloatArray
    coefficient_sd: FloatArray
    rate: FloatArray
    scatter: FloatArray
    rate_log_sd: float
    scatter_log_sd: float


class LocalLevels:
    """States: q levels that wander, q temperature coefficients that do not.

    Parameters z (2 q,), standard normal before any data: how many prior sds the logarithms of the
    q rates, then of the q scatters, lie above their prior medians.
    """

    def __init__(self, course: Course) -> None:
        self.course = course
        seen = np.isfinite(course.seen)
        self._seen = np.where(seen, course.seen, 0.0)
        self._design = _design(course) * seen[:, :, None]
        self._both_seen = seen[:, :, None] & seen[:, None, :]

    def rate_and_scatter(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Both (..., q) of z (..., 2 q), in the coordinates; rates per square root of a year."""
        rates, scatters = np.split(np.asarray(z, np.float64), 2, axis=-1)
        return (
            self.course.rate * np.exp(self.course.rate_log_sd * rates),
            self.course.scatter * np.exp(self.course.scatter_log_sd * scatters),
        )

    def misfits(self, z: FloatArray) -> FloatArray:
        """Minus the logs (m,) of the posterior density of z (m, 2 q), but for a constant."""
        return np.asarray((z**2).sum(axis=1) / 2 - self._filtered(z).log_likelihood, np.float64)

    def fitted(self) -> FloatArray:
        """z (2 q,) of the largest posterior density: the likelihood times the weak prior."""
        count = 2 * self.course.seen.shape[1]
        found = scipy.optimize.minimize(
            self._misfit_and_slope,
            np.zeros(count),
            jac=True,
            method="L-BFGS-B",
            bounds=[(-_WIDEST, _WIDEST)] * count,
            options={"ftol": 1e-7, "maxiter": 60},
        )
        return np.asarray(found.x, np.float64)

    def _misfit_and_slope(self, z: FloatArray) -> tuple[float, FloatArray]:
        """By central differences, all at once."""
        steps = _SLOPE_STEP * np.eye(len(z))
        here, *beside = self.misfits(z + np.concatenate([0 * steps[:1], steps, -steps]))
        ahead, behind = np.split(np.array(beside), 2)
        return float(here), (ahead - behind) / (2 * _SLOPE_STEP)

    def coefficient_square(self, z: FloatArray) -> FloatArray:
        """Expected square (q,) of each temperature coefficient, given all tests."""
        found, count = self.smoothed(z[None]), self.course.seen.shape[1]
        square = found.smoothed_mean[0, -1] ** 2 + found.smoothed_covariance[0, -1].diagonal()
        return np.asarray(square[count:], np.float64)

    def around(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Draws (m, 2 q) of what the parameters may be, and weights (m,) that sum to 1.

        Importance sampling from a normal law split at the mode (Geweke 1989): that a rate may be
        far smaller does not say that it may be far larger. The weights are truncated (Ionides
        2008). Without it the bands of few tests are too narrow.
        """
        strength, vectors = np.linalg.eigh(self._curvature(z))
        axes = (vectors / np.sqrt(np.maximum(strength, 1.0))).T
        best, *beside = self.misfits(np.concatenate([z[None], *map(_inside, (z + axes, z - axes))]))
        # Scales of half normal laws whose misfit rises so much over one unit.
        rises = np.maximum(2 * (np.array(beside) - best), 2e-3)
        up, down = np.split(np.clip(1 / np.sqrt(rises), 0.2, 2.0), 2)
        half = np.random.default_rng(0).normal(size=(_DRAWS // 2, len(z)))
        standard = np.concatenate([half, -half])
        scales = np.where(standard > 0, up, down)
        draws = _inside(z + (standard * scales) @ axes)
        log_weights = np.log(scales).sum(axis=1) + (standard**2).sum(axis=1) / 2
        log_weights -= self.misfits(draws)
        weights = np.exp(log_weights - log_weights.max())
        weights = np.minimum(weights, weights.mean() * np.sqrt(_DRAWS))
        return draws, weights / weights.sum()

    def _curvature(self, z: FloatArray) -> FloatArray:
        """Second derivatives (d, d) by central differences, wide because z is in prior sds."""
        steps = _STEP * np.eye(len(z))
        pairs = list(combinations(range(len(z)), 2))
        both = [steps[i] + steps[j] for i, j in pairs]
        around = [0 * z, *steps, *-steps, *both, *(-each for each in both)]
        middle, *others = self.misfits(z + np.array(around))
        ahead, behind, together, apart = np.split(
            np.array(others), np.cumsum([len(z), len(z), len(pairs)])
        )
        single = ahead + behind - 2 * middle
        second = np.diag(single)
        for (i, j), value in zip(pairs, together + apart, strict=True):
            second[i, j] = second[j, i] = (value - 2 * middle - single[i] - single[j]) / 2
        return np.asarray(second / _STEP**2, np.float64)

    def course_of_states(self, z: FloatArray) -> States:
        """Filtered and smoothed states, mixed over what rates and scatters may be."""
        draws, weights = self.around(z)
        found = self.smoothed(draws)
        return States(
            *_mixed(found.filtered_mean, found.filtered_covariance, weights),
            *_mixed(found.smoothed_mean, found.smoothed_covariance, weights),
        )

    def _filtered(self, z: FloatArray) -> _Filtered:
        """The forward recursion for z (m, 2 q); what a test does not see adds nothing."""
        rate, scatter = self.rate_and_scatter(z)
        noise, wandering = self._noise(scatter), _wandering(self.course, rate)
        first = np.concatenate([self.course.jump_variance[0], self.course.coefficient_sd**2])
        mean = np.zeros((len(z), len(first)))
        covariance = np.broadcast_to(np.diag(first), (len(z), len(first), len(first)))
        log_likelihood, levels = np.zeros(len(z)), np.arange(rate.shape[1])
        steps = []
        for test, design in enumerate(self._design):
            step = corrected(mean, covariance, design, self._seen[test], noise[:, test])
            log_likelihood += np.linalg.slogdet(step.inverse)[1] / 2
            log_likelihood -= np.einsum("mi,mij,mj->m", step.missed, step.inverse, step.missed) / 2
            steps.append(step)
            mean, covariance = step.mean_after, step.covariance_after.copy()
            covariance[:, levels, levels] += wandering[:, test]
        return _Filtered(log_likelihood, steps)

    def smoothed(self, z: FloatArray) -> States:
        """Means (m, n, 2 q) and covariances (m, n, 2 q, 2 q) for z (m, 2 q)."""
        steps = self._filtered(z).steps
        identity = np.eye(self._design.shape[2])
        pull, certainty = np.zeros((len(z), len(identity))), np.zeros((len(z), *identity.shape))
        means, covariances = [], []
        for step, design in zip(reversed(steps), self._design[::-1], strict=True):
            back = np.swapaxes(identity - step.gain @ design, 1, 2)
            seen = design.T @ step.inverse
            pull = np.einsum("mij,mj->mi", seen, step.missed) + np.einsum("mij,mj->mi", back, pull)
            certainty = seen @ design + back @ certainty @ np.swapaxes(back, 1, 2)
            means.append(step.mean + np.einsum("mij,mj->mi", step.covariance, pull))
            covariances.append(step.covariance - step.covariance @ certainty @ step.covariance)
        return States(
            np.stack([step.mean_after for step in steps], axis=1),
            np.stack([step.covariance_after for step in steps], axis=1),
            np.stack(means[::-1], axis=1),
            np.stack(covariances[::-1], axis=1),
        )

    def _noise(self, scatter: FloatArray) -> FloatArray:
        """(m, n, q, q) along the directions; 1 along those not seen, where it has no effect."""
        course = self.course
        of_coordinates = course.extra_variance + scatter[:, None] ** 2
        turned = np.einsum(
            "nij,mnj,nkj->mnik", course.directions, of_coordinates, course.directions, optimize=True
        )
        own = np.where(np.isnan(course.seen), 1.0, course.variance)
        whole = turned * self._both_seen + own[:, :, None] * np.eye(own.shape[1])
        return np.asarray(course.inflation[:, None, None] * whole, np.float64)


def _inside(z: FloatArray) -> FloatArray:
    return np.asarray(np.clip(z, -_WIDEST, _WIDEST), np.float64)


@dataclass(frozen=True, eq=False)
class Step:
    """One test: the state before and after it (m, ...), what it missed (m, q), its gain."""

    mean: FloatArray
    covariance: FloatArray
    missed: FloatArray
    inverse: FloatArray
    gain: FloatArray
    mean_after: FloatArray
    covariance_after: FloatArray


def corrected(
    mean: FloatArray,
    covariance: FloatArray,
    design: FloatArray,
    seen: FloatArray,
    noise: FloatArray,
) -> Step:
    """States (m, p) and covariances (m, p, p) once `seen` (q,) is, by `design` (q, p), with `noise`
    (m, q, q). Joseph's form: a plain difference loses what little a precise test leaves."""
    missed = seen - mean @ design.T
    towards = design @ covariance
    inverse = np.asarray(np.linalg.inv(towards @ design.T + noise), np.float64)
    gain: FloatArray = np.swapaxes(towards, 1, 2) @ inverse
    mean_after = mean + np.einsum("mij,mj->mi", gain, missed)
    kept = np.eye(mean.shape[1]) - gain @ design
    after = kept @ covariance @ np.swapaxes(kept, 1, 2)
    after += gain @ noise @ np.swapaxes(gain, 1, 2)
    return Step(mean, covariance, missed, inverse, gain, mean_after, after)


@dataclass(frozen=True, eq=False)
class _Filtered:
    """`log_likelihood` (m,), but for a constant, and the steps."""

    log_likelihood: FloatArray
    steps: list[Step]


@dataclass(frozen=True, eq=False)
class States:
    """Means (n, 2 q) and covariances (n, 2 q, 2 q) of levels and coefficients at each test."""

    filtered_mean: FloatArray
    filtered_covariance: FloatArray
    smoothed_mean: FloatArray
    smoothed_covariance: FloatArray


def _mixed(
    means: FloatArray, covariances: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of a mixture over the first axis."""
    middle = np.einsum("m,mni->ni", weights, means)
    off = means - middle
    between = np.einsum("m,mni,mnj->nij", weights, off, off, optimize=True)
    return middle, np.einsum("m,mnij->nij", weights, covariances) + between


def _design(course: Course) -> FloatArray:
    """(n, q, 2 q): each direction sees the levels, and the coefficients times the warmth."""
    warmed = course.directions * course.warmth_k[:, None, None]
    return np.concatenate([course.directions, warmed], axis=2)


def _wandering(course: Course, rate: FloatArray) -> FloatArray:
    """Variances (m, n, q) of the step that leads away from each test, for rates (m, q)."""
    steps = np.zeros((len(rate), *course.seen.shape))
    steps[:, :-1] = course.years[:, None] * rate[:, None] ** 2 + course.jump_variance[1:]
    return steps
