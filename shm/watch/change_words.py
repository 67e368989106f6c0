"""Words for a change, and for what its owner should do about it, how soon.

The words of a cause are those of the catalogue of effects.
Of a structure that no model class describes it is its frequencies, and by how much.

Traffic is named for lost tension and loosened ends alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Set

from shm.models.effects import EFFECTS
from shm.models.effects.base import OverTime
from shm.values import TENSION, Change, Drift, End, Hanger, Moved, Plane, WatchedTest, is_ratio
from shm.values.messages import NEXT_TEST, TODAY, WEEK, Urgency
from shm.values.rounding import NINETY_PERCENT, rounded_percent

_PROBABLE = 0.1  # judgement: one in ten is worth a test that tells it from the rest
_WHICH_END = "which end is not known"
_SHARES = {1 / 2: "half", 1 / 3: "a third", 1 / 4: "a quarter", 1 / 5: "a fifth", 1 / 10: "a tenth"}
_AS_GOOD_AS = 1.1  # judgement: a tenth more or less is still "about a third"
_LEAST_SHARE, _LARGEST_FACTOR = 0.05, 1e3  # judgement: beyond, an end is as good as free or clamped

CAUSES = {
    **{name: each.over_time for name, each in EFFECTS.items() if each.over_time},
    "unexplained": OverTime(
        fell="no known cause explains it",
        rose="no known cause explains it",
        check="check hanger, sensors, axes and orders of modes in the test's files",
    ),
}
"""What may have moved the frequencies beside tension and end stiffness."""


# ---------------------------------------------------------------- what may have changed


def suspects(change: Change) -> list[Moved]:
    """Return the likeliest quantity, those that moved with it, and those that may have instead."""
    return list(dict.fromkeys(each for group in suspected_groups(change) for each in group))


def suspected_groups(change: Change) -> list[tuple[Moved, ...]]:
    """Return what may have moved, each with what moved with it, the likeliest first."""
    by_name = {each.quantity: each for each in change.moved}
    groups: dict[frozenset[str], tuple[Moved, ...]] = {}
    for first in change.moved[:1]:
        for name in (first.quantity, *(n for n in by_name if n in first.alike)):
            names = (name, *by_name[name].together)
            group = tuple(by_name[each] for each in names if each in by_name)
            groups.setdefault(frozenset(names), group)
    return list(groups.values())


def probable_groups(change: Change) -> list[tuple[Moved, ...]]:
    """Return the same without what the data fit as well but nobody need expect."""
    first, *others = suspected_groups(change) or [()]
    likely = [each for each in others if each[0].probability >= _PROBABLE]
    return [first, *likely] if first else []


# ---------------------------------------------------------------- names and sizes


def quantity_words(name: str, end: End | None = None, plane: Plane | None = None) -> str:
    """`tension`, or `end stiffness k1 (deck end, transverse)`."""
    if not name.startswith("log10_k"):
        return name.replace("_", " ")
    at = f"{end} end" if end else _WHICH_END if plane else ""
    where = ", ".join(word for word in (at, plane or "") if word)
    return f"end stiffness {name.removeprefix('log10_')}" + (f" ({where})" if where else "")


def group_words(group: Sequence[Moved]) -> str:
    """`end stiffness in both planes at the deck end`, a cause, or the quantities' own names."""
    first = group[0]
    if first.quantity in CAUSES:
        cause = CAUSES[first.quantity]
        return cause.fell if first.shift_mean < 0 else cause.rose
    ends = {each.end for each in group}
    planes = {each.plane for each in group}
    if len(group) == 1 or None in planes:
        return " and ".join(quantity_words(g.quantity, g.end, g.plane) for g in group)
    where = f"both planes ({_WHICH_END})" if None in ends else f"both planes at {ends_words(ends)}"
    if len(planes) == 1:
        where = f"the {first.plane} plane at {ends_words(ends)}"
    return f"end stiffness in {where}"


def ends_words(ends: Set[End | None]) -> str:
    return "both ends" if len(ends) > 1 else f"the {next(iter(ends))} end"


def shift_words(quantity: str, mean: float, sd: float) -> str:
    """`fell by 8.2 ± 1.1 %`, rounded to its 90 % interval; `fell to about a third` of a stiffness.

    `mean` and `sd` are a fraction of the tension, of the frequencies' mean where `quantity` is
    another cause, or decades of a stiffness.
    """
    half = NINETY_PERCENT * sd
    verb = "moved" if abs(mean) <= half else "fell" if mean < 0 else "rose"
    if is_stiffness(quantity):
        return f"{verb} to {_factor_words(mean)}"
    if verb == "moved":
        return f"moved by {rounded_percent(mean, half, '+')}"
    return f"{verb} by {rounded_percent(abs(mean), half)}"


def is_stiffness(quantity: str) -> bool:
    return not is_ratio(quantity) and quantity not in CAUSES


def _factor_words(decades: float) -> str:
    """`about a third`, `about 71 % of its former value`, `about 3.2 times its former value`."""
    times = 10 ** min(decades, 10.0)
    if times < _LEAST_SHARE:
        return "less than a twentieth"
    for share, words in _SHARES.items():
        if abs(math.log(times / share)) < math.log(_AS_GOOD_AS):
            return f"about {words}"
    if times < 1:
        return f"about {100 * times:.0f} % of its former value"
    about = "" if times > _LARGEST_FACTOR else "about "
    return f"{about}{factor(decades)} times its former value"


def factor(decades: float) -> str:
    """Return how many times what it was: `0.50`, `1.06`, `3.2`."""
    times = 10 ** min(decades, 10.0)
    if times > _LARGEST_FACTOR:
        return "more than 1000"
    if times < 1 / _LARGEST_FACTOR:
        return "less than 0.001"
    return f"{times:.2f}" if times < 2 else f"{times:.1f}" if times < 10 else f"{times:.0f}"


def size_words(each: Moved | Drift) -> str:
    return shift_words(each.quantity, each.shift_mean, each.shift_sd)


def threshold_words(drift: Drift) -> str:
    if is_ratio(drift.quantity):
        return f"{100 * drift.threshold:.3g} %"
    return f"{factor(math.copysign(drift.threshold, drift.shift_mean))} times"


def beyond_words(drift: Drift) -> str:
    name = quantity_words(drift.quantity)
    return f"{name} is beyond its threshold of {threshold_words(drift)}"


def undetected_words(latest: Change) -> str:
    """Return how near the evidence is to a detection, or that the change is too small."""
    if latest.evidence_years > latest.limit_years:
        return (
            "Something changed since the baseline, by less than the watch is to tell: no first "
            "frequency, and no plane's mean, moved by enough."
        )
    share = 100 * latest.evidence_years / latest.limit_years
    known = f"{share:.2g} %" if share >= 1 else "less than 1 %"
    return (
        "No change was detected since the baseline: the evidence for one is "
        f"{known} of what a detection takes."
    )


def structure_words(hanger: Hanger) -> str:
    """Return the name of a structure that no model class describes."""
    return hanger.name or f"structure {hanger.id}"


def frequencies_state(
    hanger: Hanger, change: Change | None, beyond: Sequence[Drift], *, is_further: bool
) -> str:
    """`The frequencies of Deck have dropped by 1.2 ± 0.3 % since 2028-04-01.`"""
    name, again = structure_words(hanger), " again" if is_further else ""
    if beyond:
        lead = min(beyond, key=lambda each: each.shift_mean)
        words = _have("has", lead.shift_mean, lead.shift_sd)
        return f"The {lead.quantity} of {name} {words}, beyond its threshold."
    groups = probable_groups(change) if change else []
    if change is None or not groups:
        return f"The frequencies of {name} changed{again}; the tests do not show which."
    first, since = groups[0][0], f"since {change.began_by:%Y-%m-%d}"
    size = first.shift_mean, first.shift_sd
    if first.quantity in CAUSES:
        text = f"have{again} moved by different amounts {since}, on average by"
        return f"The frequencies of {name} {text} {_signed(*size)}."
    if first.together:
        return f"The frequencies of {name} {_have(f'have{again}', *size)} {since}."
    return f"The {first.quantity} of {name} {_have(f'has{again}', *size)} {since}."


def frequency_words(watched: Sequence[WatchedTest], hanger: Hanger) -> str:
    """Return what was detected of such a structure since its baseline, or how near that is."""
    detected = [each.change for each in watched if each.change.called]
    if not detected:
        return undetected_words(watched[-1].change) if watched else ""
    reported = (
        frequencies_state(hanger, each, (), is_further=n > 0) for n, each in enumerate(detected)
    )
    return " ".join(reported)


def each_frequency(test: WatchedTest) -> str:
    """Return the shift of each, as it is if it changed."""
    reported = (
        f"{each.quantity} {_signed(each.shift_mean, each.shift_sd)}" for each in test.drifts
    )
    return ", ".join(reported)


def _have(verb: str, mean: float, sd: float) -> str:
    half = NINETY_PERCENT * sd
    return f"{verb} {'dropped' if mean < 0 else 'risen'} by {rounded_percent(abs(mean), half)}"


def _signed(mean: float, sd: float) -> str:
    return rounded_percent(mean, NINETY_PERCENT * sd, "+")


_WHEN: dict[Urgency, str] = {"next_test": NEXT_TEST, "week": WEEK, "today": TODAY}
_LOOK_AT = "bearings, joints, cracks, new loads and the sensors"


def urgency_of(
    hanger: Hanger, change: Change | None, beyond: Sequence[Drift], drifts: Sequence[Drift] = ()
) -> Urgency:
    """Return how soon to act.

    Today for a loss beyond its threshold as surely as the owner asked to be told.

    A change came slowly and stays below its threshold, as far as `drifts` of all quantities show:
    then the next planned test is soon enough to see where it goes.
    """
    if hanger.is_modelled and _losses(hanger, beyond):
        return "today"
    slow = change is not None and change.sudden < 0.5
    near = any(each.probability > 0.5 for each in drifts)
    return "next_test" if slow and not beyond and not near else "week"


def _losses(hanger: Hanger, beyond: Sequence[Drift]) -> list[Drift]:
    """Lost tension or loosened ends that are probable, for which alone traffic is named."""
    level = hanger.thresholds.alert_probability
    return [each for each in beyond if each.shift_mean < 0 and each.probability >= level]


def action_words(
    hanger: Hanger, change: Change | None, beyond: Sequence[Drift], drifts: Sequence[Drift] = ()
) -> str:
    """Return what to do and how soon, in a sentence."""
    urgency = urgency_of(hanger, change, beyond, drifts)
    if not hanger.is_modelled:
        return f"Look at the structure {_WHEN[urgency]}: {_LOOK_AT}."
    if urgency == "today":
        look = _look(gravest(beyond), change)
        return f"{look_again(hanger)} {TODAY} and decide on traffic until then; {look}."
    groups = probable_groups(change) if change else []
    if len(groups) > 1 and not beyond:
        return _tell_apart(groups, urgency, hanger)
    lead = gravest(beyond) if beyond else groups[0][0] if groups else None
    test = _again(urgency, hanger)
    if lead is None:
        return f"{test}{'' if hanger.has_sensors else ', with more modes'}."
    if lead.quantity in CAUSES:
        check = CAUSES[lead.quantity].check
        return as_sentence(f"{_WHEN[urgency]}, {check}, then test again")
    return f"{test}; {_look(lead, change)}."


def look_again(hanger: Hanger) -> str:
    """Return how its owner makes sure: sensors that stay test it again by themselves."""
    return "Check the hanger and its sensors" if hanger.has_sensors else "Repeat the hammer test"


def _again(urgency: Urgency, hanger: Hanger) -> str:
    return f"{look_again(hanger)} {WEEK}" if urgency == "week" else f"Compare again {NEXT_TEST}"


def _tell_apart(groups: Sequence[Sequence[Moved]], urgency: Urgency, hanger: Hanger) -> str:
    """Return what shows which of several causes it was."""
    causes = [CAUSES[each[0].quantity] for each in groups if each[0].quantity in CAUSES]
    if not causes:
        again, with_what = _again(urgency, hanger), "a sensor near each end and more modes"
        if hanger.has_sensors:
            return f"{again}; a hammer test with {with_what} shows what changed."
        return f"{again} with {with_what}, to see what changed."
    check, apart_by = causes[0].check, causes[0].apart_by
    return as_sentence(f"{_WHEN[urgency]}, {check}; then test with {apart_by}, to tell them apart")


def _look(lead: Moved | Drift, change: Change | None) -> str:
    """Return where to look if a change of tension or of an end stays."""
    lost = lead.shift_mean < 0
    if lead.quantity == TENSION:
        nearby = "compare the hangers beside it (`shm drift bridge`)"
        look = f"inspect its anchorages and the rod, and {nearby}" if lost else nearby
        return f"if the {'loss' if lost else 'gain'} stays, {look}"
    moved = {each.quantity: each for each in (change.moved if change else ())}
    its = moved.get(lead.quantity)
    ends = {moved[n].end for n in (lead.quantity, *its.together) if n in moved} if its else {None}
    end = "both ends" if None in ends else ends_words(ends)
    found = "a worn pin, a cracked plate or loose bolts" if lost else "a pin seized by rust or dirt"
    return f"if the change stays, inspect {end} for {found}"


def gravest(beyond: Sequence[Drift]) -> Drift:
    """A loss before a gain, the tension before the ends."""
    return min(beyond, key=lambda each: (each.shift_mean > 0, each.quantity != TENSION))


def as_sentence(words: str) -> str:
    """With a capital and a full stop."""
    return f"{words[:1].upper()}{words[1:]}."
