"""What an alert says: an owner reads it on a phone, what moved first, what to do last."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence, Set
from datetime import datetime

from shm.values import TENSION, Change, Drift, End, Hanger, Moved, Plane, WatchedTest
from shm.values.force_units import force_unit
from shm.watch.history import NINETY_PERCENT

_CERTAIN = 0.999  # beyond, draws of a thousand cannot tell
_LISTED = 3  # technical: what a sentence bears
_LONGEST_TEST, _DIGITS = 80, 12  # of a key's 255 characters
_EITHER_LIKELY = 0.8
_WHICH_END = "which end is not known"

_CAUSES = {
    "point_mass": "a mass put on or taken off",
    "section_loss": "section lost over a stretch",
    "bending_stiffness": "another bending stiffness",
    "timebase": "the logger's clock",
    "sensor_mass": "sensors of other mass or place",
    "unexplained": "something that no cause we know explains",
}
"""What may have moved the frequencies beside tension and end stiffness."""

_LOOK_AT = {
    "point_mass": "look for a lamp, a clamp, a cable or ice on the hanger, or what was taken off.",
    "section_loss": "look along the rod for corrosion, wear or a crack.",
    "bending_stiffness": "look for broken wires, a loose sleeve or new grout.",
    "timebase": "check the logger's clock and the sampling rate in the file.",
    "sensor_mass": "ask who put the sensors where, and with what.",
    "unexplained": "check the test's files first: hanger, sensors, axes and orders of the modes.",
}


def message_of(
    test: WatchedTest,
    hanger: Hanger,
    change: Change | None,
    beyond: Sequence[Drift],
    *,
    is_call: bool,
    is_further: bool = False,
) -> str:
    """Which hanger, what moved and by how much, where, since when, how sure, what to do.

    `change` is the change behind it, as far as one is known; `is_call` says whether that is called
    now, and `is_further` whether others were before it, from which on its shift counts. `beyond`
    are the shifts from the baseline that the alert tells to be beyond their threshold.
    """
    change = change if change and change.moved else None
    head = _shifts(beyond, change) if beyond else _change(change)
    parts = [
        f"Hanger {hanger.id}: {'a further change: ' if is_further and not beyond else ''}{head}",
        _now(test, beyond, change),
        _when(change),
        _certainty(change, is_call),
        "" if beyond else _thresholds(test, change),
        _blunder(test.change),
        _advice(change, beyond),
    ]
    return " ".join(part for part in parts if part)


def message_of_agreeing(
    drift: Drift, hanger: Hanger, tests: tuple[str, str], *, is_held: bool
) -> str:
    """The same of two `tests` that read beyond a threshold; the first `is_held` for its clock.

    Nothing is said of when: that they are told at all is since their clocks may not tell.
    """
    name = quantity_words(drift.quantity)
    first = f"{tests[0]} (held for its clock)" if is_held else tests[0]
    parts = [
        f"Hanger {hanger.id}: {name} "
        f"{shift_words(drift.quantity, drift.shift_mean, drift.shift_sd)}.",
        f"Tests {first} and {tests[1]} both read beyond its threshold of {_threshold(drift)}.",
        _tension(drift) if drift.quantity == TENSION else "",
        "This counts whatever their clocks say, so that it is not said when it came.",
        f"{_advice(None, [drift])} Check the logger's clock.",
    ]
    return " ".join(part for part in parts if part)


def message_of_odd(test: WatchedTest, hanger: Hanger, in_a_row: int) -> str:
    """Of a test that agrees with none before it, or of so many in a row."""
    if in_a_row == 1:
        return (
            f"Hanger {hanger.id}: test {test.test} agrees with no test before it. Repeat it within "
            "a week: it counts in nothing until another agrees with it. Another hanger may have "
            "been hit, a sensor put elsewhere or an order mistaken; else the hanger has changed."
        )
    return (
        f"Hanger {hanger.id}: {in_a_row} tests in a row agree neither with those before nor with "
        "each other. Repeat the test today, by the same people and with the same sensors. What the "
        "watch says of this hanger rests on older tests until then."
    )


def short_name(test: str) -> str:
    """A test's name as far as a key has room for it; names that begin alike stay apart."""
    if len(test) <= _LONGEST_TEST:
        return test
    return f"{test[:_LONGEST_TEST]}-{hashlib.sha256(test.encode()).hexdigest()[:_DIGITS]}"


def watch_words(watched: Sequence[WatchedTest]) -> str:
    """What the sequential test has called since the baseline, or that it has called nothing."""
    if not watched:
        return ""
    called = [each.change for each in watched if each.change.called]
    if called:
        told = (f"{_change(each)} {_when(each)}" for each in called)
        return f"Called since the baseline: {' Then: '.join(told)}"
    latest = watched[-1].change
    return (
        f"No change is called: the evidence for one stands for {latest.evidence_years:.2g} years "
        f"without change, and is believed from {latest.limit_years:.3g} years on."
    )


def quantity_words(name: str, end: End | None = None, plane: Plane | None = None) -> str:
    """`tension`, or `end stiffness k1 (deck end, transverse)`."""
    if name == TENSION:
        return "tension"
    if name in _CAUSES:
        return _CAUSES[name]
    if not name.startswith("log10_k"):
        return name.replace("_", " ")
    at = f"{end} end" if end else _WHICH_END if plane else ""
    where = ", ".join(word for word in (at, plane or "") if word)
    return f"end stiffness {name.removeprefix('log10_')}" + (f" ({where})" if where else "")


def shift_words(quantity: str, mean: float, sd: float) -> str:
    """`fell by 8.2 % (90 % interval 7.1 to 9.3 %)`; of a stiffness the factor it fell or rose to.

    `mean` and `sd` are a fraction of the tension, or decades of a stiffness.
    """
    low, high = mean - NINETY_PERCENT * sd, mean + NINETY_PERCENT * sd
    if quantity in _CAUSES:
        return f"moved the frequencies by {100 * mean:+.2f} % in the mean"
    if quantity != TENSION:
        verb = "fell" if high < 0 else "rose" if low > 0 else "moved"
        return (
            f"{verb} to {_factor(mean)} times what it was "
            f"(90 % interval {_factor(low)} to {_factor(high)} times)"
        )
    if low <= 0 <= high:
        low_percent, high_percent = (f"{100 * each:+.1f} %" for each in (low, high))
        return f"moved by {100 * mean:+.1f} % (90 % interval {low_percent} to {high_percent})"
    near, far = sorted((abs(low), abs(high)))
    verb = "fell" if mean < 0 else "rose"
    places = 1 if far - near > 0.004 else 2
    text = f"{100 * abs(mean):.{places}f} % (90 % interval {100 * near:.{places}f} to "
    return f"{verb} by {text}{100 * far:.{places}f} %)"


def _factor(decades: float) -> str:
    """Of what it was: `0.50`, `3.2`."""
    if decades > 3:
        return "more than 1000"
    factor = 10**decades
    if factor < 0.01:
        return "less than 0.01"
    return f"{factor:.2f}" if factor < 1 else f"{factor:.1f}" if factor < 10 else f"{factor:.0f}"


def _probability(value: float) -> str:
    """Two decimals or three near the ends, with no certainty pretended."""
    if math.isnan(value):
        return "not known"
    if value > _CERTAIN:
        return "above 0.999"
    if value < 1 - _CERTAIN:
        return "below 0.001"
    return f"{value:.3f}" if not 0.01 <= value <= 0.99 else f"{value:.2f}"


# ---------------------------------------------------------------- what moved


def _change(change: Change | None) -> str:
    """What has changed, or what all may have."""
    if change is None:
        return "something has changed."
    groups = suspected_groups(change)
    if len(groups) == 1:
        return f"{_moved(groups[0])}. {_this(groups[0], change)}"
    told = "; or ".join(
        f"{_moved(each)}, probability {_probability(each[0].probability)}"
        for each in groups[:_LISTED]
    )
    return (
        f"something moved, and these tests cannot tell what: {told}"
        f"{_and_more(len(groups) - _LISTED)}."
    )


def suspects(change: Change) -> list[Moved]:
    """The likeliest quantity, those that moved with it, and those that may have instead."""
    return list(dict.fromkeys(each for group in suspected_groups(change) for each in group))


def suspected_groups(change: Change) -> list[tuple[Moved, ...]]:
    """What may have moved, each with what moved with it, the likeliest first."""
    by_name = {each.quantity: each for each in change.moved}
    groups: dict[frozenset[str], tuple[Moved, ...]] = {}
    for first in change.moved[:1]:
        for name in (first.quantity, *(n for n in by_name if n in first.alike)):
            names = (name, *by_name[name].together)
            group = tuple(by_name[each] for each in names if each in by_name)
            groups.setdefault(frozenset(names), group)
    return list(groups.values())


def _moved(group: Sequence[Moved]) -> str:
    """What moved together and how far; each by itself where they went different ways."""
    first = group[0]
    if all(_is_like(each, first) for each in group):
        size = shift_words(first.quantity, first.shift_mean, first.shift_sd)
        return f"{group_words(group)} {size}"
    each_way = (
        f"{group_words([each])} {shift_words(each.quantity, each.shift_mean, each.shift_sd)}"
        for each in group
    )
    return f"{group_words(group)} moved together: {', and '.join(each_way)}"


def _is_like(moved: Moved, first: Moved) -> bool:
    """Whether two shifts are one size, as far as they are known."""
    if (moved.quantity == TENSION) != (first.quantity == TENSION):
        return False
    apart = abs(moved.shift_mean - first.shift_mean)
    return apart <= max(moved.shift_sd, first.shift_sd)


def group_words(group: Sequence[Moved]) -> str:
    """`end stiffness in both planes at the deck end`, or the quantities' own names."""
    ends = {each.end for each in group}
    planes = {each.plane for each in group}
    if len(group) == 1 or None in planes:
        return " and ".join(quantity_words(g.quantity, g.end, g.plane) for g in group)
    where = f"both planes ({_WHICH_END})" if None in ends else f"both planes at {_ends(ends)}"
    if len(planes) == 1:
        where = f"the {group[0].plane} plane at {_ends(ends)}"
    return f"end stiffness in {where}"


def _ends(ends: Set[End | None]) -> str:
    return "both ends" if len(ends) > 1 else f"the {next(iter(ends))} end"


def _this(group: Sequence[Moved], change: Change) -> str:
    """How sure it is that it was this, and what else it might be."""
    first = group[0]
    text = f"That it is this that moved: probability {_probability(first.probability)}"
    others = [each for each in change.moved if each not in group]
    if first.probability > 0.9 or not others:
        return f"{text}."
    name = quantity_words(others[0].quantity, others[0].end, others[0].plane)
    return f"{text}; next {name}, {_probability(others[0].probability)}."


def _and_more(count: int) -> str:
    if count <= 0:
        return ""
    return f"; or {count} more" if count > 1 else "; or one more"


def _shifts(beyond: Sequence[Drift], change: Change | None) -> str:
    """What is beyond its threshold and, as far as is known, where the data put it."""
    places = {each.quantity: (each.end, each.plane) for each in (change.moved if change else ())}
    told = "; ".join(
        f"{quantity_words(drift.quantity, *places.get(drift.quantity, (None, None)))} "
        f"{shift_words(drift.quantity, drift.shift_mean, drift.shift_sd)}, beyond its threshold "
        f"of {_threshold(drift)} with probability {_probability(drift.probability)}"
        for drift in beyond
    )
    return f"{told}.{_told_apart(change)}"


def _told_apart(change: Change | None) -> str:
    if change is None:
        return ""
    groups = suspected_groups(change)
    told = " or ".join(
        f"{group_words(each)} (probability {_probability(each[0].probability)})"
        for each in groups[:_LISTED]
    )
    if len(groups) == 1:
        return f" It is the {told} that has changed."
    more = _and_more(len(groups) - _LISTED)
    return f" These tests cannot tell whether it is {told}{more} that has changed."


def _threshold(drift: Drift) -> str:
    if drift.quantity == TENSION:
        return f"{100 * drift.threshold:.3g} %"
    return f"{_factor(math.copysign(drift.threshold, drift.shift_mean))} times"


def _now(test: WatchedTest, beyond: Sequence[Drift], change: Change | None) -> str:
    """The tension where it is spoken of: a figure that the owner knows."""
    spoken = [drift.quantity for drift in beyond] + (
        [each.quantity for each in suspects(change)] if change else []
    )
    for drift in test.drifts:
        if drift.quantity == TENSION and TENSION in spoken:
            return _tension(drift)
    return ""


def _tension(drift: Drift) -> str:
    now_n, before_n = drift.value, drift.baseline
    unit = force_unit(now_n, before_n)
    return (
        f"Tension is now {unit.told(now_n)}, {100 * abs(now_n / before_n - 1):.1f} % "
        f"{'below' if now_n < before_n else 'above'} the {unit.told(before_n)} of the baseline."
    )


# ---------------------------------------------------------------- when, how sure


def _when(change: Change | None) -> str:
    if change is None:
        return ""
    since = _between(change.began_after, change.began_by)
    if change.sudden >= _EITHER_LIKELY:
        return f"It came suddenly (probability {_probability(change.sudden)}), {since}."
    if change.sudden <= 1 - _EITHER_LIKELY:
        return f"It came slowly (probability {_probability(1 - change.sudden)}); it began {since}."
    return (
        f"It began {since}; whether suddenly or slowly cannot be told yet (suddenly: probability "
        f"{_probability(change.sudden)})."
    )


def _between(after: datetime, by: datetime) -> str:
    first, last = f"{after:%Y-%m-%d}", f"{by:%Y-%m-%d}"
    return f"on {first}" if first == last else f"between {first} and {last}"


def _certainty(change: Change | None, is_call: bool) -> str:
    if change is None:
        return ""
    text = f"That anything has changed: probability {_probability(change.probability)}"
    if not is_call:
        return f"{text}."
    return (
        f"{text}; a hanger that does not change raises such an alert at most once in "
        f"{change.limit_years:.3g} years on the average."
    )


def _thresholds(test: WatchedTest, change: Change | None) -> str:
    """How near what may have changed is to its threshold."""
    if change is None:
        return ""
    by_name = {drift.quantity: drift for drift in test.drifts}
    found = [by_name[each.quantity] for each in suspects(change) if each.quantity in by_name]
    if not found:
        return ""
    nearest = max(found, key=lambda drift: drift.probability)
    name = quantity_words(nearest.quantity)
    return (
        f"The threshold of the {name} is {_threshold(nearest)}: passed with probability "
        f"{_probability(nearest.probability)}."
    )


def _blunder(change: Change) -> str:
    if not change.outlier_probability > 0.5:
        return ""
    chance = _probability(change.outlier_probability)
    return f"This test itself may be a blunder (probability {chance})."


# ---------------------------------------------------------------- what to do


def _advice(change: Change | None, beyond: Sequence[Drift]) -> str:
    return f"What to do: {_urgency(change, beyond)} {_look(change, beyond)}"


def _is_dangerous(beyond: Sequence[Drift]) -> bool:
    """Lost tension or loosened ends, for which alone traffic is named."""
    return any(drift.shift_mean < 0 for drift in beyond)


def _urgency(change: Change | None, beyond: Sequence[Drift]) -> str:
    if _is_dangerous(beyond):
        return "have the engineer in charge decide on traffic now, and hit it again today."
    if beyond:
        return "hit it again today."
    if change is not None and change.sudden < 0.5:
        return "hit it again within weeks."
    return "hit it again within days."


def _look(change: Change | None, beyond: Sequence[Drift]) -> str:
    groups = suspected_groups(change) if change else []
    first = groups[0][0] if groups else None
    if len(groups) > 1:
        return (
            "A sensor near each end and more modes tell them apart. Compare the hangers beside it "
            "(shm drift bridge), and look at its anchorages."
        )
    quantity, shift = _leading(first, beyond)
    if quantity in _LOOK_AT:
        return f"If it holds, {_LOOK_AT[quantity]}"
    if quantity == TENSION:
        return _look_at_tension(shift > 0)
    ends = {each.end for each in groups[0]} if first and first.quantity == quantity else {None}
    end = "both ends" if None in ends else _ends(ends)
    if shift < 0:
        return f"If it holds, look at {end}: a worn pin, a crack in the plate, loose bolts."
    return f"If it holds, look at {end}: a pin that rust or dirt has seized."


def _leading(first: Moved | None, beyond: Sequence[Drift]) -> tuple[str, float]:
    """What the crew looks after, and its shift; a loss of tension where nothing is known."""
    for each in (*beyond[:1], *((first,) if first else ())):
        return each.quantity, each.shift_mean
    return TENSION, -1.0


def _look_at_tension(rose: bool) -> str:
    if rose:
        return (
            "If it holds, compare the hangers beside it (shm drift bridge): one of them may have "
            "shed load."
        )
    return (
        "If it holds, compare the hangers beside it (shm drift bridge), which take up what it "
        "sheds, and look at its anchorages and along the rod."
    )
