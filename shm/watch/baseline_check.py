"""Mistaken modes and tests among those of a baseline, and whether the baseline fits at all.

A baseline that holds a mistake is wrong for years: its posterior follows it, and later tests fit it
no better than it fits itself. Tests are checked against each other, mode by mode; where there are
too few, against what the description allows.

The tests of a baseline beside each other, mode by mode.

Tests of one baseline may differ in what a hanger does: its tension, the stiffness of its ends, and
what all frequencies have in common, the clock of the logger and the warmth of the steel. Stiff
bars' modes move unequally with these. They are fitted to each test, by the slopes of a model class
at the state that the tests have in the median; what no such difference explains is mistaken.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.assumptions import Assumptions
from shm.models import Model
from shm.models.base import Conditions
from shm.values import (
    BaselineCheck,
    BoolArray,
    FloatArray,
    IntArray,
    MistakenMode,
    MistakenTest,
    ModalTest,
    Mode,
)
from shm.watch.baseline_state import (
    Key,
    Quantities,
    fit_description,
    known_modes,
    places,
    typical_parameters,
)
from shm.watch.mistaken_modes import MOST_MISTAKEN, SoundModes, log_mixture, sound_modes

_ROUNDS = 3  # technical: of "what is mistaken" and "where the others lie"
_MAD = 1.4826  # of a normal law
# Mode by mode two tests of one state differ by more than is stated: judgement, as in readings.
_SCATTER = 1e-3
# Of a log frequency: what a mode of its own may do from test to test (a joint, a sensor) is less.
_LEAST = 0.006
_FAR = 6.0  # robust standard deviations
# What the level of a mode may be off the model by: a bar as made, sag and fittings; its tail is
# heavy, so that a mode which most tests agree on is theirs however odd. Judgement.
_LEVEL_SD, _HEAVY = 0.02, 2.0
# Judgement, standard deviations of what tests of one baseline differ by: seasons and traffic move
# a tension by less, a joint that settles an end by less than a factor of two.
_TENSION_SD, _DECADES_SD = 0.1, 0.3
_COMMON_SD = 1e-3  # judgement: what sensors and the clock do to all frequencies alike
# A whole test is another hanger's, or by a wrong clock: by this all its modes may be off alike.
_WRONG_CLOCK_SD = 0.05
_LEAST_TENSION_SD, _LEAST_DECADES_SD = 0.01, 0.03  # judgement: a day's traffic and warmth do it
_LEAST_CLOCK = 0.007  # judgement: below, warmth and sensors do as much
_WRONG_TEST = 0.003  # of tests, judgement: a wrong hanger or clock
ENOUGH = 3
"""Tests from which on the odd one can be told: of two that differ, neither is."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """One test: its modes' places among the keys, what of them is sound, and by what it differs.

    `expected` (modes,) are log frequencies by the sound ones; `modes.x` (q,) is what the test
    differs by from the median one: in common, in log tension, and in decades of each spring.
    `linear` are log frequencies (modes,), slopes (modes, q) and variance (modes,) about there,
    `of_median` the same about the median test.
    """

    at: IntArray
    expected: FloatArray
    modes: SoundModes
    linear: tuple[FloatArray, FloatArray, FloatArray]
    of_median: tuple[FloatArray, FloatArray, FloatArray]
    common_sd: float

    @property
    def off(self) -> float:
        """By what its log frequencies are off the median test's, in the median."""
        return float(np.median(self.of_median[0])) if len(self.at) else 0.0

    @property
    def fits_no_state(self) -> bool:
        """Whether its modes fit none of the other tests', more than may be mistaken."""
        if not self.modes.is_misfit:
            return False
        off, slopes, _ = self.linear
        is_far = np.abs(off - slopes @ self.modes.x) > _LEAST
        return bool(is_far.sum() > MOST_MISTAKEN * len(self.at))

    def common_shift(self, spread: FloatArray) -> float:
        """By what all log frequencies are off alike, 0 where the tension explains it as well.

        `spread` (q,) is what the other tests differ by among themselves: where their ends keep
        still, an odd test is not explained by its ends; where their tensions do not, a little that
        is common to all frequencies may be theirs, too.
        """
        tension, clock = spread.copy(), spread.copy()
        tension[:2], clock[0] = (self.common_sd, _TENSION_SD), _WRONG_CLOCK_SD
        by_tension = sound_modes(*self.linear, 1 / tension**2)
        by_clock = sound_modes(*self.of_median, 1 / clock**2)
        odds = math.log(_WRONG_TEST / (1 - _WRONG_TEST))
        likelier = by_clock.log_evidence + odds > by_tension.log_evidence
        by_spread = float(np.median(self.of_median[1][:, 1])) * spread[1] if len(self.at) else 0.0
        least = max(_LEAST_CLOCK, by_spread)
        common = float(by_clock.x[0])
        return common if likelier and abs(common) > least else 0.0


class Comparison:
    """The tests of a baseline about a common level of each mode (keys,), robustly."""

    def __init__(self, tests: Sequence[ModalTest], model: Model):
        self.tests, self.model = tests, model
        counts: dict[Key, int] = {}
        for test in tests:
            for mode in known_modes(test):
                counts[mode.plane, mode.order] = counts.get((mode.plane, mode.order), 0) + 1
        self.keys = sorted(key for key, count in counts.items() if count >= ENOUGH)
        self.counts = np.array([counts[key] for key in self.keys])
        kelvin = np.array([test.temperature_c for test in tests])
        kelvin = np.abs(kelvin - np.nanmedian(kelvin)) if np.isfinite(kelvin).any() else kelvin
        assumed = model.hanger.assumptions
        kelvin = np.where(np.isfinite(kelvin), kelvin, assumed.unknown_temperature_sd_k.value)
        # A frequency goes with the root of the modulus.
        per_kelvin = assumed.modulus_per_kelvin.value / 2
        self.common_sd = np.hypot(_COMMON_SD, per_kelvin * kelvin)
        self.table = np.full((len(tests), len(self.keys)), np.nan)
        self.variance = np.full_like(self.table, np.nan)
        for row, errors, test in zip(self.table, self.variance, tests, strict=True):
            for mode in known_modes(test):
                if (mode.plane, mode.order) in self.keys:
                    at = self.keys.index((mode.plane, mode.order))
                    row[at], errors[at] = math.log(mode.frequency_hz), _variance_of(mode, assumed)

    def fitted(self) -> list[Fitted]:
        """Each test, what all have in common being the median of what they differ by."""
        planes, orders = places(self.keys)
        level = np.nanmedian(self.table, axis=0)
        base = typical_parameters(self.model, level, planes, orders)
        quantities = Quantities(self.model, base, planes, orders)
        moved = [np.zeros(quantities.count)] * len(self.tests)
        level = self._median_polish(quantities)
        spread = _SCATTER
        for _ in range(_ROUNDS):
            found = [
                self._fit(n, quantities, moved[n], level, spread) for n in range(len(self.tests))
            ]
            moved = [each.modes.x for each in found]
            predicted = np.array(
                [
                    quantities.log_frequency(x, self.model.conditions(test))
                    for x, test in zip(moved, self.tests, strict=True)
                ]
            )
            level, off = self._levels(self.table - predicted, spread)
            spread = max(_SCATTER, _MAD * float(np.nanmedian(np.abs(off))))
        return found

    def _levels(self, off: FloatArray, spread: float) -> tuple[FloatArray, FloatArray]:
        """Of what tests are off from the model (tests, keys): the level of each mode, and what is
        left of the tests that share it, NaN of others.

        The level is that of the test which most others join, weighed with how far off the model
        it is: where two of three tests have a mode wrong, the third may still be right.
        """
        apart = off[None] - off[:, None]
        variance = 2 * (self.variance + spread**2)
        joins = np.where(np.isfinite(apart), log_mixture(apart, variance), 0.0).sum(axis=1)
        centre = np.nanmedian(off)
        score = joins - _HEAVY * np.log1p(((off - centre) / _LEVEL_SD) ** 2)
        chosen = np.nanargmax(np.where(np.isfinite(off), score, -np.inf), axis=0)
        near = np.abs(off - off[chosen, np.arange(off.shape[1])]) < max(_LEAST, _FAR * spread)
        shared = np.where(near, off, np.nan)
        level = np.nanmedian(shared, axis=0)
        return level, shared - level

    def _median_polish(self, quantities: Quantities) -> FloatArray:
        """Return the level of each mode once the tension of each test is taken off: by medians."""
        slopes = quantities.slopes(np.zeros(quantities.count), Conditions())[:, 1]
        slopes = np.maximum(slopes, 0.05)  # technical: a mode that no tension moves says nothing
        tension = np.zeros(len(self.tests))
        for _ in range(2 * _ROUNDS):
            level = np.nanmedian(self.table - tension[:, None] * slopes, axis=0)
            shifts = (self.table - level) / slopes
            tension = np.array([_median_or_0(row) for row in shifts])
            tension = tension - np.median(tension)
        here = quantities.log_frequency(np.zeros(quantities.count), Conditions())
        return np.asarray(level - here)

    def _fit(
        self, n: int, quantities: Quantities, x: FloatArray, level: FloatArray, spread: float
    ) -> Fitted:
        at = np.flatnonzero(np.isfinite(self.table[n]))
        conditions = self.model.conditions(self.tests[n])
        slopes = quantities.slopes(x, conditions)[at]
        here = quantities.log_frequency(x, conditions)[at] + level[at]
        off = self.table[n, at] - here + slopes @ x
        # A median of n is off by 1.25 standard deviations over the root of n.
        variance = (self.variance[n, at] + spread**2) * (1 + 1.57 / self.counts[at])
        sd = np.array([self.common_sd[n], _TENSION_SD, *[_DECADES_SD] * (quantities.count - 2)])
        modes = sound_modes(off, slopes, variance, 1 / sd**2)
        expected = here + slopes @ (modes.x - x)
        is_far = np.abs(self.table[n, at] - expected) > _LEAST
        modes = replace(modes, sound=modes.sound | ~is_far)
        still = np.zeros(len(x))
        median = quantities.log_frequency(still, conditions)[at] + level[at]
        of_median = self.table[n, at] - median, quantities.slopes(still, conditions)[at]
        return Fitted(
            at,
            expected,
            modes,
            (off, slopes, variance),
            (*of_median, variance),
            float(self.common_sd[n]),
        )


def spread_of(states: FloatArray) -> FloatArray:
    """What tests (n, q) differ by, robustly: at least what they surely may, at most what any do."""
    q = states.shape[1]
    least = np.array([_COMMON_SD, _LEAST_TENSION_SD, *[_LEAST_DECADES_SD] * (q - 2)])
    most = np.array([_COMMON_SD, _TENSION_SD, *[_DECADES_SD] * (q - 2)])
    found = _MAD * np.median(np.abs(states - np.median(states, axis=0)), axis=0)
    # Of four tests the spread is hardly known: in one of ten it seems a third of what it is.
    return np.asarray(np.clip(3 * found, least, most))


def _variance_of(mode: Mode, assumed: Assumptions) -> float:
    sd = mode.frequency_sd_hz / mode.frequency_hz
    return sd**2 if sd > 0 and math.isfinite(sd) else assumed.unstated_frequency_sd.value**2


def _median_or_0(row: FloatArray) -> float:
    return float(np.nanmedian(row)) if np.isfinite(row).any() else 0.0


_ENOUGH_OF_TESTS = 4  # of three states of a hanger, two alike may be chance
_MOST_TENSION = 0.35  # judgement: twice 15 %, which tests of one baseline may lie apart
_OFF = 0.04  # judgement: no bar as made is as far off its class in one mode alone
_FIT_NO_STATE = "fit no tension and no end stiffness that the description allows"
_FEWEST = 5  # modes of a test: fewer leave nothing to tell the odd one by


def check_baseline(tests: Sequence[ModalTest], model: Model) -> BaselineCheck:
    """Return what is mistaken among the tests of a baseline, and whether they fit.

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
    _, off = fit_description(comparison.model, level, planes, orders, Conditions())
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
    _, off = fit_description(model, measured, planes, orders, model.conditions(test))
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
