"""Every alert that the watch can write, against the rules of the product's language.

Over a grid: each cause first, causes alike, both ways, one and several planes and ends, sure and
unsure, detected, beyond a threshold, two tests that agree, tests that fit nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import cache
from itertools import product

import pytest

from shm.values import Change, Drift, End, Moved, Plane, WatchedTest
from shm.values.messages import Lead
from shm.watch.engine.causes import (
    BENDING_STIFFNESS,
    POINT_MASS,
    SECTION_LOSS,
    SENSOR_MASS,
    TIMEBASE,
    UNEXPLAINED,
)
from shm.watch.words.alert_text import message_of, message_of_agreeing, watch_words
from shm.watch.words.notices import message_of_odd
from tests.helpers.hangers import HANGER_3

START = datetime(2026, 5, 1, tzinfo=UTC)
CAUSES = (POINT_MASS, SECTION_LOSS, BENDING_STIFFNESS, TIMEBASE, SENSOR_MASS, UNEXPLAINED)
PLACES: dict[str, tuple[End | None, Plane]] = {
    "log10_k1": ("deck", "transverse"),
    "log10_k2": ("deck", "longitudinal"),
    "log10_k3": ("arch", "transverse"),
    "log10_k4": ("arch", "longitudinal"),
    "transverse_end_stiffness": (None, "transverse"),
    "longitudinal_end_stiffness": (None, "longitudinal"),
}
SPRINGS = tuple(PLACES)
GROUPS = (
    ("tension",),
    *((name,) for name in SPRINGS),
    *((name,) for name in CAUSES),
    ("log10_k1", "log10_k2"),
    ("log10_k1", "log10_k3"),
    SPRINGS[:4],
    SPRINGS[4:],
    ("log10_k1", "log10_k2", "tension"),
    ("tension", *SPRINGS[4:]),
)
AVOIDED = (
    "called", "swing", "filtered", "smoothed", "blow", "level", "gap", "shed", "sheds",
    "examination", "remainder", "setting aside", "held probable", "chances", "told", "stands",
    "gone aside", "anew", "each by itself", "cannot tell", "hit it", "believed", "moved by itself",
)  # fmt: skip
"""LANGUAGE's list of what not to say, and the sentences that it warns of."""
MOST_WORDS, MOST_NUMBERS = 25, 2
NUMBER = re.compile(r"(?<![\w.-])[+-]?\d+(?:\.\d+)?(?!\w)")
TRAFFIC = "decide on traffic"


def moved(name: str, probability: float, sign: int, together: tuple[str, ...] = ()) -> Moved:
    size = 0.3 if name in PLACES else 0.082 if name == "tension" else 0.0082
    end, plane = PLACES.get(name, (None, None))
    return Moved(name, probability, sign * size, size / 12, end, plane, (), together)


def group_of(names: tuple[str, ...], probability: float, sign: int) -> tuple[Moved, ...]:
    return tuple(
        moved(name, probability, sign, tuple(other for other in names if other != name))
        for name in names
    )


def changes() -> Iterator[Change]:
    """Each group first, alone or like one or two others."""
    others = (
        (), ("tension",), ("point_mass",), ("log10_k3", "log10_k4"), ("timebase", "sensor_mass"),
        ("section_loss", "bending_stiffness"),
        ("unexplained", "log10_k1"),
    )  # fmt: skip
    for names, alike, sign, sure, sudden in product(
        GROUPS, others, (-1, 1), (True, False), (0.999, 0.6, 0.1)
    ):
        if set(names) & set(alike):
            continue
        first, *rest = group_of(names, 0.999 if sure else 0.55, sign)
        beside = [moved(name, 0.2 if alike else 0.05, -sign) for name in alike]
        yield Change(
            evidence_years=500.0,
            limit_years=100.0,
            probability=0.9995 if sure else 0.93,
            sudden=sudden,
            began_after=START - timedelta(days=9),
            began_by=START,
            moved=(replace(first, alike=alike), *rest, *beside),
            outlier_probability=0.01 if sure else 0.7,
        )


def drift(quantity: str, shift: float, probability: float) -> Drift:
    threshold, at_rest = (0.05, 711e3) if quantity == "tension" else (0.5, 7.0)
    value = at_rest * (1 + shift) if quantity == "tension" else at_rest + shift
    sd = abs(shift) / 9
    return Drift(3, "t9", START, quantity, at_rest, value, shift, sd, threshold, probability)


def beyond_sets() -> list[tuple[Drift, ...]]:
    each = [
        drift(name, sign * (0.1 if name == "tension" else 0.7), probability)
        for name in ("tension", "log10_k1", "transverse_end_stiffness")
        for sign in (-1, 1)
        for probability in (0.96, 0.9999)
    ]
    return [(), *((one,) for one in each), (each[2], each[4]), (each[0], each[4], each[8])]


def watched(change: Change, beyond: tuple[Drift, ...]) -> WatchedTest:
    rest = [drift(name, 0.01, 0.02) for name in ("tension", "log10_k1", "log10_k2")]
    drifts = {each.quantity: each for each in (*rest, *beyond)}
    return WatchedTest("t9", START, 11.0, tuple(drifts.values()), change)


def of_the_watch() -> Iterator[tuple[str, bool]]:
    """Messages, and whether a loss beyond its threshold is behind each.

    Each change goes with every fifth of the sets beyond. 12 changes of a group are alike in what
    others are like it; 5 and 12 have no divisor in common, so that over five such dozens each
    group, sign, certainty and suddenness meets each set.
    """
    sets, every = beyond_sets(), 5
    for number, change in enumerate(changes()):
        for beyond in sets[number % every :: every]:
            is_loss = any(each.shift_mean < 0 for each in beyond)
            test = watched(change, beyond)
            yield message_of(test, HANGER_3, change, beyond, is_call=True), is_loss
            further = message_of(test, HANGER_3, change, beyond, is_call=True, is_further=True)
            yield further, is_loss


def of_thresholds_alone() -> Iterator[tuple[str, bool]]:
    """What is beyond its threshold, told of a test that fits and of an odd one."""
    by_oddity = {change.outlier_probability: change for change in changes()}
    for change, beyond in product(by_oddity.values(), filter(None, beyond_sets())):
        told = message_of(watched(change, beyond), HANGER_3, None, beyond, is_call=False)
        yield told, any(each.shift_mean < 0 for each in beyond)


def of_single_tests() -> list[tuple[str, bool]]:
    agreeing = [
        (message_of_agreeing(one, HANGER_3, ("t8", "t9"), is_held=held), one.shift_mean < 0)
        for (one,) in (each for each in beyond_sets() if len(each) == 1)
        for held in (False, True)
    ]
    test = watched(next(changes()), ())
    return [*agreeing, *((message_of_odd(test, HANGER_3, n), False) for n in (1, 3))]


@cache
def all_messages() -> tuple[tuple[str, bool], ...]:
    found = (*of_the_watch(), *of_thresholds_alone(), *of_single_tests())
    return tuple(dict.fromkeys(found))


def sentences(message: str) -> list[str]:
    return re.split(r"(?<=\.) (?=[A-Z±])", message)


def numbers(sentence: str) -> list[str]:
    """Of a sentence; the hanger's is its name, a date is no number."""
    named = re.sub(r"^Hanger 3|\d{4}-\d{2}-\d{2}", "", sentence)
    return NUMBER.findall(named)


def failing(rule: object) -> list[str]:
    return [message for message, is_loss in all_messages() if not rule(message, is_loss)][:5]  # type: ignore[operator]


def test_the_first_sentence_has_few_words_and_one_number_with_its_interval() -> None:
    def rule(message: str, _: bool) -> bool:
        first = sentences(message)[0]
        return len(first.split()) <= MOST_WORDS and len(numbers(first)) <= MOST_NUMBERS

    assert failing(rule) == []


def test_no_sentence_before_the_details_has_more_than_two_numbers() -> None:
    def rule(message: str, _: bool) -> bool:
        said = message.split(" Details: ")[0]
        return all(len(numbers(each)) <= MOST_NUMBERS for each in sentences(said))

    assert failing(rule) == []


def test_the_second_sentence_says_what_to_do_and_how_soon() -> None:
    assert failing(lambda message, _: Lead.of(message).urgency != "none") == []


@pytest.mark.parametrize("words", [TRAFFIC, "today"])
def test_traffic_and_today_are_for_losses_beyond_the_threshold_alone(words: str) -> None:
    assert failing(lambda message, is_loss: (words in message) == is_loss) == []


def test_no_word_is_one_to_avoid() -> None:
    avoided = re.compile(rf"\b({'|'.join(map(re.escape, AVOIDED))})\b", re.IGNORECASE)
    assert failing(lambda message, _: not avoided.search(message)) == []


def test_no_probability_is_told_twice() -> None:
    def rule(message: str, _: bool) -> bool:
        before, _details, details = message.partition("Details: ")
        given = re.findall(r" is ((?:above |below )?\d\.\d\d)(?=\.)", details)
        told = details.count("The probability")
        return "probability" not in before and told == len(given) == len(set(given))

    assert failing(rule) == []


def test_what_the_report_says_of_the_watch_keeps_to_the_same_words() -> None:
    avoided = re.compile(rf"\b({'|'.join(map(re.escape, AVOIDED))})\b", re.IGNORECASE)
    for change in changes():
        quiet = replace(change, evidence_years=0.077)
        for each in (change, quiet):
            assert not avoided.search(watch_words([watched(each, ())], HANGER_3))
