"""The default identifier: subspace identification of free decays, Hankel matrices summed over hits.

Each hit's ring-down gives one Hankel matrix of future responses times past references; their sum
has the modes of all hits in its column space. State-space models of rising order are cut from it;
poles that stay from order to order, and stay when any one hit is left out, are modes.
Frequency and damping are medians over a few high orders; standard deviations are the jackknife's.

Leaving out a hit need not cost a new decomposition: the Hankel matrix without it, times the leading
right singular vectors of the whole one, spans the same columns but for terms of second order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.identify.candidates import diagram, resolved, stable_candidates
from shm.identify.contract import Dropped, Finding, Measurement, Poles
from shm.identify.options import IdentifyOptions
from shm.identify.poles import PoleSet, poles_of
from shm.identify.repeats import find_again, proven
from shm.identify.subspace import hankel, realise
from shm.values import FloatArray

_ROWS = 240
_BLOCK_ROWS = (60, 120)
_BLOCK_ROWS_ALONE = 320
"""A single channel tells close modes apart by time alone: it needs more lags."""
_MOST_ROWS = 640
_REFERENCES = 4
_MAX_ORDER = 120
_COARSE_FROM = 60
_LEAST_ORDER = 2
_RANK_TOLERANCE = 1e-17
"""Singular values below this share of the first are zero but for rounding."""
_FINAL_ORDERS = 5


@dataclass(frozen=True)
class _Size:
    """Size of the models, and the model orders that are looked at."""

    block_rows: int
    max_order: int
    sampling_rate_hz: float

    @property
    def orders(self) -> list[int]:
        step = 2 if self.max_order < _COARSE_FROM else 4
        return list(range(self.max_order, 0, -step))[::-1]

    @property
    def final_orders(self) -> list[int]:
        """The orders that estimates are taken from: spread over the upper half."""
        upper = [order for order in self.orders if 2 * order >= self.max_order]
        picks = np.linspace(0, len(upper) - 1, _FINAL_ORDERS).round().astype(int)
        return [upper[pick] for pick in sorted(set(picks.tolist()))]


def summed_hankel_ssi(measurement: Measurement, options: IdentifyOptions) -> Finding:
    """Modes of a measurement by multi-hit SSI (see the module's text)."""
    references = _references(measurement.decays)
    block_rows = _block_rows(measurement, options)
    matrices = [hankel(decay, references @ decay, block_rows) for decay in measurement.decays]
    total = np.sum(matrices, axis=0)
    max_order = _max_order(total, block_rows, options)
    if max_order < _LEAST_ORDER:
        return _nothing_moves(len(matrices))
    size = _Size(block_rows, max_order, measurement.sampling_rate_hz)
    observability, sets = _models(total, size, size.orders)
    candidates, unstable = stable_candidates(sets, size.final_orders, options)
    seconds = max(decay.shape[1] for decay in measurement.decays) / size.sampling_rate_hz
    candidates, doubles = resolved(candidates, seconds)
    models = _models_without_each_hit(matrices, _right_basis(total, observability), size)
    modes, doubtful = proven(candidates, find_again(candidates, models), options)
    return Finding(modes, unstable + doubles + doubtful, diagram(sets, candidates, options))


def _nothing_moves(hits: int) -> Finding:
    nothing = np.empty(0)
    dropped = (Dropped("ring-downs", hits, "nothing moves in them"),)
    return Finding((), dropped, Poles(nothing, nothing, nothing, nothing.astype(bool)))


def _references(decays: Sequence[FloatArray]) -> FloatArray:
    """Rows (references, channels) that mix the channels into the few that carry most energy."""
    channels = len(decays[0])
    if channels <= _REFERENCES:
        return np.eye(channels)
    covariance = np.sum([decay @ decay.T for decay in decays], axis=0)
    _, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors[:, -_REFERENCES:].T)


def _block_rows(measurement: Measurement, options: IdentifyOptions) -> int:
    shortest = min(decay.shape[1] for decay in measurement.decays)
    channels = len(measurement.points)
    shared = min(int(np.clip(_ROWS // channels, *_BLOCK_ROWS)), _MOST_ROWS // channels)
    wanted = _BLOCK_ROWS_ALONE if channels == 1 else shared
    return int(min(options.block_rows or wanted, shortest // 3))


def _max_order(matrix: FloatArray, block_rows: int, options: IdentifyOptions) -> int:
    """The highest even order that the matrix has the size and the numerical rank for."""
    values = np.linalg.svd(matrix, compute_uv=False)
    rank = int(np.sum(values > _RANK_TOLERANCE * values[0]))
    shifted_rows = matrix.shape[0] // block_rows * (block_rows - 1)
    largest = min(options.max_order or _MAX_ORDER, rank, shifted_rows // 2, matrix.shape[1])
    return int(largest // 2 * 2)


def _models(
    matrix: FloatArray, size: _Size, orders: Sequence[int]
) -> tuple[FloatArray, list[PoleSet]]:
    """Observability matrix, and the poles of each of `orders`."""
    observability, states, outputs = realise(matrix, size.block_rows, size.max_order)
    rate = size.sampling_rate_hz
    return observability, [poles_of(states[n // 2], outputs[n // 2], rate) for n in orders]


def _right_basis(matrix: FloatArray, observability: FloatArray) -> FloatArray:
    """Leading right singular vectors, (columns, order); the observability matrix is U sqrt(S)."""
    values = np.sum(observability**2, axis=0)
    return np.asarray(matrix.T @ observability / values**1.5)


def _models_without_each_hit(
    matrices: Sequence[FloatArray], basis: FloatArray, size: _Size
) -> list[list[PoleSet]]:
    if len(matrices) < 2:
        return []
    projected = [matrix @ basis for matrix in matrices]
    total = np.sum(projected, axis=0)
    return [_models(total - part, size, size.final_orders)[1] for part in projected]
