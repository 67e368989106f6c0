"""Check `hits`: how many are left to use."""

from __future__ import annotations

from collections import Counter

from shm.identify.finding.jackknife import LEAST_HITS
from shm.identify.measuring.hits import RINGING_SAMPLES
from shm.identify.quality.inspection import Inspection
from shm.identify.quality.wording import hits_of
from shm.values import QualityCheck


def check(inspection: Inspection) -> QualityCheck | None:
    """Used hits of the set-up with the fewest, below three a warning.

    A single hit with which its record begins is refused: nothing repeats it and nothing shows the
    noise it stands in, so that nobody can say which of its vibration is the hanger's.
    """
    hits = hits_of(inspection)
    if not hits:
        return None
    used = [hit for hit in hits if hit.used]
    fewest = min(sum(h.used for h in m.hits) for m in inspection.measurements)
    found = f"{len(used)} of {len(hits)} hits are used{_reasons([h.reason for h in hits])}"
    remedy = "Hit at least three times, better five, with time to ring down."
    if len(used) == 1 and used[0].start < RINGING_SAMPLES:
        found = "one hit that begins with its record: nothing tells its vibration from noise"
        return QualityCheck(
            "hits", "refused", 1.0, float(LEAST_HITS), "",
            found, f"{remedy} Record half a second before the first hit.",
        )  # fmt: skip
    if fewest < LEAST_HITS:
        return QualityCheck("hits", "warning", fewest, float(LEAST_HITS), "", found, remedy)
    return QualityCheck("hits", "good", fewest, float(LEAST_HITS), "", found)


def _reasons(reasons: list[str]) -> str:
    counts = Counter(reason for reason in reasons if reason)
    told = "; ".join(f"{count} {reason}" for reason, count in counts.items())
    return f" (left out: {told})" if told else ""
