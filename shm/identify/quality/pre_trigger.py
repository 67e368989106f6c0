"""Check `pre-trigger`: how much of the time before a hit is recorded."""

from __future__ import annotations

from shm.identify.measuring.hits import PULSE_SECONDS, RINGING_SAMPLES
from shm.identify.quality.inspection import Inspection
from shm.identify.quality.wording import hits_of, places
from shm.values import QualityCheck


def check(inspection: Inspection) -> QualityCheck | None:
    """Milliseconds from the beginning of a record to its first hit, the shortest.

    The frequency response takes 6 ms and 16 samples before the pulse: so long an anti-aliasing
    filter may announce it. The ring-down is as good without.
    """
    hits = hits_of(inspection)
    if not hits:
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
