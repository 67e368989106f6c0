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
import scipy

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
    Faults,
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
    longest = max((r.pulse.stop - r.free for r in ring_downs), default=0)
    least = max(least_seconds(options.band_high_hz) * rate, _LEAST_SHARE_OF_LONGEST * longest)
    ring_downs, faults = until_disturbed(channels, ring_downs, faults, least, rate, options)
    rows, dropped = _usable_channels(channels, faults)
    chosen = {id(r.accelerations): r.accelerations[rows] for r in ring_downs}
    ring_downs = [replace(r, accelerations=chosen[id(r.accelerations)]) for r in ring_downs]
    reasons = [
        _hit_fault(ring_down, names, least)
        for ring_down, names in zip(ring_downs, faults[:, rows].tolist(), strict=True)
    ]
    apart = np.full(len(reasons), NAN)
    if records[0].force is not None:
        sound = [index for index, reason in enumerate(reasons) if not reason]
        band_hz = options.band_low_hz, options.band_high_hz
        planes = [channels[row].plane for row in rows]
        apart[sound] = disagreement([ring_downs[n] for n in sound], rate, band_hz, planes)
        odd = outliers(apart)
        reasons = [OUTLIER if is_odd else r for r, is_odd in zip(reasons, odd, strict=True)]
    used = [index for index, reason in enumerate(reasons) if not reason]
    if not used or not rows:
        raise _nothing_left(records, reasons, dropped)
    judged = [
        replace(hit, used=not reason, reason=reason, cut="" if reason else _cut(ring_down, names))
        for hit, reason, ring_down, (_, names) in zip(hits, reasons, ring_downs, ends, strict=True)
    ]
    known = np.isfinite(apart[used])
    return Screening(
        hits=tuple(judged),
        used=tuple(ring_downs[index] for index in used),
        rows=tuple(rows),
        dropped=dropped + _counted(reasons),
        unlike=float(np.median(apart[used][known]))
        if len(used) >= FEWEST_TO_COMPARE and known.any()
        else NAN,
    )


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


def _usable_channels(
    channels: Sequence[Channel], faults: Faults
) -> tuple[list[int], tuple[Dropped, ...]]:
    """Return the rows of usable accelerations, and the dropped ones with the reason.

    Where every channel has a fault after most hits, those stay that have one hit without.
    """
    columns = faults.T.tolist()
    some_plane = any(channel.plane for channel in channels)
    reasons: list[str] = []
    for most in (0.5, 1.0):
        if all(reasons):
            reasons = [
                _channel_fault(c, f, most, some_plane)
                for c, f in zip(channels, columns, strict=True)
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


def _hit_fault(ring_down: HitRecord, faults: Sequence[str], least_samples: float) -> str:
    """Return the reason why a hit cannot be used; empty where it can."""
    pulse = ring_down.pulse
    force = ring_down.force[pulse.start : pulse.stop]
    if NOT_A_NUMBER in faults or not np.all(np.isfinite(force)):
        return NOT_A_NUMBER
    if pulse.stop - ring_down.free < least_samples:
        return CUT_OFF
    return next((fault for fault in faults if fault), "")


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
    pulse, length = hit.pulse, len(window)
    offset = hit.accelerations[:, pulse.start : pulse.stop].mean(axis=1, keepdims=True)

    def spectrum(begin: int) -> ComplexArray:
        part = hit.accelerations[:, begin : begin + length] - offset
        return np.asarray(np.fft.rfft(part * window, axis=1))

    after, step = spectrum(pulse.start), length + gap
    if pulse.start - 2 * step > 0:
        earlier, later = spectrum(pulse.start - 2 * step), spectrum(pulse.start - step)
        after = after - _carried_on(earlier, later)
    known = hit.force[pulse.start : min(pulse.end + gap, pulse.start + length)]
    push = np.zeros(length)
    # A force may have lost samples before the hit: its level is that of the others.
    push[: len(known)] = known - np.nanmedian(hit.force[max(0, pulse.start - gap) : pulse.stop])
    force = np.fft.rfft(push)
    size = np.abs(force)
    # Lines that the hammer hardly excites would be noise over nothing: they fade out instead.
    return np.asarray(after * force.conj() / (size**2 + (_HARDLY * float(size.max())) ** 2))


def _carried_on(earlier: ComplexArray, later: ComplexArray) -> ComplexArray:
    """Extrapolate two spectra (channels, lines) of one ring-down, a step apart, by one step.

    A single mode rotates and shrinks by the same factor each step: z2 / z1, here from three
    lines.
    """
    three = np.ones((1, 3))
    cross = scipy.signal.convolve2d(later * earlier.conj(), three, mode="same")
    power = scipy.signal.convolve2d(np.abs(earlier) ** 2, three, mode="same")
    with np.errstate(invalid="ignore"):  # lost samples come to nothing known: NaN
        factor = cross / np.maximum(power, np.finfo(float).tiny)
        return np.asarray(later * factor / np.maximum(1.0, np.abs(factor)))
