"""Messages of alerts: the state in a sentence, what to do and how soon, why; details last.

An owner reads the first two sentences on a phone: one number with its interval, one urgency. Each
probability is given once, at the end. Traffic is named for lost tension and loosened ends alone.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from datetime import datetime

from shm.values import TENSION, Alert, AlertKind, Change, Drift, Hanger, Moved, WatchedTest
from shm.values.messages import WEEK, Lead
from shm.values.rounding import NINETY_PERCENT, listed, rounded_percent
from shm.watch.change_words import (
    CAUSES,
    action_words,
    as_sentence,
    beyond_words,
    each_frequency,
    factor,
    frequencies_state,
    gravest,
    group_words,
    is_stiffness,
    probable_groups,
    quantity_words,
    size_words,
    suspects,
    threshold_words,
    undetected_words,
)

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
