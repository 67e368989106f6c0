"""Estimate standard deviations from hits, model orders and neighbouring modes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from shm.identify.contract import FREQUENCY_FLOOR, LEAST_HITS
from shm.values import BoolArray, FloatArray
from shm.values.modes import MOST_SLOPE, SURE_SDS

# With it 90 % intervals cover 92 %: docs/trials/identification_benchmarks.md, identify_simulated.py
_SHARE_OF_ORDERS = 0.5
_REACH, _LEAST_NEIGHBOURS = 2, 3  # judgement; what they do was counted: see `smooth_sds`
_LEAST_SLOPE = 2e-5
"""Relative. A phase is known so well that a clock's shaking would show; no one needs less."""
_BY_CHANCE = 0.01
"""Probability that as many modes, or one by so much, are sure by chance, above which none is. Of a
test of twenty modes one is beyond `SURE_SDS` by chance in 22 %."""


def jackknife_sd(estimates: FloatArray) -> FloatArray:
    """Return the standard deviation from delete-one replicates (hits, ...) of an estimate: (...).

    Efron (1982), eq. 3.1, widened by the ratio of Student's 95 % quantile with hits - 1 degrees
    of freedom to the normal one, so that a 90 % interval of a normal distribution with this
    standard deviation covers the truth in 90 %. NaN below three hits.
    """
    hits = len(estimates)
    if hits < LEAST_HITS:
        return np.full(estimates.shape[1:], np.nan)
    spread = np.sum((estimates - estimates.mean(axis=0)) ** 2, axis=0)
    return np.asarray(np.sqrt((hits - 1) / hits * spread) * widening(hits - 1))


def order_sd(estimates: Sequence[float] | Sequence[FloatArray]) -> FloatArray:
    """Return the standard deviation that the choice of the model order adds: (...).

    `estimates` (orders, ...) of a median over orders come from the same hits, so no hit left
    out shows it. It is half of their spread: measured to make the intervals of all identifiers
    right.
    """
    values = np.asarray(estimates)
    if len(values) < 2:
        return np.zeros(values.shape[1:])
    return np.asarray(_SHARE_OF_ORDERS * np.std(values, axis=0, ddof=1))


def smooth_sds(sds: FloatArray, hits: int) -> FloatArray:
    """Smooth standard deviations (modes,) over neighbouring modes.

    From a few hits one may be far too small by chance. As in G. K. Smyth's moderated variances
    (Statistical Applications in Genetics and Molecular Biology 3, 2004), a variance with hits -
    1 degrees of freedom is averaged with what the others lead to expect, here the median of up
    to four neighbours with one degree of freedom. On 576 simulated frequencies of 5 hits, none
    of them used to choose that, 0.9 % lay beyond 3 standard deviations instead of 1.9 %.
    Unchanged below three hits or three modes.
    """
    if hits < LEAST_HITS or len(sds) < _LEAST_NEIGHBOURS:
        return sds
    expected = np.array([_neighbours_sd(sds, index) for index in range(len(sds))])
    return np.asarray(np.sqrt(((hits - 1) * sds**2 + expected**2) / hits))


def _neighbours_sd(sds: FloatArray, index: int) -> float:
    near = np.arange(max(0, index - _REACH), min(len(sds), index + _REACH + 1))
    return float(np.median(sds[near[near != index]]))


def widening(freedom: int) -> float:
    """Return Student's 95 % quantile over the normal one."""
    return float(scipy.special.stdtrit(freedom, 0.95) / scipy.special.ndtri(0.95))


def frequency_sd(frequency_hz: float, estimates_hz: FloatArray) -> float:
    """Return the standard deviation of a frequency; the stated floor below three hits."""
    if len(estimates_hz) < LEAST_HITS or not np.all(np.isfinite(estimates_hz)):
        return FREQUENCY_FLOOR * frequency_hz
    return float(jackknife_sd(estimates_hz))


def are_sure(slopes: FloatArray, sds: FloatArray) -> BoolArray:
    """Return which frequencies depend on amplitude by more than chance and less than nonsense.

    Where several are beyond `SURE_SDS` that is no chance; one alone must be by more, the more modes
    there are. `slopes` and `sds` (modes,) are NaN where they are not known.
    """
    known = int(np.sum(np.isfinite(slopes)))
    size = np.where(np.isfinite(slopes), np.abs(slopes), 0.0)
    possible = (size > _LEAST_SLOPE) & (size < MOST_SLOPE)
    sure = possible & (size > SURE_SDS * sds)
    count, one = int(np.sum(sure)), 2 * scipy.special.ndtr(-SURE_SDS)
    if not count or scipy.special.bdtrc(count - 1, known, one) < _BY_CHANCE:
        return np.asarray(sure)
    alone = -scipy.special.ndtri(_BY_CHANCE / (2 * known))
    return np.asarray(possible & (size > alone * sds))
