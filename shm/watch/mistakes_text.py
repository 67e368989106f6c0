"""What is said of modes that tests keep having wrong: state, action, and why.

A misnamed mode is one of a few: where many are off, the tests do not fit the baseline.
"""

from __future__ import annotations

from collections.abc import Sequence

from shm.values import Hanger, RepeatedMistake


def notice_words(mistaken: Sequence[RepeatedMistake], hanger: Hanger) -> str:
    """The notice of them."""
    return f"Hanger {hanger.id}: {_state(mistaken)} {_action(mistaken)} {_why(mistaken)}"


def warning_words(mistaken: Sequence[RepeatedMistake], hanger: Hanger) -> str:
    """The same as one of several warnings of a report, without the reason."""
    return f"Hanger {hanger.id}: {_state(mistaken)} {_action(mistaken)}"


def _is_misfit(mistaken: Sequence[RepeatedMistake]) -> bool:
    return any(each.is_misfit for each in mistaken)


def _state(mistaken: Sequence[RepeatedMistake]) -> str:
    since = f"{min(each.since for each in mistaken):%Y-%m-%d}"
    if _is_misfit(mistaken):
        return f"its modes have not fitted the baseline's since {since}, too many to be misnamed."
    names, have = [str(each) for each in mistaken], "have" if len(mistaken) > 1 else "has"
    listed = " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
    return f"{listed} {have} not fitted the other modes since {since}."


def _action(mistaken: Sequence[RepeatedMistake]) -> str:
    if _is_misfit(mistaken):
        return (
            "Before the next planned test, compare how the modes were numbered then and now, and "
            "look for new fittings."
        )
    numbers = "their numbers" if len(mistaken) > 1 else "its number"
    return f"Check {numbers} at the next planned test."


def _why(mistaken: Sequence[RepeatedMistake]) -> str:
    if _is_misfit(mistaken):
        return (
            "No tension and no end stiffness of the baseline's model explains them, so these tests "
            "count for little until another baseline is set (`shm drift rebaseline`)."
        )
    them = "them" if len(mistaken) > 1 else "it"
    return (
        f"The watch leaves {them} out: another order or a machine's tone may be taken for {them}, "
        "or one end alone has loosened."
    )
