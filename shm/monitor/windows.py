"""From pieces of a stream to a window: what moved the hanger, and which part of it is used.

Where a train or a knock takes a small part of it, that part is set apart and the rest is used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy

from shm.identify.measuring.ambient import LOUDER
from shm.identify.options import PASSED
from shm.monitor.limits import LIMITS
from shm.monitor.sensor_health import broken_channels
from shm.monitor.spectrum import Peaks, Stretch, channel_noise, found_peaks, stretch
from shm.values import NAN, BoolArray, FloatArray, Mode
from shm.values.stream import Piece, Stream, StreamChannel, Window, WindowKind


@dataclass(frozen=True, eq=False)
class Judged:
    """A window with all that identification needs: the parts that are used, and their spectra.

    `parts` (channels, samples) each, of `channels`; `peaks` are of the known modes.
    `reason`: why it is unusable, or what was set apart.
    """

    window: Window
    channels: tuple[StreamChannel, ...] = ()
    parts: tuple[FloatArray, ...] = ()
    stretches: tuple[Stretch, ...] = ()
    peaks: Peaks | None = None
    reason: str = ""


def judged(pieces: Sequence[Piece], stream: Stream, known: Sequence[Mode]) -> Judged:
    """Return the window of `pieces` and what of it is used."""
    if not pieces:
        raise ValueError("a window of no pieces")
    broken = broken_channels(pieces, stream)
    rows = [row for row, each in enumerate(stream.channels) if each.name not in broken]
    channels = tuple(stream.channels[row] for row in rows)
    reason = "; ".join(f"{name}: {why}" for name, (_, why) in broken.items())
    if not rows:
        return _unusable(pieces, stream, f"no channel can be used ({reason})")
    values = [part for piece in pieces for part in _known_parts(piece, channels)]
    rate = stream.sampling_rate_hz
    if sum(part.shape[1] for part in values) < LIMITS.least_s * rate:
        return _unusable(pieces, stream, f"less than {LIMITS.least_s:g} s without a gap")
    band = _band_hz(known, rate)
    events = _Events.of(values, rate, band)
    parts = tuple(events.undisturbed(values))
    if sum(part.shape[1] for part in parts) < LIMITS.least_s * rate:
        why = f"{events.kind}: less than {LIMITS.least_s:g} s are undisturbed"
        return _unusable(pieces, stream, why, events)
    stretches = tuple(stretch(part, rate) for part in parts)
    peaks = found_peaks(stretches, channels, known, channel_noise(stretches, *band))
    height = float(np.median(peaks.height_db[peaks.seen])) if peaks.seen else NAN
    kind: WindowKind = events.kind
    if kind == "wind" and height < LIMITS.quiet_db and not _has_strong_peaks(stretches, band):
        kind = "quiet"
    window = _window(pieces, stream, kind, _level(stretches, band), events.unrest, height)
    apart = f"{events.seconds:.0f} s are set apart: {events.kind}" if events.seconds else ""
    reason = "; ".join(each for each in (reason, apart) if each)
    return Judged(window, channels, parts, stretches, peaks, reason)


def _window(
    pieces: Sequence[Piece],
    stream: Stream,
    kind: WindowKind,
    level: float,
    unrest: float = NAN,
    height_db: float = NAN,
) -> Window:
    start = min(piece.start for piece in pieces)
    last = max(pieces, key=lambda piece: piece.start)
    seconds = (last.start - start).total_seconds()
    return Window(
        stream=stream.name,
        hanger=stream.hanger,
        start=start,
        duration_s=seconds + last.values.shape[1] / last.sampling_rate_hz,
        kind=kind,
        level_m_s2=level,
        unrest=unrest,
        signal_to_noise_db=height_db,
        temperature_c=_longest_c(pieces),
        wind_m_s=_mean([piece.wind_m_s for piece in pieces], pieces),
    )


def _unusable(
    pieces: Sequence[Piece], stream: Stream, reason: str, events: _Events | None = None
) -> Judged:
    unrest = events.unrest if events else NAN
    return Judged(_window(pieces, stream, "unusable", NAN, unrest), reason=reason)


def _longest_c(pieces: Sequence[Piece]) -> float:
    """Of the longest piece that knows it: that of a broken thermometer is no part of a mean."""
    known = [piece for piece in pieces if math.isfinite(piece.temperature_c)]
    if not known:
        return NAN
    return max(known, key=lambda piece: piece.values.shape[1]).temperature_c


def _mean(values: Sequence[float], pieces: Sequence[Piece]) -> float:
    """Mean over the pieces that know it, by their length."""
    known = [
        (value, piece.values.shape[1])
        for value, piece in zip(values, pieces, strict=True)
        if math.isfinite(value)
    ]
    total = sum(samples for _, samples in known)
    return sum(value * samples for value, samples in known) / total if total else NAN


def _band_hz(known: Sequence[Mode], rate: float) -> tuple[float, float]:
    """Of the known modes with what a search reaches, else all that a hanger's may be in."""
    hz = [mode.frequency_hz for mode in known]
    if not hz:
        return 2.0, PASSED * rate
    return 0.8 * min(hz), min(1.2 * max(hz), 0.49 * rate)


def _known_parts(piece: Piece, channels: Sequence[StreamChannel]) -> list[FloatArray]:
    """Parts (channels, samples) of a piece in which every channel is known."""
    if any(channel.name not in piece.channels for channel in channels):
        return []
    rows = [piece.channels.index(channel.name) for channel in channels]
    values = np.asarray(piece.values, dtype=float)[rows]
    good = np.all(np.isfinite(values), axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], good, [False]))))
    parts = [values[:, begin:end] for begin, end in edges.reshape(-1, 2)]
    return [
        part for part in parts if part.shape[1] >= LIMITS.least_stretch_s * piece.sampling_rate_hz
    ]


def _level(stretches: Sequence[Stretch], band_hz: tuple[float, float]) -> float:
    """Root mean square acceleration in a band, mean over the channels."""
    total = sum(each.seconds for each in stretches)
    power = sum(
        2 * float(np.mean(np.sum(np.abs(each.values[:, each.between(*band_hz)]) ** 2, axis=1)))
        for each in stretches
    )
    return math.sqrt(power / total)


def _has_strong_peaks(stretches: Sequence[Stretch], band_hz: tuple[float, float]) -> bool:
    """Return True if several peaks of the spectrum stand out, at whatever frequency."""
    longest = max(stretches, key=lambda each: each.seconds)
    power = np.sum(np.abs(longest.values[:, longest.between(*band_hz)]) ** 2, axis=0)
    many = 8  # technical: lines averaged, whose sum by chance is 10 dB up once in 1e14
    mean = power[: len(power) // many * many].reshape(-1, many).mean(axis=1)
    around = scipy.ndimage.median_filter(mean, size=max(9, len(mean) // 20), mode="nearest")
    raised = mean > 10 ** (LIMITS.strong_db / 10) * around
    return int(np.sum(np.diff(raised.astype(int)) == 1)) >= LIMITS.strong_peaks


@dataclass(frozen=True, eq=False)
class _Events:
    """Events that disturb a window: `loud` marks blocks of `block` samples, part after part."""

    kind: Literal["wind", "traffic", "knock"]
    unrest: float
    block: int
    loud: tuple[BoolArray, ...]

    @classmethod
    def of(cls, parts: Sequence[FloatArray], rate: float, band_hz: tuple[float, float]) -> _Events:
        block = max(1, round(LIMITS.block_s * rate))
        sections = scipy.signal.butter(2, band_hz, "bandpass", fs=rate, output="sos")
        inside, slow = [], []
        for part in parts:
            centred = part - np.median(part, axis=1, keepdims=True)
            inside.append(_block_rms(scipy.signal.sosfilt(sections, centred), block))
            # Means of blocks are what a train does below the modes: it bends the deck.
            slow.append(np.abs(_blocks(centred, 2 * block).mean(axis=2)).max(axis=0).repeat(2))
        loud, kinds = [], set()
        level, sway = _median(inside), _median(slow)
        for its, below in zip(inside, slow, strict=True):
            below = np.pad(below, (0, len(its) - len(below)), "edge")
            marked = (its > LOUDER * level) | (below > 2 * LOUDER * sway)
            loud.append(_with_edges(marked))
            kinds |= {_kind_of(its[first:end]) for first, end in _runs(marked, LIMITS.after_s)}
        kind: Literal["wind", "traffic", "knock"] = "wind"
        kind = "traffic" if "traffic" in kinds else "knock" if kinds else kind
        return cls(kind, _unrest(inside), block, tuple(loud))

    @property
    def seconds(self) -> float:
        """Return how long the disturbed parts are."""
        return LIMITS.block_s * float(sum(np.sum(each) for each in self.loud))

    def undisturbed(self, parts: Sequence[FloatArray]) -> list[FloatArray]:
        """Return what lies between the events and is long enough."""
        least = int(LIMITS.least_stretch_s / LIMITS.block_s)
        return [
            part[:, first * self.block : (end * self.block if end < len(loud) else None)]
            for part, loud in zip(parts, self.loud, strict=True)
            for first, end in _runs(~loud, 0.0)
            if end - first >= least
        ]


def _blocks(values: FloatArray, block: int) -> FloatArray:
    """(channels, blocks, samples)."""
    count = values.shape[1] // block
    return values[:, : count * block].reshape(len(values), count, block)


def _block_rms(values: FloatArray, block: int) -> FloatArray:
    """Root mean square (blocks,) over the channels, each by its own median."""
    rms = np.sqrt(np.mean(_blocks(values, block) ** 2, axis=2))
    usual = np.median(rms, axis=1, keepdims=True)
    found: FloatArray = np.sqrt(np.mean((rms / np.where(usual > 0, usual, 1.0)) ** 2, axis=0))
    return found


def _median(parts: Sequence[FloatArray]) -> float:
    return float(np.median(np.concatenate(parts)))


def _unrest(parts: Sequence[FloatArray]) -> float:
    """Return the loudest five seconds over the median five seconds."""
    many = int(LIMITS.stretch_s / LIMITS.block_s)
    level = np.sqrt(
        np.concatenate([np.mean(_blocks(p[np.newaxis] ** 2, many), axis=2)[0] for p in parts])
    )
    return float(np.max(level) / np.median(level))


def _runs(marked: BoolArray, gap_s: float) -> list[tuple[int, int]]:
    """First and end of each run of marked blocks; those nearer than `gap_s` are one."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], marked, [False])))).reshape(-1, 2)
    runs: list[tuple[int, int]] = []
    for first, end in edges.tolist():
        if runs and (first - runs[-1][1]) * LIMITS.block_s < gap_s:
            runs[-1] = runs[-1][0], end
        else:
            runs.append((first, end))
    return runs


def _kind_of(level: FloatArray) -> Literal["traffic", "knock"]:
    """A knock is at its highest at once, and rings down."""
    rise_s = int(np.argmax(level)) * LIMITS.block_s
    return (
        "knock"
        if rise_s <= LIMITS.knock_rise_s and len(level) * LIMITS.block_s < LIMITS.knock_s
        else "traffic"
    )


def _with_edges(marked: BoolArray) -> BoolArray:
    """Return the loud blocks with what comes just before and after."""
    wide = marked.copy()
    for first, end in _runs(marked, 0.0):
        wide[
            max(0, first - int(LIMITS.before_s / LIMITS.block_s)) : end
            + int(LIMITS.after_s / LIMITS.block_s)
        ] = True
    return wide
