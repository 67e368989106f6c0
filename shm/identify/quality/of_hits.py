"""Check the hits: too few, double, too close, inconsistent, or of too soft a tip."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

import numpy as np

from shm.identify.contract import LEAST_HITS, Measurement
from shm.identify.measuring.hits import PULSE_SECONDS, RINGING_SAMPLES
from shm.identify.measuring.signal_faults import (
    CUT_OFF,
    DOUBLE_HIT,
    FEWEST_TO_COMPARE,
    KNOCK,
    MOST_UNLIKE,
    OUTLIER,
)
from shm.identify.options import IdentifyOptions
from shm.identify.quality.table import (
    Inspection,
    Reading,
    Row,
    fault_reading,
    hits_for,
    hits_of,
    places,
)
from shm.values import NAN, FloatArray

_RUNG_DOWN_DB = -3.0
"""Above it less than a third of a time constant is seen: damping rests on a small difference."""
_DIES_AWAY_DB = -10.0
"""Of stationary motion hardly a tenth is above another by so much, if it is of ten values."""
_LEAST_FORCE_DB = -20.0
"""Usual in impact testing (Ewins 2000, 3.4): a tenth of the force still excites."""


def _hits_used(inspection: Inspection) -> Reading | None:
    """Return the used hits of the set-up with the fewest.

    A single hit with which its record begins is refused, as nothing repeats it and nothing shows
    the noise it stands in; but for one whose vibration dies away, as noise does not, in modes that
    keep their phase from early to late.
    """
    hits = hits_of(inspection)
    if not hits:
        return None
    used = [hit for hit in hits if hit.used]
    if len(used) == 1 and used[0].start < RINGING_SAMPLES and not _dies_away(inspection):
        found = "one hit that begins with its record: nothing tells its vibration from noise"
        remedy = f"{_HIT_MORE} Record half a second before the first hit."
        return Reading(1.0, {}, "refused", found=found, remedy=remedy)
    fewest = min(sum(h.used for h in m.hits) for m in inspection.measurements)
    more = _reasons([hit.reason for hit in hits])
    if _unforced(inspection):
        more += "; no force is known, so they are known by what they set in motion"
    return Reading(fewest, {"used": len(used), "all": len(hits), "more": more})


def _dies_away(inspection: Inspection) -> bool:
    """Return whether ring-downs fall by 10 dB while most modes keep a steady phase."""
    decays = [decay for m in inspection.measurements for decay in m.decays]
    modes = inspection.finding.modes if inspection.finding else ()
    steady = [mode for mode in modes if math.isfinite(mode.amplitude_slope)]
    falls = max((_level_db(decay) for decay in decays), default=0.0) <= _DIES_AWAY_DB
    return falls and len(modes) > 0 and 2 * len(steady) >= len(modes)


def _unforced(inspection: Inspection) -> bool:
    """Return whether the hits are known from the accelerations alone."""
    return any(record.force is None for record in inspection.records)


def _reasons(reasons: list[str]) -> str:
    counts = Counter(reason for reason in reasons if reason)
    text = "; ".join(f"{count} {reason}" for reason, count in counts.items())
    return f" (left out: {text})" if text else ""


def _double_hits(inspection: Inspection) -> Reading | None:
    return fault_reading(inspection, (DOUBLE_HIT,), "used from after the second blow")


def _pre_trigger(inspection: Inspection) -> Reading | None:
    """Return the milliseconds from the beginning of a record to its first hit, the shortest.

    The frequency response takes 6 ms and 16 samples before the pulse: so long an anti-aliasing
    filter may announce it. The ring-down is as good without.
    """
    hits = hits_of(inspection)
    if not hits or _unforced(inspection):
        return None
    limit = max(
        PULSE_SECONDS + RINGING_SAMPLES / record.sampling_rate_hz for record in inspection.records
    )
    short = places(inspection, [hit for hit in hits if hit.start_s < limit])
    return Reading(1000 * min(hit.start_s for hit in hits), {"short": short}, limit=1000 * limit)


def _ring_down(inspection: Inspection) -> Reading | None:
    """Return the level of a ring-down's last tenth over its first, in dB, the hits' median."""
    if not hits_of(inspection):
        return None
    levels = [_level_db(d) for measurement in inspection.measurements for d in measurement.decays]
    level = float(np.median(levels))
    short = hits_for(inspection, (CUT_OFF,))
    cut = f"{places(inspection, short)} is cut off and left out; " if short else ""
    return Reading(level, {"below": -level, "cut": cut}, "warning" if short else None)


def _level_db(decay: FloatArray) -> float:
    tenth = max(1, decay.shape[1] // 10)
    first, last = np.std(decay[:, :tenth]), np.std(decay[:, -tenth:])
    tiny = np.finfo(float).tiny
    return float(20 * np.log10(max(float(last), tiny) / max(float(first), tiny)))


def _repeatability(inspection: Inspection) -> Reading | None:
    """Return how far apart the used hits' responses are (0 alike, 1 unlike), worst set-up."""
    if not hits_of(inspection) or _unforced(inspection):
        return None
    dropped = hits_for(inspection, (OUTLIER, KNOCK))
    known = [m.unlike for m in inspection.measurements if np.isfinite(m.unlike)]
    value = max(known, default=NAN)
    knocked = [hit for hit in hits_of(inspection) if hit.cut == KNOCK]
    if dropped or knocked:
        text = [f"left out as unlike the others: {places(inspection, dropped)}"] if dropped else []
        text += (
            [f"something else struck, or samples are lost: {places(inspection, knocked)}"]
            if knocked
            else []
        )
        return Reading(value, {}, "warning", found="; ".join(text))
    if not known:
        found = f"fewer than {FEWEST_TO_COMPARE} hits: nothing to compare"
        return Reading(NAN, {}, "unknown", found=found, remedy="Hit more often.")
    return Reading(value)


def _force_spectrum(inspection: Inspection) -> Reading | None:
    """Return the force at the band's upper end over its largest in it, in dB, the hits' median."""
    curves = [each for m in inspection.measurements for each in _force_db(m, inspection.options)]
    if not curves:
        return None
    # A zero between lobes of the spectrum is as bad as its end: the lowest value counts.
    value = float(np.median([float(np.min(db)) for _, db in curves]))
    below = [np.flatnonzero(db < _LEAST_FORCE_DB) for _, db in curves]
    ends_hz = [f[k[0] if len(k) else -1] for (f, _), k in zip(curves, below, strict=True)]
    reach = float(np.median(ends_hz))
    words = {"high": inspection.options.band_high_hz, "reach": reach}
    return Reading(
        value, words, remedy=f"Use a harder tip, or look for modes up to {reach:.0f} Hz only."
    )


def _force_db(
    measurement: Measurement, options: IdentifyOptions
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the lines in the band and each used pulse's relative level at them in dB."""
    if measurement.spectra is None or measurement.frequency_response is None:
        return
    hz: FloatArray = measurement.frequency_response.frequency_hz
    lines = (hz >= options.band_low_hz) & (hz <= options.band_high_hz)
    for level in np.abs(measurement.spectra[:, 0, lines]):
        top = max(float(level.max(initial=0.0)), np.finfo(float).tiny)
        yield hz[lines], np.asarray(20 * np.log10(np.maximum(level / top, 1e-6)))


_HIT_MORE = "Hit at least three times, better five, with time to ring down."
_USED = "{used} of {all} hits are used{more}"
_ENDS = "{cut}it ends {below:.0f} dB below its beginning"
HITS = Row("hits", _hits_used, LEAST_HITS, "", _USED, _USED, _HIT_MORE, is_least=True)
DOUBLE_HITS = Row(
    "double hits", _double_hits, 0.0, "", "no hit is double", "{faults}",
    "Hit from the wrist and let the hammer spring back at once; repeat these hits.",
)  # fmt: skip
PRE_TRIGGER = Row(
    "pre-trigger", _pre_trigger, NAN, "ms", "every pulse is recorded completely",
    "too little before {short}: frequency responses may lack a part of the pulse, frequencies and "
    "damping do not",
    "Set a pre-trigger of half a second, or start the logger before hitting.",
    is_least=True,
)  # fmt: skip
RING_DOWN = Row(
    "ring-down", _ring_down, _RUNG_DOWN_DB, "dB", _ENDS, _ENDS,
    "Wait longer before the next hit and before stopping the logger: until nothing moves.",
)  # fmt: skip
REPEATABILITY = Row(
    "repeatability", _repeatability, MOST_UNLIKE, "", "the hits agree",
    "the hits differ, and not one against the rest",
    "Hit the same point in the same direction, and let nobody touch the hanger.",
)  # fmt: skip
FORCE_SPECTRUM = Row(
    "force spectrum", _force_spectrum, _LEAST_FORCE_DB, "dB", "the force reaches {high:g} Hz",
    "the force reaches {reach:.0f} Hz; modes above may be missed or uncertain", "",
    is_least=True,
)  # fmt: skip
