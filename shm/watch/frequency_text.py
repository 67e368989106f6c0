"""What is said of a structure that no model class describes: its frequencies, and by how much."""

from __future__ import annotations

from collections.abc import Sequence

from shm.values import Change, Drift, Hanger, WatchedTest
from shm.values.rounding import NINETY_PERCENT, rounded_percent
from shm.watch.change_words import CAUSES, probable_groups, undetected_words


def structure_words(hanger: Hanger) -> str:
    """The name of a structure that no model class describes."""
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
        said = f"have{again} moved by different amounts {since}, on average by"
        return f"The frequencies of {name} {said} {_signed(*size)}."
    if first.together:
        return f"The frequencies of {name} {_have(f'have{again}', *size)} {since}."
    return f"The {first.quantity} of {name} {_have(f'has{again}', *size)} {since}."


def frequency_words(watched: Sequence[WatchedTest], hanger: Hanger) -> str:
    """What was detected of such a structure since its baseline, or how near that is."""
    detected = [each.change for each in watched if each.change.called]
    if not detected:
        return undetected_words(watched[-1].change) if watched else ""
    told = (
        frequencies_state(hanger, each, (), is_further=n > 0) for n, each in enumerate(detected)
    )
    return " ".join(told)


def each_frequency(test: WatchedTest) -> str:
    """The shift of each, as it is if it changed."""
    told = (f"{each.quantity} {_signed(each.shift_mean, each.shift_sd)}" for each in test.drifts)
    return ", ".join(told)


def odd_frequencies(test: WatchedTest, hanger: Hanger, in_a_row: int) -> str:
    """What `message_of_odd` says of such a structure."""
    name = structure_words(hanger)
    if in_a_row == 1:
        return (
            f"The frequencies of {name} in test {test.test} agree with no test before. Test again "
            "within a week; this one does not count until another agrees with it. A mode may be "
            "mistaken, a clock or a sensor wrong; or the structure has changed."
        )
    return (
        f"The frequencies of {name} agreed {in_a_row} times in a row neither with those before nor "
        "with each other. Look at sensors and clock within a week. Until then its state rests on "
        "older tests."
    )


def _have(verb: str, mean: float, sd: float) -> str:
    half = NINETY_PERCENT * sd
    return f"{verb} {'dropped' if mean < 0 else 'risen'} by {rounded_percent(abs(mean), half)}"


def _signed(mean: float, sd: float) -> str:
    return rounded_percent(mean, NINETY_PERCENT * sd, "+")
