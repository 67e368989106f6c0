"""Find mistaken modes and tests among those of a baseline, and whether the baseline fits at all.

A baseline that holds a mistake is wrong for years: its posterior follows it, and later tests fit it
no better than it fits itself. One or two tests are compared with what the description allows; of
three or more each is compared with the median of all. These may differ in what a hanger does: its
tension, the stiffness of its ends, and what all frequencies have in common, as those of a bar on
springs do (`shm.models.bar_fit`). What no such difference explains is mistaken. Another hanger's
test is held as it comes in (`shm.plausibility`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.models.bar_fit import PARAMETERS, SPRINGS, Bar, Fit, Seen, fit_bars, seen_in
from shm.values import (
    PLANES,
    BaselineCheck,
    BoolArray,
    FloatArray,
    Hanger,
    MistakenMode,
    MistakenTest,
    ModalTest,
    Mode,
)
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.mistaken_modes import MOST_MISTAKEN, sound_modes
from shm.watch.engine.quantities import MeasuredMode

_FIT_NO_STATE = "fit no tension and no end stiffness that the description allows"


_Linear = tuple[FloatArray, FloatArray, FloatArray]
"""What modes are off, how they go with a state, and their variances."""


def known_modes(test: ModalTest) -> list[Mode]:
    """Return the modes that a tension is inferred from."""
    return [mode for mode in test.regular_modes if mode.frequency_hz > 0]


def check_baseline(tests: Sequence[ModalTest], hanger: Hanger) -> BaselineCheck:
    """Return what is mistaken among the tests of a baseline, and whether they fit."""
    if not any(known_modes(test) for test in tests):
        return BaselineCheck(unchecked="no test has a mode that a tension is inferred from")
    if len(tests) >= LIMITS.enough:
        return _check_together(tests, hanger)
    checks = [_check_alone(test, hanger) for test in tests]
    return BaselineCheck(
        modes=tuple(mode for each in checks for mode in each.modes),
        misfit=next((each.misfit for each in checks if each.misfit), ""),
        unchecked=next((each.unchecked for each in checks if each.unchecked), ""),
    )


def _check_alone(test: ModalTest, hanger: Hanger) -> BaselineCheck:
    """Compare a test with what the description allows."""
    seen = seen_in([test], hanger)
    keys, log_hz = _list_modes(seen.mask), seen.log_f[seen.mask]
    if len(keys) < LIMITS.baseline_check_fewest:
        return BaselineCheck(
            unchecked=f"test {test.id} has {len(keys)} modes, and at least "
            f"{LIMITS.baseline_check_fewest} are needed"
        )
    (fit,) = fit_bars([Bar.described(hanger, seen)])
    off = log_hz - fit.log_f[seen.mask]
    odd: BoolArray = np.abs(off) > LIMITS.baseline_check_off
    if odd.sum() > MOST_MISTAKEN * len(keys):
        return BaselineCheck(
            misfit=f"{odd.sum()} of the {len(keys)} modes of test {test.id} {_FIT_NO_STATE}"
        )
    return BaselineCheck(
        tuple(
            MistakenMode(test.id, *keys[n], math.exp(log_hz[n]), math.exp(log_hz[n] - off[n]))
            for n in np.flatnonzero(odd)
        )
    )


def _check_together(tests: Sequence[ModalTest], hanger: Hanger) -> BaselineCheck:
    """Compare each test with the median of all."""
    each = [seen_in([test], hanger) for test in tests]
    mask = np.sum([seen.mask for seen in each], axis=0) >= LIMITS.enough
    keys = _list_modes(mask)
    if not keys:
        return BaselineCheck(unchecked="no mode is measured in three of its tests")
    table = np.array([seen.log_f[mask] for seen in each])
    variance = np.array([seen.variance[mask] for seen in each]) + LIMITS.mode_scatter**2
    (fit,) = fit_bars([Bar.described(hanger, Seen.of(keys, np.nanmedian(table, axis=0)))])
    off, expected, why = _fit_tests(table, variance, fit, keys)
    wrong = [MistakenTest(test.id, each) for test, each in zip(tests, why, strict=True) if each]
    sound = np.array([not each for each in why])
    modes = [
        MistakenMode(tests[n].id, *keys[at], math.exp(table[n, at]), math.exp(expected[n, at]))
        for n, at in np.argwhere(off & sound[:, None]).tolist()
    ]
    count, misfit = int(np.isfinite(table[sound]).sum()), ""
    if len(wrong) > MOST_MISTAKEN * len(tests):
        misfit = f"{len(wrong)} of its {len(tests)} tests do not agree with the others"
    elif len(modes) > MOST_MISTAKEN * count:
        misfit = f"{len(modes)} of its {count} modes do not agree from test to test"
    left = (fit.bar.seen.log_f - fit.log_f)[mask]
    return BaselineCheck(tuple(modes), tuple(wrong), misfit or _misfit_of_all(left, keys))


def _list_modes(mask: BoolArray) -> list[MeasuredMode]:
    """Return the modes of a `mask` (2, orders), plane by plane."""
    return [(PLANES[plane], order + 1) for plane, order in np.argwhere(mask).tolist()]


def _fit_tests(
    table: FloatArray, variance: FloatArray, median: Fit, keys: Sequence[MeasuredMode]
) -> tuple[BoolArray, FloatArray, list[str]]:
    """Return which modes are mistaken (tests, keys), what was expected, and why a test is wrong.

    Each test's state is fitted to its modes about their levels; these are the medians of what is
    left of all tests. A state (6,) is by what tests may differ: what all frequencies have in
    common, ln of the tension, decades of each spring.
    """
    # A median of n is off by 1.25 standard deviations over the root of n.
    variance = variance * (1 + 1.57 / np.isfinite(table).sum(axis=0))
    mask, columns = median.bar.seen.mask, [0, *range(SPRINGS.start, SPRINGS.stop)]
    sds = np.array([LIMITS.common_sd, LIMITS.tension_sd, *[LIMITS.decades_sd] * 4])
    fit_sds = np.full(PARAMETERS, LIMITS.common_sd)
    fit_sds[columns] = sds[1:]
    level = (median.bar.seen.log_f - median.log_f)[mask]
    states, why = np.zeros((len(table), len(sds))), [""] * len(table)
    off, expected, good = np.zeros(table.shape, bool), table.copy(), table.copy()

    def about(n: int, fit: Fit) -> _Linear:
        """Return what a test's modes are off the median's state, by the slopes of a fit."""
        slopes, seen = fit.way[mask][:, [-1, *columns]], np.isfinite(table[n])
        moved = slopes[:, 1:] @ (fit.theta - median.theta)[columns]
        rest = table[n] - level - fit.log_f[mask] + moved
        return rest[seen], slopes[seen], variance[n, seen]

    for _ in range(LIMITS.rounds):
        bars = [replace(median.bar, seen=Seen.of(keys, each)) for each in good - level]
        fits = fit_bars([replace(b, mean=median.theta, sd=fit_sds) for b in bars], median.theta)
        level = np.nanmedian(table - [each.log_f[mask] for each in fits], axis=0)
        for n, fit in enumerate(fits):
            rest, slopes, its = about(n, fit)
            seen, found = np.isfinite(table[n]), sound_modes(rest, slopes, its, 1 / sds**2)
            left, states[n] = rest - slopes @ found.x, found.x
            expected[n, seen] = table[n, seen] - left
            is_far = np.abs(left) > LIMITS.least_mistake
            off[n, seen] = ~found.sound & is_far
            good[n, seen] = np.where(found.sound, table[n, seen], expected[n, seen])
            is_unfit = found.is_misfit and is_far.sum() > MOST_MISTAKEN * len(rest)
            why[n] = "its modes fit none of the other tests'" if is_unfit else ""
    for n, fit in enumerate(fits if len(table) >= LIMITS.enough_for_clocks else ()):
        spread = _measure_spread(np.delete(states, n, axis=0), sds)
        if clock := _find_clock_error(about(n, fit), about(n, median), spread):
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


def _misfit_of_all(off: FloatArray, keys: Sequence[MeasuredMode]) -> str:
    """State which modes no description allows, though the tests agree on them."""
    odd = [
        (key, each)
        for key, each in zip(keys, off.tolist(), strict=True)
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
