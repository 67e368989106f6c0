"""How far the gap shrinks, in the fit and on modes and tests that were held out of it.

A fit again on part of its data: a few Gauss-Newton steps that start from the full fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.errors import UsageError
from shm.gap.contract import Design, Fit
from shm.gap.problem import GapProblem
from shm.inference.likelihood import Likelihood
from shm.models.effects import Conditions
from shm.values import NAN, BoolArray, FloatArray, IntArray, Shrinkage

_FEWEST = 4  # frequencies: three to fit (tension, stiffness and a size), one to predict
# Judgement: each fold is refitted; inner orders in thirds leave neighbours of each.
_ORDER_FOLDS, _TEST_FOLDS = 3, 6


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Residuals of held-out frequencies, of their logarithms: `before`, `after` (folds, F).

    NaN where a fold keeps the frequency in the fit; `after` is NaN where there is no cause.
    """

    before: FloatArray
    after: FloatArray

    @property
    def before_percent(self) -> FloatArray:
        """Return those (F,) of the first fold that holds the frequency out; NaN where none does."""
        return _first(self.before)

    @property
    def after_percent(self) -> FloatArray:
        """Return those (F,) of the first fold that holds the frequency out; NaN where none does."""
        return _first(self.after)


def held_out(
    problem: GapProblem,
    before: Fit,
    after: Fit | None,
    hold_out: tuple[str, ...],
    rng: np.random.Generator,
) -> HeldOut:
    """Return what baseline and cause miss of held-out data when fitted without them.

    `hold_out` names tests or orders that are left out together; empty: the orders
    between the lowest and the highest in three folds, then tests in turn. A held-out frequency
    takes its shape with it. Tests are held out as long as the others still vary every condition
    that they all vary, and unless the cause acts in that test alone: else its size would be asked
    of data that cannot know it. `rng` says which tests go together where there are many. With three
    frequencies or fewer nothing can be held out, and all is NaN. The sizes of unknown errors are
    those of the full fits.

    Raises UsageError for names that are neither, or that leave too little to fit.
    """
    design = problem.observations.design
    folds = _named(design, hold_out) if hold_out else _in_turn(design, after, rng)
    none = np.full((len(folds), design.frequencies), NAN)
    if len(folds) == 0:
        return HeldOut(none, none)
    return HeldOut(
        _residuals(problem, before, folds),
        none if after is None else _residuals(problem, after, folds),
    )


def check_hold_out(problem: GapProblem, hold_out: tuple[str, ...]) -> None:
    """Raise what `held_out` would, before anything is fitted."""
    if hold_out:
        _named(problem.observations.design, hold_out)


def shrinkage(problem: GapProblem, before: Fit, after: Fit | None, held: HeldOut) -> Shrinkage:
    """Return root mean squares in percent; NaN for what there is not."""
    return Shrinkage(
        _rms_percent(problem.left(before)),
        NAN if after is None else _rms_percent(problem.left(after)),
        _rms_percent(held.before),
        _rms_percent(held.after),
    )


def _residuals(problem: GapProblem, fit: Fit, folds: BoolArray) -> FloatArray:
    frequencies = problem.observations.design.frequencies
    predicted = refitted(problem, fit, ~folds)[:, :frequencies]
    residual = problem.observations.value[:frequencies] - predicted
    left = np.full_like(residual, NAN)
    for fold, out in enumerate(folds):
        # What repeats in all frequencies is known by those that are kept.
        kept = fit.noise.frequency[np.ix_(~out, ~out)]
        across = problem.repeated.frequency[np.ix_(out, ~out)]
        left[fold, out] = residual[fold, out] - across @ np.linalg.solve(kept, residual[fold, ~out])
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


def _in_turn(design: Design, after: Fit | None, rng: np.random.Generator) -> BoolArray:
    """Return folds (folds, F) over orders and over tests that leave enough to fit."""
    folds = np.array([*_over_orders(design), *_over_tests(design, after, rng)], dtype=bool)
    folds = folds.reshape(-1, design.frequencies)
    kept = np.sum(~folds, axis=1)
    enough = kept >= (_FEWEST - 1 if design.frequencies >= _FEWEST else design.frequencies + 1)
    return np.asarray(folds[enough & folds.any(axis=1)])


def _over_orders(design: Design) -> list[BoolArray]:
    """Return folds of the orders between the lowest and the highest, or of these alone.

    What acts on the lowest order alone, as sag does, cannot be known without it.
    """
    orders = np.unique(design.frequency_order)
    inner = orders[1:-1] if len(orders) > 2 else orders
    folds = [inner[fold::_ORDER_FOLDS] for fold in range(min(_ORDER_FOLDS, len(inner)))]
    return [np.asarray(np.isin(design.frequency_order, fold)) for fold in folds]


def _over_tests(design: Design, after: Fit | None, rng: np.random.Generator) -> list[BoolArray]:
    """Return folds of a test each, or of a few where there are many."""
    conditions = design.conditions
    bound = set() if after is None else {v.test for _, v in after.hypothesis.effects}
    candidates = [t for t, each in enumerate(conditions) if each.test not in bound]
    candidates = [t for t in candidates if _still_varied(conditions, (t,))]
    if len(set(map(_circumstances, conditions))) == 1:
        return []
    shuffled = rng.permutation(candidates).astype(int)
    groups = [shuffled[i::_TEST_FOLDS] for i in range(min(_TEST_FOLDS, len(shuffled)))]
    whole = [group for group in groups if _still_varied(conditions, tuple(group))]
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


def _first(residual: FloatArray) -> FloatArray:
    percent = np.full(residual.shape[1], NAN)
    for fold in residual[::-1]:
        percent = np.where(np.isfinite(fold), 100 * np.expm1(fold), percent)
    return percent


def _rms_percent(residual: FloatArray) -> float:
    known = residual[np.isfinite(residual)]
    return float(100 * np.sqrt(np.mean(np.expm1(known) ** 2))) if known.size else NAN


# Numerical, as Gauss-Newton steps converge: 0.05 of a standard deviation is no error to speak of.
_STEPS, _STEP_IN_SDS, _SHORTER = 6, 0.05, 0.3


def refitted(problem: GapProblem, fit: Fit, kept: BoolArray) -> FloatArray:
    """Return predictions (folds, data) of `fit` refitted to the frequencies `kept` (folds, F).

    A shape goes with its frequency. The slopes and the sizes of unknown errors are those of the
    full fit; the predictions are computed anew in every step, for all folds at once. A step that
    does not lower the misfit is taken back and tried shorter.
    """
    value, parts = problem.observations.value, [_part(problem.design, fit, each) for each in kept]

    def misfits(z: FloatArray, predicted: FloatArray) -> FloatArray:
        return np.array(
            [
                errors.squares((value - there)[None, rows])[0, 0] + point @ point
                for (rows, errors), point, there in zip(parts, z, predicted, strict=True)
            ]
        )

    z, predicted = (np.tile(each, (len(parts), 1)) for each in (fit.z, fit.predicted))
    misfit, length = misfits(z, predicted), np.ones(len(parts))
    for _ in range(_STEPS):
        found = [
            errors.linear(fit.slopes[rows], (value - there)[rows], point)
            for (rows, errors), point, there in zip(parts, z, predicted, strict=True)
        ]
        steps = length[:, None] * np.array([step for _, step, *_ in found])
        squares = [step @ inner @ step for (inner, *_), step in zip(found, steps, strict=True)]
        if max(squares) <= _STEP_IN_SDS**2:
            break
        there = problem.predict(fit.hypothesis, z + steps)
        tried = misfits(z + steps, there)
        better = tried < misfit
        z = np.where(better[:, None], z + steps, z)
        predicted = np.where(better[:, None], there, predicted)
        misfit = np.where(better, tried, misfit)
        length = np.where(better, 1.0, _SHORTER * length)
    return predicted


def _part(design: Design, fit: Fit, kept: BoolArray) -> tuple[IntArray, Likelihood]:
    """Return the rows of the data that stay, with their errors."""
    frequency, shape = np.flatnonzero(kept), np.flatnonzero(kept[design.shape_mode])
    errors = Likelihood.of(fit.noise.part(frequency, shape), fit.model_error)
    return np.concatenate([frequency, design.frequencies + shape]), errors
