"""Find tones: steady vibration of mains or machines, there whether the hammer hits or not.

They are looked for in the stretches of a record in which no hammer strikes.
"""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from shm.identify.contract import Hit, Measurement, Tone
from shm.identify.measuring.band import LEAST_SAMPLES, RATE_OVER_BAND, thinned
from shm.identify.measuring.hits import RINGING_SAMPLES
from shm.identify.options import IdentifyOptions
from shm.identify.quality.table import Inspection, Reading, Row
from shm.values import BoolArray, Channel, ComplexArray, FloatArray, Recording

_PROMINENCE = 30.0
"""Noise averaged over one channel reaches 14 times its median once in 10,000 lines."""
_FLOOR_LINES = 201  # 12 widths, as below, of a tone over the whole record: 4/T, 4 lines each
_FLOOR_WIDTHS = 12.0
"""A stretch of T seconds smears a tone over 4 / T Hz. Where ring-downs are short, 201 lines hold
nothing but the tone: then its floor is the median of three times that."""
# identify_limits.py: planted tones are steady by 0.91 and more and change by 0.38 and less, other
# narrow lines by up to 0.83 and by 0.24 and more. Neither limit parts them, both do but for 3 of
# 400 sound tests (docs/trials/identification_benchmarks.md); where within is judgement
_STEADY = 0.6
_SAME_BEFORE = 0.3
_FAINTLY_STEADY = 0.3
_SURELY_SAME_BEFORE = 0.15
"""A mode next to a tone unsteadies it in the ring-downs, not before the first hit."""
_MAY_BE_SAME_BEFORE = 0.75  # judgement: looser, as lines lie beside the tone
_STEADY_UNSEEN_BEFORE = 0.9  # of a tone 10 dB above the noise: 1/(1 + 0.1)
_LOCKED_TO_HITS = 0.6
"""Of three to five hits, the phases of a mode agree at one frequency near its own by chance."""
_STEADY_IN_BAND = _STEADY / 2  # judgement: a machine that is named needs less proof
_MOST_CANDIDATES = 100  # technical: time; tones are among the strongest lines
_LEAST_TRANSFORM = 65536  # technical: a fine grid of short records
_UNNAMED = "a machine"
_LEAST_DAMPING = 0.1  # of the median: as of a mode that hardly decays, see `foreign`
_MAINS_TOLERANCE = 0.004
"""A grid's frequency moves by 0.2 Hz in 50 in a bad hour."""


def tones(
    measurements: Sequence[Measurement], records: Sequence[Recording], options: IdentifyOptions
) -> tuple[Tone, ...]:
    """Return the tones in time records, by rising frequency.

    A tone keeps amplitude and phase through all ring-downs' later halves and has them before
    the first hit. A mode, however lightly damped, gets a new phase with each hit and is not
    there before the first. Where no quiet time before a hit is recorded, it must not go with
    the hits. Narrow peaks within a named disturbance band need only half-steadiness. None are
    found in frequency responses.
    """
    hits = [hit for measurement in measurements for hit in measurement.hits]
    lists = [
        _tones_of_record(record, [hit for hit in hits if hit.record == number], options)
        for number, record in enumerate(records)
    ]
    return _in_most(lists, options)


def _steady_tones(inspection: Inspection) -> Reading | None:
    """Return how many tones lie in the band, and at which frequencies.

    What nobody named and where a mode rings down as the others do is that mode.
    """
    if not inspection.records:
        return None
    modes = inspection.finding.modes if inspection.finding else ()
    least = _LEAST_DAMPING * float(np.median([m.damping_ratio for m in modes])) if modes else 0.0
    rings_hz = np.array([m.frequency_hz for m in modes if m.damping_ratio > least])
    tones = [
        f"{tone.frequency_hz:.2f} Hz ({tone.name})"
        for tone in inspection.tones
        if tone.name != _UNNAMED
        or not np.any(np.abs(rings_hz / tone.frequency_hz - 1) < _MAINS_TOLERANCE / 2)
    ]
    return Reading(len(tones), {"tones": ", ".join(tones)})


ROW = Row(
    "tones", _steady_tones, 0.0, "", "no steady vibration in the band",
    "steady vibration at {tones}",
    "Switch off machines near the hanger, run the logger from a battery, keep sensor cables "
    "away from power cables; name known machines as disturbance bands.",
)  # fmt: skip


def _tones_of_record(
    record: Recording, hits: Sequence[Hit], options: IdentifyOptions
) -> list[float]:
    """Return tones of the accelerations and, between hits, where nothing rings, of the force."""
    found = _steady(stretches(record, record.accelerations, hits, options), options)
    if record.force is None or not hits:
        return found
    more = _steady(stretches(record, [record.force], hits, options), options)
    return found + [f for f in more if all(abs(f / g - 1) > _MAINS_TOLERANCE / 2 for g in found)]


def _steady(parts: Stretches, options: IdentifyOptions) -> list[float]:
    """Return frequencies of the tones in some channels, the strongest first."""
    if not parts.later:
        return []
    apart_hz = 2 * parts.rate_hz / min(part.signals.shape[1] for part in parts.later)
    found: list[float] = []
    for frequency in _candidates(parts, options):
        clear = all(abs(frequency - other) > apart_hz for other in found)
        if clear and _is_tone(frequency, parts, options):
            found.append(frequency)
    return found


def _candidates(parts: Stretches, options: IdentifyOptions) -> list[float]:
    """Return frequencies of narrow lines in the sum of all later halves, the strongest first."""
    gated = np.zeros((len(parts.later[0].signals), parts.samples))
    for part in parts.later:
        gated[:, part.first : part.first + part.signals.shape[1]] = part.signals
    # A quarter of a line off, a tone is still steady over the whole record.
    length = scipy.fft.next_fast_len(max(4 * parts.samples, _LEAST_TRANSFORM), real=True)
    frequency = scipy.fft.rfftfreq(length, 1 / parts.rate_hz)
    lines = (frequency >= options.band_low_hz) & (frequency <= options.band_high_hz)
    spectra = scipy.fft.rfft(gated, n=length, axis=1)[:, lines]
    power = np.abs(spectra) ** 2
    floor = np.maximum(np.median(power, axis=1, keepdims=True), np.finfo(float).tiny)
    power = np.sum(power / floor, axis=0)
    shortest = min(part.signals.shape[1] for part in parts.later)
    width = int(min(_FLOOR_WIDTHS * length / shortest, len(power))) | 1
    floor = np.minimum(
        scipy.ndimage.median_filter(power, _FLOOR_LINES), scipy.ndimage.median_filter(power, width)
    )
    peaks = (power == scipy.ndimage.maximum_filter1d(power, 9)) & (power > _PROMINENCE * floor)
    places = np.flatnonzero(peaks & _may_be_there_before(spectra, length, lines, parts, options))
    strongest = places[np.argsort(-power[places])][:_MOST_CANDIDATES]
    tops = frequency[lines][strongest] + frequency[1] * _peak_offset(power, strongest)
    return [float(value) for value in tops]


def _may_be_there_before(
    spectra: ComplexArray, length: int, lines: BoolArray, parts: Stretches, options: IdentifyOptions
) -> BoolArray:
    """Return the lines (lines,) at which the time before the first hit does not exclude a tone."""
    if parts.before is None:
        return np.ones(spectra.shape[1], dtype=bool)
    mean = spectra * 2 / sum(part.weight for part in parts.later)
    before = (
        scipy.fft.rfft(parts.before.signals, n=length, axis=1)[:, lines] * 2 / parts.before.weight
    )
    change = np.sum(np.abs(before - mean) ** 2, axis=0)
    there = change < _MAY_BE_SAME_BEFORE * np.sum(np.abs(mean) ** 2, axis=0)
    frequency = scipy.fft.rfftfreq(length, 1 / parts.rate_hz)[lines]
    for _, low, high in options.disturbance_bands:
        there |= (frequency >= low) & (frequency <= high)
    return np.asarray(there)


def _peak_offset(power: FloatArray, places: NDArray[np.intp]) -> FloatArray:
    """Return the distance of peaks from their largest lines in lines, by a parabola."""
    inner = np.clip(places, 1, len(power) - 2)
    left, top, right = (np.log(power[inner + step]) for step in (-1, 0, 1))
    offset = 0.5 * (left - right) / np.minimum(left - 2 * top + right, -np.finfo(float).eps)
    return np.asarray(np.where(inner == places, np.clip(offset, -0.5, 0.5), 0.0))


def _is_tone(frequency_hz: float, parts: Stretches, options: IdentifyOptions) -> bool:
    turns = frequency_hz / parts.rate_hz
    amplitudes = np.array([part.amplitude(turns) for part in parts.later])
    weights = np.array([part.weight for part in parts.later]) / sum(p.weight for p in parts.later)
    steady = _steadiness(weights, amplitudes)
    if any(low <= frequency_hz <= high for _, low, high in options.disturbance_bands):
        return steady > _STEADY_IN_BAND
    if parts.before is None:
        if not math.isfinite(parts.later[0].hit):  # each part of ambient motion has its own phase
            return steady > _STEADY
        apart = _locked(turns, weights, amplitudes, parts) < _LOCKED_TO_HITS
        return steady > _STEADY_UNSEEN_BEFORE and apart
    mean = weights @ amplitudes
    change = float(np.sum(np.abs(parts.before.amplitude(turns) - mean) ** 2))
    limit = _SAME_BEFORE if steady > _STEADY else _SURELY_SAME_BEFORE
    by_chance = float(weights @ weights)  # as steady are random phases in so few stretches
    faintly = steady - by_chance > _FAINTLY_STEADY * (1 - by_chance)
    return faintly and change < limit * float(np.sum(np.abs(mean) ** 2))


def _steadiness(weights: FloatArray, amplitudes: ComplexArray) -> float:
    """Return power of the mean over mean power of amplitudes (stretches, channels); 1: equal."""
    power = float(np.sum(np.abs(weights @ amplitudes) ** 2))
    total = float(np.sum(weights @ np.abs(amplitudes) ** 2))
    return power / max(total, np.finfo(float).tiny)


def _locked(
    turns_a_sample: float, weights: FloatArray, amplitudes: ComplexArray, parts: Stretches
) -> float:
    """Return the steadiness of amplitudes referred to hits and forces; 1 for a mode."""
    hits = np.array([part.hit for part in parts.later])
    forces = np.array([part.force_n for part in parts.later])
    turned = np.exp(2j * np.pi * turns_a_sample * hits) / forces
    return _steadiness(weights, amplitudes * turned[:, np.newaxis])


def _in_most(lists: Sequence[Sequence[float]], options: IdentifyOptions) -> tuple[Tone, ...]:
    """Return a tone for each frequency that at least half of the records have."""
    pooled = sorted(frequency for each in lists for frequency in each)
    groups: list[list[float]] = []
    for frequency in pooled:
        if groups and frequency / groups[-1][-1] - 1 < _MAINS_TOLERANCE / 2:
            groups[-1].append(frequency)
        else:
            groups.append([frequency])
    common = [float(np.median(group)) for group in groups if 2 * len(group) >= len(lists)]
    return tuple(Tone(frequency, _name(frequency, options)) for frequency in common)


def _name(frequency_hz: float, options: IdentifyOptions) -> str:
    for name, low, high in options.disturbance_bands:
        if low <= frequency_hz <= high:
            return name
    order = round(frequency_hz / options.mains_hz)
    if order >= 1 and abs(frequency_hz / (order * options.mains_hz) - 1) <= _MAINS_TOLERANCE:
        return "mains" if order == 1 else f"mains, harmonic {order}"
    return _UNNAMED


_LEAST_BEFORE_S = 0.25  # judgement: lines of 4 Hz; of half a second that crews are told to record
# judgement: n random phases are steady by 1/n; three leave a mode below _STEADY, 12 surely
_FEW_SEGMENTS = 3
_SEGMENTS_WITHOUT_HITS = 12


@dataclass(frozen=True, eq=False)
class Stretch:
    """Part of a record from sample `first` on, windowed and free of its mean (channels, samples).

    `weight` is the sum of the window: a sine of amplitude 1 has the spectrum weight / 2. `hit`:
    where its hit begins, in samples, NaN where it has none; `force_n`: how hard that was.
    """

    first: int
    signals: FloatArray
    weight: float
    hit: float = math.nan
    force_n: float = 1.0

    def amplitude(self, turns_a_sample: float) -> ComplexArray:
        """Return the complex amplitude of a sine from the start of the record, (channels,)."""
        phase = 2 * np.pi * turns_a_sample * (self.first + np.arange(self.signals.shape[1]))
        parts = self.signals @ np.column_stack((np.cos(phase), -np.sin(phase)))
        return np.asarray((parts[:, 0] + 1j * parts[:, 1]) * 2 / self.weight)


@dataclass(frozen=True, eq=False)
class Stretches:
    """The stretches of a record without a hit in them: each ring-down's later half, and before."""

    later: tuple[Stretch, ...]
    before: Stretch | None
    rate_hz: float
    samples: int


def stretches(
    record: Recording, channels: Sequence[Channel], hits: Sequence[Hit], options: IdentifyOptions
) -> Stretches:
    """Return the stretches of some channels of a record, thinned to the band."""
    wanted = RATE_OVER_BAND * options.band_high_hz
    factor = max(1, int(record.sampling_rate_hz / wanted))
    rate = record.sampling_rate_hz / factor
    # Twice: two means in a row keep the mains' harmonics from folding back as tones of their own.
    signals = np.array(
        [
            np.nan_to_num(
                thinned(_smoothed(c.values, factor)[np.newaxis], record.sampling_rate_hz, wanted)[0]
            )
            for c in channels
        ]
    )
    margin = int(np.ceil(RINGING_SAMPLES / factor)) + 1
    starts = [hit.start // factor for hit in hits]
    spans = _spans(starts, margin, signals.shape[1])
    hit_before = [hits[bisect(starts, a) - 1] if hits else None for a, _ in spans]
    later = tuple(
        _stretch(signals, a, b)
        if hit is None
        else replace(_stretch(signals, a, b), hit=hit.start / factor, force_n=_size(hit))
        for (a, b), hit in zip(spans, hit_before, strict=True)
        if b - a >= LEAST_SAMPLES
    )
    quiet = starts[0] - margin if starts else 0
    before = _stretch(signals, 0, quiet) if quiet >= _LEAST_BEFORE_S * rate else None
    if before is not None and later:
        # Louder than what is left later, it is a ring-down itself, whose hit was not recorded: in
        # step with the others where hits are equally spaced.
        usual = np.mean([np.mean(part.signals**2) for part in later])
        before = None if np.mean(before.signals**2) > 2 * usual else before
    return Stretches(later, before, rate, signals.shape[1])


def _size(hit: Hit) -> float:
    """Return the peak force of a hit; 1 if it was not measured."""
    return abs(hit.peak_force_n) if math.isfinite(hit.peak_force_n) else 1.0


def _smoothed(values: FloatArray, samples: int) -> FloatArray:
    """Return running means over as many samples as are thinned to one."""
    return np.asarray(scipy.ndimage.uniform_filter1d(values, samples)) if samples > 1 else values


def _spans(starts: Sequence[int], margin: int, samples: int) -> list[tuple[int, int]]:
    """Return first and last sample of each ring-down's later half, in thirds if they are few."""
    ends = [*(start - margin for start in starts[1:]), samples]
    spans = [((a + b) // 2, b) for a, b in zip(starts, ends, strict=True)] if starts else []
    if len(spans) >= _FEW_SEGMENTS:
        return spans
    if not spans:
        return _divided(0, samples, _SEGMENTS_WITHOUT_HITS)
    return [pair for a, b in spans for pair in _divided(a, b, _FEW_SEGMENTS)]


def _divided(first: int, stop: int, parts: int) -> list[tuple[int, int]]:
    return list(pairwise(np.linspace(first, stop, parts + 1).astype(int).tolist()))


def _stretch(signals: FloatArray, first: int, stop: int) -> Stretch:
    part, window = signals[:, first:stop], np.hanning(stop - first)
    centred = part - part.mean(axis=1, keepdims=True)
    return Stretch(first, centred * window, float(window.sum()))
