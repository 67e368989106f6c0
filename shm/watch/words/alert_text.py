"""Put what the watch found into words: the state in a sentence, what to do and how soon, details.

The only place for it: alerts, pages, reports and `shm status` ask here. The first sentence has one
number with its interval. Traffic is named for lost tension and loosened ends alone.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from datetime import datetime
from functools import cache
from typing import TYPE_CHECKING

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
from shm.watch.engine.limits import LIMITS

if TYPE_CHECKING:
    from shm.models.effects.base import OverTime

_WHICH_END, _FORMER = "which end is not known", " of its former value"


# ---------------------------------------------------------------- what may have changed


def cause_of(quantity: str) -> OverTime | None:
    """Return a possible cause of moved frequencies; None for a tension or an end stiffness."""
    is_own = is_ratio(quantity) or quantity.startswith("log10_k") or "end_stiffness" in quantity
    return None if is_own else _causes().get(quantity)


@cache
def _causes() -> dict[str, OverTime]:
    from shm.models.effects import EFFECTS  # the models take long to import, and most do without
    from shm.models.effects.base import OverTime

    unexplained = OverTime(
        fell="no known cause explains it",
        rose="no known cause explains it",
        check="check hanger, sensors, axes and orders of modes in the test's files",
    )
    known = {name: each.over_time for name, each in EFFECTS.items() if each.over_time}
    return {**known, "unexplained": unexplained}


def suspected_groups(change: Change) -> list[tuple[Moved, ...]]:
    """Return what may have moved, each with what moved with it, the most probable first."""
    by_name = {each.quantity: each for each in change.moved}
    groups: dict[frozenset[str], tuple[Moved, ...]] = {}
    for first in change.moved[:1]:
        for name in (first.quantity, *(n for n in by_name if n in first.alike)):
            names = (name, *by_name[name].together)
            group = tuple(by_name[each] for each in names if each in by_name)
            groups.setdefault(frozenset(names), group)
    return list(groups.values())


def suspects(change: Change) -> list[Moved]:
    """Return the members of these groups, each once."""
    return list(dict.fromkeys(each for group in suspected_groups(change) for each in group))


def probable_groups(change: Change | None) -> list[tuple[Moved, ...]]:
    """Return these groups without what the data fit as well but nobody need expect."""
    groups = suspected_groups(change) if change else []
    return [*groups[:1], *(each for each in groups[1:] if each[0].probability >= LIMITS.probable)]


# ---------------------------------------------------------------- names and sizes


def quantity_words(name: str, end: End | None = None, plane: Plane | None = None) -> str:
    """Return `tension`, or `end stiffness k1 (deck end, transverse)`."""
    if not name.startswith("log10_k"):
        return name.replace("_", " ")
    at = f"{end} end" if end else _WHICH_END if plane else ""
    where = ", ".join(word for word in (at, plane or "") if word)
    return f"end stiffness {name.removeprefix('log10_')}" + (f" ({where})" if where else "")


def group_words(group: Sequence[Moved]) -> str:
    """Return `end stiffness in both planes at the deck end`, a cause, or the quantities' names."""
    first = group[0]
    if cause := cause_of(first.quantity):
        return cause.fell if first.shift_mean < 0 else cause.rose
    ends, planes = {each.end for each in group}, {each.plane for each in group}
    if len(group) == 1 or None in planes:
        return " and ".join(quantity_words(g.quantity, g.end, g.plane) for g in group)
    where = "both planes" if len(planes) > 1 else f"the {first.plane} plane"
    if None in ends:
        return f"end stiffness in {where} ({_WHICH_END})"
    return f"end stiffness in {where} at {'both ends' if len(ends) > 1 else f'the {first.end} end'}"


def is_stiffness(quantity: str) -> bool:
    return not is_ratio(quantity) and cause_of(quantity) is None


def shift_words(quantity: str, mean: float, sd: float) -> str:
    """Return `fell by 8.2 ± 1.1 %`; of a stiffness `fell to about 33 % of its former value`.

    `mean` and `sd` are a fraction of the tension, of the frequencies' mean where `quantity` is
    another cause, or decades of a stiffness.
    """
    half = NINETY_PERCENT * sd
    verb = "moved" if abs(mean) <= half else "fell" if mean < 0 else "rose"
    if is_stiffness(quantity):
        times = 10 ** min(mean, 10.0)
        if times < LIMITS.alert_text_least_share:
            return f"{verb} to less than a twentieth"
        if times < 1:
            return f"{verb} to about {100 * times:.0f} %{_FORMER}"
        about = "" if times > LIMITS.largest_factor else "about "
        return f"{verb} to {about}{factor(mean)} times its former value"
    if verb == "moved":
        return f"moved by {rounded_percent(mean, half, '+')}"
    return f"{verb} by {rounded_percent(abs(mean), half)}"


def size_words(each: Moved | Drift) -> str:
    return shift_words(each.quantity, each.shift_mean, each.shift_sd)


def factor(decades: float) -> str:
    """Return how many times what it was: `0.50`, `1.06`, `3.2`."""
    times = 10 ** min(decades, 10.0)
    if times > LIMITS.largest_factor:
        return "more than 1000"
    if times < 1 / LIMITS.largest_factor:
        return "less than 0.001"
    return f"{times:.2f}" if times < 2 else f"{times:.1f}" if times < 10 else f"{times:.0f}"


def _signed(mean: float, sd: float) -> str:
    return rounded_percent(mean, NINETY_PERCENT * sd, "+")


def _threshold_words(drift: Drift) -> str:
    if is_ratio(drift.quantity):
        return f"{100 * drift.threshold:.3g} %"
    return f"{factor(math.copysign(drift.threshold, drift.shift_mean))} times"


def structure_words(hanger: Hanger) -> str:
    """Return the name of a structure that no model class describes."""
    return hanger.name or f"structure {hanger.id}"


# ---------------------------------------------------------------- the state


def lead_of(
    hanger: Hanger,
    change: Change | None,
    beyond: Sequence[Drift],
    drifts: Sequence[Drift] = (),
    *,
    is_further: bool = False,
) -> Lead:
    """Return the state of a hanger of which something was found, and what to do about it how soon.

    `beyond` are shifts beyond their threshold, `drifts` those of all quantities.
    """
    state = _state if hanger.is_modelled else _state_of_frequencies
    return Lead(
        state(hanger, change, beyond, " again" if is_further else ""),
        _action(hanger, change, beyond, drifts),
    )


def _state(hanger: Hanger, change: Change | None, beyond: Sequence[Drift], again: str) -> str:
    """Return the state in a sentence of at most 25 words, with one number and its interval."""
    name = f"Hanger {hanger.id}"
    if beyond:
        lead = _gravest(beyond)
        moved = {each.quantity: each for each in (change.moved if change else ())}
        its = moved.get(lead.quantity)
        words = quantity_words(lead.quantity, *((its.end, its.plane) if its else ()))
        return f"{name}: {words} {size_words(lead)}, beyond its threshold."
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
        doubt = "" if first[0].probability >= LIMITS.sure else "most likely, "
        return f"{doubt}{_moved(first)}"
    kinds = list(dict.fromkeys(_kind(each) for each in others if _kind(each) != _kind(first)))
    if not kinds:
        return f"{_kind(first, sized=True)}, and the tests do not show at which end or plane"
    more = ", or another cause" if len(kinds) > 1 else ""
    return f"either {_kind(first, sized=True)}, or {kinds[0]}{more}"


def _moved(group: Sequence[Moved]) -> str:
    """Return what moved together, where, and how far."""
    first = group[0]
    if cause_of(first.quantity):
        return f"{group_words(group)} (frequencies {size_words(first)} on average)"
    if len(group) > 1 and any(each.quantity == TENSION for each in group):
        return _kind(group, sized=True)
    if all(abs(e.shift_mean - first.shift_mean) <= max(e.shift_sd, first.shift_sd) for e in group):
        return f"{group_words(group)} {size_words(first)}"
    way = "changed" if len({e.shift_mean > 0 for e in group}) > 1 else _way(first)
    return f"{group_words(group)} {way}, by different amounts"


def _kind(group: Sequence[Moved], *, sized: bool = False) -> str:
    """Return a group in the fewest words, such as `end stiffness fell`, or with its size."""
    first = group[0]
    if cause_of(first.quantity):
        size = f" (frequencies {_signed(first.shift_mean, first.shift_sd)})" if sized else ""
        return f"{group_words(group)}{size}"
    tension = next((each for each in group if each.quantity == TENSION), None)
    name = "end stiffness" if tension is None else "tension"
    if tension is not None and len(group) > 1:
        name = "tension, with end stiffness,"
    lead = tension or first
    return f"{name} {size_words(lead).removesuffix(_FORMER) if sized else _way(lead)}"


def _way(each: Moved) -> str:
    return "fell" if each.shift_mean < 0 else "rose"


def _state_of_frequencies(
    hanger: Hanger, change: Change | None, beyond: Sequence[Drift], again: str
) -> str:
    """Return `The frequencies of Deck have dropped by 1.2 ± 0.3 % since 2028-04-01.`"""
    name = structure_words(hanger)

    def have(verb: str, each: Moved | Drift) -> str:
        way, half = "dropped" if each.shift_mean < 0 else "risen", NINETY_PERCENT * each.shift_sd
        return f"{verb} {way} by {rounded_percent(abs(each.shift_mean), half)}"

    if beyond:
        lead = min(beyond, key=lambda each: each.shift_mean)
        return f"The {lead.quantity} of {name} {have('has', lead)}, beyond its threshold."
    groups = probable_groups(change)
    if change is None or not groups:
        return f"The frequencies of {name} changed{again}; the tests do not show which."
    first, since = groups[0][0], f"since {change.began_by:%Y-%m-%d}"
    if cause_of(first.quantity):
        size = _signed(first.shift_mean, first.shift_sd)
        text = f"have{again} moved by different amounts {since}, on average by {size}"
        return f"The frequencies of {name} {text}."
    if first.together:
        return f"The frequencies of {name} {have(f'have{again}', first)} {since}."
    return f"The {first.quantity} of {name} {have(f'has{again}', first)} {since}."


def called_words(change: Change) -> str:
    """Describe a change: `sudden: tension -6.3 %`.

    Of a stiffness it is the ratio to before, of another cause the mean effect on the
    frequencies.
    """
    kind = "sudden" if change.sudden > 0.5 else "slow"
    groups = probable_groups(change)
    if not groups:
        return f"{kind}: not known what"
    first = groups[0][0]
    size = f"{100 * first.shift_mean:+z.1f} %"
    if is_stiffness(first.quantity):
        size = f"{10**first.shift_mean:.2f} times"
    elif first.quantity != TENSION:
        size = f"(frequencies {size})"
    doubt = " (or another cause)" if len(groups) > 1 else ""
    return f"{kind}: {group_words(groups[0])} {size}{doubt}"


# ---------------------------------------------------------------- what to do

_WHEN: dict[Urgency, str] = {"next_test": NEXT_TEST, "week": WEEK, "today": TODAY}


def _urgency(
    hanger: Hanger, change: Change | None, beyond: Sequence[Drift], drifts: Sequence[Drift]
) -> Urgency:
    """Return how soon to act.

    Today for a loss beyond its threshold as surely as the owner asked to be told. A change that
    came slowly and stays below its threshold can wait for the next planned test.
    """
    level = hanger.thresholds.alert_probability
    is_lost = any(each.shift_mean < 0 and each.probability >= level for each in beyond)
    if hanger.is_modelled and is_lost:
        return "today"
    slow = change is not None and change.sudden < 0.5
    near = any(each.probability > 0.5 for each in drifts)
    return "next_test" if slow and not beyond and not near else "week"


def _action(
    hanger: Hanger, change: Change | None, beyond: Sequence[Drift], drifts: Sequence[Drift]
) -> str:
    """Return what to do and how soon, in a sentence."""
    urgency = _urgency(hanger, change, beyond, drifts)
    when = _WHEN[urgency]
    if not hanger.is_modelled:
        look_at = "bearings, joints, cracks, new loads and the sensors"
        return f"Look at the structure {when}: {look_at}."
    if urgency == "today":
        look = _look(_gravest(beyond), change)
        return f"{look_again(hanger)} {TODAY} and decide on traffic until then; {look}."
    again = f"{look_again(hanger)} {WEEK}" if urgency == "week" else f"Compare again {NEXT_TEST}"
    groups = probable_groups(change)
    if len(groups) > 1 and not beyond:
        causes = [cause for each in groups if (cause := cause_of(each[0].quantity))]
        if causes:
            check, by = causes[0].check, causes[0].apart_by
            return _as_sentence(f"{when}, {check}; then test with {by}, to tell them apart")
        with_what = "a sensor near each end and more modes"
        if hanger.has_sensors:
            return f"{again}; a hammer test with {with_what} shows what changed."
        return f"{again} with {with_what}, to see what changed."
    lead = _gravest(beyond) if beyond else groups[0][0] if groups else None
    if lead is None:
        return f"{again}{'' if hanger.has_sensors else ', with more modes'}."
    if cause := cause_of(lead.quantity):
        return _as_sentence(f"{when}, {cause.check}, then test again")
    return f"{again}; {_look(lead, change)}."


def look_again(hanger: Hanger) -> str:
    """Return how its owner makes sure: permanent sensors test it again without anybody."""
    return "Check the hanger and its sensors" if hanger.has_sensors else "Repeat the hammer test"


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
    end = "both ends" if None in ends or len(ends) > 1 else f"the {ends.pop()} end"
    found = "a worn pin, a cracked plate or loose bolts" if lost else "a pin seized by rust or dirt"
    return f"if the change stays, inspect {end} for {found}"


def _gravest(beyond: Sequence[Drift]) -> Drift:
    """Return a loss before a gain, the tension before the ends."""
    return min(beyond, key=lambda each: (each.shift_mean > 0, each.quantity != TENSION))


def _as_sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}."


# ---------------------------------------------------------------- messages


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
    now, and `is_further` whether others were before it. `beyond` are the shifts that this alert
    reports beyond their threshold, `standing` those reported before and still there.
    """
    change = change if change and change.moved else None
    everything = (*beyond, *standing)
    words = [lead_of(hanger, change, everything, test.drifts, is_further=is_further).words]
    if beyond and standing and _gravest(everything) not in beyond:
        words.append(f"New: {quantity_words(beyond[0].quantity)} {size_words(beyond[0])}.")
    words += [_when(change)] if change else []
    if test.change.outlier_probability > 0.5:
        words.append("This test itself is probably an outlier.")
    sizes = ""
    if not hanger.is_modelled:
        words.append(
            "Temperature, frost and excitation are taken off as far as the tests show what they do."
        )
        sizes = ", ".join(f"{e.quantity} {_signed(e.shift_mean, e.shift_sd)}" for e in test.drifts)
    words.append(_details(sizes, change, beyond, is_call=is_call))
    return " ".join(words)


def message_of_agreeing(
    drift: Drift, hanger: Hanger, tests: tuple[str, str], *, is_held: bool
) -> str:
    """Return the same of two `tests` that read beyond a threshold; the first may be held."""
    first = f"{tests[0]} (held for its clock)" if is_held else tests[0]
    return (
        f"{lead_of(hanger, None, [drift]).words} Tests {first} and {tests[1]} both read beyond its "
        f"threshold of {_threshold_words(drift)}. Check the logger's clock: if it is wrong, the "
        f"date of the change is not known. {_details('', None, [drift], is_call=False)}"
    )


def _details(sizes: str, change: Change | None, beyond: Sequence[Drift], *, is_call: bool) -> str:
    """Return the interval of a stiffness, and the probabilities that the document gives."""
    groups = probable_groups(change)
    lead = _gravest(beyond) if beyond else groups[0][0] if groups else None
    half = "± is half the 90 % interval"
    if lead is not None and is_stiffness(lead.quantity):
        ends = (lead.shift_mean + sign * NINETY_PERCENT * lead.shift_sd for sign in (-1, 1))
        low, high = map(factor, ends)
        half = f"90 % interval {low} to {high} times what it was"
    by_value: dict[str, list[str]] = {}
    for each in beyond:
        words = f"that {quantity_words(each.quantity)} is beyond its threshold of "
        by_value.setdefault(_probability(each.probability), []).append(
            words + _threshold_words(each)
        )
    sentences = [
        "; ".join(part for part in (half, sizes) if part),
        *(f"The probability {listed(words)} is {value}" for value, words in by_value.items()),
    ]
    if change is not None:
        detected = _probability(change.probability)
        sentences.append(
            "The change detector gives the same probability of any change"
            if detected in by_value
            else f"The probability of any change, which allows for disturbed visits, is {detected}"
        )
    if is_call and change is not None:
        years = f"{change.limit_years:.3g} years"
        sentences.append(f"The mean time between false alarms is at least {years}")
    return f"Details: {'. '.join(sentences)}."


def _probability(value: float) -> str:
    """Return two decimals, with no certainty pretended."""
    if value > LIMITS.certain:
        return "above 0.99"
    return "below 0.01" if value < 1 - LIMITS.certain else f"{value:.2f}"


def _when(change: Change) -> str:
    first, last = f"{change.began_after:%Y-%m-%d}", f"{change.began_by:%Y-%m-%d}"
    since = f"on {first}" if first == last else f"between {first} and {last}"
    if change.sudden >= LIMITS.either_likely:
        return f"It came suddenly, {since}."
    if change.sudden <= 1 - LIMITS.either_likely:
        return f"It came slowly and began {since}."
    return f"It began {since}; it is not clear yet whether suddenly or slowly."


def watch_words(watched: Sequence[WatchedTest], hanger: Hanger) -> str:
    """Return what was detected since the baseline, or how near the evidence is; and creep."""
    if not watched:
        return ""
    detected = [each.change for each in watched if each.change.called]
    say = _state if hanger.is_modelled else _state_of_frequencies
    words = [
        f"{say(hanger, change, (), ' again' if n else '')} {_when(change)}"
        for n, change in enumerate(detected)
    ]
    latest = watched[-1].change
    if not detected and latest.evidence_years > latest.limit_years:
        words.append(
            "Something changed since the baseline, by less than the watch is to report: no first "
            "frequency, and no plane's mean, moved by enough."
        )
    elif not detected:
        fraction = 100 * latest.evidence_years / latest.limit_years
        known = f"{fraction:.2g} %" if fraction >= 1 else "less than 1 %"
        words.append(
            "No change was detected since the baseline: the evidence for one is "
            f"{known} of what a detection takes."
        )
    creep = watched[-1].creep_per_year
    return " ".join([*words, *([creep.words] if creep and creep.words else [])])


def against_baseline_words(change: Change, hanger: Hanger) -> str:
    """Return that the baseline is the odd one, and what to do: of an alert and of a warning."""
    return (
        f"Hanger {hanger.id}: the {change.against_baseline} tests since the baseline agree with "
        f"each other and not with it. Find out {WEEK} what was different on its day, and set "
        "another (`shm drift rebaseline`)."
    )


def alert_of(
    hanger: Hanger,
    test: tuple[str, datetime],
    what: str,
    message: str,
    kinds: tuple[AlertKind, ...],
    drifts: tuple[Drift, ...] = (),
    change: Change | None = None,
) -> Alert:
    """Return an alert that a test, its name and time, calls for: its key names `what` it is of."""
    name, time = test
    short = name
    if len(name) > LIMITS.longest_test:  # names that begin alike stay apart
        digest = hashlib.sha256(name.encode()).hexdigest()[: LIMITS.alert_text_digits]
        short = f"{name[: LIMITS.longest_test]}-{digest}"
    return Alert(
        f"hanger-{hanger.id}:{what}:{short}", hanger.id, name, time, message, drifts, kinds, change
    )
