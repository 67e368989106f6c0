"""Absolute fit: would a hypothesis, once fitted, produce data that lie as far off as these?"""

from __future__ import annotations

import numpy as np
from scipy import stats

from shm.gap.contract import Covariance, Design, Fit, Observations
from shm.gap.likelihood import ShapeErrors
from shm.values import FloatArray

DRAWS = 100


def predictive_p_value(observations: Observations, fit: Fit, noise: Covariance) -> float:
    """Posterior predictive p-value of the misfit (Gelman, Meng and Stern, Stat. Sinica 6, 1996).

    `noise` is the covariance that the data should have about a right prediction. Three misfits are
    looked at, each a chi-square: of all frequencies, of each mode's mean frequency over the tests
    (a gap that repeats drowns in the first) and of the shapes. The smallest p-value is returned,
    times their number.
    """
    residual = observations.value - _predictions(fit)
    count = observations.design.frequencies
    misfits = [
        _p_value(residual[:, :count], noise.frequency, np.eye(count)),
        _p_value(residual[:, :count], noise.frequency, _means(observations.design)),
    ]
    if noise.shape.size:
        distance = ShapeErrors([noise]).squares(residual[:, count:])[:, 0]
        misfits.append(float(np.mean(stats.chi2.sf(distance, _freedom(observations.design)))))
    return min(1.0, len(misfits) * min(misfits))


def _predictions(fit: Fit) -> FloatArray:
    """Of draws of the posterior (draws, data), linearised about its most probable point."""
    some = fit.draws[:: max(1, len(fit.draws) // DRAWS)]
    return np.asarray(fit.predicted + (some - fit.z) @ fit.slopes.T)


def _p_value(residual: FloatArray, covariance: FloatArray, means: FloatArray) -> float:
    """The mean p-value of `means` (m, F) of residuals (draws, F) whose covariance is (F, F)."""
    lower = np.linalg.cholesky(means @ covariance @ means.T)
    whitened = np.linalg.solve(lower, means @ residual.T)
    return float(np.mean(stats.chi2.sf(np.sum(whitened**2, axis=0), len(means))))


def _freedom(design: Design) -> int:
    """Of the components of shapes; scaling to unit length takes one from each shape."""
    return len(design.shape_mode) - len(np.unique(design.shape_mode))


def _means(design: Design) -> FloatArray:
    """Rows (m, F) that average each mode over the tests in which it was measured."""
    mode = design.frequency_plane * (design.frequency_order.max() + 1) + design.frequency_order
    rows = (mode == np.unique(mode)[:, None]).astype(float)
    return np.asarray(rows / rows.sum(axis=1, keepdims=True))
