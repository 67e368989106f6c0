"""A quality check as a row: its statistic, the limit, and what is said below, above and to do."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from shm.identify.quality.inspection import (
    Inspection,
    channels_for,
    hits_for,
    hits_of,
    places,
)
from shm.values import NAN, QualityCheck, Verdict
from shm.values.rounding import listed


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
