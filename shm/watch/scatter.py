"""By how much tests of one state differ, and along what: variance components of differences.

A joint that gives in the wind, wires that slip, sensors put elsewhere: what differs
from test to test goes along a few known columns, each by an amount that is the hanger's own. It is
learnt from the differences of tests that follow each other, which a lasting change touches once,
by expectation and maximisation (Dempster, Laird and Rubin 1977), about a prior worth a few tests.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.values import FloatArray

_PRIOR_TESTS = 6.0  # judgement: a dozen tests say more than what was assumed of any hanger
_ROUNDS = 4  # technical: begun from what the tests before gave, it has nearly settled
_CLIPPED = 3.0  # times what is expected of a difference: more is a change, and no scatter
_ABSENT = 1e8


@dataclass(frozen=True, eq=False)
class Differences:
    """Of tests that follow each other: `values` and `variances` (d, n), `factors` (d, n, c)."""

    values: FloatArray
    variances: FloatArray
    factors: FloatArray


def differences(values: FloatArray, variances: FloatArray, factors: FloatArray) -> Differences:
    """Of tests (T, n) with `factors` (T, n, c); a mode that one of two lacks says nothing."""
    spread = variances[1:] + variances[:-1]
    known = np.isfinite(spread)
    return Differences(
        np.where(known, np.diff(values, axis=0), 0.0),
        np.where(known, spread, _ABSENT),
        np.where(known[:, :, None], factors[1:], 0.0),
    )


def learnt(found: Differences, prior_variance: FloatArray, begun: FloatArray) -> FloatArray:
    """Variance (c,) along each factor: of one test, half of that of a difference."""
    variance = np.maximum(begun, 1e-12)
    if not len(found.values):
        return prior_variance
    for _ in range(_ROUNDS):
        scaled = found.factors * np.sqrt(2 * variance)
        covariance = scaled @ np.swapaxes(scaled, 1, 2)
        n = covariance.shape[1]
        covariance[:, range(n), range(n)] += found.variances
        weight = np.linalg.inv(covariance)
        pulled = np.einsum("dij,dj->di", weight, found.values)
        square = (found.values * pulled).sum(axis=1)
        modes = np.maximum((found.variances < _ABSENT).sum(axis=1), 1)
        trust = np.minimum(1.0, _CLIPPED * modes / np.maximum(square, 1e-12))
        own = np.einsum("dic,dij,djc->dc", scaled, weight, scaled, optimize=True)
        along = np.einsum("dic,di->dc", scaled, pulled)
        there = np.abs(found.factors).max(axis=1) > 0
        expected = there * (trust[:, None] * along**2 + 1 - own)  # of a unit normal, squared
        variance = (_PRIOR_TESTS * prior_variance + variance * expected.sum(axis=0)) / (
            _PRIOR_TESTS + there.sum(axis=0)
        )
    return np.asarray(variance)
