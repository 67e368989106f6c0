"""Messages of alerts: the state in a sentence, what to do and how soon, why; details last.

An owner reads the first two sentences on a phone: one number with its interval, one urgency. Each
probability is given once, at the end. Traffic is named for lost tension and loosened ends alone.
The words of a cause are those of the catalogue of effects. Of a structure that no model class
describes it is its frequencies, and by how much.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence, Set
from datetime import datetime

from shm.models.effects import EFFECTS
from shm.models.effects.base import OverTime
from shm.values import (
    TENSION,
    Alert,
    AlertKind,
    Change,
    Drift,
    End,
    Hanger,
    Moved,
    Plane,
    WatchedTest,
    is_ratio,
)
from shm.values.messages import NEXT_TEST, TODAY, WEEK, Lead, Urgency
from shm.values.rounding import NINETY_PERCENT, listed, rounded_percent

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


_SURE = 0.9  # judgement: below nine in ten a sentence says "most likely"
_EITHER_LIKELY = 0.8  # judgement: four to one that it was sudden, or slow
_CERTAIN = 0.995  # reads 1.00 in two decimals, which nobody may claim
_LISTED = 3  # technical: what a list in a message bears
_LONGEST_TEST, _DIGITS = 80, 12  # of a key's 255 characters
_HALF_WIDTH = "± is half the 90 % interval"


def message_of(
    test: WatchedTest,
    hanger: Hanger,
    change: Change | None,
    beyond: Sequence[Drift],
    *,
    is_call: bool,
    is_further: bool = False,
    standing: Sequence[Drift] = (),
) -> str:
    """Return the lead of the hanger as it is now; since when; then details.

    `change` is the change behind it, as far as one is known; `is_call` says whether it is detected
    now, and `is_further` whether others were before it, from which on its shift counts. `beyond`
    are the shifts from the baseline that the alert says to be beyond their threshold, `standing`
    those that were said before and still are.
    """
    change = change if change and change.moved else None
    everything = (*beyond, *standing)
    lead = lead_of(hanger, change, everything, test.drifts, is_further=is_further)
    is_new = bool(beyond and standing) and gravest(everything) not in beyond
    if hanger.is_modelled:
        sizes = _sizes(change, everything) or _HALF_WIDTH * ("±" in lead.state)
        details = _of_hanger(test, change, beyond, sizes, is_call=is_call)
    else:
        details = _of_frequencies(test, change, is_call=is_call)
    words = (lead.words, _new(beyond) if is_new else "", _when(change), *details)
    return " ".join(part for part in words if part)


def lead_of(
    hanger: Hanger,
    change: Change | None,
    beyond: Sequence[Drift],
    drifts: Sequence[Drift] = (),
    *,
    is_further: bool = False,
) -> Lead:
    """Return the state of a hanger of which something was found, and what to do about it how soon.

    The only place where it is put into words: alerts, pages, reports and `shm status` ask here.
    """
    say = _state if hanger.is_modelled else frequencies_state
    return Lead(
        say(hanger, change, beyond, is_further=is_further),
        action_words(hanger, change, beyond, drifts),
    )


def _new(beyond: Sequence[Drift]) -> str:
    return f"New: {quantity_words(beyond[0].quantity)} {size_words(beyond[0])}."


def _of_hanger(
    test: WatchedTest, change: Change | None, beyond: Sequence[Drift], sizes: str, *, is_call: bool
) -> list[str]:
    is_odd = test.change.outlier_probability > 0.5
    return [
        "This test itself is probably an outlier." if is_odd else "",
        _details(
            sizes, _probabilities(test, change, beyond), _false_alarms(change) if is_call else ""
        ),
    ]


def _of_frequencies(test: WatchedTest, change: Change | None, *, is_call: bool) -> list[str]:
    """Return the same of a structure of which frequencies alone are watched."""
    return [
        "Temperature, frost and excitation are taken off as far as the tests show what they do.",
        _details(
            _HALF_WIDTH,
            each_frequency(test),
            f"probability {_probability(change.probability)} that anything changed"
            if change
            else "",
            _false_alarms(change) if is_call else "",
        ),
    ]


def message_of_agreeing(
    drift: Drift, hanger: Hanger, tests: tuple[str, str], *, is_held: bool
) -> str:
    """The same of two `tests` that read beyond a threshold; the first `is_held` for its clock.

    When it came is not said: these tests speak since their clocks may be wrong.
    """
    first = f"{tests[0]} (held for its clock)" if is_held else tests[0]
    words = f"{quantity_words(drift.quantity)} {size_words(drift)}"
    text = [(drift.probability, f"that {beyond_words(drift)}")]
    parts = [
        f"Hanger {hanger.id}: {words}, beyond its threshold.",
        action_words(hanger, None, [drift]),
        f"Tests {first} and {tests[1]} both read beyond its threshold of {threshold_words(drift)}.",
        "Check the logger's clock: if it is wrong, the date of the change is not known.",
        _details(_sizes(None, [drift]) or _HALF_WIDTH, _merged(text)),
    ]
    return " ".join(part for part in parts if part)


def against_baseline_words(change: Change, hanger: Hanger) -> str:
    """That the baseline is the odd one, and what to do: of an alert and of a warning."""
    return (
        f"Hanger {hanger.id}: the {change.against_baseline} tests since the baseline agree with "
        f"each other and not with it. Find out {WEEK} what was different on its day, and set "
        "another (`shm drift rebaseline`)."
    )


def short_name(test: str) -> str:
    """A test's name as far as a key has room for it; names that begin alike stay apart."""
    if len(test) <= _LONGEST_TEST:
        return test
    return f"{test[:_LONGEST_TEST]}-{hashlib.sha256(test.encode()).hexdigest()[:_DIGITS]}"


def alert_of(
    hanger: Hanger,
    test: tuple[str, datetime],
    what: str,
    message: str,
    kinds: tuple[AlertKind, ...],
    drifts: tuple[Drift, ...] = (),
    change: Change | None = None,
) -> Alert:
    """An alert that a test, its name and time, calls for: its key names `what` it is of."""
    name, time = test
    key = f"hanger-{hanger.id}:{what}:{short_name(name)}"
    return Alert(key, hanger.id, name, time, message, drifts, kinds, change)


def watch_words(watched: Sequence[WatchedTest]) -> str:
    """Return what was detected since the baseline, or how near the evidence is; and creep."""
    if not watched:
        return ""
    creep = watched[-1].creep_per_year
    rate = creep.words if creep else ""
    return " ".join(filter(None, (_detected_words(watched), rate)))


def _detected_words(watched: Sequence[WatchedTest]) -> str:
    detected = [each.change for each in watched if each.change.called]
    if detected:
        each_one = (f"{as_sentence(_changed(each))} {_when(each)}" for each in detected)
        return f"Detected since the baseline: {' Then: '.join(each_one)}"
    return undetected_words(watched[-1].change)


# ---------------------------------------------------------------- the first sentence


def _state(
    hanger: Hanger, change: Change | None, beyond: Sequence[Drift], *, is_further: bool
) -> str:
    """Return the state in a sentence of at most 25 words, with one number and its interval."""
    name = f"Hanger {hanger.id}"
    if beyond:
        lead = gravest(beyond)
        places = {
            each.quantity: (each.end, each.plane) for each in (change.moved if change else ())
        }
        words = quantity_words(lead.quantity, *places.get(lead.quantity, (None, None)))
        return f"{name}: {words} {size_words(lead)}, beyond its threshold."
    again = " again" if is_further else ""
    if change is None:
        return f"{name} changed{again}; its tests do not show what."
    return f"{name}{' changed again' if again else ''}: {_changed(change)}."


def _changed(change: Change) -> str:
    """Return what changed and by how much, and what fits the tests as well."""
    groups = probable_groups(change)
    if not groups:
        return "the tests do not show what changed"
    first, *others = groups
    if not others:
        doubt = "" if first[0].probability >= _SURE else "most likely, "
        return f"{doubt}{_moved(first)}"
    kinds = list(dict.fromkeys(_kind(each) for each in others if _kind(each) != _kind(first)))
    if not kinds:
        return f"{_kind_moved(first)}, and the tests do not show at which end or in which plane"
    more = ", or another cause" if len(kinds) > 1 else ""
    return f"either {_kind_moved(first)}, or {kinds[0]}{more}"


def _moved(group: Sequence[Moved]) -> str:
    """Return what moved together and how far."""
    first = group[0]
    if first.quantity in CAUSES:
        return f"{group_words(group)} (frequencies {size_words(first)} on average)"
    if _is_mixed(group):
        tension = next(each for each in group if each.quantity == TENSION)
        return f"tension {size_words(tension)}, and end stiffness {_way(group)} with it"
    if all(abs(e.shift_mean - first.shift_mean) <= max(e.shift_sd, first.shift_sd) for e in group):
        return f"{group_words(group)} {size_words(first)}"
    return f"{group_words(group)} {_way(group)}, by different amounts"


def _kind(group: Sequence[Moved]) -> str:
    """A group in the fewest words, without its size: `end stiffness fell`."""
    first = group[0]
    if first.quantity in CAUSES:
        return group_words(group)
    if _is_mixed(group):
        return "tension and end stiffness changed together"
    return f"{'tension' if first.quantity == TENSION else 'end stiffness'} {_way(group)}"


def _kind_moved(group: Sequence[Moved]) -> str:
    """Return the same with its size."""
    first = group[0]
    if first.quantity in CAUSES:
        size = rounded_percent(first.shift_mean, NINETY_PERCENT * first.shift_sd, "+")
        return f"{group_words(group)} (frequencies {size})"
    if _is_mixed(group):
        tension = next(each for each in group if each.quantity == TENSION)
        return f"tension, with end stiffness, {size_words(tension)}"
    return f"{'tension' if first.quantity == TENSION else 'end stiffness'} {size_words(first)}"


def _is_mixed(group: Sequence[Moved]) -> bool:
    return len(group) > 1 and any(each.quantity == TENSION for each in group)


def _way(group: Sequence[Moved]) -> str:
    """Return which way a group went, the tension of a mixed one aside."""
    springs = [each for each in group if len(group) == 1 or each.quantity != TENSION]
    ways = {each.shift_mean > 0 for each in springs}
    return "changed" if len(ways) > 1 else "rose" if ways.pop() else "fell"


# ---------------------------------------------------------------- why, and details


def _when(change: Change | None) -> str:
    if change is None:
        return ""
    since = _between(change.began_after, change.began_by)
    if change.sudden >= _EITHER_LIKELY:
        return f"It came suddenly, {since}."
    if change.sudden <= 1 - _EITHER_LIKELY:
        return f"It came slowly and began {since}."
    return f"It began {since}; it is not clear yet whether suddenly or slowly."


def _between(after: datetime, by: datetime) -> str:
    first, last = f"{after:%Y-%m-%d}", f"{by:%Y-%m-%d}"
    return f"on {first}" if first == last else f"between {first} and {last}"


def _details(*parts: str) -> str:
    given = "; ".join(part for part in parts if part)
    return f"Details: {given}." if given else ""


def _sizes(change: Change | None, beyond: Sequence[Drift]) -> str:
    """Intervals of stiffnesses, and of whatever else may have changed."""
    groups = probable_groups(change) if change else []
    moved = [each for group in groups for each in group]
    if beyond and len(groups) < 2:
        moved = []
    names = {each.quantity: quantity_words(each.quantity, each.end, each.plane) for each in moved}
    chosen: dict[str, Moved | Drift] = {each.quantity: each for each in beyond}
    for each in moved:
        chosen.setdefault(each.quantity, each)
    shown = [
        _interval(names.get(name) or quantity_words(name), each)
        for name, each in chosen.items()
        if is_stiffness(name) or (name == TENSION and len(chosen) > 1)
    ]
    more = f" and {len(shown) - _LISTED} more" if len(shown) > _LISTED else ""
    return f"90 % intervals: {', '.join(shown[:_LISTED])}{more}" if shown else ""


def _interval(name: str, each: Moved | Drift) -> str:
    if each.quantity == TENSION:
        return f"tension {size_words(each)}"
    ends = (each.shift_mean + sign * NINETY_PERCENT * each.shift_sd for sign in (-1, 1))
    low, high = map(factor, ends)
    return f"{name} {low} to {high} times what it was"


def _probabilities(test: WatchedTest, change: Change | None, beyond: Sequence[Drift]) -> str:
    """Each probability once."""
    words = [(each.probability, f"that {beyond_words(each)}") for each in beyond]
    if change is not None:
        groups = probable_groups(change)
        words += [(each[0].probability, _that(each)) for each in groups[:_LISTED]]
        others = [each for each in change.moved if each not in groups[0]]
        if len(groups) == 1 and groups[0][0].probability < _SURE and others:
            words.append((others[0].probability, _that([others[0]])))
        # What is beyond its threshold has changed, whatever the newest tests add.
        anything = max([change.probability, *(each.probability for each in beyond)])
        words.append((anything, "that anything changed"))
        is_sudden = change.sudden >= 0.5
        way = "suddenly" if is_sudden else "slowly"
        words.append((max(change.sudden, 1 - change.sudden), f"that it came {way}"))
        if not beyond and (nearest := _nearest(test, change)):
            words.append((nearest.probability, f"that {beyond_words(nearest)}"))
    if test.change.outlier_probability > 0.5:
        words.append((test.change.outlier_probability, "that this test is an outlier"))
    return _merged(words)


def _that(group: Sequence[Moved]) -> str:
    words = group_words(group)
    return f"that {words}" if group[0].quantity in CAUSES else f"that {words} changed"


def _merged(said: Sequence[tuple[float, str]]) -> str:
    """`probability 0.97 that tension changed; 0.90 that ...`: what is as likely stands together."""
    by_value: dict[str, list[str]] = {}
    for value, words in said:
        if not math.isnan(value):
            by_value.setdefault(_probability(value), []).append(words)
    reported = (f"{value} {listed(words)}" for value, words in by_value.items())
    return f"probability {', '.join(reported)}" if by_value else ""


def _probability(value: float) -> str:
    """Two decimals, with no certainty pretended."""
    if value > _CERTAIN:
        return "above 0.99"
    return "below 0.01" if value < 1 - _CERTAIN else f"{value:.2f}"


def _nearest(test: WatchedTest, change: Change) -> Drift | None:
    """Return what may have changed and is the likeliest to be beyond its threshold."""
    by_name = {drift.quantity: drift for drift in test.drifts}
    found = [by_name[each.quantity] for each in suspects(change) if each.quantity in by_name]
    return max(found, key=lambda drift: drift.probability, default=None)


def _false_alarms(change: Change | None) -> str:
    if change is None:
        return ""
    return f"mean time between false alarms at least {change.limit_years:.3g} years"
