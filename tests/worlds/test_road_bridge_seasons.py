"""The road bridge's world: its physics, its events, and what separates a test from the truth."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.worlds.road_bridge_seasons import (
    GAINED,
    PLANES,
    Event,
    Nuisances,
    Season,
    bridge,
    neighbours,
    season,
)

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product

QUIET = Event()
DAY = 540.0


@cache
def _quiet(seed: int = 4) -> Season:
    return season(seed, years=2.2, event=QUIET, nuisances=Nuisances.none())


def _with(event: Event, seed: int = 4, **on: bool) -> Season:
    return season(seed, years=2.2, event=event, nuisances=Nuisances.none(**on))


def _tested_after(seed: int = 4) -> list[int]:
    """Return the numbers of hangers with tests on both sides of the day."""
    return [
        number
        for number, each in enumerate(_quiet(seed).hangers)
        if (each.truth["day"] < DAY).sum() > 2 and (each.truth["day"] > DAY).sum() > 2
    ]


def test_frequencies_without_nuisances_are_those_of_the_bar() -> None:
    for each in _quiet().hangers[:6]:
        truth = each.truth
        wanted = [
            truth["bar"]
            .plane(p)
            .solve(truth["built_tension_n"], tuple(truth["springs_nm_rad"][p]), count=5)
            for p in range(len(PLANES))
        ]
        assert truth["exact_hz"] == pytest.approx(
            np.broadcast_to(wanted, truth["exact_hz"].shape), rel=1e-6
        )
        read = [mode["frequency_hz"] for mode in each.visits[0]["modes"]]
        assert read == pytest.approx(np.ravel(wanted), rel=1e-4)
        assert truth["tension_n"] == pytest.approx(truth["built_tension_n"])


@pytest.mark.parametrize("number", [0, 5])
def test_temperature_moves_the_tension_by_the_coefficients(number: int) -> None:
    found = _with(QUIET, temperature=True).hangers[number].truth
    built = bridge(4)[number]
    warmer = found["hanger_c"] - found["deck_c"]
    columns = np.stack([np.ones_like(warmer), found["deck_c"] - 10, warmer], 1)
    fitted = np.linalg.lstsq(columns, found["tension_n"] / built.tension_n, rcond=None)[0]
    assert fitted == pytest.approx([1, built.per_k, built.warmer_per_k], rel=1e-8)
    assert 5e-4 <= abs(built.per_k) <= 3e-3
    low, high = found["exact_hz"][:, 0, 0][np.argsort(found["tension_n"])[[0, -1]]]
    pulled = np.ptp(found["tension_n"]) / built.tension_n
    assert high / low - 1 == pytest.approx(pulled / 2, abs=0.3 * pulled + 5e-3)


@pytest.mark.parametrize("size", [-0.10, -0.01])
def test_a_lost_tension_goes_to_the_neighbours(size: float) -> None:
    number = 6
    found = _with(Event("tension_step", number, DAY, size))
    built = [each.tension_n for each in bridge(4)]
    lasts = found.hangers[number].truth
    after = lasts["day"] >= DAY
    assert lasts["baseline_tension_n"][after] == pytest.approx((1 + size) * built[number])
    assert lasts["baseline_tension_n"][~after] == pytest.approx(built[number])
    for other in neighbours(number):
        truth = found.hangers[other].truth
        gained = truth["baseline_tension_n"] - built[other]
        assert gained == pytest.approx(
            np.where(truth["day"] >= DAY, -size * GAINED * built[number], 0.0), abs=1e-6
        )
        assert truth["gained_from_neighbours"] * built[other] == pytest.approx(gained, abs=1e-6)


@pytest.mark.parametrize(
    ("kind", "size"),
    [("springs", 1 / 3), ("springs", 0.1), ("lamp", 20.0), ("section_loss", 0.08)],
)
def test_events_that_keep_the_tension_move_frequencies(kind: str, size: float) -> None:
    for number in _tested_after()[::9]:
        found = _with(Event(kind, number, DAY, size, end="arch")).hangers[number].truth
        quiet = _quiet().hangers[number].truth
        after = found["day"] >= DAY
        ratio = found["exact_hz"] / quiet["exact_hz"]
        assert ratio[~after] == pytest.approx(1.0, abs=1e-12)
        assert found["baseline_tension_n"] == pytest.approx(quiet["baseline_tension_n"])
        moved = np.abs(ratio[after] - 1).max()
        assert 2e-5 < moved < 0.3
        if kind != "section_loss":
            assert (ratio[after] <= 1 + 1e-9).all()


def test_an_event_leaves_other_hangers_alone() -> None:
    quiet, found = (
        season(9, years=2.0, event=QUIET),
        season(9, years=2.0, event=Event("lamp", 5, 0.0, 8.0)),
    )
    same = [a.visits == b.visits for a, b in zip(quiet.hangers, found.hangers, strict=True)]
    tests_at_it = [
        number for number in neighbours(5) if (quiet.hangers[number].truth["tested"] == 5).any()
    ]
    assert not same[5]
    assert all(each for number, each in enumerate(same) if number not in (5, *tests_at_it))


def test_a_season_is_a_function_of_its_seed() -> None:
    first, again, other = (season(seed, 4, 2.0) for seed in (5, 5, 6))
    assert [each.visits for each in first.hangers] == [each.visits for each in again.hangers]
    assert [each.visits for each in first.hangers] != [each.visits for each in other.hangers]
    whole = season(5, years=2.0)
    for each in first.hangers:
        assert each.visits == whole.hangers[each.truth["number"]].visits


def test_errors_are_as_stated_or_half_as_large_again() -> None:
    errors = []
    for seed in range(2):
        found = _with(QUIET, seed=seed, scatter=True, misstated=True)
        for each in found.hangers:
            for visit, exact in zip(each.visits, each.truth["exact_hz"], strict=True):
                read = np.array([m["frequency_hz"] for m in visit["modes"]])
                stated = np.array([m["frequency_sd_hz"] for m in visit["modes"]])
                errors.append(np.sqrt(np.mean(((read - exact.ravel()) / stated) ** 2)))
    ratio = np.sqrt(np.mean(np.square(errors)))
    assert ratio == pytest.approx(np.sqrt(0.7 + 0.3 * 1.5**2), rel=0.02)


def test_visits_have_the_faults_of_the_field() -> None:
    causes: dict[str, int] = {}
    tests = iced = no_temperature = no_level = 0
    for seed in range(4):
        for each in season(seed, years=3.0, event=QUIET).hangers:
            truth = each.truth
            days = truth["day"]
            assert (np.diff(days) > 0).all()
            assert len(days) == len(each.visits)
            tests += len(days)
            for mistake in truth["mistaken"]:
                causes[mistake["cause"]] = causes.get(mistake["cause"], 0) + 1
            iced += int((truth["coating_kg_m"] > 0).sum())
            assert (truth["air_c"][truth["coating_kg_m"] > 0] < -1).all()
            no_temperature += sum("temperature_c" not in visit for visit in each.visits)
            no_level += sum("amplitude" not in visit for visit in each.visits)
    assert 0.03 < causes["gross"] / tests < 0.05
    assert 0.15 < causes["order"] / (4 * 24) < 0.35
    assert 0.15 < causes["neighbour"] / (4 * 24) < 0.35
    assert 0.005 < iced / tests < 0.08
    assert 0.1 < no_temperature / tests < 0.2
    assert 0.25 < no_level / tests < 0.35
