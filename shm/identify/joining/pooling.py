"""One estimate from those of several set-ups, which differ by more than their own scatter tells."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri, stdtrit

from shm.values import NAN, FloatArray

_LEAST_SET_UPS = 3


def pooled(values: FloatArray, sds: FloatArray) -> tuple[float, float]:
    """Mean and standard deviation of `values` (set-ups,) with their own `sds`, NaN where unknown.

    Random effects: what set-ups differ by (mounting of sensors, temperature) is estimated from
    their scatter and added to the variance of each (DerSimonian and Laird 1986, eq. 6 to 9); its
    share of the result is widened as Student's 95 % quantile is over the normal one. An unknown
    standard deviation counts as the largest known one, and none as smaller than the median: from a
    few hits it may be small by chance. Where none is known, three set-ups or more tell by their
    scatter alone; the result of fewer is NaN.
    """
    count = len(values)
    if count == 1:
        return float(values[0]), float(sds[0])
    if np.all(np.isnan(sds)):
        scatter = float(np.std(values, ddof=1)) / np.sqrt(count) * _widening(count)
        return float(np.mean(values)), scatter if count >= _LEAST_SET_UPS else NAN
    own = np.where(np.isnan(sds), np.nanmax(sds), sds) ** 2
    own = np.maximum(own, max(float(np.nanmedian(sds**2)), np.finfo(float).tiny))
    between = _between(values, own)
    weights = 1 / (own + between)
    alone = 1 / np.sum(1 / own)
    variance = alone + (1 / np.sum(weights) - alone) * _widening(count) ** 2
    return float(values @ weights / np.sum(weights)), float(np.sqrt(variance))


def _between(values: FloatArray, own: FloatArray) -> float:
    """The variance between set-ups beyond their `own` variances (set-ups,)."""
    weights = 1 / own
    total = np.sum(weights)
    excess = weights @ (values - values @ weights / total) ** 2 - (len(values) - 1)
    return max(0.0, float(excess / (total - np.sum(weights**2) / total)))


def _widening(count: int) -> float:
    return float(stdtrit(count - 1, 0.95) / ndtri(0.95))
