"""Find mistaken modes and tests among those of a baseline, and whether the baseline fits at all.

A baseline that holds a mistake is wrong for years: its posterior follows it, and later tests fit it
no better than it fits itself. One or two tests are compared with what the description allows; of
three or more each is compared with the median of all. These may differ in what a hanger does: its
tension, the stiffness of its ends, and what all frequencies have in common, by the slopes of a
model class. What no such difference explains is mistaken. Another hanger's test is held as it comes
in (`shm.plausibility`).
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shm.models import Model
from shm.models.classes.base import Conditions
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
from shm.watch.limits import LIMITS
from shm.watch.mistaken_modes import MOST_MISTAKEN, log_mixture, sound_modes
from shm.watch.quantities import MeasuredMode

_FIT_NO_STATE = "fit no tension and no end stiffness that the description allows"

_SPRING, _FELT = "log10_k", 3.0  # of the stiffness of a wave: a spring that bends with the bar


def known_modes(test: ModalTest) -> list[Mode]:
    """Return the modes that a tension is inferred from."""
    return [mode for mode in test.regular_modes if mode.frequency_hz > 0]


def check_baseline(tests: Sequence[ModalTest], model: Model) -> BaselineCheck:
    """Return what is mistaken among the tests of a baseline, and whether they fit.

    `model` is any class of the hanger that is fast.
    """
    if not any(known_modes(test) for test in tests):
        return BaselineCheck(unchecked="no test has a mode that a tension is inferred from")
    if len(tests) >= LIMITS.enough:
        return _check_together(tests, model)
    checks = [_check_alone(test, model) for test in tests]
    return BaselineCheck(
        modes=tuple(mode for each in checks for mode in each.modes),
        misfit=next((each.misfit for each in checks if each.misfit), ""),
        unchecked=next((each.unchecked for each in checks if each.unchecked), ""),
    )


def _check_alone(test: ModalTest, model: Model) -> BaselineCheck:
    """Compare a test with what the description allows."""
    modes = known_modes(test)
    if len(modes) < LIMITS.baseline_check_fewest:
        return BaselineCheck(
            unchecked=f"test {test.id} has {len(modes)} modes, and at least "
            f"{LIMITS.baseline_check_fewest} are needed"
        )
    measured = np.log([mode.frequency_hz for mode in modes])
    bar = _Bar.of([(mode.plane, mode.order) for mode in modes], model, measured)
    off = bar.off_description(model.conditions(test))
    odd: BoolArray = np.abs(off) > LIMITS.baseline_check_off
    if odd.sum() > MOST_MISTAKEN * len(modes):
        return BaselineCheck(
            misfit=f"{odd.sum()} of the {len(modes)} modes of test {test.id} {_FIT_NO_STATE}"
        )
    expected_hz = np.exp(measured - off)
    return BaselineCheck(
        tuple(
            MistakenMode(test.id, mode.plane, mode.order, mode.frequency_hz, float(hz))
            for mode, hz, is_odd in zip(modes, expected_hz, odd, strict=True)
            if is_odd
        )
    )


def _check_together(tests: Sequence[ModalTest], model: Model) -> BaselineCheck:
    """Compare each test with the median of all."""
    every = [(mode.plane, mode.order) for test in tests for mode in known_modes(test)]
    keys = sorted(key for key in set(every) if every.count(key) >= LIMITS.enough)
    if not keys:
        return BaselineCheck(unchecked="no mode is measured in three of its tests")
    table, variance = _tabulate(tests, keys, model)
    bar = _Bar.of(keys, model, np.nanmedian(table, axis=0))
    off, expected, why = _fit_tests(tests, table, variance, bar)
    wrong = [MistakenTest(test.id, each) for test, each in zip(tests, why, strict=True) if each]
    sound = np.array([not each for each in why])
    modes = [
        MistakenMode(tests[n].id, plane, order, math.exp(table[n, at]), math.exp(expected[n, at]))
        for n, at in np.argwhere(off & sound[:, None]).tolist()
        for plane, order in [keys[at]]
    ]
    count, misfit = int(np.isfinite(table[sound]).sum()), ""
    if len(wrong) > MOST_MISTAKEN * len(tests):
        misfit = f"{len(wrong)} of its {len(tests)} tests do not agree with the others"
    elif len(modes) > MOST_MISTAKEN * count:
        misfit = f"{len(modes)} of its {count} modes do not agree from test to test"
    return BaselineCheck(tuple(modes), tuple(wrong), misfit or _misfit_of_all(bar, keys))


def _tabulate(
    tests: Sequence[ModalTest], keys: Sequence[MeasuredMode], model: Model
) -> tuple[FloatArray, FloatArray]:
    """Return log frequencies (tests, keys), NaN where not measured, and their variances."""
    table, variance = np.full((2, len(tests), len(keys)), np.nan)
    unstated = model.hanger.assumptions.unstated_frequency_sd.value
    for row, test in enumerate(tests):
        for mode in known_modes(test):
            if (mode.plane, mode.order) in keys:
                at = keys.index((mode.plane, mode.order))
                sd = mode.frequency_sd_hz / mode.frequency_hz
                is_stated = sd > 0 and math.isfinite(sd)
                table[row, at] = math.log(mode.frequency_hz)
                variance[row, at] = (sd if is_stated else unstated) ** 2 + LIMITS.mode_scatter**2
    return table, variance


def _fit_tests(
    tests: Sequence[ModalTest], table: FloatArray, variance: FloatArray, bar: _Bar
) -> tuple[BoolArray, FloatArray, list[str]]:
    """Return which modes are mistaken (tests, keys), what was expected, and why a test is wrong.

    Each test's state is fitted to its modes about their levels; these are the medians of what is
    left of all tests.
    """
    # A median of n is off by 1.25 standard deviations over the root of n.
    variance = variance * (1 + 1.57 / np.isfinite(table).sum(axis=0))
    sds = np.array([LIMITS.common_sd, LIMITS.tension_sd, *[LIMITS.decades_sd] * (bar.count - 2)])
    states = np.zeros((len(tests), bar.count))
    off, expected, why = np.zeros(table.shape, bool), table.copy(), [""] * len(tests)
    conditions = [bar.model.conditions(test) for test in tests]
    for _ in range(LIMITS.rounds):
        predicted = np.array(
            [bar.predict(x[None], its)[0] for x, its in zip(states, conditions, strict=True)]
        )
        level = np.nanmedian(table - predicted, axis=0)
        for n, its in enumerate(conditions):
            seen = np.flatnonzero(np.isfinite(table[n]))
            slopes = bar.slopes(states[n], its)[seen]
            rest = (table[n] - predicted[n] - level)[seen] + slopes @ states[n]
            found = sound_modes(rest, slopes, variance[n, seen], 1 / sds**2)
            left = rest - slopes @ found.x
            states[n] = found.x
            expected[n, seen] = table[n, seen] - left
            is_far = np.abs(left) > LIMITS.least_mistake
            off[n, seen] = ~found.sound & is_far
            is_unfit = found.is_misfit and is_far.sum() > MOST_MISTAKEN * len(seen)
            why[n] = "its modes fit none of the other tests'" if is_unfit else ""
    for n, its in enumerate(conditions if len(tests) >= LIMITS.enough_for_clocks else ()):
        seen = np.flatnonzero(np.isfinite(table[n]))
        spread = _measure_spread(np.delete(states, n, axis=0), sds)
        by_state = []
        for x in (states[n], np.zeros(bar.count)):
            slopes = bar.slopes(x, its)[seen]
            rest = (table[n] - level)[seen] - bar.predict(x[None], its)[0][seen] + slopes @ x
            by_state.append((rest, slopes, variance[n, seen]))
        about_state, about_median = by_state
        if clock := _find_clock_error(about_state, about_median, spread):
            why[n] = (
                "all its frequencies are off the other tests' alike, by "
                f"{100 * math.expm1(clock):+.1f} %: another hanger, or a wrong clock"
            )
    return off, expected, why


def _measure_spread(states: FloatArray, sds: FloatArray) -> FloatArray:
    """Return what tests (n, q) differ by, robustly, between what they surely and at most may."""
    least = np.array(
        [LIMITS.common_sd, LIMITS.least_spread[0], *[LIMITS.least_spread[1]] * (len(sds) - 2)]
    )
    found = 1.4826 * np.median(np.abs(states - np.median(states, axis=0)), axis=0)
    # Of four tests the spread is hardly known: in one of ten it seems a third of what it is.
    return np.asarray(np.clip(3 * found, least, sds))


_Linear = tuple[FloatArray, FloatArray, FloatArray]


def _find_clock_error(about_state: _Linear, about_median: _Linear, spread: FloatArray) -> float:
    """Return by what all log frequencies of a test are off alike, 0 where a tension explains it.

    `spread` (q,) is what the other tests differ by: where their tensions do not keep still, a
    little that is common to all frequencies may be theirs, too.
    """
    tension, clock = spread.copy(), spread.copy()
    tension[:2], clock[0] = (LIMITS.common_sd, LIMITS.tension_sd), LIMITS.clock_sd
    by_tension = sound_modes(*about_state, 1 / tension**2)
    by_clock = sound_modes(*about_median, 1 / clock**2)
    odds = math.log(LIMITS.wrong_clock / (1 - LIMITS.wrong_clock))
    least = max(LIMITS.least_clock, float(np.median(about_median[1][:, 1])) * spread[1])
    common = float(by_clock.x[0])
    is_clock = by_clock.log_evidence + odds > by_tension.log_evidence and abs(common) > least
    return common if is_clock else 0.0


def _misfit_of_all(bar: _Bar, keys: Sequence[MeasuredMode]) -> str:
    """State which modes no description allows, though the tests agree on them."""
    off = bar.off_description(Conditions()).tolist()
    odd = [
        (key, each)
        for key, each in zip(keys, off, strict=True)
        if abs(each) > LIMITS.baseline_check_off
    ]
    if len(odd) > MOST_MISTAKEN * len(keys):
        return f"{len(odd)} of the {len(keys)} modes of its tests {_FIT_NO_STATE}"
    if not odd or len(keys) < LIMITS.baseline_check_fewest:
        return ""
    (plane, order), worst = max(odd, key=lambda each: abs(each[1]))
    return (
        f"{plane} {order} of all its tests is {100 * math.expm1(worst):+.0f} % off what the "
        "other modes and the description allow"
    )


@dataclass(frozen=True, eq=False)
class _Bar:
    """Modes (n,) of a hanger, and their `measured` log frequencies.

    The state (q,) by which tests may differ is what all have in common, ln of the tension, and
    decades of each spring.
    """

    model: Model
    planes: IntArray
    orders: IntArray
    measured: FloatArray

    @classmethod
    def of(cls, keys: Sequence[MeasuredMode], model: Model, measured: FloatArray) -> _Bar:
        planes = np.array([PLANES.index(plane) for plane, _ in keys], dtype=int)
        orders = np.array([order - 1 for _, order in keys], dtype=int)
        return cls(model, planes, orders, measured)

    def _log_frequencies(self, theta: FloatArray, conditions: Conditions) -> FloatArray:
        found = self.model.frequencies_at(theta, int(self.orders.max()) + 1, conditions)
        return np.asarray(np.log(found[:, self.planes, self.orders]))

    def _best(self, theta: FloatArray, its: Conditions) -> tuple[FloatArray, FloatArray]:
        """Return the most probable of parameter sets and its misfit; a few modes are mistaken."""
        off = self.measured - self._log_frequencies(theta, its)
        at = int(np.nanargmax(log_mixture(off, LIMITS.model_sd**2).sum(axis=1)))
        return theta[at], off[at]

    def off_description(self, conditions: Conditions) -> FloatArray:
        """Return what modes (n,) are off from the description's most probable parameter set."""
        rng = np.random.default_rng(0)
        lower, upper = self.model.prior.lower, self.model.prior.upper
        theta = lower + (upper - lower) * rng.random((LIMITS.draws, len(lower)))
        best, off = self._best(theta, conditions)
        for width in LIMITS.narrower:
            near = best + width * (upper - lower) * rng.uniform(
                -1, 1, (LIMITS.draws // 4, len(lower))
            )
            best, off = self._best(np.vstack([best, np.clip(near, lower, upper)]), conditions)
        return off

    @cached_property
    def base(self) -> FloatArray:
        """Return the described bar with ends that are felt, at the tension which suits best.

        Slopes are taken there: what differs from test to test is the same anywhere near.
        """
        model, names, prior = self.model, self.model.parameter_names, self.model.prior
        theta = (prior.lower + prior.upper) / 2
        for column, name in enumerate(names):
            with contextlib.suppress(KeyError):
                theta[column] = model.usual(name)
            if name == "theta_L":
                theta[column] = 1.0
            elif name.startswith(_SPRING):
                theta[column] = math.log10(_FELT * model.wave_stiffness_n_m_rad(1))
        every = np.tile(theta, (LIMITS.tensions, 1))
        every[:, names.index("theta_F")] = np.geomspace(*LIMITS.tension_range, LIMITS.tensions)
        return self._best(np.clip(every, prior.lower, prior.upper), Conditions())[0]

    @cached_property
    def _springs(self) -> list[int]:
        names = self.model.parameter_names
        return [n for n, name in enumerate(names) if name.startswith(_SPRING)]

    @property
    def count(self) -> int:
        """Return q."""
        return 2 + len(self._springs)

    def predict(self, x: FloatArray, conditions: Conditions) -> FloatArray:
        """Return log frequencies (sets, n) of states (sets, q)."""
        theta, prior, springs = np.tile(self.base, (len(x), 1)), self.model.prior, self._springs
        tension = self.model.parameter_names.index("theta_F")
        theta[:, tension] *= np.exp(
            np.clip(x[:, 1], -LIMITS.farthest_tension, LIMITS.farthest_tension)
        )
        decades = np.clip(x[:, 2:], -LIMITS.farthest_decades, LIMITS.farthest_decades)
        theta[:, springs] = np.clip(
            theta[:, springs] + decades, prior.lower[springs], prior.upper[springs]
        )
        return self._log_frequencies(theta, conditions) + x[:, :1]

    def slopes(self, x: FloatArray, conditions: Conditions) -> FloatArray:
        """Return how log frequencies go with the state (n, q), by central differences."""
        steps = np.array(
            [1.0, LIMITS.baseline_check_tension_step, *[LIMITS.decades_step] * len(self._springs)]
        )
        both = np.vstack([x + np.diag(steps), x - np.diag(steps)])
        up, down = np.split(self.predict(both, conditions), 2)
        return np.asarray(((up - down) / (2 * steps[:, None])).T)
