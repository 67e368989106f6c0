"""What a quality check looks at, and how hits and channels are counted and told to the crew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from shm.identify.contract import Finding, Hit, Measurement, Tone
from shm.identify.options import IdentifyOptions
from shm.values import QualityCheck, Recording
from shm.values.rounding import listed

_MOST_TOLD = 4  # technical: of a sentence that can be read


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


class Check(Protocol):
    """Gives one figure of a test's quality; None where the question does not arise."""

    def __call__(self, inspection: Inspection) -> QualityCheck | None: ...


def hits_of(inspection: Inspection) -> list[Hit]:
    """All hits of all set-ups, used or not."""
    return [hit for measurement in inspection.measurements for hit in measurement.hits]


def hits_for(inspection: Inspection, reasons: Sequence[str]) -> list[Hit]:
    """The hits that were left out for one of the reasons."""
    return [hit for hit in hits_of(inspection) if hit.reason.startswith(tuple(reasons))]


def channels_for(inspection: Inspection, reasons: Sequence[str]) -> list[str]:
    """The channels that were left out for one of the reasons, as `channel acc_3`."""
    dropped = [d for measurement in inspection.measurements for d in measurement.dropped]
    return sorted(
        {d.what for d in dropped if "channel" in d.what and d.reason.startswith(tuple(reasons))}
    )


def places(inspection: Inspection, hits: Sequence[Hit]) -> str:
    """Such as `the hits at 12.3 s and 45.1 s`, with the record where there are several.

    More than four are counted.
    """
    if len(hits) > _MOST_TOLD:
        return f"{len(hits)} hits"
    several = len(inspection.records) > 1
    told = [
        f"{hit.start_s:.1f} s" + (f" of record {hit.record + 1}" if several else "") for hit in hits
    ]
    return ("the hit at " if len(told) == 1 else "the hits at ") + listed(told)


def fault_count(
    inspection: Inspection,
    name: str,
    reasons: Sequence[str],
    none: str,
    remedy: str,
    part: str = "used until then",
) -> QualityCheck | None:
    """How many hits and channels were left out for the reasons, or of how many hits a part is used;
    none is good."""
    if not hits_of(inspection):
        return None
    hits, channels = hits_for(inspection, reasons), channels_for(inspection, reasons)
    cut = [hit for hit in hits_of(inspection) if hit.cut.startswith(tuple(reasons))]
    count = len(hits) + len(channels) + len(cut)
    if not count:
        return QualityCheck(name, "good", 0.0, 0.0, "", none)
    told = [places(inspection, hits)] if hits else []
    found = f"left out: {listed(told + channels)}" if told + channels else ""
    used = f"{part}: {places(inspection, cut)}" if cut else ""
    found = "; ".join(each for each in (found, used) if each)
    return QualityCheck(name, "warning", float(count), 0.0, "", found, remedy)
