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
# Of a difference, in its own sds: up to the first all counts, from the second on nothing: what lies
# that far is a change, and no scatter (Hampel 1974). One good one in 370 is beyond the first.
_SCATTER_UP_TO, _CHANGE_FROM = 3.0, 6.0
_ABSENT = 1e8  # technical: no log frequency differs by 1e4


@dataclass(frozen=True, eq=False)
class Differences:
    """Of tests that follow each other: `values` (d, n), `factors` (d, n, c), along which they
    scatter, and `covariance` (d, n, n) of what is known to differ beside that."""

    values: FloatArray
    covariance: FloatArray
    factors: FloatArray


def differences(
    values: FloatArray, variances: FloatArray, factors: FloatArray, doubt: FloatArray
) -> Differences:
    """Of tests (T, n) with `factors` (T, n, c); a mode that one of two lacks says nothing.

    `doubt` (T, n, m) are the factors of what conditions leave open, unit normals a test.
    """
    spread = variances[1:] + variances[:-1]
    known = np.isfinite(spread)
    of_both = np.concatenate([doubt[1:], doubt[:-1]], axis=2) * known[:, :, None]
    own = np.where(known, spread, _ABSENT)
    return Differences(
        np.where(known, np.diff(values, axis=0), 0.0),
        own[:, :, None] * np.eye(values.shape[1]) + of_both @ np.swapaxes(of_both, 1, 2),
        np.where(known[:, :, None], factors[1:], 0.0),
    )


def learnt(found: Differences, prior_variance: FloatArray, begun: FloatArray) -> FloatArray:
    """Variance (c,) along each factor: of one test, half of that of a difference."""
    variance = np.maximum(begun, 1e-12)
    if not len(found.values):
        return prior_variance
    there = np.abs(found.factors).max(axis=1) > 0
    for _ in range(_ROUNDS):
        scaled = found.factors * np.sqrt(2 * variance)
        weight = np.linalg.inv(scaled @ np.swapaxes(scaled, 1, 2) + found.covariance)
        weighted = weight @ scaled
        # Of a unit normal along each factor: its mean given the difference, and what that explains.
        along = np.einsum("dic,di->dc", weighted, found.values)
        explained = np.einsum("dic,dic->dc", scaled, weighted)
        far = np.abs(along) / np.sqrt(np.maximum(explained, 1e-12))
        left = np.clip((_CHANGE_FROM - far) / (_CHANGE_FROM - _SCATTER_UP_TO), 0.0, 1.0)
        square = explained * np.minimum(far, _SCATTER_UP_TO) ** 2
        expected = there * (left * square + (1 - left) * explained + 1 - explained)
        variance = (_PRIOR_TESTS * prior_variance + variance * expected.sum(axis=0)) / (
            _PRIOR_TESTS + there.sum(axis=0)
        )
    return np.asarray(variance)
