"""The proof of the seasons' world: frame against statics, then events."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.worlds.tied_arch_seasons import (
    ORDERS,
    PLANES,
    Array,
    Bar,
    Event,
    Frame,
    Nuisances,
    Season,
    State,
    frequencies,
    frequencies_full,
    season,
)

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product

BAR = Bar(9.0, 0.08, 2.05e11, 7850.0, own_weight=False)


def _state(tension: float, springs: Any = 0.0, kg: float = 0.0, at_m: float = 1.8) -> State:
    both = np.broadcast_to(np.asarray(springs, dtype=float), (1, 2, 2))
    one = (np.array([v]) for v in (10.0, kg, at_m))
    return State(np.array([tension]), both, *one)


@cache
def _season(event: Event = Event(), nuisances: Nuisances = Nuisances(), seed: int = 5) -> Season:  # noqa: B008
    return season(seed, 8, years=1.5, event=event, nuisances=nuisances)


def _exact(s: Season, number: int) -> Array:
    """(visit, plane, order), not a number where the neighbour was tested."""
    rows = s.hangers[number].truth["visits"]
    return np.array([[row["exact_hz"][p] for p in PLANES] for row in rows])


def _rows(s: Season, number: int, name: str) -> Array:
    return np.array([row[name] for row in s.hangers[number].truth["visits"]])


# ------------------------------------------------------------------------------------------- bar


def test_basis_of_a_season_gives_the_full_solution_at_every_visit() -> None:
    rng, count = np.random.default_rng(1), 30
    bar = replace(BAR, own_weight=True, fork=(0.2, 3.0, 2.0), flexibility_m_per_n=(5e-9, 2e-9))
    springs = 10 ** rng.uniform(4.8, 6.8, (count, 2, 2))
    states = State(
        rng.uniform(3.2e5, 4.4e5, count),
        springs,
        rng.uniform(-15, 40, count),
        rng.uniform(0.2, 0.45, count),
        rng.uniform(1.0, 4.0, count),
    )
    found = frequencies(bar, states)[0]
    full = np.array([frequencies_full(bar, states, v) for v in range(count)])
    assert np.abs(found / full - 1).max() < 1e-5


# ----------------------------------------------------------------------------------------- frame


def _frame(places: Array, lengths: Array, area: Array) -> Frame:
    stiffness = tuple((2.1e11 * area / lengths).tolist())
    return Frame(80.0, 14.0, tuple(places.tolist()), stiffness, tuple(lengths.tolist()))


PLACES, LENGTHS = np.array([9.0, 18.0, 30.0, 43.0, 55.0, 70.0]), np.array([5.0, 9, 12, 13, 11, 6])
AREAS = np.array([3.0, 4, 5, 5, 4, 6]) * 1e-3
FRAME = _frame(PLACES, LENGTHS, AREAS)


def test_losing_a_hanger_is_the_frame_without_it() -> None:
    gone = list(FRAME.hanger_stiffness_n_m)
    gone[2] *= 1e-9
    without = replace(FRAME, hanger_stiffness_n_m=tuple(gone))
    load, pull = FRAME.unit(line_n_m=5e4), FRAME.unit(longer_m=(0, 0, 1.0, 0, 0, 0))
    (whole, unit), (other,) = FRAME.respond([load, pull]), without.respond([load])
    c = unit.tension_n
    handed = whole.tension_n - whole.tension_n[2] * c / c[2]
    assert handed == pytest.approx(other.tension_n, abs=1.0)
    assert handed[1] > whole.tension_n[1]
    assert handed[3] > whole.tension_n[3]


# ---------------------------------------------------------------------------------------- season


def test_same_seed_same_season() -> None:
    first, again = _season(), season(5, 8, years=1.5)
    assert [h.visits for h in first.hangers.values()] == [h.visits for h in again.hangers.values()]
    assert _season(seed=6).hangers[1].visits != first.hangers[1].visits


def test_nuisances_off_the_frequencies_are_those_of_the_described_bar() -> None:
    s = _season(nuisances=Nuisances.none())
    for h in s.hangers.values():
        d, rows = h.description, h.truth["visits"]
        bar = Bar(
            d["length_m"], d["diameter_m"], d["elastic_modulus_pa"], d["density_kg_m3"], False
        )
        exact = frequencies_full(bar, _state(d["nominal_tension_n"], h.truth["springs_nm_rad"]), 0)
        for visit, row in zip(h.visits, rows, strict=True):
            read = np.array([m["frequency_hz"] for m in visit["modes"]]).reshape(2, ORDERS)
            assert read == pytest.approx(exact[:, :ORDERS], rel=1e-6)
            assert visit["temperature_c"] == 10.0
            assert row["tension_n"] == pytest.approx(d["nominal_tension_n"], rel=1e-12)
        assert not h.truth["mistaken"]


def test_an_event_of_one_bar_moves_that_bar_alone_and_from_its_day() -> None:
    quiet = _season()
    planted = {
        "springs": Event("springs", 3, 250.0, 1 / 3, end="arch", planes=("transverse",)),
        "lamp": Event("lamp", 3, 250.0, 8.0),
        "section_loss": Event("section_loss", 3, 250.0, 0.15),
        "sensor_moved": Event("sensor_moved", 3, 250.0, 0.45, place=0.5),
    }
    for event in planted.values():
        s = _season(event)
        own = _rows(s, 3, "tested_hanger") == 3
        late = (_rows(s, 3, "day") >= 250) & own
        ratio = _exact(s, 3) / _exact(quiet, 3)
        assert ratio[~late] == pytest.approx(1.0, abs=1e-5)
        assert np.abs(ratio[late, 0] - 1).max(axis=1).min() > 1e-4
        assert _rows(s, 3, "tension_n").tolist() == _rows(quiet, 3, "tension_n").tolist()
        if event.kind == "springs":
            assert ratio[late, 1] == pytest.approx(1.0, abs=1e-5)
        others = [k for k in s.hangers if k not in (2, 3, 4)]  # neighbours may go astray to it
        assert all(s.hangers[k].visits == quiet.hangers[k].visits for k in others)
        assert {k for k, h in s.hangers.items() if h.truth["concerned"]} == {3}
