"""What can be wrong with the blows: too few, two in one swing, no time before or after, unlike each
other, a tip too soft for the band.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from shm.identify.contract import Hit, Measurement
from shm.identify.estimation.repeats import LEAST_HITS
from shm.identify.measuring.hits import PULSE_SECONDS, RINGING_SAMPLES, HitRecord, find_pulses
from shm.identify.measuring.screening import FEWEST_TO_COMPARE, LIMIT, disagreement
from shm.identify.measuring.signal_faults import CUT_OFF, DOUBLE_HIT, KNOCK, OUTLIER
from shm.identify.quality.inspection import Inspection, fault_count, hits_for, hits_of, places
from shm.values import NAN, FloatArray, QualityCheck, Recording

_RUNG_DOWN_DB = -3.0
"""Above it less than a third of a time constant is seen: damping rests on a small difference."""
_DIES_AWAY_DB = -10.0
"""Of stationary motion hardly a tenth is above another by so much, if it is of ten values."""
_LEAST_FORCE_DB = -20.0
"""Usual in impact testing (Ewins 2000, 3.4): a tenth of the force still excites."""
_LONGEST_PULSE_S = 0.05  # judgement: ten soft pulses; what follows is noise in the spectrum
_TRANSFORM_S = 1.0


def hits_used(inspection: Inspection) -> QualityCheck | None:
    """Used hits of the set-up with the fewest, below three a warning.

    A single hit with which its record begins is refused, as nothing repeats it and nothing shows
    the noise it stands in; but for one whose vibration dies away, as noise does not, in modes that
    keep their phase from early to late.
    """
    hits = hits_of(inspection)
    if not hits:
        return None
    used = [hit for hit in hits if hit.used]
    fewest = min(sum(h.used for h in m.hits) for m in inspection.measurements)
    found = f"{len(used)} of {len(hits)} hits are used{_reasons([h.reason for h in hits])}"
    if _unforced(inspection):
        found += "; no force is known, so they are known by what they set in motion"
    remedy = "Hit at least three times, better five, with time to ring down."
    if len(used) == 1 and used[0].start < RINGING_SAMPLES and not _dies_away(inspection):
        found = "one hit that begins with its record: nothing tells its vibration from noise"
        return QualityCheck(
            "hits", "refused", 1.0, float(LEAST_HITS), "",
            found, f"{remedy} Record half a second before the first hit.",
        )  # fmt: skip
    if fewest < LEAST_HITS:
        return QualityCheck("hits", "warning", fewest, float(LEAST_HITS), "", found, remedy)
    return QualityCheck("hits", "good", fewest, float(LEAST_HITS), "", found)


def _dies_away(inspection: Inspection) -> bool:
    """Whether ring-downs fall by 10 dB, and most modes are seen to turn steadily as they do."""
    decays = [decay for m in inspection.measurements for decay in m.decays]
    modes = inspection.finding.modes if inspection.finding else ()
    steady = [mode for mode in modes if math.isfinite(mode.amplitude_slope)]
    falls = max((_level_db(decay) for decay in decays), default=0.0) <= _DIES_AWAY_DB
    return falls and len(modes) > 0 and 2 * len(steady) >= len(modes)


def _unforced(inspection: Inspection) -> bool:
    """Whether the hits are known from the accelerations alone."""
    return any(record.force is None for record in inspection.records)


def _reasons(reasons: list[str]) -> str:
    counts = Counter(reason for reason in reasons if reason)
    told = "; ".join(f"{count} {reason}" for reason, count in counts.items())
    return f" (left out: {told})" if told else ""


def double_hits(inspection: Inspection) -> QualityCheck | None:
    """How many hits have a second blow in their ring-down.

    They are used from after it.
    """
    remedy = "Hit from the wrist and let the hammer spring back at once; repeat these hits."
    return fault_count(
        inspection,
        "double hits",
        (DOUBLE_HIT,),
        "each hit is a single blow",
        remedy,
        part="used from after the second blow",
    )


def pre_trigger(inspection: Inspection) -> QualityCheck | None:
    """Milliseconds from the beginning of a record to its first hit, the shortest.

    The frequency response takes 6 ms and 16 samples before the pulse: so long an anti-aliasing
    filter may announce it. The ring-down is as good without.
    """
    hits = hits_of(inspection)
    if not hits or _unforced(inspection):
        return None
    limit = max(
        PULSE_SECONDS + RINGING_SAMPLES / record.sampling_rate_hz for record in inspection.records
    )
    shortest = min(hit.start_s for hit in hits)
    short = [hit for hit in hits if hit.start_s < limit]
    good = not short
    return QualityCheck(
        "pre-trigger",
        "good" if good else "warning",
        1000 * shortest,
        1000 * limit,
        "ms",
        "every pulse is recorded whole"
        if good
        else f"too little before {places(inspection, short)}: "
        "frequency responses may lack a part of the pulse, frequencies and damping do not",
        "" if good else "Set a pre-trigger of half a second, or start the logger before hitting.",
    )


def ring_down(inspection: Inspection) -> QualityCheck | None:
    """Level of a ring-down's last tenth over its first, in dB, median over the used hits."""
    if not hits_of(inspection):
        return None
    levels = [_level_db(d) for measurement in inspection.measurements for d in measurement.decays]
    level = float(np.median(levels))
    short = hits_for(inspection, (CUT_OFF,))
    found = f"it ends {-level:.0f} dB below its beginning"
    if not short and level <= _RUNG_DOWN_DB:
        return QualityCheck("ring-down", "good", level, _RUNG_DOWN_DB, "dB", found)
    found = f"{places(inspection, short)} is cut off and left out; {found}" if short else found
    return QualityCheck(
        "ring-down", "warning", level, _RUNG_DOWN_DB, "dB", found,
        "Wait longer before the next hit and before stopping the logger: until nothing moves.",
    )  # fmt: skip


def _level_db(decay: FloatArray) -> float:
    tenth = max(1, decay.shape[1] // 10)
    first, last = np.std(decay[:, :tenth]), np.std(decay[:, -tenth:])
    tiny = np.finfo(float).tiny
    return float(20 * np.log10(max(float(last), tiny) / max(float(first), tiny)))


def repeatability(inspection: Inspection) -> QualityCheck | None:
    """How far apart the used hits' responses are (0 alike, 1 unlike), worst set-up."""
    if not hits_of(inspection) or _unforced(inspection):
        return None
    dropped = hits_for(inspection, (OUTLIER, KNOCK))
    values = [_apart(m, inspection) for m in inspection.measurements]
    known = [value for value in values if np.isfinite(value)]
    value = max(known, default=NAN)
    remedy = "Hit the same point in the same direction, and let nobody touch the hanger."
    struck = [hit for hit in hits_of(inspection) if hit.cut == KNOCK]
    if dropped or struck:
        told = [f"left out as unlike the others: {places(inspection, dropped)}"] if dropped else []
        told += [f"something else struck: {places(inspection, struck)}"] if struck else []
        found = "; ".join(told)
        return QualityCheck("repeatability", "warning", value, LIMIT, "", found, remedy)
    if not known:
        found = f"fewer than {FEWEST_TO_COMPARE} hits: nothing to compare"
        return QualityCheck("repeatability", "unknown", NAN, LIMIT, "", found, "Hit more often.")
    if value > LIMIT:
        found = "the hits differ, and not one against the rest"
        return QualityCheck("repeatability", "warning", value, LIMIT, "", found, remedy)
    return QualityCheck("repeatability", "good", value, LIMIT, "", "the hits are alike")


def _apart(measurement: Measurement, inspection: Inspection) -> float:
    """Median over the used hits of how far each is from the others; NaN below three hits."""
    if sum(hit.used for hit in measurement.hits) < FEWEST_TO_COMPARE:
        return NAN
    names = {point.name for point in measurement.points}
    used = {(hit.record, hit.start) for hit in measurement.hits if hit.used}
    records = [
        part
        for number in sorted({hit.record for hit in measurement.hits})
        for part in _hit_records(inspection.records[number], number, names, used)
    ]
    options = inspection.options
    rate = inspection.records[measurement.hits[0].record].sampling_rate_hz
    planes = [
        c.plane
        for c in inspection.records[measurement.hits[0].record].accelerations
        if c.name in names
    ]
    apart = disagreement(records, rate, (options.band_low_hz, options.band_high_hz), planes)
    known = apart[np.isfinite(apart)]
    return float(np.median(known)) if len(known) else NAN


def _hit_records(
    record: Recording, number: int, names: set[str], used: set[tuple[int, int]]
) -> list[HitRecord]:
    """The used hits of one record, with the channels that are used."""
    force = record.force
    assert force is not None
    accelerations = np.array([c.values for c in record.accelerations if c.name in names])
    pulses = find_pulses(force.values, record.sampling_rate_hz)
    return [HitRecord(force.values, accelerations, p) for p in pulses if (number, p.start) in used]


def force_spectrum(inspection: Inspection) -> QualityCheck | None:
    """Force at the band's upper end over its largest in the band, in dB, median over the hits."""
    used = [hit for hit in hits_of(inspection) if hit.used]
    if not used or _unforced(inspection):
        return None
    high = inspection.options.band_high_hz
    curves = [_spectrum_db(inspection, hit) for hit in used]
    # A zero between lobes of the spectrum is as bad as its end: the lowest value counts.
    ends = [float(np.min(db)) for _, db in curves]
    value = float(np.median(ends))
    if value >= _LEAST_FORCE_DB:
        found = f"the force reaches {high:g} Hz"
        return QualityCheck("force spectrum", "good", value, _LEAST_FORCE_DB, "dB", found)
    below = [np.flatnonzero(db < _LEAST_FORCE_DB) for _, db in curves]
    ends_hz = [f[k[0] if len(k) else -1] for (f, _), k in zip(curves, below, strict=True)]
    reach = float(np.median(ends_hz))
    return QualityCheck(
        "force spectrum", "warning", value, _LEAST_FORCE_DB, "dB",
        f"the force reaches {reach:.0f} Hz; modes above may be missed or uncertain",
        f"Use a harder tip, or look for modes up to {reach:.0f} Hz only.",
    )  # fmt: skip


def _spectrum_db(inspection: Inspection, hit: Hit) -> tuple[FloatArray, FloatArray]:
    """Frequencies (lines,) in the band and the pulse's level at them over its largest, in dB."""
    record, options = inspection.records[hit.record], inspection.options
    force, rate = record.force, record.sampling_rate_hz
    assert force is not None
    first = max(0, hit.start - RINGING_SAMPLES)
    stop = hit.start + int(_LONGEST_PULSE_S * rate)
    cut = force.values[first : stop + 1] - np.median(force.values[first : hit.start + int(rate)])
    fade = np.ones(len(cut))
    tail = int(PULSE_SECONDS * rate)
    fade[len(cut) - tail :] = np.linspace(1, 0, tail)
    length = max(len(cut), int(_TRANSFORM_S * rate))
    level = np.abs(np.fft.rfft(cut * fade, n=length))
    frequency = np.fft.rfftfreq(length, 1 / rate)
    lines = (frequency >= options.band_low_hz) & (frequency <= options.band_high_hz)
    top = max(float(level[lines].max(initial=0.0)), np.finfo(float).tiny)
    decibels = 20 * np.log10(np.maximum(level[lines] / top, 1e-6))
    return np.asarray(frequency[lines]), np.asarray(decibels)
