"""Mistaken modes and tests among those of a baseline, and whether the baseline fits at all.

A baseline that holds a mistake is wrong for years: its posterior follows it, and later tests fit it
no better than it fits itself. Tests are checked against each other, mode by mode; where there are
too few, against what the description allows.

Tests of one baseline may differ in what a hanger does: its tension, the stiffness of its ends, and
what all frequencies have in common, the clock of the logger and the warmth of the steel. Stiff
bars' modes move unequally with these. They are fitted to each test, by the slopes of a model class
at the state that the tests have in the median; what no such difference explains is mistaken.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.models import Model
from shm.models.base import Conditions
from shm.values import (
    PLANES,
    BaselineCheck,
    BoolArray,
    FloatArray,
    IntArray,
    MistakenMode,
    MistakenTest,
    ModalTest,
    Mode,
)
from shm.watch.mistaken_modes import MOST_MISTAKEN, SoundModes, log_mixture, sound_modes
from shm.watch.quantities import MeasuredMode

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
_ENOUGH = 3  # tests from which on the odd mode can be told: of two that differ, neither is
_ENOUGH_OF_TESTS = 4  # of three states of a hanger, two alike may be chance
_MOST_TENSION = 0.35  # judgement: twice 15 %, which tests of one baseline may lie apart
_OFF = 0.04  # judgement: no bar as made is as far off its class in one mode alone
_FEWEST = 5  # modes of a test: fewer leave nothing to tell the odd one by
_FIT_NO_STATE = "fit no tension and no end stiffness that the description allows"

_TENSION_STEP, _DECADES_STEP = 0.02, 0.1  # technical: of finite differences
_FARTHEST_TENSION, _FARTHEST_DECADES = 0.4, 1.0  # technical: beyond it nothing is linearised
_DRAWS = 4000  # of the description: technical, refined below
_NARROWER = (0.3, 0.1, 0.03)  # technical: of the prior's range, about the best draw
_SPRING, _FELT = "log10_k", 3.0  # of the stiffness of a wave: a spring that bends with the bar
_TENSION_RANGE, _TENSIONS = (0.3, 2.5), 60  # of the nominal one; technical
_MODEL_SD = 0.01  # judgement: of a frequency, a class beside a bar as made


def known_modes(test: ModalTest) -> list[Mode]:
    """Return the modes that a tension is inferred from."""
    return [mode for mode in test.regular_modes if mode.frequency_hz > 0]


def check_baseline(tests: Sequence[ModalTest], model: Model) -> BaselineCheck:
    """Return what is mistaken among the tests of a baseline, and whether they fit.

    `model` is any class of the hanger that is fast.
    """
    if not any(known_modes(test) for test in tests):
        return BaselineCheck(unchecked="no test has a mode that a tension is inferred from")
    if len(tests) >= _ENOUGH:
        return _against_each_other(tests, model)
    checks = [_against_description(test, model) for test in tests]
    return BaselineCheck(
        modes=tuple(mode for each in checks for mode in each.modes),
        misfit=next((each.misfit for each in checks if each.misfit), ""),
        unchecked=next((each.unchecked for each in checks if each.unchecked), ""),
    )


def _against_description(test: ModalTest, model: Model) -> BaselineCheck:
    modes = known_modes(test)
    if len(modes) < _FEWEST:
        return BaselineCheck(
            unchecked=f"test {test.id} has {len(modes)} modes, and at least {_FEWEST} are needed"
        )
    at = _Modes.of([(mode.plane, mode.order) for mode in modes], model, model.conditions(test))
    measured = np.log([mode.frequency_hz for mode in modes])
    off = at.off_description(measured)
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


def _against_each_other(tests: Sequence[ModalTest], model: Model) -> BaselineCheck:
    comparison = _Comparison(tests, model)
    if not comparison.keys:
        return BaselineCheck(unchecked="no mode is measured in three of its tests")
    found = comparison.fitted()
    out = _mistaken_tests(tests, found) if len(tests) >= _ENOUGH_OF_TESTS else ()
    gone = {each.test for each in out}
    rest = [(test, each) for test, each in zip(tests, found, strict=True) if test.id not in gone]
    modes = []
    for test, each in rest:
        measured = {(mode.plane, mode.order): mode.frequency_hz for mode in known_modes(test)}
        for at, expected, is_sound in zip(each.at, each.expected, each.modes.sound, strict=True):
            if not is_sound:
                plane, order = key = comparison.keys[at]
                wrong = MistakenMode(test.id, plane, order, measured[key], math.exp(expected))
                modes.append(wrong)
    count, misfit = sum(len(known_modes(test)) for test, _ in rest), ""
    if len(out) > MOST_MISTAKEN * len(tests):
        misfit = f"{len(out)} of its {len(tests)} tests do not agree with the others"
    elif len(modes) > MOST_MISTAKEN * count:
        misfit = f"{len(modes)} of its {count} modes do not agree from test to test"
    return BaselineCheck(tuple(modes), out, misfit or comparison.off_in_all())


def _mistaken_tests(
    tests: Sequence[ModalTest], found: Sequence[_Fitted]
) -> tuple[MistakenTest, ...]:
    out = []
    states = np.array([each.modes.x for each in found])
    for n, (test, each) in enumerate(zip(tests, found, strict=True)):
        others = np.delete(states, n, axis=0)
        shift = float(each.modes.x[1] - np.median(others[:, 1]))
        why = ""
        if each.common_shift(_spread_of(others)):
            why = (
                "all its frequencies are off the other tests' alike, by "
                f"{100 * math.expm1(each.off):+.1f} %: another hanger, or a wrong clock"
            )
        elif abs(shift) > _MOST_TENSION:
            why = (
                f"its tension would be {100 * math.expm1(shift):+.0f} % off the other tests': "
                "another hanger"
            )
        elif each.fits_no_state:
            why = "its modes fit none of the other tests'"
        out += [MistakenTest(test.id, why)] if why else []
    return tuple(out)


def _spread_of(states: FloatArray) -> FloatArray:
    """Return what tests (n, q) differ by, robustly: between what they surely and at most may."""
    ends = states.shape[1] - 2
    least = np.array([_COMMON_SD, _LEAST_TENSION_SD, *[_LEAST_DECADES_SD] * ends])
    most = np.array([_COMMON_SD, _TENSION_SD, *[_DECADES_SD] * ends])
    found = _MAD * np.median(np.abs(states - np.median(states, axis=0)), axis=0)
    # Of four tests the spread is hardly known: in one of ten it seems a third of what it is.
    return np.asarray(np.clip(3 * found, least, most))


@dataclass(frozen=True, eq=False)
class _Fitted:
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
        """Return True if its modes fit none of the other tests', more than may be mistaken."""
        off, slopes, _ = self.linear
        is_far = np.abs(off - slopes @ self.modes.x) > _LEAST
        return self.modes.is_misfit and bool(is_far.sum() > MOST_MISTAKEN * len(self.at))

    def common_shift(self, spread: FloatArray) -> float:
        """Return by what all log frequencies are off alike, 0 where the tension explains it.

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
        common = float(by_clock.x[0])
        return common if likelier and abs(common) > max(_LEAST_CLOCK, by_spread) else 0.0


class _Comparison:
    """The tests of a baseline about a common level of each mode (keys,), robustly."""

    def __init__(self, tests: Sequence[ModalTest], model: Model):
        self.tests, self.model = tests, model
        every = [(mode.plane, mode.order) for test in tests for mode in known_modes(test)]
        self.keys = sorted(key for key in set(every) if every.count(key) >= _ENOUGH)
        self.counts = np.array([every.count(key) for key in self.keys])
        kelvin = np.array([test.temperature_c for test in tests])
        kelvin = np.abs(kelvin - np.nanmedian(kelvin)) if np.isfinite(kelvin).any() else kelvin
        assumed = model.hanger.assumptions
        kelvin = np.where(np.isfinite(kelvin), kelvin, assumed.unknown_temperature_sd_k.value)
        # A frequency goes with the root of the modulus.
        self.common_sd = np.hypot(_COMMON_SD, assumed.modulus_per_kelvin.value / 2 * kelvin)
        self.table = np.full((len(tests), len(self.keys)), np.nan)
        self.variance = np.full_like(self.table, np.nan)
        for row, errors, test in zip(self.table, self.variance, tests, strict=True):
            for mode in known_modes(test):
                if (mode.plane, mode.order) in self.keys:
                    at = self.keys.index((mode.plane, mode.order))
                    sd = mode.frequency_sd_hz / mode.frequency_hz
                    is_stated = sd > 0 and math.isfinite(sd)
                    row[at] = math.log(mode.frequency_hz)
                    errors[at] = (sd if is_stated else assumed.unstated_frequency_sd.value) ** 2
        self.at = _Modes.of(self.keys, model)

    def fitted(self) -> list[_Fitted]:
        """Fit each test, what all have in common being the median of what they differ by."""
        middle = np.nanmedian(self.table, axis=0)
        bar = _Bar(self.at, self.at.typical_parameters(middle))
        still, spread = np.zeros(bar.count), _SCATTER
        moved, level = [still] * len(self.tests), middle - bar.log_frequency(still, Conditions())
        # Technical: of "what is mistaken" and "where the others lie"
        for _ in range(3):
            found = [self._fit(n, bar, moved[n], level, spread) for n in range(len(self.tests))]
            moved = [each.modes.x for each in found]
            predicted = [
                bar.log_frequency(x, self.model.conditions(test))
                for x, test in zip(moved, self.tests, strict=True)
            ]
            level, off = self._levels(self.table - np.array(predicted), spread)
            spread = max(_SCATTER, _MAD * float(np.nanmedian(np.abs(off))))
        return found

    def off_in_all(self) -> str:
        """Say which modes no description allows, though the tests agree on them."""
        off = self.at.off_description(np.nanmedian(self.table, axis=0)).tolist()
        odd = [(key, each) for key, each in zip(self.keys, off, strict=True) if abs(each) > _OFF]
        if len(odd) > MOST_MISTAKEN * len(self.keys):
            return f"{len(odd)} of the {len(self.keys)} modes of its tests {_FIT_NO_STATE}"
        if not odd or len(self.keys) < _FEWEST:
            return ""
        (plane, order), worst = max(odd, key=lambda each: abs(each[1]))
        return (
            f"{plane} {order} of all its tests is {100 * math.expm1(worst):+.0f} % off what the "
            "other modes and the description allow"
        )

    def _levels(self, off: FloatArray, spread: float) -> tuple[FloatArray, FloatArray]:
        """Return the level of each mode, and what is left of the tests that share it, else NaN.

        `off` (tests, keys) is by what they are off the model. The level is that of the test which
        most others join, weighed with how far off the model it is: where two of three tests have a
        mode wrong, the third may still be right.
        """
        apart = off[None] - off[:, None]
        variance = 2 * (self.variance + spread**2)
        joins = np.where(np.isfinite(apart), log_mixture(apart, variance), 0.0).sum(axis=1)
        score = joins - _HEAVY * np.log1p(((off - np.nanmedian(off)) / _LEVEL_SD) ** 2)
        chosen = np.nanargmax(np.where(np.isfinite(off), score, -np.inf), axis=0)
        near = np.abs(off - off[chosen, np.arange(off.shape[1])]) < max(_LEAST, _FAR * spread)
        shared = np.where(near, off, np.nan)
        level = np.nanmedian(shared, axis=0)
        return level, shared - level

    def _fit(self, n: int, bar: _Bar, x: FloatArray, level: FloatArray, spread: float) -> _Fitted:
        at = np.flatnonzero(np.isfinite(self.table[n]))
        conditions, measured = self.model.conditions(self.tests[n]), self.table[n, at]
        # A median of n is off by 1.25 standard deviations over the root of n.
        variance = (self.variance[n, at] + spread**2) * (1 + 1.57 / self.counts[at])

        def about(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            slopes = bar.slopes(x, conditions)[at]
            off = measured - bar.log_frequency(x, conditions)[at] - level[at]
            return off + slopes @ x, slopes, variance

        sd = np.array([self.common_sd[n], _TENSION_SD, *[_DECADES_SD] * (bar.count - 2)])
        off, slopes, _ = linear = about(x)
        modes = sound_modes(*linear, 1 / sd**2)
        left = off - slopes @ modes.x
        modes = replace(modes, sound=modes.sound | (np.abs(left) <= _LEAST))
        of_median = about(np.zeros(len(x)))
        return _Fitted(at, measured - left, modes, linear, of_median, float(self.common_sd[n]))


@dataclass(frozen=True, eq=False)
class _Modes:
    """Modes (n,) of a hanger, and where its description puts them."""

    model: Model
    conditions: Conditions
    planes: IntArray
    orders: IntArray

    @classmethod
    def of(
        cls, keys: Sequence[MeasuredMode], model: Model, conditions: Conditions | None = None
    ) -> _Modes:
        planes = np.array([PLANES.index(plane) for plane, _ in keys], dtype=int)
        orders = np.array([order - 1 for _, order in keys], dtype=int)
        return cls(model, conditions or Conditions(), planes, orders)

    def log_frequencies(self, theta: FloatArray, conditions: Conditions) -> FloatArray:
        """Return those (sets, n) of parameter sets."""
        found = self.model.frequencies_at(theta, int(self.orders.max()) + 1, conditions)
        return np.asarray(np.log(found[:, self.planes, self.orders]))

    def _best(self, theta: FloatArray, measured: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the likeliest of parameter sets, a few modes being mistaken, and its misfit."""
        off = measured - self.log_frequencies(theta, self.conditions)
        at = int(np.nanargmax(log_mixture(off, _MODEL_SD**2).sum(axis=1)))
        return theta[at], off[at]

    def off_description(self, measured: FloatArray) -> FloatArray:
        """Return what modes (n,) are off from the description's likeliest parameter set."""
        rng = np.random.default_rng(0)
        lower, upper = self.model.prior.lower, self.model.prior.upper
        theta = lower + (upper - lower) * rng.random((_DRAWS, len(lower)))
        best, off = self._best(theta, measured)
        for width in _NARROWER:
            near = best + width * (upper - lower) * rng.uniform(-1, 1, (_DRAWS // 4, len(lower)))
            best, off = self._best(np.vstack([best, np.clip(near, lower, upper)]), measured)
        return off

    def typical_parameters(self, level: FloatArray) -> FloatArray:
        """Return the described bar with ends that are felt, at the tension which suits `level`.

        Slopes are taken there: what differs from test to test is the same anywhere near.
        """
        model, names = self.model, self.model.parameter_names
        theta = (model.prior.lower + model.prior.upper) / 2
        for column, name in enumerate(names):
            with contextlib.suppress(KeyError):
                theta[column] = model.usual(name)
            if name == "theta_L":
                theta[column] = 1.0
            elif name.startswith(_SPRING):
                theta[column] = math.log10(_FELT * model.wave_stiffness_n_m_rad(1))
        every = np.tile(theta, (_TENSIONS, 1))
        tension = names.index("theta_F")
        every[:, tension] = np.geomspace(*_TENSION_RANGE, _TENSIONS)
        every = np.clip(every, model.prior.lower, model.prior.upper)
        return self._best(every, level)[0]


class _Bar:
    """The state (q,) by which tests of a hanger may differ, and its log frequencies (keys,)."""

    def __init__(self, at: _Modes, base: FloatArray):
        self._at, self._base = at, base
        names = at.model.parameter_names
        self._tension = names.index("theta_F")
        self._springs = [n for n, name in enumerate(names) if name.startswith(_SPRING)]
        self.count = 2 + len(self._springs)

    def log_frequency(self, x: FloatArray, conditions: Conditions) -> FloatArray:
        """Return those (keys,) of a state."""
        return np.asarray(self._predicted(x[None], conditions)[0])

    def slopes(self, x: FloatArray, conditions: Conditions) -> FloatArray:
        """Return how they go with the state (keys, q), by central differences."""
        steps = np.array([1.0, _TENSION_STEP, *[_DECADES_STEP] * len(self._springs)])
        both = np.vstack([x + np.diag(steps), x - np.diag(steps)])
        up, down = np.split(self._predicted(both, conditions), 2)
        return np.asarray(((up - down) / (2 * steps[:, None])).T)

    def _predicted(self, x: FloatArray, conditions: Conditions) -> FloatArray:
        theta, prior, springs = (
            np.tile(self._base, (len(x), 1)),
            self._at.model.prior,
            self._springs,
        )
        theta[:, self._tension] *= np.exp(np.clip(x[:, 1], -_FARTHEST_TENSION, _FARTHEST_TENSION))
        decades = np.clip(x[:, 2:], -_FARTHEST_DECADES, _FARTHEST_DECADES)
        theta[:, springs] = np.clip(
            theta[:, springs] + decades, prior.lower[springs], prior.upper[springs]
        )
        return self._at.log_frequencies(theta, conditions) + x[:, :1]
