"""Select the usable hits and channels of a set-up.

A fault of one channel after one hit leaves out that hit; after most hits, that channel. A clipped
force does not: the ring-down is as good as any, the check `clipping` states what it spoils. Nor
does an acceleration that is clipped at first: the ring-down begins later. An unseen impact in a
ring-down, as a hit between two samples of the force, and a gap in one channel end it. A double
hit's begins after the second impact. A hit that disagrees with the others fell at a wrong place or
direction, or somebody held the hanger.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import NotIdentifiable
from shm.identify.contract import Dropped, Hit
from shm.identify.measuring.band import least_seconds
from shm.identify.measuring.hits import (
    LEAST_SHARE_OF_HARDEST,
    PULSE_SECONDS,
    RINGING_SAMPLES,
    HitRecord,
    Pulse,
    find_pulses,
    hits_by_plane,
)
from shm.identify.measuring.signal_faults import (
    CLIPPED,
    CUT_OFF,
    DOUBLE_HIT,
    FEWEST_TO_COMPARE,
    MOST_UNLIKE,
    NOT_A_NUMBER,
    OUTLIER,
    clipped_ends,
    faults_of_channels,
    until_disturbed,
)
from shm.identify.measuring.unforced_hits import find_unforced
from shm.identify.options import IdentifyOptions
from shm.values import NAN, BoolArray, Channel, ComplexArray, FloatArray, Plane, Recording

_LEAST_SHARE_OF_LONGEST = 0.25  # judgement: a quarter as sharp, it blurs the others
_TIMES_OTHERS = 5.0  # judgement: for tests in which all hits differ
# judgement: long enough to tell lines 1 % apart, short enough to end before the next hit
_PERIODS_OF_BAND = 100.0
_LEAST_SAMPLES = 32  # judgement: sixteen lines
_HARDLY = 0.1  # 20 dB below the largest, usual in impact testing (Ewins 2000, 3.4)


@dataclass(frozen=True, eq=False)
class Screening:
    """All `hits`; the ring-downs of the `used` ones, with the accelerations of `rows` alone.

    `unlike` is how far the used hits are from each other, the median; NaN below three hits.
    """

    hits: tuple[Hit, ...]
    used: tuple[HitRecord, ...]
    rows: tuple[int, ...]
    dropped: tuple[Dropped, ...]
    unlike: float


def screen(records: Sequence[Recording], options: IdentifyOptions) -> Screening:
    """Select the usable hits and channels of one set-up; raises NotIdentifiable for none."""
    hits, ring_downs = _hits(records, options)
    channels, rate = records[0].accelerations, records[0].sampling_rate_hz
    ends = clipped_ends(channels, ring_downs)
    ring_downs = [replace(r, clipped_end=end) for r, (end, _) in zip(ring_downs, ends, strict=True)]
    faults = faults_of_channels(channels, ring_downs, rate, options)
    least = _least_samples(ring_downs, rate, options)
    ring_downs, faults = until_disturbed(channels, ring_downs, faults, least, rate, options)
    rows, dropped = _usable_channels(channels, faults)
    ring_downs = _with_rows(ring_downs, rows)
    reasons = _reasons(ring_downs, [[each[row] for row in rows] for each in faults], rate, options)
    planes = [channels[row].plane for row in rows]
    forced = records[0].force is not None
    if forced:
        reasons = _with_outliers(ring_downs, reasons, rate, options, planes)
    used = [ring_down for ring_down, reason in zip(ring_downs, reasons, strict=True) if not reason]
    if not used or not rows:
        raise _nothing_left(records, reasons, dropped)
    judged = [
        replace(hit, used=not reason, reason=reason, cut="" if reason else _cut(ring_down, names))
        for hit, reason, ring_down, (_, names) in zip(hits, reasons, ring_downs, ends, strict=True)
    ]
    unlike = NAN
    if forced and len(used) >= FEWEST_TO_COMPARE:
        apart = disagreement(used, rate, (options.band_low_hz, options.band_high_hz), planes)
        unlike = float(np.nanmedian(apart)) if np.isfinite(apart).any() else NAN
    return Screening(tuple(judged), tuple(used), tuple(rows), dropped + _counted(reasons), unlike)


def pulses_of(record: Recording, options: IdentifyOptions) -> list[Pulse]:
    """Return the hits of a record: by its force where that is recorded, else by the motion."""
    rate = record.sampling_rate_hz
    if record.force is not None:
        return find_pulses(record.force.values, rate)
    accelerations = np.array([channel.values for channel in record.accelerations])
    return find_unforced(accelerations, rate, options.band_high_hz)


def _hits(
    records: Sequence[Recording], options: IdentifyOptions
) -> tuple[list[Hit], list[HitRecord]]:
    """Return each hit of each record, as a row of the result and with its signals."""
    hits, ring_downs = [], []
    for index, record in enumerate(records):
        accelerations = np.array([channel.values for channel in record.accelerations])
        force = np.zeros(record.samples) if record.force is None else record.force.values
        for pulse in pulses_of(record, options):
            start_s = pulse.start / record.sampling_rate_hz
            hits.append(Hit(index, pulse.start, start_s, pulse.peak_force_n))
            ring_downs.append(HitRecord(force, accelerations, pulse))
    return hits, ring_downs


def _cut(ring_down: HitRecord, clipped_channels: Sequence[str]) -> str:
    """Return the reason why a used ring-down begins after its pulse or ends before the next hit."""
    if ring_down.cut:
        return ring_down.cut
    if ring_down.clipped_end:
        return f"{CLIPPED}: {', '.join(clipped_channels)}"
    return DOUBLE_HIT if ring_down.pulse.second_peak > 0 else ""


def _with_rows(ring_downs: Sequence[HitRecord], rows: list[int]) -> list[HitRecord]:
    """Return the hits with some rows of their accelerations; hits of one record share them."""
    chosen = {
        id(r.accelerations): r.accelerations
        if len(rows) == len(r.accelerations)
        else r.accelerations[rows]
        for r in {id(r.accelerations): r for r in ring_downs}.values()
    }
    return [replace(r, accelerations=chosen[id(r.accelerations)]) for r in ring_downs]


def _usable_channels(
    channels: Sequence[Channel], faults: Sequence[Sequence[str]]
) -> tuple[list[int], tuple[Dropped, ...]]:
    """Return the rows of usable accelerations, and the dropped ones with the reason.

    Where every channel has a fault after most hits, those stay that have one hit without.
    """
    columns = [[each[row] for each in faults] for row in range(len(channels))]
    some_plane = any(channel.plane for channel in channels)
    reasons = [
        _channel_fault(c, f, 0.5, some_plane) for c, f in zip(channels, columns, strict=True)
    ]
    if all(reasons):
        reasons = [
            _channel_fault(c, f, 1.0, some_plane) for c, f in zip(channels, columns, strict=True)
        ]
    dropped = [
        Dropped(f"channel {c.name}", 1, r) for c, r in zip(channels, reasons, strict=True) if r
    ]
    return [row for row, reason in enumerate(reasons) if not reason], tuple(dropped)


def _channel_fault(channel: Channel, faults: Sequence[str], most: float, some_plane: bool) -> str:
    """Return why a channel cannot be used; at most a fraction `most` of hits may have `faults`."""
    found = [fault for fault in faults if fault]
    if faults and (len(found) > most * len(faults) or len(found) == len(faults)):
        (fault, count), *_ = Counter(found).most_common(1)
        return fault if count == len(faults) else f"{fault}, after {count} of {len(faults)} hits"
    if some_plane and channel.plane is None:
        return "its plane is not stated, those of others are"
    return ""


def _reasons(
    ring_downs: Sequence[HitRecord],
    faults: Sequence[Sequence[str]],
    sampling_rate_hz: float,
    options: IdentifyOptions,
) -> list[str]:
    """Return the reason why each hit cannot be used; empty where it can."""
    least = _least_samples(ring_downs, sampling_rate_hz, options)
    return [_hit_fault(r, f, least) for r, f in zip(ring_downs, faults, strict=True)]


def _least_samples(
    ring_downs: Sequence[HitRecord], sampling_rate_hz: float, options: IdentifyOptions
) -> float:
    """Return the shortest useful ring-down in samples."""
    longest = max((r.pulse.stop - r.free for r in ring_downs), default=0)
    return max(
        least_seconds(options.band_high_hz) * sampling_rate_hz, _LEAST_SHARE_OF_LONGEST * longest
    )


def _hit_fault(ring_down: HitRecord, faults: Sequence[str], least_samples: float) -> str:
    pulse = ring_down.pulse
    if not np.all(np.isfinite(ring_down.force[pulse.start : pulse.stop])):
        return NOT_A_NUMBER
    if NOT_A_NUMBER in faults:
        return NOT_A_NUMBER
    if pulse.stop - ring_down.free < least_samples:
        return CUT_OFF
    return next((fault for fault in faults if fault), "")


def _with_outliers(
    ring_downs: Sequence[HitRecord],
    reasons: Sequence[str],
    sampling_rate_hz: float,
    options: IdentifyOptions,
    planes: Sequence[Plane | None],
) -> list[str]:
    """Return the reasons, with one added for each sound hit that disagrees with the others."""
    sound = [index for index, reason in enumerate(reasons) if not reason]
    band_hz = options.band_low_hz, options.band_high_hz
    apart = disagreement([ring_downs[index] for index in sound], sampling_rate_hz, band_hz, planes)
    odd = {index for index, is_odd in zip(sound, outliers(apart), strict=True) if is_odd}
    return [OUTLIER if index in odd else reason for index, reason in enumerate(reasons)]


def _counted(reasons: Sequence[str]) -> tuple[Dropped, ...]:
    counts = Counter(reason for reason in reasons if reason)
    return tuple(Dropped("hits", count, reason) for reason, count in counts.items())


def _nothing_left(
    records: Sequence[Recording], reasons: Sequence[str], dropped: Sequence[Dropped]
) -> NotIdentifiable:
    if not reasons:
        what = "no hammer hit stands out of the force signal."
    elif dropped and len(dropped) == len(records[0].accelerations):
        what = f"no acceleration channel can be used: {_listed(dropped)}."
    else:
        what = f"no hit can be used: {_listed(_counted(reasons))}."
    return NotIdentifiable(
        what,
        file=records[0].source,
        channel=records[0].force.name if records[0].force and not reasons else "",
        remedy="Check hammer and sensor cables, and measure again.",
    )


def _listed(dropped: Sequence[Dropped]) -> str:
    return ", ".join(f"{entry.count} {entry.what} ({entry.reason})" for entry in dropped)


def disagreement(
    hits: Sequence[HitRecord],
    sampling_rate_hz: float,
    band_hz: tuple[float, float],
    planes: Sequence[Plane | None],
) -> FloatArray:
    """Return the distance of each hit's accelerance from the others', (hits,), from 0 to 1.

    Of hits j and k over all channels and lines: 1 - |h_j . h_k|^2 / (|h_j|^2 |h_k|^2) (the
    modal assurance criterion, Allemang 1982, of two responses), which a hammer's level and
    calibration do not move; for each hit the lower median over the others. NaN where there are
    none, for a hit whose pulse the record's beginning may cut off, for double, clipped or
    disturbed hits, and for one so soon after another that its ring-down cannot be separated.
    Where both of the channels' `planes` were hit in turn, the others are those of its plane.
    """
    apart = np.full(len(hits), np.nan)
    step = _step([hit for hit in hits if not hit.cut], sampling_rate_hz, band_hz)
    known = [
        index
        for index, hit in enumerate(hits)
        if hit.pulse.start > 0
        and hit.free == hit.pulse.end
        and not hit.cut
        and not _comes_too_soon(hit, step, unseen=hits[max(0, index - 1)])
    ]
    if len(known) < 2:
        return apart
    responses = _responses([hits[index] for index in known], sampling_rate_hz, band_hz, step)
    flat = responses.reshape(len(known), -1)
    level = np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), np.finfo(float).tiny)
    with np.errstate(invalid="ignore"):  # a hit with lost samples is like none: NaN
        mac = np.abs((flat / level) @ (flat / level).conj().T) ** 2
    power = np.sum(np.abs(responses) ** 2, axis=2)
    for group in list(hits_by_plane(power, planes).values()) or [list(range(len(known)))]:
        ordered = np.sort((1 - mac + 2 * np.eye(len(known)))[np.ix_(group, group)], axis=1)
        apart[np.array(known)[group]] = np.maximum(ordered[:, (len(group) - 2) // 2], 0.0)
    return apart


def outliers(apart: FloatArray) -> BoolArray:
    """Return the hits that disagree while most of the others agree, (hits,)."""
    judged = apart[np.isfinite(apart)]
    if len(judged) < FEWEST_TO_COMPARE:
        return np.zeros(len(apart), dtype=bool)
    found = apart > max(MOST_UNLIKE, _TIMES_OTHERS * float(np.median(judged)))
    return np.asarray(found if 2 * np.sum(found) < len(judged) else np.zeros_like(found))


def _step(hits: Sequence[HitRecord], sampling_rate_hz: float, band_hz: tuple[float, float]) -> int:
    """Return the samples between two spectra of a ring-down: 100 periods of the highest mode."""
    gap = _gap(sampling_rate_hz)
    room = min((hit.pulse.stop - hit.pulse.start for hit in hits), default=0)
    wanted = int(_PERIODS_OF_BAND / band_hz[1] * sampling_rate_hz)
    return max(min(wanted, room // 3), min(_LEAST_SAMPLES, room)) + gap


def _gap(sampling_rate_hz: float) -> int:
    return int(PULSE_SECONDS * sampling_rate_hz) + RINGING_SAMPLES


def _comes_too_soon(hit: HitRecord, step: int, unseen: HitRecord) -> bool:
    """Return whether the two spectra that predict the remaining ringing contain another hit.

    A hit that the force does not show ends the ring-down before, too.
    """
    if unseen.cut and unseen.force is hit.force and unseen.pulse.start < hit.pulse.start:
        return unseen.pulse.stop > hit.pulse.start - 2 * step
    before = hit.force[
        max(0, hit.pulse.start - 2 * step) : max(0, hit.pulse.start - RINGING_SAMPLES)
    ]
    return (
        len(before) > 0 and float(np.ptp(before)) > LEAST_SHARE_OF_HARDEST * hit.pulse.peak_force_n
    )


def _responses(
    hits: Sequence[HitRecord], sampling_rate_hz: float, band_hz: tuple[float, float], step: int
) -> ComplexArray:
    """Return each hit's accelerance without the ringing before it, (hits, channels, lines)."""
    gap = _gap(sampling_rate_hz)
    length = step - gap
    frequency = np.fft.rfftfreq(length, 1 / sampling_rate_hz)
    lines = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    window = np.cos(np.pi / 2 * np.arange(length) / length) ** 2
    return np.array([_response(hit, gap, window)[:, lines] for hit in hits])


def _response(hit: HitRecord, gap: int, window: FloatArray) -> ComplexArray:
    start, length = hit.pulse.start, len(window)
    cut = slice(start, hit.pulse.stop)
    offset = hit.accelerations[:, cut].mean(axis=1, keepdims=True)

    def spectrum(begin: int) -> ComplexArray:
        part = hit.accelerations[:, begin : begin + length] - offset
        return np.asarray(np.fft.rfft(part * window, axis=1))

    after, step = spectrum(start), length + gap
    if start - 2 * step > 0:
        after = after - _carried_on(spectrum(start - 2 * step), spectrum(start - step))
    force = _force_spectrum(hit, gap, length)
    size = np.abs(force)
    # Lines that the hammer hardly excites would be noise over nothing: they fade out instead.
    return after * force.conj() / (size**2 + (_HARDLY * float(size.max())) ** 2)


def _carried_on(earlier: ComplexArray, later: ComplexArray) -> ComplexArray:
    """Extrapolate two spectra (channels, lines) of one ring-down, a step apart, by one step.

    A single mode rotates and shrinks by the same factor each step: z2 / z1, here from three
    lines.
    """
    cross = _three_lines(later * earlier.conj())
    power = np.maximum(_three_lines(np.abs(earlier) ** 2), np.finfo(float).tiny)
    with np.errstate(invalid="ignore"):  # lost samples come to nothing known: NaN
        factor = cross / power
        return np.asarray(later * factor / np.maximum(1.0, np.abs(factor)))


def _three_lines(values: ComplexArray | FloatArray) -> ComplexArray:
    padded = np.pad(values, ((0, 0), (1, 1)))
    return np.asarray(padded[:, :-2] + padded[:, 1:-1] + padded[:, 2:])


def _force_spectrum(hit: HitRecord, gap: int, length: int) -> ComplexArray:
    """Return the spectrum of the pulse alone, (lines,)."""
    pulse = hit.pulse
    begin = max(0, pulse.start - gap)
    force = np.zeros(length)
    known = hit.force[pulse.start : min(pulse.end + gap, pulse.start + length)]
    # A force may have lost samples before the hit: its level is that of the others.
    force[: len(known)] = known - np.nanmedian(hit.force[begin : pulse.stop])
    return np.asarray(np.fft.rfft(force))
