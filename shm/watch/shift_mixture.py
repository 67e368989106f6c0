"""Shifts in the units that people read, of mixtures of normal distributions in the coordinate."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from shm.values import FloatArray, WatchedQuantity, is_ratio
from shm.watch.quantities import coordinate_of, shift_of

# Technical: exact for polynomials of degree 13.
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(7)
_WEIGHTS = _WEIGHTS / _WEIGHTS.sum()
_NEGLIGIBLE = 1e-7  # technical: less than the least probability that is told


@dataclass(frozen=True)
class Shift:
    """Mean and sd of a shift."""

    mean: float
    sd: float


def shift_of_mixture(
    quantity: WatchedQuantity, weights: FloatArray, mean: FloatArray, sd: FloatArray
) -> Shift:
    """Of normal distributions (B,) in the coordinate; no shift at all with what `weights` leave.

    By Gauss-Hermite quadrature of seven nodes in each.
    """
    kept = weights > _NEGLIGIBLE
    weights = weights[kept]
    mean, sd = mean[kept], sd[kept]
    shifts = shift_of(quantity, mean[:, None] + sd[:, None] * _NODES)
    first = float(weights @ shifts @ _WEIGHTS)
    second = float(weights @ (shifts - first) ** 2 @ _WEIGHTS)
    second += (1 - float(weights.sum())) * first**2
    return Shift(first, math.sqrt(max(second, 0.0)))


def beyond(
    quantity: WatchedQuantity,
    weights: FloatArray,
    mean: FloatArray,
    sd: FloatArray,
    threshold: float,
    least: float = 0.0,
) -> float:
    """Probability of a shift beyond a threshold, the likelier way, by the same mixture.

    Decades of an end that is as good as clamped move nothing: what moves the frequencies' mean by
    less than `least`, a spring's coordinate, is not beyond.
    """
    kept = weights > _NEGLIGIBLE
    weights, mean = weights[kept], mean[kept]
    sd = np.maximum(sd[kept], 1e-12)
    low, high = (_coordinate(quantity, sign * threshold) for sign in (-1, 1))
    if not is_ratio(quantity.name):
        low, high = min(low, -least), max(high, least)
    down = float(weights @ scipy.special.ndtr((low - mean) / sd))
    up = float(weights @ scipy.special.ndtr((mean - high) / sd))
    return min(max(down, up), 1.0)


def _coordinate(quantity: WatchedQuantity, shift: float) -> float:
    """Return the coordinate of a shift; infinite where the quantity's table ends before it."""
    is_fraction = is_ratio(quantity.name)
    value = quantity.baseline * (1 + shift) if is_fraction else quantity.baseline + shift
    if not min(quantity.values) < value < max(quantity.values):
        return math.copysign(math.inf, shift)
    return coordinate_of(quantity, value)
