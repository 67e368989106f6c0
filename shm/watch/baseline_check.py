"""Mistaken modes and tests among those of a baseline, and whether the baseline fits at all.

A baseline that holds a mistake is wrong for years: its posterior follows it, and later tests fit it
no better than it fits itself. Tests are checked against each other, mode by mode; where there are
too few, against what the description allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.models import Model
from shm.models.base import Conditions
from shm.values import BaselineCheck, BoolArray, MistakenMode, MistakenTest, ModalTest
from shm.watch.baseline_comparison import ENOUGH, Comparison, Fitted, spread_of
from shm.watch.baseline_state import Key, best_of, known_modes, places
from shm.watch.mistaken_modes import MOST_MISTAKEN

_ENOUGH_OF_TESTS = 4  # of three states of a hanger, two alike may be chance
_MOST_TENSION = 0.35  # judgement: twice 15 %, which tests of one baseline may lie apart
_OFF = 0.04  # judgement: no bar as made is as far off its class in one mode alone
_FIT_NO_STATE = "fit no tension and no end stiffness that the description allows"
_FEWEST = 5  # modes of a test: fewer leave nothing to tell the odd one by


def check_baseline(tests: Sequence[ModalTest], model: Model) -> BaselineCheck:
    """What is mistaken among the tests of a baseline, and whether they fit.

    `model` is any class of the hanger that is fast.
    """
    if not any(known_modes(test) for test in tests):
        return BaselineCheck(unchecked="no test has a mode that a tension is inferred from")
    if len(tests) >= ENOUGH:
        return _against_each_other(tests, model)
    checks = [_against_description(test, model) for test in tests]
    return BaselineCheck(
        modes=tuple(mode for each in checks for mode in each.modes),
        misfit=next((each.misfit for each in checks if each.misfit), ""),
        unchecked=next((each.unchecked for each in checks if each.unchecked), ""),
    )


def _against_each_other(tests: Sequence[ModalTest], model: Model) -> BaselineCheck:
    comparison = Comparison(tests, model)
    if not comparison.keys:
        return BaselineCheck(unchecked="no mode is measured in three of its tests")
    found = comparison.fitted()
    out = _mistaken_tests(tests, found)
    gone = {each.test for each in out}
    modes = tuple(
        mistaken
        for test, each in zip(tests, found, strict=True)
        if test.id not in gone
        for mistaken in _mistaken_modes(test, each, comparison.keys)
    )
    misfit = _misfit(tests, modes, out) or _off_in_all(comparison)
    return BaselineCheck(modes, out, misfit)


def _mistaken_tests(
    tests: Sequence[ModalTest], found: Sequence[Fitted]
) -> tuple[MistakenTest, ...]:
    if len(tests) < _ENOUGH_OF_TESTS:
        return ()
    out = []
    states = np.array([each.modes.x for each in found])
    for n, (test, each) in enumerate(zip(tests, found, strict=True)):
        others = np.delete(states, n, axis=0)
        shift = float(each.modes.x[1] - np.median(others[:, 1]))
        if each.common_shift(spread_of(others)):
            percent = 100 * math.expm1(each.off)
            why = (
                f"all its frequencies are off the other tests' alike, by {percent:+.1f} %: another "
                "hanger, or a wrong clock"
            )
            out.append(MistakenTest(test.id, why))
        elif abs(shift) > _MOST_TENSION:
            out.append(
                MistakenTest(
                    test.id,
                    f"its tension would be {100 * math.expm1(shift):+.0f} % off the other tests': "
                    "another hanger",
                )
            )
        elif each.fits_no_state:
            out.append(MistakenTest(test.id, "its modes fit none of the other tests'"))
    return tuple(out)


def _mistaken_modes(test: ModalTest, found: Fitted, keys: Sequence[Key]) -> list[MistakenMode]:
    measured = {(mode.plane, mode.order): mode.frequency_hz for mode in known_modes(test)}
    rows = zip(found.at.tolist(), found.expected.tolist(), found.modes.sound.tolist(), strict=True)
    wrong = [(*keys[at], expected) for at, expected, sound in rows if not sound]
    return [
        MistakenMode(test.id, plane, order, measured[plane, order], math.exp(expected))
        for plane, order, expected in wrong
    ]


def _misfit(
    tests: Sequence[ModalTest], modes: Sequence[MistakenMode], out: Sequence[MistakenTest]
) -> str:
    """More than a third of the tests, or of the modes of the others."""
    if len(out) > MOST_MISTAKEN * len(tests):
        return f"{len(out)} of its {len(tests)} tests do not agree with the others"
    gone = {each.test for each in out}
    count = sum(len(known_modes(test)) for test in tests if test.id not in gone)
    if len(modes) > MOST_MISTAKEN * count:
        return f"{len(modes)} of its {count} modes do not agree from test to test"
    return ""


def _off_in_all(comparison: Comparison) -> str:
    """Which modes no description allows, though the tests agree on them; empty where none."""
    planes, orders = places(comparison.keys)
    level = np.nanmedian(comparison.table, axis=0)
    _, off = best_of(comparison.model, level, planes, orders, Conditions())
    odd = [
        (key, each)
        for key, each in zip(comparison.keys, off.tolist(), strict=True)
        if abs(each) > _OFF
    ]
    if len(odd) > MOST_MISTAKEN * len(comparison.keys):
        return f"{len(odd)} of the {len(comparison.keys)} modes of its tests {_FIT_NO_STATE}"
    if not odd or len(comparison.keys) < _FEWEST:
        return ""
    (plane, order), worst = max(odd, key=lambda each: abs(each[1]))
    return (
        f"{plane} {order} of all its tests is {100 * math.expm1(worst):+.0f} % off what the "
        "other modes and the description allow"
    )


def _against_description(test: ModalTest, model: Model) -> BaselineCheck:
    modes = known_modes(test)
    if len(modes) < _FEWEST:
        return BaselineCheck(
            unchecked=f"test {test.id} has {len(modes)} modes, and at least {_FEWEST} are needed"
        )
    planes, orders = places([(mode.plane, mode.order) for mode in modes])
    measured = np.log([mode.frequency_hz for mode in modes])
    _, off = best_of(model, measured, planes, orders, model.conditions(test))
    is_odd: BoolArray = np.abs(off) > _OFF
    if is_odd.sum() > MOST_MISTAKEN * len(modes):
        return BaselineCheck(
            misfit=f"{is_odd.sum()} of the {len(modes)} modes of test {test.id} {_FIT_NO_STATE}"
        )
    mistaken = tuple(
        MistakenMode(test.id, mode.plane, mode.order, mode.frequency_hz, float(hz))
        for mode, hz, odd in zip(modes, np.exp(measured - off), is_odd.tolist(), strict=True)
        if odd
    )
    return BaselineCheck(mistaken)
