"""Local levels with a temperature regressor, in the state-space form of statsmodels.

Harvey, Forecasting, Structural Time Series Models and the Kalman Filter (1989), chapters 2 to 4;
Durbin and Koopman, Time Series Analysis by State Space Methods (2012), section 4.10 for tests that
see some directions only. Importing statsmodels takes seconds: import this module where it is used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy
from statsmodels.tsa.statespace.kalman_smoother import SmootherResults
from statsmodels.tsa.statespace.mlemodel import MLEModel

from shm.values import FloatArray

_WIDEST = 4.0
_STEP = 0.1
_DRAWS = 32


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


class LocalLevels(MLEModel):  # type: ignore[misc]
    """States: q levels that wander, q temperature coefficients that do not.

    Parameters z (2 q,), standard normal before any data: how many prior sds the logarithms of the
    q rates, then of the q scatters, lie above their prior medians.
    """

    def __init__(self, course: Course) -> None:
        tests, quantities = course.seen.shape
        super().__init__(course.seen, k_states=2 * quantities, k_posdef=quantities)
        self.course = course
        identity = np.eye(2 * quantities)
        self["transition"], self["selection"] = identity, identity[:, :quantities]
        self["design"] = _time_last(_design(course))
        self["state_cov"] = np.zeros((quantities, quantities, tests))
        self["obs_cov"] = np.zeros((quantities, quantities, tests))
        first = np.concatenate([course.jump_variance[0], course.coefficient_sd**2])
        self.ssm.initialize_known(np.zeros(2 * quantities), np.diag(first))

    @property
    def param_names(self) -> list[str]:
        count = self.course.seen.shape[1]
        return [f"{name}_{j}" for name in ("rate", "scatter") for j in range(count)]

    @property
    def start_params(self) -> FloatArray:
        return np.zeros(len(self.param_names))

    def rate_and_scatter(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Both (q,), in the coordinates; rates per square root of a year."""
        rates, scatters = np.split(np.asarray(z, np.float64), 2)
        return (
            self.course.rate * np.exp(self.course.rate_log_sd * rates),
            self.course.scatter * np.exp(self.course.scatter_log_sd * scatters),
        )

    def update(self, params: FloatArray, **kwargs: object) -> None:
        """Set the noises of these parameters."""
        super().update(params, **kwargs)
        rate, scatter = self.rate_and_scatter(params)
        self["state_cov"] = _wandering(self.course, rate)
        self["obs_cov"] = _time_last(_noise(self.course, scatter))

    def misfit(self, z: FloatArray) -> float:
        """Minus the log of the posterior density of z, but for a constant."""
        return float(z @ z) / 2 - float(self.loglike(z))

    def fitted(self) -> FloatArray:
        """z (2 q,) of the largest posterior density: the likelihood times the weak prior."""
        found = scipy.optimize.minimize(
            self.misfit,
            self.start_params,
            method="L-BFGS-B",
            bounds=[(-_WIDEST, _WIDEST)] * len(self.start_params),
            options={"ftol": 1e-7, "maxiter": 60},
        )
        return np.asarray(found.x, np.float64)

    def coefficient_square(self, z: FloatArray) -> FloatArray:
        """Expected square (q,) of each temperature coefficient, given all tests."""
        _, _, smoothed, spread = _states(self.smooth(z, return_ssm=True))
        count = self.course.seen.shape[1]
        square = smoothed[-1] ** 2 + spread[-1].diagonal()
        return np.asarray(square[count:], np.float64)

    def around(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Draws (m, 2 q) of what the parameters may be, and weights (m,) that sum to 1.

        Importance sampling from a normal law split at the mode (Geweke 1989): that a rate may be
        far smaller does not say that it may be far larger. The weights are truncated (Ionides
        2008). Without it the bands of few tests are too narrow.
        """
        strength, vectors = np.linalg.eigh(_curvature(self.misfit, z))
        axes = vectors / np.sqrt(np.maximum(strength, 1.0))
        best = self.misfit(z)
        up, down = (
            np.array([_side(self.misfit(self._inside(z + sign * axis)) - best) for axis in axes.T])
            for sign in (1, -1)
        )
        half = np.random.default_rng(0).normal(size=(_DRAWS // 2, len(z)))
        standard = np.concatenate([half, -half])
        scales = np.where(standard > 0, up, down)
        draws = self._inside(z + (standard * scales) @ axes.T)
        log_weights = np.log(scales).sum(axis=1) + (standard**2).sum(axis=1) / 2
        log_weights -= [self.misfit(draw) for draw in draws]
        weights = np.exp(log_weights - log_weights.max())
        weights = np.minimum(weights, weights.mean() * np.sqrt(_DRAWS))
        return draws, weights / weights.sum()

    def _inside(self, z: FloatArray) -> FloatArray:
        return np.asarray(np.clip(z, -_WIDEST, _WIDEST), np.float64)

    def course_of_states(self, z: FloatArray) -> States:
        """Filtered and smoothed states, mixed over what rates and scatters may be."""
        draws, weights = self.around(z)
        parts = [_states(self.smooth(each, return_ssm=True)) for each in draws]
        filtered, filtered_spread, smoothed, smoothed_spread = (
            np.stack(part) for part in zip(*parts, strict=True)
        )
        return States(
            *_mixed(filtered, filtered_spread, weights), *_mixed(smoothed, smoothed_spread, weights)
        )


def _side(rise: float) -> float:
    """Scale of a half normal law whose misfit rises by `rise` over one unit."""
    return float(np.clip(1 / np.sqrt(max(2 * rise, 1e-3)), 0.2, 2.0))


@dataclass(frozen=True, eq=False)
class States:
    """Means (n, 2 q) and covariances (n, 2 q, 2 q) of levels and coefficients at each test."""

    filtered_mean: FloatArray
    filtered_covariance: FloatArray
    smoothed_mean: FloatArray
    smoothed_covariance: FloatArray


def _states(found: SmootherResults) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    filtered, smoothed = found.filtered_state_cov, found.smoothed_state_cov
    return (
        found.filtered_state.T.copy(),
        np.moveaxis(filtered, -1, 0).copy(),
        found.smoothed_state.T.copy(),
        np.moveaxis(smoothed, -1, 0).copy(),
    )


def _mixed(
    means: FloatArray, covariances: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of a mixture over the first axis."""
    middle = np.einsum("m,mni->ni", weights, means)
    off = means - middle
    between = np.einsum("m,mni,mnj->nij", weights, off, off, optimize=True)
    return middle, np.einsum("m,mnij->nij", weights, covariances) + between


def _curvature(misfit: Callable[[FloatArray], float], z: FloatArray) -> FloatArray:
    """Second derivatives (d, d) by central differences, wide because z is in prior sds."""
    steps = _STEP * np.eye(len(z))
    middle = misfit(z)
    ahead, behind = ([misfit(z + sign * step) for step in steps] for sign in (1, -1))
    second = np.diag([a - 2 * middle + b for a, b in zip(ahead, behind, strict=True)])
    for i, j in combinations(range(len(z)), 2):
        both = misfit(z + steps[i] + steps[j]) + misfit(z - steps[i] - steps[j])
        second[i, j] = second[j, i] = (
            both - ahead[i] - ahead[j] - behind[i] - behind[j] + 2 * middle
        ) / 2
    return np.asarray(second / _STEP**2, np.float64)


def _design(course: Course) -> FloatArray:
    """(n, q, 2 q): each direction sees the levels, and the coefficients times the warmth."""
    warmed = course.directions * course.warmth_k[:, None, None]
    return np.concatenate([course.directions, warmed], axis=2)


def _wandering(course: Course, rate: FloatArray) -> FloatArray:
    """(q, q, n) in statsmodels' order of time: the step that leads away from each test."""
    tests, quantities = course.seen.shape
    steps = np.zeros((tests, quantities))
    steps[:-1] = course.years[:, None] * rate**2 + course.jump_variance[1:]
    return _time_last(steps[:, :, None] * np.eye(quantities))


def _noise(course: Course, scatter: FloatArray) -> FloatArray:
    """(n, q, q) along the directions; 1 along those not seen, where it has no effect."""
    of_coordinates = course.extra_variance + scatter**2
    turned = np.einsum(
        "nij,nj,nkj->nik", course.directions, of_coordinates, course.directions, optimize=True
    )
    own = np.where(np.isnan(course.seen), 1.0, course.variance)
    whole = turned + own[:, :, None] * np.eye(own.shape[1])
    return np.asarray(course.inflation[:, None, None] * whole, np.float64)


def _time_last(array: FloatArray) -> FloatArray:
    return np.ascontiguousarray(np.moveaxis(array, 0, -1))
