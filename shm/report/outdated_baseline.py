"""That a baseline no longer fits what is known, and what to do: sentences of the report."""

from __future__ import annotations

from shm.report.contents import HangerReport

_MOST_CHANGES = 3  # what a sentence bears


def redescribed(data: HangerReport) -> str:
    """That the description has changed since the baseline, and what to do; empty where not."""
    if not data.redescribed:
        return ""
    changed, more = data.redescribed[:_MOST_CHANGES], data.redescribed[_MOST_CHANGES:]
    named = ", ".join(changed) + (f" and {len(more)} more" if more else "")
    number = data.hanger.id
    return (
        f"The description of hanger {number} has changed since its baseline: {named}. "
        f"{_anew(number)} "
        "Until then shifts and alerts compare two descriptions, not two states of the hanger."
    )


def discarded(data: HangerReport) -> str:
    """That tests of the baseline count no more, and what to do; empty where all do."""
    if not data.discarded:
        return ""
    names, number = ", ".join(data.discarded), data.hanger.id
    return (
        f"The baseline of hanger {number} was made from {names}, discarded since: the comparison "
        f"with it is no longer valid. {_anew(number)}"
    )


def _anew(number: int) -> str:
    return f"Set a new baseline: `shm drift rebaseline --hanger {number} --since DAY --why TEXT`."
