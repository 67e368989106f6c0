"""Select tests that count, and bound the evidence of a change by whether it stays.

A test counts where it agrees with what was before it or with a test next to it. So a blunder
counts in nothing as long as it is alone, and what lasts counts from its second test on.

The sums of `change_point` take tests to scatter normally. They do not: vans and joints that give
for a day are many more than a normal law has. So a change has no more evidence than the tests after
it give as plain yes or no: each shows the change or not, and shows it without one as often as the
tests before did. Or it is those before that were odd, where they are few.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from shm.values import BoolArray, FloatArray
from shm.watch.engine.causes import BENDING_STIFFNESS, SPRINGS
from shm.watch.engine.change_point import RAMP, Evidence
from shm.watch.engine.limits import LIMITS


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

    def distance(self, one: int, other: int) -> tuple[float, int]:
        """Return a difference's squared length, and its modes."""
        both = np.isfinite(self.variances[one]) & np.isfinite(self.variances[other])
        if not both.any():
            return 0.0, 0
        scatter = self.factors[both] * self.sds
        covariance = 2 * scatter @ scatter.T
        for doubt in (self.doubt[one][both], self.doubt[other][both]):
            covariance += doubt @ doubt.T
        covariance += np.diag((self.variances[one] + self.variances[other])[both])
        off = (self.values[one] - self.values[other])[both]
        return float(off @ np.linalg.solve(covariance, off)), int(both.sum())

    def agree(self, one: int, other: int) -> bool:
        """Return True if two tests may be of one state."""
        square, modes = self.distance(one, other)
        return modes > 0 and square < float(scipy.special.chdtri(modes, LIMITS.seldom))


def select_consistent_tests(seen: Seen, known: BoolArray, baseline_tests: int) -> BoolArray:
    """Return which of the tests (T,) count; `known` is the result when there were fewer of them.

    Of a baseline of three tests or more those count that agree with half of the others. What was
    found of a test stays once two tests have followed it.
    """
    tests = len(seen.values)
    found = np.zeros(tests, bool)
    settled = max(len(known) - LIMITS.near, 0)
    found[:settled] = known[:settled]
    first = min(baseline_tests, tests)
    if settled < first:
        found[:first] = _of_baseline(seen, first)
        settled = first
    for test in range(settled, tests):
        before = np.flatnonzero(found[:test])[-LIMITS.before :]
        agreeing = sum(seen.agree(test, int(each)) for each in before)
        near = [
            test + step
            for step in range(-LIMITS.near, LIMITS.near + 1)
            if step and 0 <= test + step < tests
        ]
        near = [each for each in near if each >= first]
        agrees = agreeing >= LIMITS.agreeing * len(before)
        found[test] = agrees or any(seen.agree(test, each) for each in near)
    return found


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
    odds, tail = np.log(prior / (1 - prior)), LIMITS.persistence_tail
    against = []
    for before in np.flatnonzero(known[:test])[-LIMITS.before :]:
        square, d = seen.distance(test, int(before))
        if d:
            # Student's density over the normal one, both of d modes
            size = scipy.special.gammaln((tail + d) / 2) - scipy.special.gammaln(tail / 2)
            size -= d * np.log(LIMITS.wider * math.sqrt(tail / 2))
            wide = (tail + d) / 2 * np.log1p(square / tail / LIMITS.wider**2)
            against.append(size - wide + square / 2)
    if not against:
        return prior
    return float(1 / (1 + np.exp(-np.clip(odds + min(against), -700, 700))))


# Before any test, of tests without a change so many lie as far as one, as if from so many tests.
# Judgement: joints give and wires slip on one windy day in seven, which ten calm tests do not
# disprove; heavy vehicles, sensors and mistakes together are one test in thirty, which no number
# of tests disproves.
_SLIPPING = (SPRINGS, BENDING_STIFFNESS)


@dataclass(frozen=True, eq=False)
class Course:
    """Tests mode by mode: what the evidence is the sum of.

    `rows` (T, n, z) are the null's columns and those of called changes, `changing` (T, n, n + q)
    the columns of a change, `values` (T, n) and their `covariance` (T, K, n, n) in the evidence;
    `errors` (T, n) are the variances of each mode by itself. The first `baseline` are the
    baseline's.
    """

    rows: FloatArray
    changing: FloatArray
    values: FloatArray
    covariance: FloatArray
    errors: FloatArray
    baseline: int


def bound_by_recurrence(
    evidence: Evidence, course: Course, limit_years: float
) -> tuple[float, int]:
    """Return log of the years that stay for a change, and the tests against a lone baseline.

    Of the most probable changes each has no more than it has anyway, and the most of all counts. A
    baseline stands alone only where a normal law would call the change.
    """
    is_clear = evidence.log_evidence > math.log(limit_years)
    found, against = -math.inf, 0
    leading = float(evidence.log_mass.max(initial=-math.inf))
    for n, index in enumerate(_most_probable(evidence)):
        mass = float(evidence.log_mass[index])
        if mass < leading - LIMITS.alike_nats:
            break
        log_years, is_of_those_before, showing = _of_change(evidence, course, index)
        found = max(found, min(mass, log_years))
        first = int(evidence.beginnings[index[0]])
        if n == 0 and first == course.baseline and is_of_those_before and is_clear:
            against = showing
    return found, against


def _most_probable(evidence: Evidence) -> list[tuple[int, ...]]:
    """Return the likeliest changes of different beginning, kind and cause."""
    by_cause = evidence.log_mass.max(axis=(1, 4), initial=-math.inf)
    order = np.argsort(by_cause.ravel())[::-1][: LIMITS.persistence_leading]
    chosen: list[tuple[int, ...]] = []
    for at, kind, d in np.array(np.unravel_index(order, by_cause.shape)).T.tolist():
        of_one = evidence.log_mass[at, :, kind, d]
        k, size = np.unravel_index(int(of_one.argmax()), of_one.shape)
        if math.isfinite(of_one[k, size]):
            chosen.append((at, int(k), kind, d, int(size)))
    return chosen


def _of_change(
    evidence: Evidence, course: Course, index: tuple[int, ...]
) -> tuple[float, bool, int]:
    """Log of the years, whether those before a change being odd bounds these, how many show it."""
    at, _, kind, d, _ = index
    first = int(evidence.beginnings[at])
    begun = max((each.first for each in evidence.called), default=0)
    shown, sd, largest = _shown(evidence, course, index)
    expected = np.ones(len(shown))
    if kind == RAMP:
        since = evidence.years - float(evidence.years[first - 1])
        expected = since / max(evidence.progress(at), 1e-12)
    is_after = np.arange(len(shown)) >= first
    before = shown[begun:first][sd[begun:first] < LIMITS.telling]
    after = is_after & (sd < LIMITS.telling * expected) & (expected >= LIMITS.shown)
    least = LIMITS.large_seem if largest > LIMITS.large else LIMITS.seem
    slips = evidence.directions[d].name in _SLIPPING
    seem, as_from = (LIMITS.slipped, LIMITS.slipped_as_from) if slips else (least, LIMITS.as_from)
    does = shown[after] >= LIMITS.shown * expected[after]
    as_far = (before[:, None] >= LIMITS.shown * expected[after]).sum(axis=0)
    odd = np.maximum((as_far + seem * as_from) / (len(before) + as_from), least)
    showing, not_showing = LIMITS.showing * LIMITS.as_from, (1 - LIMITS.showing) * LIMITS.as_from
    likely = scipy.special.betaln(showing + does.sum(), not_showing + (~does).sum())
    likely -= scipy.special.betaln(showing, not_showing)
    those_after = np.where(does, np.log(odd), np.log1p(-odd)).sum()
    early = before >= LIMITS.shown
    odd_before = LIMITS.gross_before if largest > LIMITS.gross else max(seem, LIMITS.seem)
    those_before = np.where(early, math.log1p(-LIMITS.seem), math.log(odd_before)).sum()
    those_before += max(int((~early).sum()) - 1, 0) * math.log(LIMITS.odd_alike)
    each = np.clip(evidence.waited, LIMITS.least_waited, LIMITS.most_waited)
    waited = float(each @ evidence.shares.sum(axis=(1, 2, 3, 4)))
    log_years = math.log(waited) + float(likely - np.logaddexp(those_after, those_before))
    is_baseline_odd = largest <= LIMITS.gross and bool(those_before > those_after)
    return log_years, is_baseline_odd, int(does.sum())


def _shown(
    evidence: Evidence, course: Course, index: tuple[int, ...]
) -> tuple[FloatArray, FloatArray, float]:
    """Return the fraction of a change that each test (T,) shows, its sd, and the largest move.

    The latter is that of any log frequency.
    """
    change, null = evidence.mean_of(index)
    moves, rest = course.changing @ change, course.values - course.rows @ null
    shown, sd = fraction_shown(moves, rest, course.covariance[:, index[1]], course.errors)
    return shown, sd, float(np.abs(moves).max(initial=0.0))


def fraction_shown(
    moves: FloatArray, rest: FloatArray, covariance: FloatArray, errors: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the fraction of `moves` (T, n) that each test's `rest` (T, n) shows, and its sd (T,).

    By generalised least squares with the `covariance` (T, n, n) of the evidence; the sd is that by
    the `errors` (T, n) of each mode alone (record 0037).
    """
    weight = np.linalg.solve(covariance, moves[..., None])[..., 0]
    strength = np.maximum((weight * moves).sum(axis=1), 1e-12)
    sd = np.sqrt((weight**2 * errors).sum(axis=1)) / strength
    return (weight * rest).sum(axis=1) / strength, sd
