"""Standard deviations from leaving out one hit at a time, and from the choice of model order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri, stdtrit

from shm.values import FloatArray

LEAST_HITS = 3
_SHARE_OF_ORDERS = 0.5
_REACH, _LEAST_NEIGHBOURS = 2, 3
FREQUENCY_FLOOR = 0.001
"""With fewer than three hits nothing says how well hits repeat. The frequency then gets this
standard deviation, as a fraction: what hangers' frequencies differ by from one day to the next.
Damping and shape stay without."""


def jackknife_sd(estimates: FloatArray) -> FloatArray:
    """Standard deviation of an estimate from its delete-one replicates (hits, ...): (...).

    Efron (1982), eq. 3.1, widened by the ratio of Student's 95 % quantile with hits - 1 degrees of
    freedom to the normal one, so that a 90 % interval of a normal distribution with this standard
    deviation covers the truth in 90 %. NaN below three hits.
    """
    hits = len(estimates)
    if hits < LEAST_HITS:
        return np.full(estimates.shape[1:], np.nan)
    spread = np.sum((estimates - estimates.mean(axis=0)) ** 2, axis=0)
    return np.asarray(np.sqrt((hits - 1) / hits * spread) * _widening(hits))


def order_sd(estimates: Sequence[float] | Sequence[FloatArray]) -> FloatArray:
    """Standard deviation that the choice of the model order adds to a median over orders: (...).

    `estimates` (orders, ...) come from the same hits, so no hit left out shows it. It is half of
    their spread: measured to make the intervals of all identifiers right.
    """
    values = np.asarray(estimates)
    if len(values) < 2:
        return np.zeros(values.shape[1:])
    return np.asarray(_SHARE_OF_ORDERS * np.std(values, axis=0, ddof=1))


def steadied(sds: FloatArray, hits: int) -> FloatArray:
    """Standard deviations (modes,) of neighbours, each made steadier by those beside it.

    From a few hits one may be far too small by chance. As in G. K. Smyth's moderated variances
    (Statistical Applications in Genetics and Molecular Biology 3, 2004), a variance with hits - 1
    degrees of freedom is averaged with what the others lead to expect, here the median of up to
    four neighbours with one degree of freedom. On 576 simulated frequencies of 5 hits, none of
    them used to choose that, 0.9 % lay beyond 3 standard deviations instead of 1.9 %. Unchanged
    below three hits or three modes.
    """
    if hits < LEAST_HITS or len(sds) < _LEAST_NEIGHBOURS:
        return sds
    expected = np.array([_beside(sds, index) for index in range(len(sds))])
    return np.asarray(np.sqrt(((hits - 1) * sds**2 + expected**2) / hits))


def _beside(sds: FloatArray, index: int) -> float:
    near = np.arange(max(0, index - _REACH), min(len(sds), index + _REACH + 1))
    return float(np.median(sds[near[near != index]]))


def _widening(hits: int) -> float:
    return float(stdtrit(hits - 1, 0.95) / ndtri(0.95))


def frequency_sd(frequency_hz: float, estimates_hz: FloatArray) -> float:
    """Standard deviation of a frequency; the stated floor where there are too few hits."""
    if len(estimates_hz) < LEAST_HITS:
        return FREQUENCY_FLOOR * frequency_hz
    return float(jackknife_sd(estimates_hz))
