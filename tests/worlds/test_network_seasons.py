"""The world of network-arch seasons against the whole bar, and its own promises."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.worlds.network_seasons import (
    PLANES,
    Event,
    Nuisances,
    Season,
    State,
    bridge,
    full_modes,
    reduced,
    season,
)

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product

ALONE = replace(Nuisances(), crossing_share=0.0)


@pytest.mark.parametrize("kind", ["none", "section_loss", "lamp"])
def test_the_fast_map_is_the_full_solve(kind: str) -> None:
    rng = np.random.default_rng(5)
    event = Event(kind, size=0.2 if kind != "none" else 0.0)
    for i, hanger in enumerate(bridge(4, 12, Nuisances())[::3]):
        fast = reduced(hanger, PLANES[i % 2], event, True, 8)
        whole = fast.parts[False].beam
        places = whole.marks_m
        for _ in range(3):
            state = State(
                hanger.tension_n * rng.uniform(0.85, 1.1),
                rng.uniform(hanger.slip_factor, hanger.stick_factor),
                (rng.uniform(0.3, 1.2), rng.uniform(0.3, 1.2)),
                rng.uniform(-20, 30),
                ((0.45, places[int(rng.integers(len(places)))]),),
                kind == "section_loss",
            )
            expected = full_modes(whole, state, 6)[0]
            assert fast.modes([state], 6)[0][0] == pytest.approx(expected, rel=1e-5)


def test_without_nuisances_the_frequencies_are_exact_and_constant() -> None:
    calm = season(7, hangers=5, nuisances=Nuisances.none())
    hangers = bridge(7, 5, Nuisances.none())
    for record, hanger in zip(calm.hangers, hangers, strict=True):
        assert record.description["length_m"] == hanger.length_m
        assert record.truth["tension_n"] == pytest.approx(hanger.description["nominal_tension_n"])
        for plane in PLANES:
            beam = hanger.beam(plane, Event(), ())
            expected = full_modes(beam, State(hanger.tension_n), 6)[0]
            for visit in record.visits:
                modes = [m for m in visit["modes"] if m["plane"] == plane]
                assert len(modes) >= 4
                read = [m["frequency_hz"] for m in modes]
                assert read == pytest.approx(expected[: len(read)], rel=1e-5)
        assert not record.truth["mistaken"]


def _flat(of: Season) -> list[Any]:
    return [(h.name, h.description, h.visits, h.operators) for h in of.hangers]


def test_same_seed_same_season_and_plain_json() -> None:
    first, second, other = season(11, 6), season(11, 6), season(12, 6)
    assert json.dumps(_flat(first)) == json.dumps(_flat(second)) != json.dumps(_flat(other))


def _shift(kind: str, size: float, **more: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Relative shifts (visit, plane, order) of the event's hanger 3; of hangers 0 to 7 (max)."""
    event = Event(kind, 3, 400.0, size, **more)
    plain, struck = (season(21, 8, event=e, nuisances=ALONE) for e in (None, event))
    shifts = []
    for a, b in zip(plain.hangers, struck.hangers, strict=True):
        assert [v["time"] for v in a.visits] == [v["time"] for v in b.visits]
        rows = [b.truth["frequency_hz"][p] / a.truth["frequency_hz"][p] - 1 for p in PLANES]
        swapped = {k for k, _ in b.truth["swapped"]}
        own = np.array([v["id"] not in swapped for v in b.visits])
        shifts.append(np.stack(rows, axis=1) * own[:, None, None])
    days = np.array(struck.hangers[3].truth["day"])
    assert np.abs(shifts[3][days < 400]).max() < 1e-5
    return shifts[3][days >= 400], days, np.array([np.abs(s).max() for s in shifts])


@pytest.mark.parametrize(
    ("kind", "size"),
    [("springs", 0.3), ("lamp", 4.0), ("section_loss", 0.2), ("sensor_moved", 0.25)],
)
def test_a_local_event_stays_in_its_hanger(kind: str, size: float) -> None:
    own, _, largest = _shift(kind, size)
    assert np.abs(own).max() > 2e-4
    assert np.delete(largest, 3).max() == 0.0
    if kind == "springs":
        assert own.max() < 1e-5


def test_a_step_of_tension_is_carried_by_the_neighbours() -> None:
    own, _, largest = _shift("tension_step", -0.05)
    assert np.median(own[:, :, 0]) == pytest.approx(-0.025, rel=0.15)
    assert 0 < largest[4] < 0.4 * largest[3]
    alone = season(21, 8, event=Event("tension_step", 3, 400.0, -0.05), nuisances=ALONE)
    truth = alone.hangers[3].truth
    base, days = truth["baseline_tension_n"], np.array(truth["day"])
    years = days / 365.25
    expected = truth["reference_tension_n"] * (1 + truth["settlement_per_year"] * years)
    assert base == pytest.approx(expected * np.where(days >= 400, 0.95, 1.0), rel=1e-9)


def test_season_is_as_faulty_as_promised() -> None:
    whole = season(1)
    visits = [v for h in whole.hangers for v in h.visits]
    modes = sum(len(v["modes"]) for v in visits)
    wrong = sum(len(h.truth["mistaken"]) for h in whole.hangers)
    assert 0.02 < wrong / modes < 0.06
    assert 0.1 < np.mean(["temperature_c" not in v for v in visits]) < 0.3
    counts = sorted(len(h.visits) for h in whole.hangers)
    assert counts[0] < 20
    assert counts[-1] > 100
    for visit in visits:
        names = [(m["plane"], m["order"]) for m in visit["modes"]]
        assert len(set(names)) == len(names)
        assert all(m["frequency_sd_hz"] > 0 for m in visit["modes"])
