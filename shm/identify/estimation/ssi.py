"""The default identifier: subspace identification of free decays, Hankel matrices summed over hits.

Each hit's ring-down gives one Hankel matrix of future responses times past references. Poles that
stay from order to order, and stay when any one hit is left out, are modes. Frequency and damping
are medians over a few high orders; standard deviations are the jackknife's. Ambient motion goes
the same way: the covariances of white-noise-driven modes are sums of free decays.

pyOMA2 cuts state-space models of rising order from the sum and solves them. Leaving out a hit need
not cost a decomposition of the whole: the Hankel matrix without it, times the leading right
singular vectors of the whole one, spans the same columns but for terms of second order.

A model of the whole band spends its lags on its highest frequency: of a long hanger it sees a
second, while two planes beat for ten. So ring-downs are also seen through narrow windows: shifted
down and sampled slowly, a part of the band is seen for longer by a smaller model, and what rings
outside of it does not mask it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from itertools import pairwise

import numpy as np
import scipy

from shm.identify.contract import Finding, Measurement
from shm.identify.estimation.poles import PoleSet
from shm.identify.estimation.pyoma import poles_of_orders
from shm.identify.estimation.repeats import LEAST_HITS
from shm.identify.estimation.stabilise import (
    empty_finding,
    final_orders,
    merge_findings,
    stabilised,
)
from shm.identify.options import IdentifyOptions
from shm.values import FloatArray

WIDTH_HZ = 12.0
"""judgement: up to twenty modes of a long hanger. Of those that anybody could identify in ten
records with few hits or none (tests/worlds/recordings.py, seeds 5001 and 5004) the whole band
gives 36 %, with windows of 10 Hz 68 %, of 5 Hz 57 %."""
_GUARD = 0.2  # of the width, on either side: there the filter falls
_FILTER_ORDER, _STOP_DB = 12, 90.0
"""Hits ring 60 to 90 dB above the noise: with 50 dB, modes of other windows are found as images."""
STOPPED = 1e-4
"""Share of the whole motion, -80 dB, below which a window holds but what its filter lets by."""
_SETTLING = 1.5  # in 1 / guard: what is left of its start is 70 dB below the whole (test_zoom)
_ORDERS_IN_WINDOW = 40
_SURE_BELOW_HZ = 30.0
"""Of 221 modes in 16 records with few hits or none (tests/worlds/recordings.py, seeds 5000, 5001)
windows find 186 and 13 others; 177 and 23 with order 60 and without `_SURE_BELOW_HZ`."""
_OVERLAP = 0.05  # of the width: a mode at the edge of two windows is found in either


@dataclass(frozen=True)
class Window:
    """A part of the band; modes are looked for between `low_hz` and `high_hz`."""

    low_hz: float
    high_hz: float

    @property
    def _reach_hz(self) -> float:
        """From the middle to where nothing passes."""
        return (0.5 + _GUARD) * (self.high_hz - self.low_hz)

    @property
    def shift_hz(self) -> float:
        """By how much frequencies are lower in the window."""
        return (self.low_hz + self.high_hz) / 2 - self._reach_hz

    def rate_hz(self, sampling_rate_hz: float) -> float:
        return sampling_rate_hz / self._step(sampling_rate_hz)

    def _step(self, sampling_rate_hz: float) -> int:
        return max(1, int(sampling_rate_hz / (4 * self._reach_hz)))

    def through(self, decay: FloatArray, sampling_rate_hz: float) -> FloatArray:
        """Return a free decay (channels, samples) lowered by `shift_hz`, at `rate_hz`.

        The filter runs from the end to the beginning: so a sum of decaying sines stays one
        from its first sample on, and only its end, where the filter starts, is lost.
        """
        middle = self.shift_hz + self._reach_hz
        turned = decay * np.exp(-2j * np.pi * middle / sampling_rate_hz * np.arange(decay.shape[1]))
        passed = scipy.signal.sosfilt(
            _low_pass(2 * self._reach_hz / sampling_rate_hz), turned[:, ::-1]
        )[:, ::-1]
        rate = self.rate_hz(sampling_rate_hz)
        slow = passed[:, :: self._step(sampling_rate_hz)]
        spoilt = int(_SETTLING / (_GUARD * (self.high_hz - self.low_hz)) * rate)
        slow = slow[:, : max(slow.shape[1] - spoilt, slow.shape[1] // 2)]
        back = np.exp(2j * np.pi * self._reach_hz / rate * np.arange(slow.shape[1]))
        return np.asarray((slow * back).real)

    def options(self, options: IdentifyOptions) -> IdentifyOptions:
        """Return the options with this window's band; windows overlap to miss no mode.

        Poles of noise are as dense in one window as in another, so the tolerance of a
        frequency from model to model grows with it no further than `_SURE_BELOW_HZ`.
        """
        more = _OVERLAP * (self.high_hz - self.low_hz)
        strict = min(1.0, 2 * _SURE_BELOW_HZ / (self.low_hz + self.high_hz))
        return replace(
            options,
            band_low_hz=max(self.low_hz - more, options.band_low_hz),
            band_high_hz=min(self.high_hz + more, options.band_high_hz),
            max_order=min(options.max_order or _ORDERS_IN_WINDOW, _ORDERS_IN_WINDOW),
            max_frequency_sd=strict * options.max_frequency_sd,
            max_frequency_spread=strict * options.max_frequency_spread,
        )


@lru_cache(maxsize=16)
def _low_pass(edge: float) -> FloatArray:
    """Return the sections of a Chebyshev filter that stops above a fraction of half the rate."""
    return np.asarray(scipy.signal.cheby2(_FILTER_ORDER, _STOP_DB, min(edge, 0.99), output="sos"))


def windows(sampling_rate_hz: float, options: IdentifyOptions) -> Iterator[Window]:
    """Yield windows of equal width, side by side over the band."""
    low_hz = options.band_low_hz
    high_hz = min(options.band_high_hz, sampling_rate_hz / 2)
    count = max(1, round((high_hz - low_hz) / WIDTH_HZ))
    edges = np.linspace(low_hz, high_hz, count + 1)
    for low, high in pairwise(edges.tolist()):
        yield Window(low, high)


_AMBIENT_SD = 2.0
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
_REFERENCES_AMBIENT = 8
"""Of what nobody hit, the channels' mixture by energy loses a low mode, whose accelerations are
small: the first of five of pyOMA2's example (4 references find four modes, 5 all). judgement: more
than eight channels are seldom of one set-up."""
_MAX_ORDER = 120  # judgement: two each of the 30 modes a plane that a long hanger has below 100 Hz
_FEW_ORDERS = 40
"""Where nobody hit, models that are far larger than what moves follow the chance in it: a structure
of five modes loses one in ten at orders up to 120, none at 28 to 40 (tests/worlds/recordings.py)"""
_LEAST_POINTS = 3
"""Of one hit, shapes alone tell a mode from noise in a window, and those of two channels agree by
chance: case1 of tests/identify/test_real_records.py, one channel, would have seven modes too many.
"""
_LONG = 0.75
"""Of the third longest: the shortest ring-down that windows look at. Lags are a third of the
shortest, and two planes' modes beat slowly: of five of 1.6 to 4.5 s in a record of a long hanger
(tests/worlds/recordings.py, plain 9302) a window finds 2 of 16 modes, of the three longest 10."""
_ROWS_WINDOW = 60  # judgement: two seconds of lags, at four times the reach of a window
_MOST_SUMS = 10  # judgement: parts of ambient motion by twos; Student's quantile is 6 % above
_COARSE_FROM = 60  # judgement: thirty orders or so tell what stays, and more only cost
_LEAST_ORDER = 2  # one mode
_RANK_TOLERANCE = 1e-17
"""Singular values below this share of the first are zero but for rounding."""


def summed_hankel_ssi(measurement: Measurement, options: IdentifyOptions) -> Finding:
    """Return modes of a measurement by multi-hit SSI (see the module's text)."""
    is_ambient = measurement.frequency_response is None and not measurement.hits
    if is_ambient:
        samples = sum(part.shape[1] for part in measurement.decays)
        options = replace(
            options,
            max_frequency_sd=_AMBIENT_SD * options.max_frequency_sd,
            ambient_s=samples / measurement.sampling_rate_hz,
        )
    mixed = references(measurement.decays, _REFERENCES_AMBIENT if is_ambient else _REFERENCES)
    rows = block_rows(measurement, options)
    matrices = [hankel(decay, mixed @ decay, rows) for decay in measurement.decays]
    if is_ambient:
        matrices = _few_sums(matrices)
    found = modes_of_hankel(matrices, rows, measurement, options)
    if is_ambient:
        few = replace(options, max_order=min(options.max_order or _FEW_ORDERS, _FEW_ORDERS))
        found = merge_findings(found, modes_of_hankel(matrices, rows, measurement, few))
    checked = len(measurement.decays) > 1 or len(measurement.points) >= _LEAST_POINTS
    timed = bool(measurement.hits) or is_ambient
    if _repeated(measurement) or not (timed and checked):
        return found
    every = windows(measurement.sampling_rate_hz, options)
    return merge_findings(found, through_windows(measurement, options, every))


def search_windows(
    measurement: Measurement, options: IdentifyOptions, at_hz: Sequence[float] | None = None
) -> Finding | None:
    """Identify modes in windows around `at_hz`, or over the band.

    Returns None where windows were used before or cannot be.
    """
    every = windows(measurement.sampling_rate_hz, options)
    around = [w for w in every if at_hz is None or any(w.low_hz <= hz <= w.high_hz for hz in at_hz)]
    if not around or not measurement.hits or not _repeated(measurement):
        return None
    return through_windows(measurement, options, around)


def through_windows(
    measurement: Measurement, options: IdentifyOptions, every: Iterable[Window]
) -> Finding:
    """Return the modes that each window shows by itself."""
    return reduce(merge_findings, (_in_window(window, measurement, options) for window in every))


def _in_window(window: Window, measurement: Measurement, options: IdentifyOptions) -> Finding:
    rate, rate_slow = measurement.sampling_rate_hz, window.rate_hz(measurement.sampling_rate_hz)
    by_length = sorted(decay.shape[1] for decay in measurement.decays)
    least = _LONG * by_length[-min(LEAST_HITS, len(by_length))]
    long = [decay for decay in measurement.decays if decay.shape[1] >= least]
    decays = tuple(window.through(decay, rate) for decay in long)
    if _size(decays) < STOPPED * _size(long):
        return empty_finding(len(decays))
    mixed = references(decays)
    rows = min(_ROWS_WINDOW, min(decay.shape[1] for decay in decays) // 3)
    matrices = [hankel(decay, mixed @ decay, rows) for decay in decays]
    slow = replace(measurement, decays=decays, sampling_rate_hz=rate_slow)
    return modes_of_hankel(
        _few_sums(matrices), rows, slow, window.options(options), window.shift_hz
    )


def _few_sums(matrices: Sequence[FloatArray]) -> list[FloatArray]:
    """Return the matrices as no more than ten sums, each to be left out in turn."""
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


def references(responses: Sequence[FloatArray], most: int = _REFERENCES) -> FloatArray:
    """Return rows (references, channels) that mix channels into the `most` with most energy."""
    channels = len(responses[0])
    if channels <= most:
        return np.eye(channels)
    covariance = np.sum([response @ response.T for response in responses], axis=0)
    _, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors[:, -most:].T)


def _repeated(measurement: Measurement) -> bool:
    """Return whether there are hits enough to separate modes from noise."""
    hit = bool(measurement.hits) or measurement.frequency_response is not None
    return hit and len(measurement.decays) >= LEAST_HITS


def block_rows(measurement: Measurement, options: IdentifyOptions) -> int:
    """Return the number of time lags in the Hankel matrices."""
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
    """Return modes from the Hankel matrices of the hits, each of `rows` blocks of rows.

    `shift_hz` is what their frequencies lie below the true ones.
    """
    total = np.sum(matrices, axis=0)
    left, values, right = np.linalg.svd(total, full_matrices=False)
    max_order = _max_order(total.shape, values, rows, options.max_order or _MAX_ORDER)
    if max_order < _LEAST_ORDER:
        return empty_finding(len(matrices))
    size = _Size(rows, max_order, measurement.sampling_rate_hz, shift_hz)
    leading = left[:, :max_order] * values[:max_order]
    sets = poles_of_orders(leading, rows, size.orders, size.sampling_rate_hz, shift_hz)
    without_each = _models_without_each_hit(matrices, right[:max_order].T, size)
    seconds = max(decay.shape[1] for decay in measurement.decays) / size.sampling_rate_hz
    return stabilised(sets, without_each, seconds, options)


def _max_order(shape: tuple[int, int], values: FloatArray, rows: int, most: int) -> int:
    """Return the highest even order up to `most` that a matrix' size and numerical rank allow."""
    rank = int(np.sum(values > _RANK_TOLERANCE * values[0]))
    shifted_rows = shape[0] // rows * (rows - 1)
    largest = min(most, rank, shifted_rows // 2, shape[1])
    return int(largest // 2 * 2)


def _models_without_each_hit(
    matrices: Sequence[FloatArray], basis: FloatArray, size: _Size
) -> list[list[PoleSet]]:
    """Return the models with each hit left out, in the columns that `basis` combines.

    `basis` are right singular vectors of the full matrix.
    """
    if len(matrices) < 2:
        return []
    projected = [matrix @ basis for matrix in matrices]
    total = np.sum(projected, axis=0)
    orders = final_orders(size.orders)
    return [
        poles_of_orders(total - each, size.block_rows, orders, size.sampling_rate_hz, size.shift_hz)
        for each in projected
    ]


def hankel(response: FloatArray, reference: FloatArray, block_rows: int) -> FloatArray:
    """Sum over time of future responses times past references.

    `response` (channels, samples) and `reference` (references, samples) give a matrix of shape
    (channels * block_rows, references * block_rows). For a free decay it is exact, and it leaves
    out lag zero, hence white noise. As pyOMA2's method `cov`, but the sums at all lags are made
    once, by Fourier transform: from one block column to the next they lose a sample and gain one.
    """
    channels, samples = response.shape
    count = samples - 2 * block_rows + 1
    lines = scipy.fft.next_fast_len(samples, real=True)
    begun = np.fft.rfft(reference[:, :count], lines).conj()
    sums = np.fft.irfft(np.fft.rfft(response, lines)[:, np.newaxis] * begun, lines)
    sums = sums[..., 1 : 2 * block_rows]
    matrix = np.empty((block_rows, channels, block_rows, len(reference)))
    for at, column in enumerate(reversed(range(block_rows))):
        matrix[:, :, column] = np.moveaxis(sums[..., column : column + block_rows], -1, 0)
        if column:
            lags = column + block_rows - 1
            lost, gained = (
                response[:, np.newaxis, k + 1 : k + 1 + lags] * reference[:, k, np.newaxis]
                for k in (at, at + count)
            )
            sums = sums[..., :lags] + gained - lost
    return np.asarray(matrix.reshape(channels * block_rows, -1) * (samples / count))
