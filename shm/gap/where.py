"""Where model and measurement differ: the residual of every measured frequency.

Residuals are weighed by the identification's errors alone, not by the model error that a fit may
have taken up to live with the gap: else a large gap would look like none.
"""

from __future__ import annotations

import numpy as np

from shm.gap.contract import Fit, Observations
from shm.gap.problem import GapProblem
from shm.gap.shrinkage import HeldOut
from shm.values import NAN, PLANES, FloatArray, Residual

_LEAST_LEFT = 1e-9


def residuals(
    problem: GapProblem, before: Fit, after: Fit | None, held_out: HeldOut | None
) -> tuple[Residual, ...]:
    """The residual of each frequency from the baseline's fit `before`, in the data's order.

    `z` is the residual over its own standard deviation, which is smaller than the
    identification's: part of each error is absorbed by the tension and the other free parameters
    (standardised residual, Cook and Weisberg 1982, 2.1; here with known variances and priors). It
    equals the z-score of the measurement against a prediction from all other data. Shares are
    parts of the frequencies' chi-square and add to 1; NaN where there is no misfit at all.
    """
    design = problem.observations.design
    frequencies = design.frequencies
    deviation = (problem.observations.value - before.predicted)[:frequencies]
    sd = identification_sd(problem.observations, before if after is None else after)
    z = deviation / sd[:frequencies] / np.sqrt(unabsorbed(before.slopes, sd)[:frequencies])
    misfit = (deviation / sd[:frequencies]) ** 2
    columns = np.column_stack(
        [
            np.exp(problem.observations.value[:frequencies]),
            np.exp(before.predicted[:frequencies]),
            100 * np.expm1(deviation),
            z,
            misfit / misfit.sum() if misfit.sum() > 0 else np.full(frequencies, NAN),
            _percent(problem.observations, after),
            *_held_out_percent(frequencies, held_out),
        ]
    )
    named = zip(design.frequency_plane, design.frequency_order, design.frequency_test, strict=True)
    return tuple(
        Residual(PLANES[plane], int(order), design.conditions[test].test, *row)
        for (plane, order, test), row in zip(named, columns.tolist(), strict=True)
    )


def identification_sd(observations: Observations, fit: Fit) -> FloatArray:
    """Standard deviations (data,); those that nobody gave are what `fit` takes for the errors."""
    total = np.concatenate([np.diag(fit.noise.frequency), fit.noise.shape_variance])
    return np.where(np.isfinite(observations.sd), observations.sd, np.sqrt(total))


def unabsorbed(slopes: FloatArray, sd: FloatArray) -> FloatArray:
    """The part (data,) of each datum's error variance that the free parameters do not absorb.

    One less the leverage, for parameters with standard normal priors, `slopes` (data, d) and
    independent errors `sd` (data,).
    """
    weighted = slopes / sd[:, None]
    covariance = np.linalg.inv(np.eye(slopes.shape[1]) + weighted.T @ weighted)
    leverage = np.einsum("ij,jk,ik->i", weighted, covariance, weighted)
    return np.asarray(np.maximum(1 - leverage, _LEAST_LEFT))


def _percent(observations: Observations, fit: Fit | None) -> FloatArray:
    frequencies = observations.design.frequencies
    if fit is None:
        return np.full(frequencies, NAN)
    return 100 * np.expm1((observations.value - fit.predicted)[:frequencies])


def _held_out_percent(frequencies: int, held_out: HeldOut | None) -> tuple[FloatArray, FloatArray]:
    if held_out is None:
        return np.full(frequencies, NAN), np.full(frequencies, NAN)
    return held_out.before_percent, held_out.after_percent
