"""Warnings about the baseline of a hanger: they come first wherever its state is given.

A watch that compares with a wrong baseline is quiet for years. So a baseline that does not fit, or
that stands out among its neighbours, and a mode that tests keep having wrong are never "No change".

That a baseline no longer fits what is known, and what to do: sentences of the report.
"""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from itertools import islice

from shm.report.formatting import counted, listed
from shm.values import BaselineCheck, Hanger, Summary, WatchedTest
from shm.values.messages import WEEK
from shm.values.rounding import rounded_percent
from shm.watch.words.alert_text import against_baseline_words, look_again

# Judgement: hangers of sound bridges are within a quarter of their nominal tension, or all are off.
_OFF_NOMINAL = 0.25
_MOST_LOST = (
    0.5  # judgement: no season, load or wrong mode halves a tension; both intervals allowed
)
_NEIGHBOURS = 4  # nearest of its kind: judgement, two each way; loads of a bridge vary along it
_FEWEST_NEIGHBOURS = 2  # of one neighbour nobody can say which of the two stands out


def open_warnings(
    hanger: Hanger,
    check: BaselineCheck | None,
    neighbours: str = "",
    latest: WatchedTest | None = None,
    now: Sequence[str] = (),
) -> tuple[str, ...]:
    """Return warnings, each a state, an action and a reason; empty where there are none.

    `check` is that of the baseline, `neighbours` the result of `standing_out`, `latest` the
    watch after the newest test, `now` the results of `nearly_slack` and `passed_over`.
    """
    found = [each for each in now if each]
    if check is not None and check.misfit:
        found.append(
            f"Hanger {hanger.id}: its baseline does not fit. Check the description and the numbers "
            f"of the modes, and repeat the test {WEEK}. Why: {check.misfit}."
        )
    if check is not None and check.tests:
        many = len(check.tests) > 1
        names = listed([each.test for each in check.tests])
        found.append(
            f"Hanger {hanger.id}: its baseline is made without test{'s' * many} {names}. Find out "
            f"{WEEK} which hanger was hit, and check the logger's clock. Why: {check.tests[0].why}."
        )
    if neighbours:
        found.append(neighbours)
    if latest is not None and latest.change.is_baseline_alone:
        found.append(against_baseline_words(latest.change, hanger))
    notable = [each for each in latest.mistaken if each.is_notable] if latest else []
    if notable:
        from shm.watch.words.notices import (
            warning_words,  # which brings the engine, and few need it
        )

        found.append(warning_words(notable, hanger))
    elif latest is not None and latest.is_unexplained:
        found.append(
            f"Hanger {hanger.id}: no tension and no end stiffness explains its latest test. "
            f"{look_again(hanger)} {WEEK}, and compare how its modes were numbered with the "
            "baseline's."
        )
    return tuple(found)


def passed_over(hanger: Hanger, window: str) -> str:
    """Return that the newest test was not compared: it is in a maintenance `window`."""
    return (
        f"Hanger {hanger.id}: its latest test was made in a maintenance window and is not compared "
        f"with the baseline. Test it again {WEEK} of the end of the works. Until then nobody knows "
        f"whether it changed ({window})."
    )


def nearly_slack(hanger: Hanger, baseline: Summary, now: Summary, *, is_reported: bool) -> str:
    """Return that the latest test alone reads most of the tension lost; "" where it does not.

    A bar that carries next to nothing is as stiff as before, and the watch may put its frequencies
    down to something else, or be unsure for want of tests. Empty where it `is_reported` that the
    tension is beyond its threshold.
    """
    nominal_n = hanger.nominal_tension_n
    if is_reported or not nominal_n > 0 or not now.q95 < _MOST_LOST * baseline.q05:
        return ""
    half = (now.q95 - now.q05) / 2 / nominal_n
    return (
        f"Hanger {hanger.id} carries {rounded_percent(now.mean / nominal_n, half)} of its nominal "
        "tension by its latest test alone: it may be going slack. Look at it and repeat the test "
        "today. The watch is not yet sure that it is the tension that changed."
    )


def standing_out(hanger: Hanger, hangers: Sequence[Hanger], tensions: Mapping[int, Summary]) -> str:
    """Return that a baseline is far off its nominal tension unlike its neighbours; else "".

    `hangers` stand in the order of the bridge; `tensions` are those of their baselines.
    """
    share = _share(hanger, tensions)
    if share is None:
        return ""
    kind = [each for each in hangers if each.family == hanger.family]
    at = [each.id for each in kind].index(hanger.id)
    near = (
        kind[n]
        for step in range(1, len(kind))
        for n in (at - step, at + step)
        if 0 <= n < len(kind)
    )
    known = (each for one in near if (each := _share(one, tensions)) is not None)
    others = list(islice(known, _NEIGHBOURS))
    if len(others) < _FEWEST_NEIGHBOURS:
        return ""
    of_others = statistics.median(mean for mean, _, _ in others)
    mean, low, high = share
    # The near end of the interval: a tension that is hardly known stands out by nothing.
    off = low - 1 if mean > 1 else 1 - high
    if off < _OFF_NOMINAL or abs(of_others - 1) > _OFF_NOMINAL:
        return ""
    return (
        f"Hanger {hanger.id}: its baseline lies {rounded_percent(abs(mean - 1), (high - low) / 2)} "
        f"{'above' if mean > 1 else 'below'} nominal, unlike its neighbours. Check its length, its "
        "section and the numbers of its modes within a week."
    )


def _share(hanger: Hanger, tensions: Mapping[int, Summary]) -> tuple[float, float, float] | None:
    """Return mean and 90 % interval of the baseline's tension over the nominal one."""
    found, nominal_n = tensions.get(hanger.id), hanger.nominal_tension_n
    if found is None or not nominal_n > 0:
        return None
    return found.mean / nominal_n, found.q05 / nominal_n, found.q95 / nominal_n


_MOST_CHANGES = 3  # what a sentence bears


def redescription_words(hanger: Hanger, changes: Sequence[str]) -> str:
    """Return that the description has changed since the baseline, and what to do; else ""."""
    if not changes:
        return ""
    changed, more = changes[:_MOST_CHANGES], changes[_MOST_CHANGES:]
    named = ", ".join(changed) + (f" and {len(more)} more" if more else "")
    return (
        f"The description of hanger {hanger.id} has changed since its baseline: {named}. "
        f"{_rebaseline(hanger.id)} "
        "Until then shifts and alerts compare two descriptions, not two states of the hanger."
    )


def discarded(hanger: Hanger, tests: Sequence[str]) -> str:
    """Return that `tests` of the baseline count no more, and what to do; else ""."""
    if not tests:
        return ""
    return (
        f"The baseline of hanger {hanger.id} was made from {', '.join(tests)}, discarded since: "
        f"the comparison with it is no longer valid. {_rebaseline(hanger.id)}"
    )


def dated_by_receipt(names: Sequence[str]) -> str:
    """Return that tests without a time are dated by their receipt; empty where there are none."""
    if not names:
        return ""
    more = f" and {len(names) - _MOST_CHANGES} more" if len(names) > _MOST_CHANGES else ""
    first = ", ".join(names[:_MOST_CHANGES])
    are = "is" if len(names) == 1 else "are"
    return (
        f"{counted(len(names), 'test')} without a time {are} dated by the receipt of the file: "
        f"{first}{more}. Say `time` in the file's header or its sidecar, and send it again."
    )


def _rebaseline(number: int) -> str:
    command = f"shm drift rebaseline --hanger {number} --since DAY --why TEXT"
    return f"Set a new baseline {WEEK}: `{command}`."
