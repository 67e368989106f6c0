"""Tests that agree with none next to them: another hanger was hit, a clock was off, a bad day.

A test counts where it agrees with what was before it or with a test next to it, before or after,
and none of its modes strays: two tests agree by the modes that they share, and these may be without
the one that is mistaken. So a blunder counts in nothing as long as it is alone, and what lasts
counts from its second test on, however large it is. Nothing here asks which cause it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.values import BoolArray, FloatArray

_SELDOM = 1e-3  # of tests that agree so many are taken for such that do not
_NEAR = 2  # tests to each side: a blunder may lie between two that agree
_BEFORE = 5  # counted tests that say where the hanger was
_AGREEING = 0.4  # judgement: of those before; two of five
# Of a log frequency (judgement): further off than by any load, and nearer than orders are.
_STRAYS, _SAME = 0.04, 0.02
_WIDER, _TAIL = 10.0, 2.0  # judgement: how a blunder lies, ten times as wide and with heavy tails


@dataclass(frozen=True, eq=False)
class Seen:
    """Tests (T,) mode by mode: `values` and `variances` (T, n), infinite where not measured.

    `factors` (n, c) with `sds` (c,) are what tests of one state scatter along, and by; `doubt`
    (T, n, m) are the factors of what conditions leave open.
    """

    values: FloatArray
    variances: FloatArray
    doubt: FloatArray
    factors: FloatArray
    sds: FloatArray

    def distance(self, one: int, other: int) -> tuple[float, int, float]:
        """Return a difference's squared length, its modes, its covariance's log determinant."""
        both = np.isfinite(self.variances[one]) & np.isfinite(self.variances[other])
        if not both.any():
            return 0.0, 0, 0.0
        scatter = self.factors[both] * self.sds
        covariance = 2 * scatter @ scatter.T
        for doubt in (self.doubt[one][both], self.doubt[other][both]):
            covariance += doubt @ doubt.T
        covariance += np.diag((self.variances[one] + self.variances[other])[both])
        off = (self.values[one] - self.values[other])[both]
        return (
            float(off @ np.linalg.solve(covariance, off)),
            int(both.sum()),
            float(np.linalg.slogdet(covariance)[1]),
        )

    def agree(self, one: int, other: int) -> bool:
        """Return True if two tests may be of one state."""
        square, modes, _ = self.distance(one, other)
        return modes > 0 and square < float(scipy.special.chdtri(modes, _SELDOM))


def select_consistent_tests(seen: Seen, known: BoolArray, baseline_tests: int) -> BoolArray:
    """Return which of the tests (T,) count; `known` is the result when there were fewer of them.

    Of a baseline of three tests or more those count that agree with half of the others. What was
    found of a test stays once two tests have followed it.
    """
    tests = len(seen.values)
    found = np.zeros(tests, bool)
    settled = max(len(known) - _NEAR, 0)
    found[:settled] = known[:settled]
    first = min(baseline_tests, tests)
    if settled < first:
        found[:first] = _of_baseline(seen, first)
        settled = first
    for test in range(settled, tests):
        before = np.flatnonzero(found[:test])[-_BEFORE:]
        agreeing = sum(seen.agree(test, int(each)) for each in before)
        near = [
            test + step for step in range(-_NEAR, _NEAR + 1) if step and 0 <= test + step < tests
        ]
        near = [each for each in near if each >= first]
        agrees = agreeing >= _AGREEING * len(before) or any(seen.agree(test, n) for n in near)
        found[test] = agrees and not _has_outlying_mode(seen, found, test, near)
    return found


def _has_outlying_mode(seen: Seen, found: BoolArray, test: int, near: Sequence[int]) -> bool:
    """Return True if a mode lies where no counted test before has it, and none next to it."""
    for mode in np.flatnonzero(np.isfinite(seen.variances[test])):
        measured = np.isfinite(seen.variances[:, mode])
        before = np.flatnonzero(found[:test] & measured[:test])[-_BEFORE:]
        its, others = seen.values[test, mode], seen.values[:, mode]
        if not len(before) or abs(its - np.median(others[before])) <= _STRAYS:
            continue
        if not any(measured[each] and abs(its - others[each]) < _SAME for each in near):
            return True
    return False


def _of_baseline(seen: Seen, first: int) -> BoolArray:
    measured = np.isfinite(seen.variances[:first]).any(axis=1)
    if measured.sum() < 3:
        return np.asarray(measured)
    agreeing = np.array(
        [
            [one != other and seen.agree(one, other) for other in range(first)]
            for one in range(first)
        ]
    )
    found = measured & (agreeing.sum(axis=1) >= (measured.sum() - 1) / 2)
    return np.asarray(found if found.any() else measured)


def outlier_probability(seen: Seen, known: BoolArray, test: int, prior: float) -> float:
    """Return the probability that a test is a blunder, by the nearest of the last that count."""
    odds = np.log(prior / (1 - prior))
    against = []
    for before in np.flatnonzero(known[:test])[-_BEFORE:]:
        square, d, _ = seen.distance(test, int(before))
        if d:
            wide = -(_TAIL + d) / 2 * np.log1p(square / _TAIL / _WIDER**2) - d * np.log(_WIDER)
            against.append(wide + square / 2)
    if not against:
        return prior
    return float(1 / (1 + np.exp(-np.clip(odds + min(against), -700, 700))))
