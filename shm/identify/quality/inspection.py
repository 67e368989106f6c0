"""Hold the data that a quality check evaluates, and describe hits and channels to the crew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shm.identify.contract import Finding, Hit, Measurement, Tone
from shm.identify.options import IdentifyOptions
from shm.values import Recording
from shm.values.rounding import listed

_MAX_NAMED = 4  # technical: of a sentence that can be read


@dataclass(frozen=True, eq=False)
class Inspection:
    """A test before its modes are numbered.

    `records` are the time records, none where frequency responses were given; `measurements` one a
    set-up; `tones` ring steadily in them; `finding` is what the identifier found, None where it has
    not run yet; `cross_check` what a second identifier found, None where none was asked.
    """

    records: Sequence[Recording]
    measurements: Sequence[Measurement]
    options: IdentifyOptions
    tones: Sequence[Tone] = ()
    finding: Finding | None = None
    cross_check: Finding | None = None


def hits_of(inspection: Inspection) -> list[Hit]:
    """Return all hits of all set-ups, used or not."""
    return [hit for measurement in inspection.measurements for hit in measurement.hits]


def hits_for(inspection: Inspection, reasons: Sequence[str]) -> list[Hit]:
    """Return the hits that were left out for one of the reasons."""
    return [hit for hit in hits_of(inspection) if hit.reason.startswith(tuple(reasons))]


def channels_for(inspection: Inspection, reasons: Sequence[str]) -> list[str]:
    """Return the channels that were left out for one of the reasons, as `channel acc_3`."""
    dropped = [d for measurement in inspection.measurements for d in measurement.dropped]
    return sorted(
        {d.what for d in dropped if "channel" in d.what and d.reason.startswith(tuple(reasons))}
    )


def places(inspection: Inspection, hits: Sequence[Hit]) -> str:
    """Describe hits, as `the hits at 12.3 s and 45.1 s`, with the record where there are several.

    More than four are counted.
    """
    if len(hits) > _MAX_NAMED:
        return f"{len(hits)} hits"
    several = len(inspection.records) > 1
    names = [
        f"{hit.start_s:.1f} s" + (f" of record {hit.record + 1}" if several else "") for hit in hits
    ]
    return ("the hit at " if len(names) == 1 else "the hits at ") + listed(names)
