"""What holds of a hanger after a test: the only place that decides what is reported.

A condition begins once its probability reaches the level that the owner asked for, and ends once
tests of two visits have it below half of that: a probability that hovers about the level does not
ring every week, and a van that stands on the deck for a day ends nothing. What is new of the
conditions is reported, once.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from typing import Literal

from shm.documents import value_of
from shm.errors import BadInput
from shm.values import TENSION, AlertKind, Change, Drift, RepeatedMistake, Thresholds, WatchedTest
from shm.values.drift import OF_ONE_VISIT

Way = Literal["up", "down"]
BEYOND: AlertKind = "beyond threshold"
REPEAT: AlertKind = "repeat the test"
DISAGREE: AlertKind = "tests disagree"
BASELINE: AlertKind = "check the baseline"
MODES: AlertKind = "check the modes"
CALLS: tuple[AlertKind, ...] = ("sudden change", "slow drift")
NO_LOAD = 0.1
"""Of the tension (judgement): no lift and no lorry beside the hanger takes or gives as much."""
_ODD = 0.9  # nine to one: a notice that is wrong costs a test
_IN_A_ROW = 3  # tests that fit nothing: no longer bad luck


@dataclass(frozen=True)
class Condition:
    """Something that holds of a hanger.

    `about` is the quantity or mode, `way` to which side it went, where there is one. It holds
    `since` a time and looks over since another, `fading`. What is `improbable` to the watch all
    along, as two tests that agree whatever their clocks say, ends once the shift has come back.
    `number` counts the detected changes.
    """

    kind: AlertKind
    about: str = ""
    way: Way | None = None
    number: int = 0
    since: datetime | None = field(default=None, compare=False)
    fading: datetime | None = field(default=None, compare=False)
    improbable: bool = field(default=False, compare=False)


@dataclass(frozen=True)
class State:
    """What the conditions of a hanger follow from, after its `latest` test.

    `standing` are the conditions that were reported and still held at the test before; `called` the
    detected changes, `odd` how many tests in a row fit nothing, `mistaken` the modes that the last
    tests have wrong.
    """

    standing: frozenset[Condition] = frozenset()
    called: tuple[Change, ...] = ()
    odd: int = 0
    mistaken: tuple[RepeatedMistake, ...] = ()
    latest: WatchedTest | None = None

    def with_test(self, test: WatchedTest) -> State:
        """Return the state with one more test."""
        odd = self.odd + 1 if test.change.outlier_probability > _ODD else 0
        return replace(self, odd=odd, mistaken=test.mistaken, latest=test)

    def with_reported(self, holding: frozenset[Condition], news: frozenset[Condition]) -> State:
        """Return the state with what still holds of what was reported, and `news`."""
        standing = frozenset(each for each in holding if each in self.standing)
        called = self.called
        if not any(each.kind in CALLS for each in standing | news) and not standing:
            called = ()
        if self.latest is not None and self.latest.change.called:
            called = (*called, self.latest.change)
        return replace(self, standing=standing | news, called=called)

    @property
    def beyond(self) -> Mapping[tuple[str, Way], datetime | None]:
        """Since when each quantity is beyond its threshold, and to which side."""
        return {
            (each.about, each.way): each.since
            for each in self.standing
            if each.kind == BEYOND and each.way
        }

    def to_text(self) -> str:
        """Return JSON, from which `from_text` makes an equal one; the latest test is left out."""
        standing = sorted(self.standing, key=lambda each: (each.kind, each.about, each.number))
        return json.dumps(
            {
                "standing": [asdict(each) for each in standing],
                "called": [asdict(change) for change in self.called],
                "odd": self.odd,
                "mistaken": [asdict(each) for each in self.mistaken],
            },
            default=datetime.isoformat,
        )

    @classmethod
    def from_text(cls, text: str) -> State:
        """Return what `to_text` wrote, nothing where the text is empty; raises BadInput for
        another."""
        if not text:
            return cls()
        try:
            kept = json.loads(text)
            if "standing" not in kept:
                return cls(_from_version_1_0_0(kept))
            return cls(
                frozenset(value_of(tuple[Condition, ...], kept["standing"])),
                value_of(tuple[Change, ...], kept["called"]),
                int(kept["odd"]),
                value_of(tuple[RepeatedMistake, ...], kept["mistaken"]),
            )
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise BadInput(
                f"what was told of a hanger cannot be read: {error!r}.",
                remedy="Go over the hanger's tests from its baseline on.",
            ) from error


def _from_version_1_0_0(kept: Mapping[str, object]) -> frozenset[Condition]:
    """Return the conditions that version 1.0.0 kept; raises KeyError for another document."""
    beyond = value_of(tuple[tuple[str, Way, datetime], ...], kept["beyond"])
    found = {Condition(BEYOND, quantity, way, since=at) for quantity, way, at in beyond}
    if kept["call"]:
        found.add(Condition(CALLS[0], number=1, since=value_of(datetime, kept["call"])))
    return frozenset(found)


def conditions(state: State, thresholds: Thresholds, now: datetime) -> frozenset[Condition]:
    """Return what holds of a hanger after the latest test of its state, at its time `now`."""
    test = state.latest
    if test is None:
        return state.standing
    held = {each: each for each in _holding(state, test, thresholds.end_probability, now)}
    is_call = test.change.called and not _is_known(test.change, held)
    found = list(_beyond(test, thresholds.alert_probability, is_call=is_call))
    if is_call:
        kind = CALLS[0] if test.change.sudden >= 0.5 else CALLS[1]
        number = 1 + sum(each.kind in CALLS for each in state.standing)
        about, way = _first(test.change)
        found.append(Condition(kind, about, way, number))
    found += _baseline(test)
    if state.odd:
        found.append(Condition(REPEAT))
    if state.odd >= _IN_A_ROW:
        found.append(Condition(DISAGREE))
    found += _modes(test)
    for each in found:
        held.setdefault(each, replace(each, since=now))
    return frozenset(held.values())


def _holding(state: State, test: WatchedTest, end: float, now: datetime) -> Iterator[Condition]:
    """Yield those of the reported conditions that still hold."""
    drifts = {each.quantity: each for each in test.drifts}
    for each in state.standing:
        if each.kind in CALLS:
            if not test.change.probability < end:
                yield each
            continue
        if each.kind not in (BEYOND, BASELINE):
            continue  # they hold as long as tests show them anew
        is_over = each.kind == BASELINE and not test.change.is_baseline_alone
        if each.kind == BEYOND:
            is_over = _is_over(each, drifts.get(each.about), end)
        since = each.fading or now
        if not is_over:
            yield replace(each, fading=None)
        elif now - since <= OF_ONE_VISIT:
            yield replace(each, fading=since)


def _is_over(each: Condition, drift: Drift | None, end: float) -> bool:
    """Return whether a shift is no longer beyond its threshold; not where it is unknown."""
    if drift is None:
        return False
    probability = drift.probability * (way_of(drift.shift_mean) == each.way)
    is_back = not drift.may_be_beyond(-1.0 if each.way == "down" else 1.0)
    return probability < end and (is_back or not each.improbable)


def _beyond(test: WatchedTest, level: float, *, is_call: bool) -> Iterator[Condition]:
    """Yield the quantities that are beyond their thresholds as surely as was asked for."""
    for drift in test.told if is_call else test.drifts:
        if drift.probability >= level:
            yield Condition(BEYOND, drift.quantity, way_of(drift.shift_mean))


def _baseline(test: WatchedTest) -> Iterator[Condition]:
    """Yield that the baseline does not fit: a loss kept for a notice is silent for as long as
    nobody looks, so that a shift of the tension that no load explains is beyond its threshold,
    where it is likelier the tension than anything else that changed if the baseline was sound."""
    if not test.change.is_baseline_alone:
        return
    moved = {each.quantity: each.probability for each in test.change.moved}
    for drift in test.drifts:
        is_far = abs(drift.shift_mean) > max(NO_LOAD, drift.threshold)
        is_likeliest = moved.get(TENSION, 1.0) > 0.5
        if drift.quantity == TENSION and drift.is_clearly_beyond and is_far and is_likeliest:
            yield Condition(BEYOND, TENSION, way_of(drift.shift_mean), improbable=True)
            return
    yield Condition(BASELINE)


def _modes(test: WatchedTest) -> Iterator[Condition]:
    """Yield the modes that tests keep having wrong; a test that fits no state is one of them."""
    notable = [each for each in test.mistaken if each.is_notable]
    if any(each.is_misfit for each in notable):
        yield Condition(MODES, "test")
    for each in notable:
        if not each.is_misfit:
            yield Condition(MODES, f"{each.plane}-{each.order}")


def _first(change: Change) -> tuple[str, Way | None]:
    """Return what changed first of all, and its way."""
    if not change.moved:
        return "", None
    return change.moved[0].quantity, way_of(change.moved[0].shift_mean)


def _is_known(change: Change, held: Mapping[Condition, Condition]) -> bool:
    """Return whether a called change began before a condition that stands, and so is what that one
    reported."""
    first = change.moved[0] if change.moved else None
    named = {first.quantity, *first.together, *first.alike} if first else set()
    since = [
        each.since
        for each in held
        if each.since and (each.kind in CALLS or (each.kind == BEYOND and each.about in named))
    ]
    return any(change.began_by <= each for each in since)


def way_of(shift: float) -> Way:
    """Return to which side a shift goes."""
    return "down" if shift < 0 else "up"
