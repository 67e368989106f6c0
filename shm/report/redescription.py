"""What a report says first where the description has changed since the baseline."""

from __future__ import annotations

from shm.report.content import HangerReport

_MOST_NAMED = 3


def redescribed(data: HangerReport) -> str:
    """That the description has changed since the baseline, and what to do; empty where not."""
    if not data.redescribed:
        return ""
    changed, more = data.redescribed[:_MOST_NAMED], data.redescribed[_MOST_NAMED:]
    named = ", ".join(changed) + (f" and {len(more)} more" if more else "")
    number = data.hanger.id
    return (
        f"The description of hanger {number} has changed since its baseline: {named}. "
        f"Set a new baseline: `shm drift rebaseline --hanger {number} --since DAY --why TEXT`. "
        "Until then shifts and alerts compare two descriptions, not two states of the hanger."
    )
