"""The likelihood of shifts of a prediction, with linear parameters integrated out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.contract import Fit, Hypothesis
from shm.gap.likelihood import Likelihood
from shm.gap.noise import MEAN_MODEL_ERROR
from shm.gap.problem import GapProblem
from shm.values import FloatArray

LARGEST_SCALE = 1.8
"""Up to this factor, up or down, a shift counts as one in proportion to the effect's size.

Judgement: eight decades in 32 points, as scans have, are so far apart; over more a shift bends.
"""

_CELL = 2 * float(np.log(LARGEST_SCALE))  # from the smallest to the largest, of the logarithm
# Technical: rounding of logarithms, and a square that is divided by.
_NEAR, _NOTHING = 1e-9, 1e-30


@dataclass(frozen=True, eq=False)
class Marginal:
    """Of `g` shifts of a prediction, with the linear parameters integrated out.

    `whole` (g,): by how many standard deviations each moves the data, `visible` (g,): by how many
    beyond what the linear parameters can follow. `log_likelihood` (g,) of the shifts as they are;
    `scale` (g,), up to 1.8 up or down, makes them fit best, with the log likelihood `log_peak`
    (g,); `log_mean` (g,) is that of the mean likelihood over all these scales, evenly over their
    logarithm. `step` (g, d) is where the linear parameters go with the scaled shifts, `follow`
    (g, d) with the plain ones.
    """

    whole: FloatArray
    visible: FloatArray
    log_likelihood: FloatArray
    scale: FloatArray
    log_peak: FloatArray
    log_mean: FloatArray
    step: FloatArray
    follow: FloatArray


@dataclass(frozen=True, eq=False)
class _Products:
    """Products of residual and shifts in each node: beyond what the linear parameters follow.

    `cross` of residual and shifts and `shift` of these with themselves, (nodes, g), `whole` the
    latter before anything follows; `height`
    (nodes,) is the log likelihood of the residual. `solved` (nodes, d, 1 + g): where the linear
    parameters go with each.
    """

    cross: FloatArray
    shift: FloatArray
    whole: FloatArray
    height: FloatArray
    solved: FloatArray


def marginal(
    problem: GapProblem, hypothesis: Hypothesis, before: Fit, shift: FloatArray
) -> Marginal:
    """Of shifts (g, data) added to what `before` predicts, by the unknown errors of `hypothesis`.

    The parameters of `before` are those that are linear.
    """
    likelihood = problem.likelihood(hypothesis)
    products = _products(likelihood, before, problem.observations.value - before.predicted, shift)
    nodes = np.arange(len(shift))
    plain = products.height[:, None] + products.cross - products.shift / 2
    own = np.maximum(products.shift, _NOTHING)
    scales = (products.cross / own).clip(1 / LARGEST_SCALE, LARGEST_SCALE)
    peaks = products.height[:, None] + scales * products.cross - scales**2 * own / 2
    best = peaks.argmax(axis=0)
    scale = scales[best, nodes]
    log_peak = np.asarray(scipy.special.logsumexp(peaks, axis=0))
    width = np.sqrt(2 * np.pi / own[best, nodes]) / scale
    residual, shifts = products.solved[best, :, 0], products.solved[best, :, 1 + nodes]
    usual = _nominal(problem, likelihood, peaks.max(axis=1))
    return Marginal(
        whole=np.sqrt(products.whole[usual]),
        visible=np.sqrt(products.shift[usual]),
        log_likelihood=np.asarray(scipy.special.logsumexp(plain, axis=0)),
        scale=scale,
        log_peak=log_peak,
        log_mean=log_peak + np.log(np.minimum(width / _CELL, 1.0)),
        step=residual - scale[:, None] * shifts,
        follow=residual - shifts,
    )


def _products(
    likelihood: Likelihood, before: Fit, residual: FloatArray, shift: FloatArray
) -> _Products:
    d = len(before.z)
    columns = np.column_stack([before.slopes, residual])
    gram = likelihood.weighed(columns).products(np.vstack([columns.T, shift]))
    # The prior is d more data, of value 0 and standard deviation 1.
    inner, outer = gram[:, :d, :d] + np.eye(d), np.swapaxes(gram[:, d:, :d], 1, 2).copy()
    outer[:, :, 0] -= before.z
    solved: FloatArray = np.linalg.solve(inner, outer).astype(np.float64)
    followed = (outer[:, :, :1] * solved).sum(axis=1)
    square = gram[:, d, d] + before.z @ before.z - followed[:, 0]
    own = likelihood.squares(shift).T
    alone = own - (outer[:, :, 1:] * solved[:, :, 1:]).sum(axis=1)
    volume = np.linalg.slogdet(inner)[1]
    return _Products(
        cross=gram[:, d + 1 :, d] - followed[:, 1:],
        shift=np.maximum(alone, 0.0),
        whole=own,
        height=likelihood.log_height - volume / 2 - square / 2,
        solved=solved,
    )


def _nominal(problem: GapProblem, likelihood: Likelihood, height: FloatArray) -> int:
    """The node by which to say what can be seen: the likeliest of those with a usual model error.

    Where no standard deviation is known, the likeliest of all with the shift that fits best.
    """
    error = np.array([node.model_error for node in likelihood.nodes])
    if np.isfinite(problem.observations.sd[: likelihood.frequencies]).any():
        away = np.abs(np.log(error / MEAN_MODEL_ERROR))
        height = np.where(away < away.min() + _NEAR, height, -np.inf)
    return int(height.argmax())
