"""The spectrum of a window in stretches, and where in it the known modes' peaks have gone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.monitor.limits import LIMITS
from shm.values import ComplexArray, FloatArray, Mode
from shm.values.stream import StreamChannel

REACH = 0.06
"""A tenth of the tension lost moves the frequencies of a taut string by 5 %."""
ALONE, _ALONE_SHARE = 0.004, 0.3
"""judgement: how far a mode may be from where the others say that all have gone: what temperature
does to one more than to another between windows, and a share of the whole change."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """Lines of one stretch without a gap.

    `values` (channels, lines): its Fourier transform from 0 Hz up, scaled so that the mean square
    of a line is the two-sided power density, in (m/s^2)^2/Hz.
    """

    seconds: float
    values: ComplexArray

    def between(self, low_hz: float, high_hz: float) -> slice:
        """Lines of a band."""
        first = max(1, math.ceil(low_hz * self.seconds))
        return slice(first, max(first, math.floor(high_hz * self.seconds) + 1))


def stretch(values: FloatArray, sampling_rate_hz: float) -> Stretch:
    """The spectrum of `values` (channels, samples), of which a few go for the transform's sake."""
    samples = values.shape[1]
    while scipy.fft.next_fast_len(samples, real=True) != samples:
        samples -= 1
    used = values[:, :samples] - values[:, :samples].mean(axis=1, keepdims=True)
    lines = scipy.fft.rfft(used) / math.sqrt(samples * sampling_rate_hz)
    return Stretch(samples / sampling_rate_hz, np.asarray(lines, dtype=np.complex128))


def channel_noise(stretches: Sequence[Stretch], low_hz: float, high_hz: float) -> FloatArray:
    """Noise (channels,) of the sensors, in m/s^2/sqrt(Hz): the quiet tenth of a band's spectrum.

    Sensors of one logger are alike; what moves one plane more is not taken for its noise.
    """
    quiet = np.median(
        [_quiet(each.values[:, each.between(low_hz, high_hz)]) for each in stretches], 0
    )
    usual = float(np.median(quiet))
    noise: FloatArray = np.sqrt(
        np.clip(quiet, usual / LIMITS.noise_ratio, usual * LIMITS.noise_ratio)
    )
    return np.maximum(noise, np.finfo(float).tiny)


def _quiet(lines: ComplexArray) -> FloatArray:
    count = lines.shape[1] // LIMITS.smoothed * LIMITS.smoothed
    power = np.abs(lines[:, :count]) ** 2
    smooth = power.reshape(len(lines), -1, LIMITS.smoothed).mean(axis=2)
    found: FloatArray = np.quantile(smooth, 0.1, axis=1)
    return found


def shape_on(channels: Sequence[StreamChannel], mode: Mode) -> FloatArray:
    """A known mode on the channels; NaN where its shape says nothing, 0 in the other plane.

    What moves both planes is no shape but the mix of two modes that were not told apart: then each
    is taken to move its own plane alone.
    """
    value, cross = (
        np.nan_to_num([getattr(point, name) for point in mode.shape]) for name in ("value", "cross")
    )
    mixed = np.sum(cross**2) > LIMITS.mixed**2 * np.sum(value**2)
    found = np.full(len(channels), np.nan)
    for row, channel in enumerate(channels):
        inside = channel.plane == mode.plane
        found[row] = math.nan if inside else 0.0
        for point in mode.shape:
            if abs(point.x_m - channel.x_m) < LIMITS.same_place_m:
                across = 0.0 if mixed else float(np.nan_to_num(point.cross))
                found[row] = point.value if inside else across
    return found


def _known_shapes(
    channels: Sequence[StreamChannel], known: Sequence[Mode], stretches: Sequence[Stretch]
) -> tuple[FloatArray, list[int]]:
    """Shapes (channels, modes), and of which modes they are only guessed.

    Where the known mode does not say it, the strongest motion of the sensors of its plane does. A
    mode without a sensor in its plane has a shape of zeros.
    """
    rows = [shape_on(channels, mode) for mode in known]
    shapes = np.array(rows).reshape(len(known), len(channels)).T
    guessed = []
    for column, mode in enumerate(known):
        missing = np.isnan(shapes[:, column])
        if missing.any() and not np.any(np.abs(shapes[~missing, column]) > 0):
            inside = np.array([channel.plane == mode.plane for channel in channels])
            shapes[:, column] = inside * strongest(stretches, mode.frequency_hz, inside)
            guessed.append(column)
        shapes[:, column] = _to_largest(np.nan_to_num(shapes[:, column]))
    return shapes, guessed


def _to_largest(shape: FloatArray) -> FloatArray:
    largest = float(shape[np.argmax(np.abs(shape))])
    scaled: FloatArray = shape / (largest or 1.0)
    return scaled


def strongest(
    stretches: Sequence[Stretch],
    frequency_hz: float,
    weight: FloatArray | float = 1.0,
    within: float = 0.01,
) -> FloatArray:
    """Return the real shape (channels,) that carries most of the power near a frequency."""
    power = power_near(stretches, frequency_hz, within) * np.outer(weight, weight)
    vector: FloatArray = np.linalg.eigh(power)[1][:, -1]
    return vector


def power_near(stretches: Sequence[Stretch], frequency_hz: float, within: float) -> FloatArray:
    """Products of the channels (channels, channels), summed over a share of the frequency."""
    power = np.zeros((len(stretches[0].values),) * 2)
    for each in stretches:
        half = max(within * frequency_hz, 1.5 / each.seconds)
        lines = each.values[:, each.between(frequency_hz - half, frequency_hz + half)]
        power += np.real(lines @ lines.conj().T)
    return power


@dataclass(frozen=True, eq=False)
class Peaks:
    """Peaks of the known modes; arrays (modes,), `shapes` (channels, modes).

    `expected_hz` is where a change common to all puts them; `height_db` is over the floor;
    `damping` as it was known; `noise` (channels,) in m/s^2/sqrt(Hz). A mode that no sensor sees has
    a shape of zeros; of `guessed` modes the shape is a guess.
    """

    expected_hz: FloatArray
    frequency_hz: FloatArray
    height_db: FloatArray
    shapes: FloatArray
    damping: FloatArray
    noise: FloatArray
    guessed: int

    @property
    def seen(self) -> list[int]:
        """The modes that sensors can see."""
        found: list[int] = np.flatnonzero(np.any(self.shapes != 0, axis=0)).tolist()
        return found


def found_peaks(
    stretches: Sequence[Stretch],
    channels: Sequence[StreamChannel],
    known: Sequence[Mode],
    noise: FloatArray,
) -> Peaks:
    """Return the peaks of known modes near the change of frequency that suits all of them best.

    A change of tension moves all modes alike: the product of the modes' spectra, each seen by its
    own shape, has its highest peak there.
    """
    shapes, guessed = _known_shapes(channels, known, stretches)
    damping = np.array([m.damping_ratio if m.damping_ratio > 0 else LIMITS.damping for m in known])
    shift = np.arange(-REACH, REACH + LIMITS.step / 2, LIMITS.step)
    rows = [
        _raised(stretches, mode, row, z, shift)
        for mode, row, z in zip(known, _seen_by(known, shapes, noise), damping, strict=True)
    ]
    height = np.array(rows).reshape(len(known), len(shift))
    common = shift[int(np.argmax(height.sum(axis=0)))]
    reach = ALONE + _ALONE_SHARE * abs(common)
    alone = (shift - common) / reach
    # To the reach there are two standard deviations: a higher peak farther off is another mode's.
    best = np.argmax(np.where(np.abs(alone) <= 1, height - 2 * alone**2, -np.inf), axis=1)
    before = np.array([mode.frequency_hz for mode in known])
    hz = before * (1 + shift[best])
    top = height[np.arange(len(known)), best]
    for column in guessed:
        near = strongest(stretches, hz[column], within=damping[column])
        shapes[:, column] = _to_largest(near)
    return Peaks(
        before * (1 + common), hz, 10 / math.log(10) * top, shapes, damping, noise, len(guessed)
    )


def _seen_by(known: Sequence[Mode], shapes: FloatArray, noise: FloatArray) -> list[FloatArray]:
    """Weights (channels,) of each mode that see it and not its neighbours within reach."""
    hz = np.array([mode.frequency_hz for mode in known])
    rows = []
    for index in range(len(known)):
        near = np.flatnonzero(np.abs(hz / hz[index] - 1) < 2 * REACH)
        # Two shapes that these sensors can hardly tell apart are not pulled apart for it.
        inverse = np.linalg.pinv(shapes[:, near] / noise[:, np.newaxis], rcond=0.1) / noise
        rows.append(inverse[int(np.flatnonzero(near == index)[0])])
    return rows


def _raised(
    stretches: Sequence[Stretch], mode: Mode, row: FloatArray, damping: float, shift: FloatArray
) -> FloatArray:
    """Log power over the median at each shift, averaged over a peak's width; at least 0."""
    at_hz = mode.frequency_hz * (1 + shift)
    power = np.zeros(len(shift))
    for each in stretches:
        half = max(damping * mode.frequency_hz, 1.5 / each.seconds)
        lines = each.between(at_hz[0] - 2 * half, at_hz[-1] + 2 * half)
        seen = np.abs(row @ each.values[:, lines]) ** 2
        total = np.concatenate(([0.0], np.cumsum(seen)))
        edge_hz = (np.arange(lines.start, lines.start + len(total)) - 0.5) / each.seconds
        high, low = (np.interp(at_hz + side * half, edge_hz, total) for side in (1, -1))
        power += (high - low) / (2 * half)
    floor = float(np.median(power))
    if not floor > 0:
        return np.zeros(len(shift))
    raised: FloatArray = np.log(np.maximum(power / floor, 1.0))
    return raised
