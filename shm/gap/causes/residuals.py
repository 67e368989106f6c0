"""Residuals of a fit: of every frequency, over conditions, and held out.

A predictive p-value tells how often the fit would produce data that lie as far off.

Residuals are weighed by the identification's errors alone, not by the model error that a fit may
have taken up to live with the gap: else a large gap would look like none.
How far the gap shrinks is said of the fit and of modes and tests held out of it: it is fitted again
on the others to first order about the full fit, which on the golden cases is right to 0.001 %.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy

from shm.errors import UsageError
from shm.gap.hypotheses.contract import Design, Fit, Observations
from shm.gap.hypotheses.problem import GapProblem
from shm.inference.sampler.likelihood import Covariance, Likelihood, ShapeErrors
from shm.models.effects import Conditions
from shm.values import (
    NAN,
    PLANES,
    BoolArray,
    FloatArray,
    IntArray,
    Residual,
    Shrinkage,
    Trend,
)

_LEAST_LEFT = 0.01  # numerical: of the variance of a datum that the fit follows but for its bend
DRAWS = 100  # technical: a mean p-value to a tenth of its spread over draws


def residuals(
    problem: GapProblem, before: Fit, after: Fit | None, held_out: HeldOut
) -> tuple[Residual, ...]:
    """Return the residual of each frequency from the baseline's fit `before`, in the data's order.

    `z` is the residual over its own standard deviation, of which the tension and the other free
    parameters absorb a part (standardised residual, Cook and Weisberg 1982, 2.1; here with known
    variances and priors). Where the fit allows for no other errors it equals the z-score of the
    measurement against a prediction from all other data. What is left after is in stated standard
    deviations, NaN without one. Shares are parts of the frequencies'
    chi-square and add to 1; NaN where there is no misfit at all.
    """
    design = problem.observations.design
    frequencies = design.frequencies
    value = problem.observations.value[:frequencies]
    deviation = problem.left(before)
    left_after = np.full(frequencies, NAN) if after is None else problem.left(after)
    sd = identification_sd(problem, before if after is None else after)
    left = np.maximum(np.diag(left_over(before, sd)), _LEAST_LEFT * sd[:frequencies] ** 2)
    z = deviation / np.sqrt(left)
    misfit = (deviation / sd[:frequencies]) ** 2
    columns = np.column_stack(
        [
            np.exp(value),
            np.exp(value - deviation),
            100 * np.expm1(deviation),
            z,
            misfit / misfit.sum() if misfit.sum() > 0 else np.full(frequencies, NAN),
            100 * np.expm1(left_after),
            _first_percent(held_out.before),
            _first_percent(held_out.after),
            left_after / problem.observations.sd[:frequencies],
        ]
    )
    named = zip(design.frequency_plane, design.frequency_order, design.frequency_test, strict=True)
    return tuple(
        Residual(PLANES[plane], int(order), design.conditions[test].test, *row)
        for (plane, order, test), row in zip(named, columns.tolist(), strict=True)
    )


def identification_sd(problem: GapProblem, fit: Fit) -> FloatArray:
    """Return standard deviations (data,); those that nobody gave are what `fit` takes for errors.

    Less what repeats in any case, which is no error of identification.
    """
    sd, count = problem.observations.sd, problem.design.frequencies
    repeated = problem.repeated_with(fit.hypothesis.effects).frequency
    variance = np.diag(fit.noise.frequency - repeated)
    return np.concatenate(
        [np.where(np.isfinite(sd[:count]), sd[:count], np.sqrt(variance)), sd[count:]]
    )


def left_over(fit: Fit, sd: FloatArray) -> FloatArray:
    """Return the covariance (F, F) of what a fit leaves of independent errors `sd` (data,).

    A fit weighs the data by all errors that it allows for. Supports that give and a section that
    varies keep its parameters from following the data as far as `sd` alone would let them.
    """
    noise = Likelihood.of(fit.noise, fit.model_error).weighed(fit.slopes)
    weighed = np.concatenate([noise.frequency[0], noise.shape[0]])
    information = np.eye(fit.slopes.shape[1]) + fit.slopes.T @ weighed
    followed = fit.slopes @ np.linalg.solve(information, weighed.T)
    remainder = (np.eye(len(sd)) - followed)[: len(fit.noise.frequency)]
    return np.asarray((remainder * sd**2) @ remainder.T)


def trends(problem: GapProblem, before: Fit) -> tuple[Trend, ...]:
    """Return the trends of the frequency residuals, that with the largest share first.

    Conditions that the tests do not vary are absent. The regression is weighted by the
    identification's errors. Tests are compared mode by mode (each plane and order has its own
    mean), so that a test with other modes cannot pass for a trend; orders are compared within a
    test and plane, planes within an order. Standard deviations allow for what the baseline's
    parameters have absorbed. The trend over planes is longitudinal less transverse.
    """
    frequencies = problem.observations.design.frequencies
    residual = 100 * problem.left(before)
    sd = identification_sd(problem, before)
    covariance = 1e4 * left_over(before, sd)
    found = [
        _trend(name, values, groups, residual, 100 * sd[:frequencies], covariance)
        for name, values, groups in _conditions(problem.observations.design)
        if _varies(values, groups)
    ]
    return tuple(sorted(found, key=lambda trend: -trend.share))


def _conditions(design: Design) -> Iterator[tuple[str, FloatArray, IntArray]]:
    """Yield each condition's name, its value at each frequency and the groups to compare within."""
    test, plane, order = design.frequency_test, design.frequency_plane, design.frequency_order
    mode = 2 * order + plane
    masses = [c.added_mass.mass_kg if c.added_mass else 0.0 for c in design.conditions]
    yield "temperature", design.temperature_shift_k, mode
    yield "amplitude", design.amplitude, mode
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


def predictive_p_values(
    observations: Observations, predicted: FloatArray, noise: Covariance
) -> tuple[float, float]:
    """Return the posterior predictive p-values of frequencies and of shapes.

    Gelman, Meng and Stern, Stat. Sinica 6, 1996. `predicted` (draws, data) are those of draws of
    the posterior, `noise` is the covariance that the data should have about a right prediction.
    Three misfits are looked at, each a chi-square: of all frequencies, of each mode's mean
    frequency over the tests (a gap that repeats drowns in the first), of which the smaller p-value
    counts, and of the shapes. Each is times the number of misfits; without shapes theirs is 1.
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
    of_frequencies, of_shapes = min(misfits[:2]), min(misfits[2:], default=1.0)
    return min(1.0, len(misfits) * of_frequencies), min(1.0, len(misfits) * of_shapes)


def predictions(problem: GapProblem, fit: Fit) -> FloatArray:
    """Return those of some draws of a fit's posterior (draws, data)."""
    some = fit.draws[:: max(1, len(fit.draws) // DRAWS)]
    return problem.predict(fit.hypothesis, some)


def _p_value(residual: FloatArray, covariance: FloatArray, means: FloatArray) -> float:
    """Return the mean p-value of `means` (m, F) of residuals (draws, F) of a covariance (F, F)."""
    lower = np.linalg.cholesky(means @ covariance @ means.T)
    whitened = np.linalg.solve(lower, means @ residual.T)
    return float(np.mean(scipy.stats.chi2.sf(np.sum(whitened**2, axis=0), len(means))))


def _freedom(design: Design) -> int:
    """Return that of the components of shapes; scaling to unit length takes one from each."""
    return len(design.shape_mode) - len(np.unique(design.shape_mode))


def _means(design: Design) -> FloatArray:
    """Return rows (m, F) that average each mode over the tests in which it was measured."""
    rows = (design.mode == np.unique(design.mode)[:, None]).astype(float)
    return np.asarray(rows / rows.sum(axis=1, keepdims=True))


_FEWEST = 4  # frequencies: three to fit (tension, stiffness and a size), one to predict
# Judgement: each fold is refitted; inner orders in thirds leave neighbours of each.
_ORDER_FOLDS, _TEST_FOLDS = 3, 6


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Residuals of held-out frequencies, of their logarithms: `before`, `after` (folds, F).

    NaN where a fold keeps the frequency in the fit; `after` is NaN where no cause moves it.
    """

    before: FloatArray
    after: FloatArray


def held_out(
    problem: GapProblem, before: Fit, after: Fit | None, hold_out: tuple[str, ...] = ()
) -> HeldOut:
    """Return what baseline and cause miss of held-out data when fitted without them.

    `hold_out` names tests or orders that are left out together; empty: the orders between the
    lowest and the highest in three folds, then tests in turn. A held-out frequency takes its shape
    with it. Tests are held out as long as the others still vary every condition that they all vary,
    and unless the cause acts in that test alone: else its size would be asked of data that cannot
    know it. With three frequencies or fewer nothing can be held out, and all is NaN; so is `after`
    of a cause that moves no frequency, such as a turned sensor. Slopes and the sizes of unknown
    errors are those of the full fits.

    Raises UsageError for names that are neither, or that leave too little to fit.
    """
    design = problem.observations.design
    folds = _named(design, hold_out) if hold_out else _in_turn(design, after)
    none = np.full((len(folds), design.frequencies), NAN)
    moves = after is not None and after.slopes[: design.frequencies, len(before.z) :].any()
    return HeldOut(
        _residuals(problem, before, folds) if len(folds) else none,
        _residuals(problem, after, folds) if after and moves and len(folds) else none,
    )


def check_hold_out(design: Design, hold_out: tuple[str, ...]) -> None:
    """Raise what `held_out` would, before anything is fitted."""
    if hold_out:
        _named(design, hold_out)


def shrinkage(problem: GapProblem, before: Fit, after: Fit | None, held: HeldOut) -> Shrinkage:
    """Return root mean squares in percent; NaN for what there is not."""
    return Shrinkage(
        _rms_percent(problem.left(before)),
        NAN if after is None else _rms_percent(problem.left(after)),
        _rms_percent(held.before),
        _rms_percent(held.after),
    )


def _residuals(problem: GapProblem, fit: Fit, folds: BoolArray) -> FloatArray:
    """Return what `fit`, refitted to the others of each fold, misses of what the fold holds out."""
    design, residual = problem.observations.design, problem.observations.value - fit.predicted
    left = np.full(folds.shape, NAN)
    for fold, out in enumerate(folds):
        others, shapes = np.flatnonzero(~out), np.flatnonzero(~out[design.shape_mode])
        rows = np.concatenate([others, design.frequencies + shapes])
        errors = Likelihood.of(fit.noise.part(others, shapes), fit.model_error)
        _, step, *_ = errors.linear(fit.slopes[rows], residual[rows], fit.z)
        rest = (residual - fit.slopes @ step)[: design.frequencies]
        # What repeats in all frequencies is known by the others.
        repeated = problem.repeated_with(fit.hypothesis.effects).frequency
        across = repeated[np.ix_(out, others)]
        covariance = fit.noise.frequency[np.ix_(others, others)]
        left[fold, out] = rest[out] - across @ np.linalg.solve(covariance, rest[others])
    return left


def _named(design: Design, names: tuple[str, ...]) -> BoolArray:
    """Return one fold (1, F) that holds out everything that is named."""
    tests = np.array([each.test for each in design.conditions])[design.frequency_test]
    orders = np.array([str(order) for order in design.frequency_order])
    unknown = [name for name in names if name not in tests and name not in orders]
    if unknown:
        raise UsageError(
            f"{unknown[0]} is neither a test nor an order of these data.",
            remedy=f"Name tests ({', '.join(dict.fromkeys(tests))}) or orders "
            f"({', '.join(map(str, np.unique(design.frequency_order)))}).",
        )
    held = np.any([tests == name if name in tests else orders == name for name in names], axis=0)
    if np.sum(~held) < _FEWEST - 1:
        raise UsageError(
            f"without {', '.join(names)} only {np.sum(~held)} frequencies are left to fit.",
            remedy="Hold out fewer tests or orders.",
        )
    return np.asarray(held[None], dtype=bool)


def _in_turn(design: Design, after: Fit | None) -> BoolArray:
    """Return folds (folds, F) over orders and over tests that leave enough to fit."""
    folds = np.array([*_over_orders(design), *_over_tests(design, after)], dtype=bool)
    folds = folds.reshape(-1, design.frequencies)
    if design.frequencies < _FEWEST:
        return folds[:0]
    return np.asarray(folds[(np.sum(~folds, axis=1) >= _FEWEST - 1) & folds.any(axis=1)])


def _over_orders(design: Design) -> list[BoolArray]:
    """Return folds of the orders between the lowest and the highest, or of these alone.

    What acts on the lowest order alone, as sag does, cannot be known without it.
    """
    orders = np.unique(design.frequency_order)
    inner = orders[1:-1] if len(orders) > 2 else orders
    folds = [inner[fold::_ORDER_FOLDS] for fold in range(min(_ORDER_FOLDS, len(inner)))]
    return [np.asarray(np.isin(design.frequency_order, fold)) for fold in folds]


def _over_tests(design: Design, after: Fit | None) -> list[BoolArray]:
    """Return folds of a test each, or of a few where there are many."""
    conditions = design.conditions
    if len(set(map(_circumstances, conditions))) == 1:
        return []
    bound = set() if after is None else {v.test for _, v in after.hypothesis.effects}
    free = [t for t, each in enumerate(conditions) if each.test not in bound]
    able = [t for t in free if _still_varied(conditions, (t,))]
    groups = [tuple(able[i::_TEST_FOLDS]) for i in range(min(_TEST_FOLDS, len(able)))]
    whole = [group for group in groups if _still_varied(conditions, group)]
    return [np.asarray(np.isin(design.frequency_test, group)) for group in whole]


def _circumstances(conditions: Conditions) -> tuple[float, float, float]:
    mass = 0.0 if conditions.added_mass is None else conditions.added_mass.mass_kg
    return conditions.temperature_shift_k, conditions.amplitude, mass


def _still_varied(conditions: tuple[Conditions, ...], without: tuple[int, ...]) -> bool:
    rest = [each for t, each in enumerate(conditions) if t not in without]
    if not rest:
        return False
    varied = np.ptp([_circumstances(each) for each in conditions], axis=0) > 0
    still = np.ptp([_circumstances(each) for each in rest], axis=0) > 0
    return bool(np.all(still | ~varied))


def _first_percent(residual: FloatArray) -> FloatArray:
    """Return the residuals (F,) of the first fold that holds each frequency out; NaN for none."""
    percent = np.full(residual.shape[1], NAN)
    for fold in residual[::-1]:
        percent = np.where(np.isfinite(fold), 100 * np.expm1(fold), percent)
    return percent


def _rms_percent(residual: FloatArray) -> float:
    known = residual[np.isfinite(residual)]
    return float(100 * np.sqrt(np.mean(np.expm1(known) ** 2))) if known.size else NAN
