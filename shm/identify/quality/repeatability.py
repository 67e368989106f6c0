"""Check `repeatability`: how alike the used hits are, and which were not."""

from __future__ import annotations

import numpy as np

from shm.identify.contract import Measurement
from shm.identify.measuring.hits import HitRecord, find_pulses
from shm.identify.measuring.outliers import LEAST_HITS, LIMIT, disagreement
from shm.identify.measuring.signal_faults import KNOCK, OUTLIER
from shm.identify.quality.inspection import Inspection
from shm.identify.quality.wording import hits_for, hits_of, places
from shm.values import NAN, QualityCheck, Recording


def check(inspection: Inspection) -> QualityCheck | None:
    """How far apart the used hits' responses are (0 alike, 1 unlike), worst set-up."""
    if not hits_of(inspection):
        return None
    dropped = hits_for(inspection, (OUTLIER, KNOCK))
    values = [_apart(m, inspection) for m in inspection.measurements]
    known = [value for value in values if np.isfinite(value)]
    value = max(known, default=NAN)
    remedy = "Hit the same point in the same direction, and let nobody touch the hanger."
    if dropped:
        found = f"left out as unlike the others: {places(inspection, dropped)}"
        return QualityCheck("repeatability", "warning", value, LIMIT, "", found, remedy)
    if not known:
        found = f"fewer than {LEAST_HITS} hits: nothing to compare"
        return QualityCheck("repeatability", "unknown", NAN, LIMIT, "", found, "Hit more often.")
    if value > LIMIT:
        found = "the hits differ, and not one against the rest"
        return QualityCheck("repeatability", "warning", value, LIMIT, "", found, remedy)
    return QualityCheck("repeatability", "good", value, LIMIT, "", "the hits are alike")


def _apart(measurement: Measurement, inspection: Inspection) -> float:
    """Median over the used hits of how far each is from the others; NaN below three hits."""
    if sum(hit.used for hit in measurement.hits) < LEAST_HITS:
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
    apart = disagreement(records, rate, (options.band_low_hz, options.band_high_hz))
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
