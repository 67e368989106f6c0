"""Rows of the table of checks, and the data that they evaluate.

A row is a statistic of a test, its limit, and what is said below, above and to do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from shm.identify.contract import Finding, FoundMode, Hit, Measurement, Tone
from shm.identify.options import IdentifyOptions
from shm.values import NAN, Hanger, Mode, QualityCheck, Recording, ResponsePoint, Verdict
from shm.values.rounding import listed

_MAX_NAMED = 4  # technical: of a sentence that can be read


@dataclass(frozen=True, eq=False)
class Inspection:
    """A test, before and after its modes are numbered.

    `records` are the time records, none where frequency responses were given; `measurements` one a
    set-up; `tones` ring steadily in them; `finding` is what the identifier found, None where it has
    not run yet, over `points`; `cross_check` what a second identifier found, None where none was
    asked. Once modes are numbered, `apart` are those of each set-up, `modes` those with an order,
    and `hanger` is the described bar.
    """

    records: Sequence[Recording]
    measurements: Sequence[Measurement]
    options: IdentifyOptions
    tones: Sequence[Tone] = ()
    finding: Finding | None = None
    cross_check: Finding | None = None
    points: Sequence[ResponsePoint] = ()
    apart: Sequence[Sequence[FoundMode]] = ()
    modes: Sequence[Mode] = ()
    hanger: Hanger | None = None


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


@dataclass(frozen=True)
class Reading:
    """Hold what a statistic comes to; `words` fill the row's sentences.

    `verdict`, `limit`, `found` and `remedy` take the place of the row's where they are given.
    """

    value: float
    words: Mapping[str, object] = field(default_factory=dict)
    verdict: Verdict | None = None
    limit: float | None = None
    found: str = ""
    remedy: str = ""


@dataclass(frozen=True)
class Row:
    """One check. Values above the `limit` are a warning; below it where `is_least`.

    `good` and `bad` are sentences with `{value}` and the reading's words. `statistic` gives None
    where the question does not arise.
    """

    name: str
    statistic: Callable[[Inspection], Reading | None]
    limit: float
    unit: str
    good: str
    bad: str
    remedy: str
    is_least: bool = False

    def check(self, inspection: Inspection) -> QualityCheck | None:
        """Return the figure of a test; None where the question does not arise."""
        reading = self.statistic(inspection)
        if reading is None:
            return None
        limit = self.limit if reading.limit is None else reading.limit
        value = float(reading.value)
        is_good = value >= limit if self.is_least else value <= limit
        verdict = reading.verdict or ("good" if is_good else "warning")
        sentence = self.good if verdict == "good" else self.bad
        return QualityCheck(
            name=self.name,
            verdict=verdict,
            value=NAN if verdict == "unknown" else value,
            limit=float(limit),
            unit=self.unit,
            found=reading.found or sentence.format(value=value, **reading.words),
            remedy="" if verdict == "good" else reading.remedy or self.remedy,
        )


def fault_reading(
    inspection: Inspection, reasons: Sequence[str], part: str = "used until then"
) -> Reading | None:
    """Return how many hits and channels were left out for the reasons, or used in part."""
    if not hits_of(inspection):
        return None
    hits, channels = hits_for(inspection, reasons), channels_for(inspection, reasons)
    cut = [hit for hit in hits_of(inspection) if hit.cut.startswith(tuple(reasons))]
    texts = [places(inspection, hits)] if hits else []
    found = f"left out: {listed(texts + channels)}" if texts + channels else ""
    used = f"{part}: {places(inspection, cut)}" if cut else ""
    text = "; ".join(each for each in (found, used) if each)
    return Reading(len(hits) + len(channels) + len(cut), {"faults": text})
