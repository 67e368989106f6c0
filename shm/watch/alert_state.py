"""The conditions of a hanger that were reported and still apply."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime

from shm.values import Change, Drift, Plane, RepeatedMistake, WatchedTest
from shm.values.drift import OF_ONE_VISIT
from shm.watch.agreement import Way, way_of


@dataclass(frozen=True)
class AlertState:
    """The conditions in force: when each quantity was reported beyond its threshold, and a call.

    `called` are the changes that were called, told or not: after a call the sequential test speaks
    of a further change, no longer of that one. `mistaken` are the modes that the last tests have
    wrong, `noted` those of them that were told, `alone` whether it was told that the baseline
    stands alone. `agreed` are those of `beyond` that two tests told which agree: to the watch they
    were improbable all along. `fading` says since when those of `beyond` look over that must do so
    on another day, too.
    """

    beyond: Mapping[tuple[str, Way], datetime] = field(default_factory=dict)
    call: datetime | None = None
    called: tuple[Change, ...] = ()
    odd: int = 0
    mistaken: tuple[RepeatedMistake, ...] = ()
    noted: frozenset[tuple[Plane, int]] = frozenset()
    alone: bool = False
    agreed: frozenset[tuple[str, Way]] = frozenset()
    fading: Mapping[tuple[str, Way], datetime] = field(default_factory=dict)


def still(told: AlertState, test: WatchedTest, end: float) -> AlertState:
    """Return what still stands at a test: all but what tests of two visits have below `end`.

    A van that stands on the deck for a day ends nothing; neither do unknown shifts. What two tests
    that agree have told was improbable to the watch all along: it ends once the shift has come
    back, too.
    """
    over = {
        (drift.quantity, way)
        for drift in test.drifts
        for way in ("up", "down")
        if _probability(drift, way) < end
        and not (
            (drift.quantity, way) in told.agreed
            and drift.may_be_beyond(-1.0 if way == "down" else 1.0)
        )
    }
    fading = {each: told.fading.get(each, test.time) for each in told.beyond if each in over}
    ended = {each for each, since in fading.items() if test.time - since > OF_ONE_VISIT}
    beyond = {condition: at for condition, at in told.beyond.items() if condition not in ended}
    fading = {each: since for each, since in fading.items() if each in beyond}
    agreed = told.agreed - ended
    if test.change.probability < end:
        return AlertState(beyond, odd=told.odd, alone=told.alone, agreed=agreed, fading=fading)
    return replace(told, beyond=beyond, agreed=agreed, fading=fading)


def _probability(drift: Drift, way: Way) -> float:
    """That the shift is beyond its threshold in one way; nearly none is where it went the other."""
    return drift.probability * (way_of(drift.shift_mean) == way)


def with_beyond(told: AlertState, beyond: Sequence[Drift], at: datetime) -> AlertState:
    """Return the state with shifts that were told at a test to be beyond their threshold."""
    return replace(told, beyond={**told.beyond, **dict.fromkeys(conditions(beyond), at)})


def conditions(drifts: Sequence[Drift]) -> frozenset[tuple[str, Way]]:
    """Each quantity and the way that it went."""
    return frozenset((each.quantity, way_of(each.shift_mean)) for each in drifts)
