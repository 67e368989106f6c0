"""The default identifier: subspace identification of free decays, Hankel matrices summed over hits.

Each hit's ring-down gives one Hankel matrix of future responses times past references. Poles that
stay from order to order, and stay when any one hit is left out, are modes. Frequency and damping
are medians over a few high orders; standard deviations are the jackknife's. Ambient motion goes
the same way: the covariances of white-noise-driven modes are sums of free decays.

Subspace identification with the hammer's force as input, Hankel matrices summed over hits.

Where the free decay is what follows the pulse, this one looks at each hit from before the hammer
strikes. What the measured force explains is projected out of the future responses, so a second
blow, or a force that does not end, does no harm; the pulse needs no end.

Modes from Hankel matrices, one a hit, whose sum has the modes of all hits in its column space.

State-space models of rising order are cut from the sum. Leaving out a hit need not cost a new
decomposition: the Hankel matrix without it, times the leading right singular vectors of the whole
one, spans the same columns but for terms of second order.

The one door to pyOMA2: two functions of its `ssi` module, kept quiet.

Importing pyOMA2 turns numpy's warnings off, attaches a log handler, mutes matplotlib's logger and
draws progress bars on standard error; all four are undone here. Only `pyoma2.functions.ssi` is
imported: the rest of the package brings pandas and scikit-learn.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, reduce
from types import ModuleType
from typing import Any

import numpy as np

from shm.errors import NotIdentifiable
from shm.identify.contract import Finding, Measurement
from shm.identify.estimation.poles import PoleSet, poles_of
from shm.identify.estimation.repeats import LEAST_HITS
from shm.identify.estimation.stabilise import (
    completed,
    final_orders,
    nothing_moves,
    stabilised,
)
from shm.identify.estimation.zoom import STOPPED, Window, windows
from shm.identify.options import IdentifyOptions
from shm.values import FloatArray

_NOBODY_HIT = 2.0
"""The chance in ambient motion moves a frequency more than noise does a ring-down's: so many times
the largest standard deviation of a hammer test are taken."""
# Rows are channels times lags and cost their cube; so many leave 0.9 s a test. Of modes 20 dB above
# the noise in 11 kinds of recordings_trial.py (seeds 0 to 2), ring-downs then give 79 %, with 240
# rows 72 %: modes of two planes that are all but equal need lags as long as their beat.
_ROWS = 640
_BLOCK_ROWS = (100, 220)
_MOST_ROWS = 880
_ROWS_FEW = 240
_BLOCK_ROWS_FEW = (60, 120)
"""Covariances of ambient motion are vague at long lags; fewer than three hits do not prove what a
larger model makes of noise."""
_BLOCK_ROWS_ALONE = 320
"""A single channel tells close modes apart by time alone: it needs more lags."""
_REFERENCES = 4  # judgement: two planes, and two modes that are close in each
_MAX_ORDER = 120  # judgement: two each of the 30 modes a plane that a long hanger has below 100 Hz
_FEW_ORDERS = 40
"""Where nobody hit, models that are far larger than what moves follow the chance in it: a structure
of five modes loses one in ten at orders up to 120, none at 28 to 40 (tests/worlds/recordings.py)"""
_LEAST_POINTS = 3
"""Of one hit, shapes alone tell a mode from noise in a window, and those of two channels agree by
chance: case1 of tests/identify/test_real_records.py, one channel, would have seven modes too many.
"""
_ROWS_WINDOW = 60  # judgement: two seconds of lags, at four times the reach of a window
_MOST_SUMS = 10  # judgement: parts of ambient motion by twos; Student's quantile is 6 % above
_COARSE_FROM = 60  # judgement: thirty orders or so tell what stays, and more only cost
_LEAST_ORDER = 2  # one mode
_RANK_TOLERANCE = 1e-17
"""Singular values below this share of the first are zero but for rounding."""


def summed_hankel_ssi(measurement: Measurement, options: IdentifyOptions) -> Finding:
    """Modes of a measurement by multi-hit SSI (see the module's text)."""
    nobody_hit = measurement.frequency_response is None and not measurement.hits
    if nobody_hit:
        samples = sum(part.shape[1] for part in measurement.decays)
        options = replace(
            options,
            max_frequency_sd=_NOBODY_HIT * options.max_frequency_sd,
            ambient_s=samples / measurement.sampling_rate_hz,
        )
    mixed = references(measurement.decays)
    rows = block_rows(measurement, options)
    matrices = [hankel(decay, mixed @ decay, rows) for decay in measurement.decays]
    if nobody_hit:
        matrices = _few_sums(matrices)
    found = modes_of_hankel(matrices, rows, measurement, options)
    if nobody_hit:
        few = replace(options, max_order=min(options.max_order or _FEW_ORDERS, _FEW_ORDERS))
        found = completed(found, modes_of_hankel(matrices, rows, measurement, few))
    checked = len(measurement.decays) > 1 or len(measurement.points) >= _LEAST_POINTS
    timed = bool(measurement.hits) or nobody_hit
    if _repeated(measurement) or not (timed and checked):
        return found
    return completed(found, through_windows(measurement, options))


def summed_hankel_ssi_with_input(measurement: Measurement, options: IdentifyOptions) -> Finding:
    """Modes of a measurement by multi-hit SSI with the force as input.

    Raises NotIdentifiable where the measurement holds no force over time.
    """
    if not measurement.driven:
        raise NotIdentifiable(
            "identifier 'ssi-input' needs the hammer's force over time.",
            file=measurement.source,
            remedy="Give time records with a force channel, or use the identifier 'ssi'.",
        )
    mixed = references(measurement.decays)
    rows = block_rows(measurement, options)
    matrices = [
        hankel_with_input(driven[1:], mixed @ driven[1:], driven[:1], rows)
        for driven in measurement.driven
    ]
    return modes_of_hankel(matrices, rows, measurement, options)


def through_windows(measurement: Measurement, options: IdentifyOptions) -> Finding:
    """The modes that each window of the band shows by itself."""
    every = windows(measurement.sampling_rate_hz, options)
    return reduce(completed, (_in_window(window, measurement, options) for window in every))


def _in_window(window: Window, measurement: Measurement, options: IdentifyOptions) -> Finding:
    rate, rate_slow = measurement.sampling_rate_hz, window.rate_hz(measurement.sampling_rate_hz)
    decays = tuple(window.through(decay, rate) for decay in measurement.decays)
    if _size(decays) < STOPPED * _size(measurement.decays):
        return nothing_moves(len(decays))
    mixed = references(decays)
    rows = min(_ROWS_WINDOW, min(decay.shape[1] for decay in decays) // 3)
    matrices = [hankel(decay, mixed @ decay, rows) for decay in decays]
    slow = replace(measurement, decays=decays, sampling_rate_hz=rate_slow)
    return modes_of_hankel(
        _few_sums(matrices), rows, slow, window.options(options), window.shift_hz
    )


def _few_sums(matrices: Sequence[FloatArray]) -> list[FloatArray]:
    """The matrices as no more than ten sums, each to be left out in turn."""
    return [np.sum(matrices[n::_MOST_SUMS], axis=0) for n in range(min(len(matrices), _MOST_SUMS))]


def _size(decays: Sequence[FloatArray]) -> float:
    return max(float(np.std(decay)) for decay in decays)


@dataclass(frozen=True)
class _Size:
    """Size of the models, and the model orders that are looked at."""

    block_rows: int
    max_order: int
    sampling_rate_hz: float
    shift_hz: float = 0.0

    @property
    def orders(self) -> list[int]:
        step = 2 if self.max_order < _COARSE_FROM else 4
        return list(range(self.max_order, 0, -step))[::-1]


def references(responses: Sequence[FloatArray]) -> FloatArray:
    """Rows (references, channels) that mix the channels into the few that carry most energy."""
    channels = len(responses[0])
    if channels <= _REFERENCES:
        return np.eye(channels)
    covariance = np.sum([response @ response.T for response in responses], axis=0)
    _, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors[:, -_REFERENCES:].T)


def _repeated(measurement: Measurement) -> bool:
    """Whether hits enough tell modes from noise."""
    hit = bool(measurement.hits) or measurement.frequency_response is not None
    return hit and len(measurement.decays) >= LEAST_HITS


def block_rows(measurement: Measurement, options: IdentifyOptions) -> int:
    """How many time lags the Hankel matrices hold."""
    shortest = min(decay.shape[1] for decay in measurement.decays)
    channels = len(measurement.points)
    rows, bounds = (_ROWS, _BLOCK_ROWS) if _repeated(measurement) else (_ROWS_FEW, _BLOCK_ROWS_FEW)
    shared = min(int(np.clip(rows // channels, *bounds)), _MOST_ROWS // channels)
    wanted = _BLOCK_ROWS_ALONE if channels == 1 else shared
    return int(min(options.block_rows or wanted, shortest // 3))


def modes_of_hankel(
    matrices: Sequence[FloatArray],
    rows: int,
    measurement: Measurement,
    options: IdentifyOptions,
    shift_hz: float = 0.0,
) -> Finding:
    """Modes from the Hankel matrices of the hits, each of `rows` blocks of rows.

    `shift_hz` is what their frequencies lie below the true ones.
    """
    total = np.sum(matrices, axis=0)
    max_order = _max_order(total, rows, options.max_order or _MAX_ORDER)
    if max_order < _LEAST_ORDER:
        return nothing_moves(len(matrices))
    size = _Size(rows, max_order, measurement.sampling_rate_hz, shift_hz)
    observability, sets = _models(total, size, size.orders)
    without_each = _models_without_each_hit(matrices, _right_basis(total, observability), size)
    seconds = max(decay.shape[1] for decay in measurement.decays) / size.sampling_rate_hz
    return stabilised(sets, without_each, seconds, options)


def _max_order(matrix: FloatArray, rows: int, most: int) -> int:
    """The highest even order up to `most` that the matrix has the size and numerical rank for."""
    values = np.linalg.svd(matrix, compute_uv=False)
    rank = int(np.sum(values > _RANK_TOLERANCE * values[0]))
    shifted_rows = matrix.shape[0] // rows * (rows - 1)
    largest = min(most, rank, shifted_rows // 2, matrix.shape[1])
    return int(largest // 2 * 2)


def _models(
    matrix: FloatArray, size: _Size, orders: Sequence[int]
) -> tuple[FloatArray, list[PoleSet]]:
    """Observability matrix, and the poles of each of `orders`."""
    observability, states, outputs = realise(matrix, size.block_rows, size.max_order)
    rate, shift_hz = size.sampling_rate_hz, size.shift_hz
    return observability, [
        poles_of(states[n // 2], outputs[n // 2], rate, shift_hz) for n in orders
    ]


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
    orders = final_orders(size.orders)
    return [_models(total - part, size, orders)[1] for part in projected]


def _no_progress_bar(*bounds: int, **_: Any) -> Iterator[int]:
    return iter(range(*bounds))


@cache
def _pyoma2() -> ModuleType:
    """The `ssi` module, loaded where it is called: it brings `scipy.linalg`."""
    matplotlib_level = logging.getLogger("matplotlib").level
    with np.errstate():
        from pyoma2.functions import ssi
    logger = logging.getLogger("pyoma2")
    for handler in list(logger.handlers):
        logger.removeHandler(handler)
    logger.setLevel(logging.WARNING)
    logging.getLogger("matplotlib").setLevel(matplotlib_level)
    setattr(ssi, "trange", _no_progress_bar)  # noqa: B010
    return ssi


def hankel(response: FloatArray, reference: FloatArray, block_rows: int) -> FloatArray:
    """Sum over time of future responses times past references.

    `response` (channels, samples) and `reference` (references, samples) give a matrix of shape
    (channels * block_rows, references * block_rows). For a free decay it is exact, and it leaves
    out lag zero, hence white noise. It is `build_hank` of pyOMA2 to rounding, without its product
    of the size of all rows: a block is its neighbour down the antidiagonal, one sample later.
    """
    channels, references, most = len(response), len(reference), block_rows - 1
    samples = response.shape[1] - 2 * block_rows + 1
    blocks = np.empty((block_rows, channels, block_rows, references))
    future = response[:, block_rows:]
    for back in range(block_rows):
        first = most - back
        past = reference[:, first : first + samples]
        blocks[0, :, back] = future[:, :samples] @ past.T
    gone = reference[:, :most][:, ::-1].T
    come = reference[:, samples : samples + most][:, ::-1].T
    for row in range(1, block_rows):
        before, last = future[:, row - 1, None, None], future[:, row - 1 + samples, None, None]
        blocks[row, :, :-1] = blocks[row - 1, :, 1:] + last * come - before * gone
        blocks[row, :, -1] = future[:, row : row + samples] @ reference[:, :samples].T
    matrix = blocks.reshape(block_rows * channels, block_rows * references)
    return np.asarray(matrix / samples * response.shape[1], dtype=np.float64)


def hankel_with_input(
    response: FloatArray, reference: FloatArray, force: FloatArray, block_rows: int
) -> FloatArray:
    """The same after what the future of `force` (1, samples) explains is projected out.

    Its least squares are scaled by the force's own size; as future responses and past references
    enter both with the share of a direction that the force has, weak ones do no harm.
    """
    matrix, _ = _pyoma2().build_hank(response, reference, block_rows, "IOcov", U=force)
    return np.asarray(matrix * response.shape[1], dtype=np.float64)


def realise(
    matrix: FloatArray, block_rows: int, max_order: int
) -> tuple[FloatArray, list[FloatArray], list[FloatArray]]:
    """Observability matrix (rows, max_order); state and output matrices of orders 0, 2, 4, ..."""
    observability, states, outputs, _ = _pyoma2().SSI_fast(matrix, block_rows, max_order, step=2)
    return np.asarray(observability, dtype=np.float64), list(states), list(outputs)
