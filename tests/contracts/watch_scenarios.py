"""The scenarios of the watch as one table: a history, what is reported of it, when, and why.

Each history is one of readings (`tests.helpers.synthetic_readings`), of which the first is the
baseline. Nothing of the watch but its result is asked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.values import Reading, WatchedQuantity
from tests.helpers.synthetic_readings import (
    BOTH_ENDS,
    PLANES_ALONE,
    SPRING_STEP,
    TENSION_ALONE,
    History,
    columns,
    off_by,
    shifted,
)

CHANGE_AT = 10
QUIET = History(tests=24, outliers=0, seasons_k=5)
CALM = History(tests=13, outliers=0)
Make = Callable[[], Sequence[Reading]]


@dataclass(frozen=True)
class Scenario:
    """One history and what is to be reported of it.

    The first detection is of a test from `first` to `last`, both counted from 0; of none where
    `first` is None. It names `cause` first, where one is given. `is_baseline_doubted` says whether
    the baseline must be doubted after the last test. `why` states the reason in a few words.
    """

    name: str
    why: str
    make: Make
    first: int | None = None
    last: int = 0
    cause: str = ""
    quantities: tuple[WatchedQuantity, ...] = TENSION_ALONE
    is_baseline_doubted: bool = False


def lose(fraction: float) -> list[float]:
    """Return the coordinate of a tension that has lost a fraction."""
    return [math.log(1 - fraction)]


def load(readings: Sequence[Reading], tests: Sequence[int], by: float = 0.04) -> list[Reading]:
    """Return readings of which some have another tension, as under a van on the deck."""
    found = list(readings)
    for test in tests:
        found = shifted(found, test, [by])
    return found


def simulate(history: History, seed: int = 0) -> Make:
    """Return what makes the readings of a history."""
    return lambda: history.readings(seed)


def change(step: Sequence[float], more: int = 5, **changes: object) -> History:
    """Return a history with a step at the eleventh test."""
    known = {"tests": CHANGE_AT + more, "change_at": CHANGE_AT, "step": step, **changes}
    return replace(History(), **known)  # type: ignore[arg-type]


def loads(seed: int, tests: Sequence[int], by: float = 0.04, until: int = 24) -> Make:
    """Return what makes quiet readings with a load in some of the tests."""
    return lambda: load(QUIET.readings(seed), tests, by)[:until]


def give_now_and_then(seed: int) -> Sequence[Reading]:
    """Return readings in which a joint gives in one test of five."""
    readings = replace(QUIET, quantities=PLANES_ALONE, tests=30).readings(seed)
    giving = np.random.default_rng(0).random((2, 30))[seed] < 0.2
    for test in np.flatnonzero(giving).tolist():
        readings = shifted(readings, test, [0.0, -3 * SPRING_STEP, 0.0])
    return readings


def lose_after_odd_baseline() -> Sequence[Reading]:
    """Return readings of a disturbed baseline and a loss of 5 % at the 17th test."""
    readings = load(QUIET.readings(2), [0], 0.08)
    for test in range(16, 24):
        readings = shifted(readings, test, [-0.05])
    return readings


def go_wild(by: float, *, stays: bool) -> Sequence[Reading]:
    """Return readings of which the tenth, or all from it on, has all frequencies off alike."""
    readings = CALM.readings(5)
    after = [off_by(each, by) for each in readings[10:]] if stays else readings[10:]
    return [*readings[:9], off_by(readings[9], by), *after]


def go_wild_each_its_way() -> Sequence[Reading]:
    """Return readings of which four are wild and agree with none."""
    readings = History(tests=15, outliers=0).readings(5)
    for test, by in ((8, -0.2), (10, 0.3), (11, -0.6), (13, 0.1)):
        readings[test] = off_by(readings[test], by)
    return readings


def hang_mass() -> Sequence[Reading]:
    """Return readings of a hanger on which a mass was put."""
    of_mass, _ = columns(1).by_cause["point_mass"][4]
    return change([0.0], 4, outliers=0, mode_step=3 * of_mass).readings(0)


def list_scenarios() -> Iterator[Scenario]:
    """Yield the table."""
    for lost in (0.02, 0.05, 0.1):
        yield Scenario(
            f"loss of {lost:.0%}",
            "by the third test, under a season's swing",
            simulate(change(lose(lost), seasons_k=20)),
            CHANGE_AT,
            CHANGE_AT + 2,
        )
    slow = History(tests=34, change_at=CHANGE_AT, ramp=[-0.02], seasons_k=20)
    yield Scenario("slow loss", "before 2 % are lost", simulate(slow), CHANGE_AT, CHANGE_AT + 11)
    warm = History(tests=40, seasons_k=25, per_kelvin=0.002)
    yield Scenario("temperature", "what goes with it is no change", simulate(warm))
    yield Scenario(
        "loss of 3 % under 25 K",
        "the swing hides no loss",
        simulate(change(lose(0.03), seasons_k=25)),
        CHANGE_AT,
        CHANGE_AT + 3,
    )
    dark = History(tests=24, temperatures_missing=0.5)
    yield Scenario("temperatures missing", "what is not known is no change", simulate(dark))
    yield Scenario(
        "loss of 10 %, temperatures missing",
        "nor does it hide one",
        simulate(replace(dark, change_at=CHANGE_AT, step=lose(0.1))),
        CHANGE_AT,
        CHANGE_AT + 7,
    )
    for by in (0.03, 0.1, 0.5, 2.0, -0.9):
        yield Scenario(
            f"one test off by {by}",
            "one visit detects nothing, however far off",
            lambda by=by: shifted(History(tests=14, outliers=0).readings(1), 9, [by]),  # type: ignore[misc]
        )
    yield Scenario(
        "one test off along a spring",
        "one visit detects nothing",
        lambda: shifted(
            History(PLANES_ALONE, tests=12, outliers=0).readings(1), 9, [0, -10 * SPRING_STEP, 0]
        ),
        quantities=PLANES_ALONE,
    )
    yield Scenario(
        "loss of 30 %",
        "the second test shows it",
        simulate(change(lose(0.3), 2, outliers=0), 4),
        CHANGE_AT + 1,
        CHANGE_AT + 1,
    )
    for cause, moved in (("tension", [*lose(0.04), 0, 0]), ("log10_kx", [0, -3 * SPRING_STEP, 0])):
        yield Scenario(
            f"{cause} among springs",
            "planes tell tension from an end",
            simulate(change(moved, 8, quantities=PLANES_ALONE)),
            CHANGE_AT,
            CHANGE_AT + 7,
            cause,
            PLANES_ALONE,
        )
    yield Scenario(
        "mass", "it is named, not tension", hang_mass, CHANGE_AT, CHANGE_AT + 3, "point_mass"
    )
    for seed in (0, 1):
        yield Scenario(
            f"two tests under a van {seed}", "a van stays for two tests", loads(seed, [12, 13])
        )
        yield Scenario(
            f"load that stays {seed}", "no van stays", loads(seed, range(12, 24)), 13, 15
        )
    yield Scenario("load that never came before", "three tests", loads(4, range(14, 24)), 14, 16)
    for seed in (0, 1):
        yield Scenario(
            f"loss that comes back at once {seed}",
            "it comes and goes without a change",
            loads(seed, [9, 10, 15, 20, 21], -0.03),
        )
        yield Scenario(
            f"joint that gives now and then {seed}",
            "one test in five does so without a change",
            lambda seed=seed: give_now_and_then(seed),  # type: ignore[misc]
            quantities=PLANES_ALONE,
        )
    yield Scenario(
        "odd baseline",
        "one test against all is the odd one",
        loads(1, [0], 0.08),
        is_baseline_doubted=True,
    )
    for by, begin in ((-0.08, 2), (-0.7, 2), (-0.7, 1)):
        yield Scenario(
            f"loss of {by} from test {begin}",
            "no load does it, or two tests agree before",
            loads(0, range(begin, 12), by, 12),
            begin,
            5,
        )
    yield Scenario(
        "loss after an odd baseline",
        "the odd baseline hides nothing",
        lose_after_odd_baseline,
        17,
        19,
        is_baseline_doubted=True,
    )
    for by in (0.05, -0.3, 3.0):
        yield Scenario(
            f"wild test of {by}",
            "another hanger was hit",
            lambda by=by: go_wild(by, stays=False),  # type: ignore[misc]
        )
        yield Scenario(
            f"wild tests of {by} that stay",
            "two that agree are no blunder",
            lambda by=by: go_wild(by, stays=True),  # type: ignore[misc]
            9,
            11,
        )
    yield Scenario("wild tests, each its own way", "they agree with none", go_wild_each_its_way)
    ends = History(BOTH_ENDS, tests=12)
    for seed in range(3):
        yield Scenario(
            f"five quantities {seed}",
            "many causes, no change",
            simulate(ends, seed),
            quantities=BOTH_ENDS,
        )


SCENARIOS = {each.name: each for each in list_scenarios()}
