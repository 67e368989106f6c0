"""The pattern over the bridge: who shed load, who took it up, and when it is no hanger at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from shm.errors import NothingThere
from shm.values import Drift, FloatArray
from shm.watch.neighbours import BridgePattern, HangerShift, NeighbourOptions, shifts_of
from shm.watch.words.neighbours_words import bridge_pattern

NOW = datetime(2026, 5, 1, tzinfo=UTC)
NOISE = 0.003
HANGERS = 20
ORDER = tuple(range(1, HANGERS + 1))
OPTIONS = NeighbourOptions()
CALIBRATION_RUNS = 100
QUIET_RUNS = 60


def tensions(rng: np.random.Generator) -> FloatArray:
    return np.asarray(700e3 * np.clip(1 + 0.15 * rng.standard_normal(HANGERS), 0.5, 2))


def shed(baseline: FloatArray, index: int, fraction: float, shares: Sequence[float]) -> FloatArray:
    """Shifts where one hanger loses a fraction of its tension to those within two places."""
    shift, lost = np.zeros(len(baseline)), fraction * baseline[index]
    shift[index] -= lost
    for step, share in zip((-2, -1, 1, 2), shares, strict=True):
        if 0 <= index + step < len(baseline):
            shift[index + step] += share * lost
    return shift


def measured(
    rng: np.random.Generator,
    baseline: FloatArray,
    shift: FloatArray,
    missing: Sequence[int] = (),
    stated: float = 1.0,
) -> list[HangerShift]:
    """Shifts with noise; hangers count from 1. `stated` is the stated noise over the true one."""
    sd = NOISE * baseline
    seen = shift + sd * rng.standard_normal(len(baseline))
    return [
        HangerShift(i + 1, i, NOW, baseline[i], seen[i], stated * sd[i])
        for i in range(len(baseline))
        if i + 1 not in missing
    ]


def named(pattern: BridgePattern) -> str:
    best = pattern.explanations[0]
    return best.name if best.probability >= OPTIONS.named_from else "undecided"


def sure(shift_n: dict[int, float], **changes: object) -> list[HangerShift]:
    """Twelve hangers of 700 kN, nearly noiseless, at rest but for `shift_n`."""
    return [
        replace(HangerShift(i, i - 1, NOW, 700e3, shift_n.get(i, 0.0), 1.5e3), **changes)  # type: ignore[arg-type]
        for i in range(1, 13)
    ]


# ---------------------------------------------------------------- simulated bridges


@pytest.mark.trial
def test_shed_load_is_named_with_the_right_hanger() -> None:
    rng, right = np.random.default_rng(1), 0
    for _ in range(CALIBRATION_RUNS):
        baseline, index = tensions(rng), int(rng.integers(HANGERS))
        shift = shed(baseline, index, 0.05, rng.dirichlet([1.5, 4, 4, 1.5]))
        pattern = bridge_pattern(measured(rng, baseline, shift), ORDER)
        right += named(pattern) == "load redistribution" and pattern.suspects[0].hangers == (
            index + 1,
        )
    assert right >= 0.95 * CALIBRATION_RUNS


@pytest.mark.trial
@pytest.mark.parametrize(("stated", "false_names"), [(1.0, 1), (0.6, 3)])
def test_a_bridge_at_rest_is_not_accused_even_where_the_noise_is_understated(
    stated: float, false_names: int
) -> None:
    rng, wrong = np.random.default_rng(2), 0
    for _ in range(QUIET_RUNS):
        baseline = tensions(rng)
        shifts = measured(rng, baseline, np.zeros(HANGERS), stated=stated)
        wrong += named(bridge_pattern(shifts)) not in ("no change", "undecided")
    assert wrong <= false_names


def test_a_common_shift_is_named_and_not_put_down_to_a_hanger() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        baseline = tensions(rng)
        pattern = bridge_pattern(measured(rng, baseline, -0.01 * baseline))
        assert named(pattern) == "common shift"
        assert pattern.alike_fraction == pytest.approx(-0.01, abs=0.003)
        assert pattern.sentence.startswith("All hangers shifted alike, by -")


def test_two_hangers_that_shed_at_once_are_both_named() -> None:
    rng, right = np.random.default_rng(4), 0
    for _ in range(20):
        baseline = tensions(rng)
        shares = rng.dirichlet([1.5, 4, 4, 1.5], 2)
        shift = shed(baseline, 4, 0.05, shares[0]) + shed(baseline, 12, 0.04, shares[1])
        pattern = bridge_pattern(measured(rng, baseline, shift))
        right += named(pattern) == "load redistribution" and pattern.suspects[0].hangers == (5, 13)
    assert right >= 19


# ---------------------------------------------------------------- what the owner reads


def test_the_sentence_says_who_lost_and_who_took_it_up() -> None:
    pattern = bridge_pattern(sure({6: 16e3, 7: -34e3, 8: 15e3, 9: 3e3}))
    assert pattern.explanations[0].name == "load redistribution"
    assert pattern.sentence.startswith(
        "Load has moved from hanger 7 to its neighbours. Hanger 7 lost 34.0 ± 2.5 kN. "
        "Hangers 6 and 8 beside it took up 31.0 ± 3.5 kN of it."
    )
    ways = {row.hanger: row.way for row in pattern.rows if row.way != "unchanged"}
    assert ways == {6: "gained", 7: "lost", 8: "gained"}
    kept = pattern.sum_kept
    assert kept.hangers == (5, 6, 7, 8, 9)
    assert kept.complete
    assert kept.sum_n == pytest.approx(0, abs=1)
    assert kept.probability > 0.99


def test_a_loss_at_the_end_of_the_bridge_says_that_the_end_may_carry_a_part() -> None:
    pattern = bridge_pattern(sure({1: -34e3, 2: 12e3, 3: 5e3}))
    assert pattern.suspects[0].hangers == (1,)
    assert named(pattern) == "load redistribution"
    assert not pattern.sum_kept.complete
    assert "bridge's end" in pattern.remarks[1]


# ---------------------------------------------------------------- which tests are compared


def test_tests_older_than_the_window_are_listed_and_not_compared() -> None:
    shifts = sure({7: -34e3, 6: 16e3, 8: 18e3})
    shifts[0] = replace(shifts[0], time=NOW - timedelta(days=31), shift_n=-90e3)
    shifts[1] = replace(shifts[1], time=NOW - timedelta(days=29))
    pattern = bridge_pattern(shifts, (*range(1, 13), 40))
    assert [(each.hanger, each.time) for each in pattern.not_compared] == [
        (1, shifts[0].time),
        (40, None),
    ]
    assert [row.hanger for row in pattern.rows] == list(range(2, 13))
    assert pattern.suspects[0].hangers == (7,)


@pytest.mark.parametrize("old", [False, True])
def test_fewer_than_three_hangers_make_no_pattern(old: bool) -> None:
    shifts = sure({})[:3] if old else sure({})[:2]
    if old:
        shifts[0] = replace(shifts[0], time=NOW - timedelta(days=99))
    with pytest.raises(NothingThere, match="only 2 of the hangers"):
        bridge_pattern(shifts)


def test_shifts_are_the_latest_known_drifts_of_the_tension_in_their_order() -> None:
    def drift(hanger: int, day: int, shift: float, quantity: str = "tension") -> Drift:
        time = NOW + timedelta(days=day)
        return Drift(hanger, f"t{day}", time, quantity, 700e3, 0, shift, 0.002, 0.05, 0.1)

    drifts = {
        4: [drift(4, 2, -0.03), drift(4, 1, 0.5), drift(4, 3, 0.2, "log10_k1")],
        9: [drift(9, 1, 0.01), drift(9, 2, float("nan"))],
        5: [drift(5, 1, 0.1, "log10_k1")],
    }
    found = shifts_of(drifts, (9, 7, 5, 4))
    assert [(each.hanger, each.place) for each in found] == [(9, 0), (4, 3)]
    assert [each.shift_n for each in found] == pytest.approx([7e3, -21e3])
    assert [each.shift_sd_n for each in found] == pytest.approx([1.4e3, 1.4e3])
