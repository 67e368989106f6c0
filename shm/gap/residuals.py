"""Where model and measurement differ: the residual of every measured frequency, with which
conditions it grows, and whether a fitted hypothesis would produce data that lie as far off.

Residuals are weighed by the identification's errors alone, not by the model error that a fit may
have taken up to live with the gap: else a large gap would look like none.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy

from shm.gap.contract import Covariance, Design, Fit, NoiseNode, Observations
from shm.gap.cross_validation import HeldOut
from shm.gap.likelihood import Likelihood, ShapeErrors
from shm.gap.problem import GapProblem
from shm.values import NAN, PLANES, FloatArray, IntArray, Residual, Trend

_LEAST_LEFT = 1e-9  # technical: of a datum that the fit follows altogether
DRAWS = 100  # technical: a mean p-value to a tenth of its spread over draws


def residuals(
    problem: GapProblem, before: Fit, after: Fit | None, held_out: HeldOut | None
) -> tuple[Residual, ...]:
    """The residual of each frequency from the baseline's fit `before`, in the data's order.

    `z` is the residual over its own standard deviation, of which the tension and the other free
    parameters absorb a part (standardised residual, Cook and Weisberg 1982, 2.1; here with known
    variances and priors). Where the fit allows for no other errors it equals the z-score of the
    measurement against a prediction from all other data. Shares are parts of the frequencies'
    chi-square and add to 1; NaN where there is no misfit at all.
    """
    design = problem.observations.design
    frequencies = design.frequencies
    deviation = (problem.observations.value - before.predicted)[:frequencies]
    sd = identification_sd(problem, before if after is None else after)
    left = np.maximum(np.diag(left_over(before, sd)), _LEAST_LEFT * sd[:frequencies] ** 2)
    z = deviation / np.sqrt(left)
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


def identification_sd(problem: GapProblem, fit: Fit) -> FloatArray:
    """Standard deviations (data,); those that nobody gave are what `fit` takes for the errors.

    Less what repeats in any case, which is no error of identification.
    """
    sd, count = problem.observations.sd, problem.design.frequencies
    own = np.diag(fit.noise.frequency - problem.repeated.frequency)
    return np.concatenate([np.where(np.isfinite(sd[:count]), sd[:count], np.sqrt(own)), sd[count:]])


def left_over(fit: Fit, sd: FloatArray) -> FloatArray:
    """Covariance (F, F) of what a fit leaves of independent errors `sd` (data,) in frequencies.

    A fit weighs the data by all errors that it allows for. Supports that give and a section that
    varies keep its parameters from following the data as far as `sd` alone would let them.
    """
    noise = Likelihood([NoiseNode(fit.noise, 0.0, fit.model_error)]).weighed(fit.slopes)
    weighed = np.concatenate([noise.frequency[0], noise.shape[0]])
    information = np.eye(fit.slopes.shape[1]) + fit.slopes.T @ weighed
    followed = fit.slopes @ np.linalg.solve(information, weighed.T)
    kept = (np.eye(len(sd)) - followed)[: len(fit.noise.frequency)]
    return np.asarray((kept * sd**2) @ kept.T)


def _percent(observations: Observations, fit: Fit | None) -> FloatArray:
    frequencies = observations.design.frequencies
    if fit is None:
        return np.full(frequencies, NAN)
    return 100 * np.expm1((observations.value - fit.predicted)[:frequencies])


def _held_out_percent(frequencies: int, held_out: HeldOut | None) -> tuple[FloatArray, FloatArray]:
    if held_out is None:
        return np.full(frequencies, NAN), np.full(frequencies, NAN)
    return held_out.before_percent, held_out.after_percent


def trends(problem: GapProblem, before: Fit) -> tuple[Trend, ...]:
    """The trends of the frequency residuals, that with the largest share first.

    Conditions that the tests do not vary are absent. The regression is weighted by the
    identification's errors. Tests are compared mode by mode (each plane and order has its own
    mean), so that a test with other modes cannot pass for a trend; orders are compared within a
    test and plane, planes within an order. Standard deviations allow for what the baseline's
    parameters have absorbed. The trend over planes is longitudinal less transverse.
    """
    frequencies = problem.observations.design.frequencies
    residual = 100 * (problem.observations.value - before.predicted)[:frequencies]
    sd = identification_sd(problem, before)
    covariance = 1e4 * left_over(before, sd)
    found = [
        _trend(name, values, groups, residual, 100 * sd[:frequencies], covariance)
        for name, values, groups in _conditions(problem.observations.design)
        if _varies(values, groups)
    ]
    return tuple(sorted(found, key=lambda trend: -trend.share))


def _conditions(design: Design) -> Iterator[tuple[str, FloatArray, IntArray]]:
    """Each condition's name, its value at each frequency and the groups it is compared within."""
    test, plane, order = design.frequency_test, design.frequency_plane, design.frequency_order
    mode = 2 * order + plane
    each = design.conditions
    masses = [0.0 if c.added_mass is None else c.added_mass.mass_kg for c in each]
    yield "temperature", np.array([c.temperature_shift_k for c in each])[test], mode
    yield "amplitude", np.array([c.amplitude for c in each])[test], mode
    yield "added mass", np.array(masses)[test], mode
    yield "order", order.astype(float), 2 * test + plane
    yield "plane", plane.astype(float), order


def _varies(values: FloatArray, groups: IntArray) -> bool:
    return any(np.ptp(values[groups == group]) > 0 for group in np.unique(groups))


def _trend(
    name: str,
    values: FloatArray,
    groups: IntArray,
    residual: FloatArray,
    sd: FloatArray,
    covariance: FloatArray,
) -> Trend:
    weight = 1 / sd**2
    contrast = _centred(values / np.ptp(values), groups, weight)
    spread = weight @ contrast**2
    estimator = weight * contrast / spread
    slope = float(estimator @ residual)
    misfit = float(weight @ residual**2)
    return Trend(
        condition=name,
        slope_percent=slope,
        slope_sd_percent=float(np.sqrt(max(float(estimator @ covariance @ estimator), 0.0))),
        share=float(slope**2 * spread / misfit) if misfit > 0 else NAN,
    )


def _centred(values: FloatArray, groups: IntArray, weight: FloatArray) -> FloatArray:
    centred = values.copy()
    for group in np.unique(groups):
        rows = groups == group
        centred[rows] -= np.average(values[rows], weights=weight[rows])
    return centred


def predictive_p_value(
    observations: Observations, predicted: FloatArray, noise: Covariance
) -> float:
    """Posterior predictive p-value of the misfit (Gelman, Meng and Stern, Stat. Sinica 6, 1996).

    `predicted` (draws, data) are those of draws of the posterior, `noise` is the covariance that
    the data should have about a right prediction. Three misfits are looked at, each a chi-square:
    of all frequencies, of each mode's mean frequency over the tests (a gap that repeats drowns in
    the first) and of the shapes. The smallest p-value is returned, times their number.
    """
    residual = observations.value - predicted
    count = observations.design.frequencies
    misfits = [
        _p_value(residual[:, :count], noise.frequency, np.eye(count)),
        _p_value(residual[:, :count], noise.frequency, _means(observations.design)),
    ]
    if noise.shape.size:
        distance = ShapeErrors([noise]).squares(residual[:, count:])[:, 0]
        misfits.append(float(np.mean(scipy.stats.chi2.sf(distance, _freedom(observations.design)))))
    return min(1.0, len(misfits) * min(misfits))


def predictions(problem: GapProblem, fit: Fit) -> FloatArray:
    """Of some draws of a fit's posterior (draws, data).

    Draws that were sampled (`effective` is known) lie along whatever bent ridge the end springs
    leave, where slopes at the most probable point say nothing; those of a normal distribution hold
    for its own slopes alone.
    """
    some = fit.draws[:: max(1, len(fit.draws) // DRAWS)]
    if np.isfinite(fit.effective):
        return problem.predict(fit.hypothesis, some)
    return np.asarray(fit.predicted + (some - fit.z) @ fit.slopes.T)


def _p_value(residual: FloatArray, covariance: FloatArray, means: FloatArray) -> float:
    """The mean p-value of `means` (m, F) of residuals (draws, F) whose covariance is (F, F)."""
    lower = np.linalg.cholesky(means @ covariance @ means.T)
    whitened = np.linalg.solve(lower, means @ residual.T)
    return float(np.mean(scipy.stats.chi2.sf(np.sum(whitened**2, axis=0), len(means))))


def _freedom(design: Design) -> int:
    """Of the components of shapes; scaling to unit length takes one from each shape."""
    return len(design.shape_mode) - len(np.unique(design.shape_mode))


def _means(design: Design) -> FloatArray:
    """Rows (m, F) that average each mode over the tests in which it was measured."""
    mode = design.frequency_plane * (design.frequency_order.max() + 1) + design.frequency_order
    rows = (mode == np.unique(mode)[:, None]).astype(float)
    return np.asarray(rows / rows.sum(axis=1, keepdims=True))
