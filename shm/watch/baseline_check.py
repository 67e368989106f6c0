"""Mistaken modes among the tests of a baseline: another order, the other plane's, a machine's tone.

A baseline that holds one is wrong for years: its posterior follows the mistake, and later tests fit
it no better than it fits itself. Tests are checked against each other, mode by mode; where there
are too few, against what the description allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.models import Model
from shm.models.base import Conditions
from shm.values import PLANES, BoolArray, FloatArray, IntArray, ModalTest, Mode, Plane

_ENOUGH = 3  # tests: of two that differ, none is the odd one
_ROUNDS = 3  # technical: medians of what is common to a test, and to a mode
_MAD = 1.4826  # of a normal law
_FAR = 6.0  # robust standard deviations
# Of a log frequency: what a mode of its own may do from test to test (a joint, a sensor) is less.
_LEAST = 0.006
_DRAWS = 4000  # of the description: technical, refined below
_NARROWER = (0.3, 0.1, 0.03)  # technical: of the prior's range, about the best draw
_MODEL_SD = 0.01  # judgement: of a frequency, a class beside a bar as made
_MISTAKEN, _RANGE = 0.05, 0.7  # share of modes, and what one is off by in log frequency
_OFF = 0.04  # judgement: no bar as made is as far off its class in one mode alone
_FEWEST = 5  # modes in a plane-wise row: fewer leave nothing to tell the odd one by


@dataclass(frozen=True)
class MistakenMode:
    """A mode that is left out of a baseline: in `test`, measured and as it was expected, in Hz."""

    test: str
    plane: str
    order: int
    measured_hz: float
    expected_hz: float

    def __str__(self) -> str:
        return (
            f"{self.plane} {self.order} of test {self.test}: {self.measured_hz:.4g} Hz, expected "
            f"about {self.expected_hz:.4g} Hz"
        )


def without_mistaken(
    tests: Sequence[ModalTest], model: Model
) -> tuple[tuple[ModalTest, ...], tuple[MistakenMode, ...]]:
    """The tests without the modes that are mistaken, and those.

    `model` is any class of the hanger that is fast; it is asked only where there are fewer than
    three tests.
    """
    if len(tests) >= _ENOUGH:
        return _against_each_other(tests)
    kept: list[ModalTest] = []
    found: list[MistakenMode] = []
    for test in tests:
        sound, mistaken = _against_description(test, model)
        kept.append(sound)
        found += mistaken
    return tuple(kept), tuple(found)


def _against_each_other(
    tests: Sequence[ModalTest],
) -> tuple[tuple[ModalTest, ...], tuple[MistakenMode, ...]]:
    keys = sorted({(m.plane, m.order) for test in tests for m in _known(test)})
    if not keys:
        return tuple(tests), ()
    table = np.full((len(tests), len(keys)), np.nan)
    for row, test in zip(table, tests, strict=True):
        for mode in _known(test):
            row[keys.index((mode.plane, mode.order))] = math.log(mode.frequency_hz)
    level, common = _levels(table)
    off = table - level - common[:, None]
    spread = max(_MAD * float(np.nanmedian(np.abs(off))), _LEAST / _FAR)
    is_odd = np.abs(off) > _FAR * spread
    is_odd &= np.isfinite(table).sum(axis=0) >= _ENOUGH
    kept: list[ModalTest] = []
    found: list[MistakenMode] = []
    for n, test in enumerate(tests):
        expected = dict(zip(keys, np.exp(level + common[n]).tolist(), strict=True))
        odd = {key for key, is_one in zip(keys, is_odd[n].tolist(), strict=True) if is_one}
        sound, mistaken = _split(test, odd, expected)
        kept.append(sound)
        found += mistaken
    return tuple(kept), tuple(found)


def _levels(table: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The level of each mode (modes,) and what is common to a test (tests,): median polish."""
    common = np.zeros(len(table))
    level = np.nanmedian(table, axis=0)
    for _ in range(_ROUNDS):
        rest = table - level
        common = np.array([np.nanmedian(row) if np.isfinite(row).any() else 0.0 for row in rest])
        level = np.nanmedian(table - common[:, None], axis=0)
    return level, common


def _against_description(
    test: ModalTest, model: Model
) -> tuple[ModalTest, tuple[MistakenMode, ...]]:
    modes = _known(test)
    if len(modes) < _FEWEST:
        return test, ()
    planes = np.array([PLANES.index(mode.plane) for mode in modes])
    orders = np.array([mode.order - 1 for mode in modes])
    measured = np.log([mode.frequency_hz for mode in modes])
    conditions = model.conditions(test)
    rng = np.random.default_rng(0)
    lower, upper = model.prior.lower, model.prior.upper
    theta = lower + (upper - lower) * rng.random((_DRAWS, len(lower)))
    best, off = _best(model, theta, measured, planes, orders, conditions)
    for width in _NARROWER:
        near = best + width * (upper - lower) * rng.uniform(-1, 1, (_DRAWS // 4, len(lower)))
        theta = np.vstack([best, np.clip(near, lower, upper)])
        best, off = _best(model, theta, measured, planes, orders, conditions)
    is_odd: BoolArray = np.abs(off) > _OFF
    if is_odd.sum() > len(modes) / 3:
        return test, ()
    expected = {
        (mode.plane, mode.order): float(hz)
        for mode, hz in zip(modes, np.exp(measured - off), strict=True)
    }
    odd = {(m.plane, m.order) for m, is_one in zip(modes, is_odd.tolist(), strict=True) if is_one}
    return _split(test, odd, expected)


def _best(
    model: Model,
    theta: FloatArray,
    measured: FloatArray,
    planes: IntArray,
    orders: IntArray,
    conditions: Conditions,
) -> tuple[FloatArray, FloatArray]:
    """The likeliest of parameter sets, a few modes being mistaken, and what it is off by."""
    found = model.frequencies_at(theta, int(orders.max()) + 1, conditions)
    off = measured - np.log(found[:, planes, orders])
    good = np.log(1 - _MISTAKEN) - (off / _MODEL_SD) ** 2 / 2 - np.log(2 * np.pi * _MODEL_SD**2) / 2
    total = np.logaddexp(good, np.log(_MISTAKEN / _RANGE)).sum(axis=1)
    at = int(np.nanargmax(total))
    return theta[at], off[at]


def _split(
    test: ModalTest, odd: set[tuple[Plane, int]], expected: dict[tuple[Plane, int], float]
) -> tuple[ModalTest, tuple[MistakenMode, ...]]:
    if not odd:
        return test, ()
    mistaken = tuple(
        MistakenMode(test.id, m.plane, m.order, m.frequency_hz, expected[m.plane, m.order])
        for m in _known(test)
        if (m.plane, m.order) in odd
    )
    modes = tuple(mode for mode in test.modes if (mode.plane, mode.order) not in odd)
    return replace(test, modes=modes), mistaken


def _known(test: ModalTest) -> list[Mode]:
    return [mode for mode in test.regular_modes if mode.frequency_hz > 0]
