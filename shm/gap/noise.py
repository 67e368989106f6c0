"""The unknown errors of the data: a few possibilities, each a covariance with a prior weight.

The frequencies err by their identification, independently, and by a small model error that belongs
to a mode and so repeats in every test: cov = diag(sd^2) + sigma^2 [same plane and order]. sigma has
a half-normal prior: the general model agrees with independent finite elements to 1e-5, and what is
much larger than that is a gap, not scatter. Where no standard deviations are given there is instead
one unknown standard deviation for all, log-uniform; where some are, both. Unknowns are integrated
by the trapezoidal rule over their logarithm.
"""

from __future__ import annotations

import numpy as np

from shm.gap.contract import Covariance, Design, NoiseNode, Observations
from shm.values import FloatArray

MODEL_ERROR_SCALE = 2e-5
MEAN_MODEL_ERROR = MODEL_ERROR_SCALE * float(np.sqrt(2 / np.pi))
SD_LOWER, SD_UPPER = 1e-4, 3e-2
_SIGMA_LOWER, _SIGMA_UPPER, _SIGMAS = 3e-6, 1e-4, 8
_SDS, _SDS_OF_SOME = 32, 12
_SIGMAS_OF_SOME = 7


def nodes(observations: Observations) -> tuple[NoiseNode, ...]:
    """The possibilities for `observations`; their weights add to 1."""
    sd = observations.sd[: observations.design.frequencies]
    shape = observations.sd[observations.design.frequencies :] ** 2
    known = np.isfinite(sd)
    same = same_mode(observations.design)
    return tuple(
        NoiseNode(
            Covariance(np.diag(np.where(known, sd, common) ** 2) + sigma**2 * same, shape),
            float(np.log(weight * share)),
            float(sigma if known.any() else common),
        )
        for common, share in zip(*_unknown_sds(known), strict=True)
        for sigma, weight in zip(*_model_errors(known), strict=True)
    )


def same_mode(design: Design) -> FloatArray:
    """(F, F): 1 where two frequencies are of one plane and order, 0 elsewhere."""
    mode = np.stack([design.frequency_plane, design.frequency_order])
    return np.asarray((mode[:, :, None] == mode[:, None, :]).all(axis=0), dtype=float)


def _unknown_sds(known: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values of the common unknown standard deviation and their weights."""
    if known.all():
        return np.zeros(1), np.ones(1)
    values = np.geomspace(SD_LOWER, SD_UPPER, _SDS_OF_SOME if known.any() else _SDS)
    return values, _trapezoidal(np.ones(len(values)))


def _model_errors(known: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values of sigma and their weights; no sigma where all standard deviations are unknown."""
    if not known.any():
        return np.zeros(1), np.ones(1)
    values = np.geomspace(_SIGMA_LOWER, _SIGMA_UPPER, _SIGMAS if known.all() else _SIGMAS_OF_SOME)
    density = values * np.exp(-((values / MODEL_ERROR_SCALE) ** 2) / 2)
    # Below its smallest value the prior is flat: its integral there is the density by logarithm.
    return values, _trapezoidal(density, below=density[0] / np.log(values[1] / values[0]))


def _trapezoidal(density: FloatArray, below: float = 0.0) -> FloatArray:
    """Weights of values evenly spaced in the logarithm, of a density by the logarithm.

    The first gets what lies `below` it as well, in units of the spacing.
    """
    weights = density.copy()
    weights[[0, -1]] /= 2
    weights[0] += below
    return np.asarray(weights / weights.sum())
