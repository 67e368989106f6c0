"""Make Hankel matrices of free decays, and see decays through narrow windows of the band.

A model of the whole band spends its lags on its highest frequency: of a long hanger it sees a
second, while two planes beat for ten. Shifted down and sampled slowly, a part of the band is seen
for longer by a smaller model, and what rings outside of it does not mask it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import scipy

from shm.identify.options import IdentifyOptions
from shm.values import FloatArray

_REFERENCES = 4  # judgement: two planes, and two modes that are close in each
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

    def through(
        self, decay: FloatArray, sampling_rate_hz: float, *, forward: bool = False
    ) -> FloatArray:
        """Return a free decay (channels, samples) lowered by `shift_hz`, at `rate_hz`.

        The filter runs from the end to the beginning: so a sum of decaying sines stays one
        from its first sample on, and only its end, where the filter starts, is lost.

        So do the products of motion that noise drives with itself, `forward`, at earlier times:
        they hold no shorter lag of it. Filtered one way alone, it has modes on the filter's slopes.
        """
        way = 1 if forward else -1
        middle = self.shift_hz + self._reach_hz
        turned = decay * np.exp(-2j * np.pi * middle / sampling_rate_hz * np.arange(decay.shape[1]))
        passed = scipy.signal.sosfilt(
            _low_pass(2 * self._reach_hz / sampling_rate_hz), turned[:, ::way]
        )[:, ::way]
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


def references(responses: Sequence[FloatArray], most: int = _REFERENCES) -> FloatArray:
    """Return rows (references, channels) that mix channels into the `most` with most energy."""
    channels = len(responses[0])
    if channels <= most:
        return np.eye(channels)
    covariance = np.sum([response @ response.T for response in responses], axis=0)
    _, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors[:, -most:].T)


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
