"""What is said of modes that tests keep having wrong: state, action, and why.

A misnamed mode is one of a few: where many are off, the tests do not fit the baseline.
"""

from __future__ import annotations

from collections.abc import Sequence

from shm.values import Hanger, RepeatedMistake
from shm.values.rounding import listed


def notice_words(mistaken: Sequence[RepeatedMistake], hanger: Hanger) -> str:
    """The notice of them."""
    return f"Hanger {hanger.id}: {' '.join(_words(mistaken))}"


def warning_words(mistaken: Sequence[RepeatedMistake], hanger: Hanger) -> str:
    """The same as one of several warnings of a report, without the reason."""
    return f"Hanger {hanger.id}: {' '.join(_words(mistaken)[:2])}"


def _words(mistaken: Sequence[RepeatedMistake]) -> tuple[str, str, str]:
    """State, action and why."""
    since = f"{min(each.since for each in mistaken):%Y-%m-%d}"
    if any(each.is_misfit for each in mistaken):
        return _of_misfit(since)
    names, many = [str(each) for each in mistaken], len(mistaken) > 1
    have, numbers, them = ("have", "their numbers", "them") if many else ("has", "its number", "it")
    return (
        f"{listed(names)} {have} not fitted the other modes since {since}.",
        f"Check {numbers} at the next planned test.",
        f"The watch leaves {them} out: another order or a machine's tone may be taken for {them}, "
        "or one end alone has loosened.",
    )


def _of_misfit(since: str) -> tuple[str, str, str]:
    return (
        f"since {since} more of its modes miss the baseline's than one wrong number explains.",
        "At the next planned test, compare how the modes were numbered then and now, and "
        "look for new fittings.",
        "No tension and no end stiffness of the baseline's model explains them, so these tests "
        "count for little until another baseline is set (`shm drift rebaseline`).",
    )
