"""A world of seasons: years of hammer tests on the mixed hangers of a tied-arch road bridge.

Independent of the program under test: neither equations solved, nor draws, nor ideas of what is
a nuisance are shared with it.  One seed gives descriptions, tests and truth.

Bridge.  A concrete deck under two steel arches of 12 hangers each, 3 to 22 m long (a
parabola).
Round bars between forks, two of them with a turnbuckle; spiral strands between sockets; tubes
welded to plates that lie along the bridge or across it.  Four in ten lean by 2 to 10 degrees.

Hanger.  Bar of `bars.py`: tension growing with own weight, sag, fittings and
plates as stiff or heavy stretches, rotational springs, other ones at either end and in either
plane.  A spring is drawn as fixity k / (k + sqrt(T EI)), sqrt(T EI) being what the end of a long
taut bar resists with.  The modulus of steel falls by 3e-4 per K.

Temperature.  Air: season, weather of days (AR(1)) and hours.  The hanger follows in 40 minutes and
takes up to 7 K of sun, the deck in 30 hours and takes 4 K.  The tension is

    T = T_lasting (1 + a (deck - 10 deg C) + b (hanger - deck) + traffic)

with a of 0.05 to 0.3 %/K of either sign, as hanger, arch and bearings have it (what an owner knows
of it is nothing), b of -0.05 to -0.3 %/K (a bar that warms alone slackens).

Traffic moves the tension from test to test by 0.05 to 0.3 % (sd, by hanger).  Creep of the
concrete shifts up to 0.4 % a year between hangers of a side, less with the years; its sum over a
side is nought.  It is benign: below what owners call a change (`truth["creep_per_year"]`).

Tests.  Monthly, quarterly or yearly by hanger, six in ten with ten tests in the first year; left
out tests, gaps of months, second tests on the same day.  Stated standard deviations are real or,
in 3 of 10 tests, 1.5 times too small.  The sensor (20 to 300 g) sits elsewhere by 5 to 20 cm each
time.  Another person hits 1.6 to 2.5 times harder in 15 % of the tests, and one joint of a hanger
gives with the amplitude.  Below -1 deg C a third of the tests meets rime, on average 1 mm of
600 kg/m3.  Once in some histories each: orders off by one, the neighbour's modes, another logger's
clock (1e-4).  4 % of the tests have one mode wrong by 0.5 to 2 %.

A hanger that loses tension leaves 0.3 of it to either neighbour.

Levels, probabilities and rates are engineering judgement; nothing was fitted to a program's answer.
Not in it: hangers that cross, vibration of the deck, wind, mode shapes, wires that slip in bending,
a hanger's second order with its arch.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from tests.worlds import bars, seasons
from tests.worlds.bars import GRAVITY_M_S2, POISSON, Array, Matrices, Zone
from tests.worlds.seasons import KINDS, PLANES, REFERENCE_C, YEAR_D, lagged, mode

SIDE = 12
START = datetime(2019, 1, 1, tzinfo=UTC)
SETTLING_DAYS = 40  # of weather before the first test, so that the deck's lag has settled
GAINED = 0.3  # of a lost tension, by either neighbour
SOFTENING_PER_K = -3e-4  # of steel's modulus; EN 1993-1-2 has more, from 100 deg C on
STREAMS = (
    "bridge", "order", "hanger", "springs", "weather", "hours", "creep", "plan", "crew",
    "conditions", "errors", "faults", "events",
)  # fmt: skip


@dataclass(frozen=True)
class Event(seasons.Event):
    """An event; a moved sensor sits at a new place, `size` of the length."""

    place: float = 0.35


@dataclass(frozen=True)
class Nuisances(seasons.Switched):
    """Everything of the field that separates a test from the tension; each can be left out."""

    temperature: bool = True
    traffic: bool = True
    creep: bool = True
    scatter: bool = True
    misstated: bool = True
    sensor: bool = True
    amplitude: bool = True
    ice: bool = True
    faults: bool = True
    missing: bool = True


@dataclass(frozen=True)
class Bar:
    """A bar in both planes; `zones` are those of each, `shear_area_m2` has the coefficient."""

    length_m: float
    modulus_pa: float
    area_m2: float
    second_moment_m4: float
    mass_kg_m: float
    shear_area_m2: float
    inclination_deg: float = 90.0
    zones: tuple[tuple[Zone, ...], ...] = ((), ())

    @property
    def bending_nm2(self) -> float:
        """Return E I of the free bar."""
        return self.modulus_pa * self.second_moment_m4

    def plane(self, number: int) -> Plane:
        """Return the bar in one plane; across a leaning one the weight acts in the second."""
        lean = np.deg2rad(self.inclination_deg)
        made = bars.Bar(
            self.length_m, 0.0, self.bending_nm2, self.mass_kg_m,
            self.modulus_pa / (2 * (1 + POISSON)) * self.shear_area_m2,
            self.mass_kg_m * self.second_moment_m4 / self.area_m2,
            self.modulus_pa * self.area_m2,
            zones=self.zones[number],
            gravity_along_m_s2=float(GRAVITY_M_S2 * np.sin(lean)),
            gravity_across_m_s2=float(GRAVITY_M_S2 * np.cos(lean)) if number == 1 else 0.0,
        )  # fmt: skip
        return Plane(Matrices(made, elements=5))


@dataclass(frozen=True, eq=False)
class Plane:
    """A bar in one plane, of which any visit's frequencies are solved."""

    matrices: Matrices

    def solve(
        self,
        tension_n: float,
        springs: tuple[float, float],
        *,
        stiffer: float = 1.0,
        masses: Sequence[tuple[float, float]] = (),
        coating_kg_m: float = 0.0,
        count: int = 6,
    ) -> Array:
        """Return the lowest frequencies in Hz.

        `springs` are in N m/rad at the deck and arch end, `stiffer` a factor on Young's modulus,
        `masses` in kg at places.
        """
        inertia = self.matrices.with_masses(masses) + coating_kg_m * self.matrices.coating
        stiffness = self.matrices.stiffness(tension_n, springs, stiffer)
        return bars.solve(stiffness, inertia, count)[0]


@dataclass(frozen=True, eq=False)
class Hanger:
    """A hanger as built, and as its owner describes it."""

    number: int
    kind: str  # bar, strand or tube
    bar: Bar
    tension_n: float
    springs: Array  # (plane, end)
    diameter_m: float
    per_k: float
    warmer_per_k: float
    traffic: float
    gives: tuple[int, float]  # an end, and how its springs fall with the amplitude
    description: dict[str, Any]


@dataclass(eq=False)
class HangerSeason:
    """Description and tests of a hanger, what its owner knows of repairs, and the truth."""

    description: dict[str, Any]
    visits: list[dict[str, Any]]
    repairs: list[dict[str, Any]]
    truth: dict[str, Any] = field(repr=False)

    def document(self) -> dict[str, Any]:
        """Return the modal-tests document."""
        return {"schema": "shm.modes/1", "hanger": self.description["id"], "tests": self.visits}

    def toml(self) -> str:
        """Return the `[[hanger]]` table."""
        plain = {key: each for key, each in self.description.items() if key != "turnbuckle"}
        lines = ["[[hanger]]", *(f"{key} = {json.dumps(each)}" for key, each in plain.items())]
        for each in self.description.get("turnbuckle", ()):
            lines += ["", "[[hanger.turnbuckle]]"]
            lines += [f"{key} = {value}" for key, value in each.items()]
        return "\n".join(lines) + "\n"


@dataclass(frozen=True, eq=False)
class Season:
    """Years of tests on some hangers of one bridge; hangers are counted from 0."""

    hangers: list[HangerSeason]
    events: list[Event]


def draws(seed: int, stream: str, number: int = 0) -> np.random.Generator:
    """Return the stream of random numbers of one nuisance, alike whatever the others are."""
    return np.random.default_rng([seed, STREAMS.index(stream), number])


# ---------------------------------------------------------------------------------------- bridge


def bridge(seed: int) -> list[Hanger]:
    """Return the 24 hangers of a bridge, side by side from the left."""
    rng = draws(seed, "bridge")
    inner = ["tube", "strand", "bar", "strand", "strand", "tube", "bar", "strand"]
    kinds = []
    for _ in range(2):
        moved = np.roll(inner, int(rng.integers(len(inner)))).tolist()
        kinds += ["bar", "bar", *moved, "bar", "bar"]
    lengths = []
    for number in range(2 * SIDE):
        off = (number % SIDE) / ((SIDE - 1) / 2) - 1
        lengths.append((3.0 + 19.0 * (1 - off**2)) * rng.uniform(0.98, 1.0))
    long_bars = [n for n, kind in enumerate(kinds) if kind == "bar" and lengths[n] > 7.0]
    with_turnbuckle = rng.choice(long_bars, 2, replace=False).tolist()
    return [
        _hanger(seed, n, kind, lengths[n], n in with_turnbuckle) for n, kind in enumerate(kinds)
    ]


def _section(kind: str, rng: np.random.Generator, length_m: float) -> dict[str, float]:
    """Draw the section as drawn and the stress of a hanger."""
    if kind == "bar":
        d = float(rng.choice([0.045, 0.05, 0.06] if length_m < 9 else [0.06, 0.07, 0.08]))
        area, second = math.pi * d**2 / 4, math.pi * d**4 / 64
        return _drawn(d, area, second, 7850 * area, 205e9, 0.886 * area, rng.uniform(120, 280))
    if kind == "strand":
        d = float(rng.choice([0.044, 0.052, 0.06, 0.068]))
        fill = rng.uniform(0.82, 0.88)
        area, second = fill * math.pi * d**2 / 4, fill * math.pi * d**4 / 64
        return _drawn(d, area, second, 8300 * area, 160e9, 0.8 * area, rng.uniform(220, 420))
    d, wall = float(rng.choice([0.1143, 0.1397, 0.1683])), float(rng.choice([0.008, 0.01]))
    within = d - 2 * wall
    area, second = math.pi * (d**2 - within**2) / 4, math.pi * (d**4 - within**4) / 64
    return _drawn(d, area, second, 7850 * area, 208e9, 0.53 * area, rng.uniform(70, 150))


def _drawn(
    diameter_m: float, area_m2: float, second_m4: float, mass: float, modulus: float,
    shear_m2: float, stress_mpa: float,
) -> dict[str, float]:  # fmt: skip
    return {
        "diameter_m": diameter_m, "area_m2": area_m2, "second_moment_m4": second_m4,
        "mass_kg_m": mass, "modulus_pa": modulus, "shear_area_m2": shear_m2,
        "tension_n": stress_mpa * 1e6 * area_m2,
    }  # fmt: skip


def _hanger(seed: int, number: int, kind: str, length_m: float, turnbuckle: bool) -> Hanger:
    rng = draws(seed, "hanger", number)
    drawn = _section(kind, rng, length_m)
    d, wider = drawn["diameter_m"], 1 + rng.normal(0, 0.004)
    leans = rng.uniform() < 0.4
    inclination = float(rng.uniform(80, 88)) if leans else 90.0
    bends = rng.uniform(0.4, 0.95) if kind == "strand" else 1.0
    zones, fittings, ends = _fittings(kind, rng, d, length_m)
    description: dict[str, Any] = {
        "id": number + 1, "kind": "strand" if kind == "strand" else "rod",
        "length_m": round(length_m, 2), "elastic_modulus_pa": drawn["modulus_pa"],
        "nominal_tension_n": round(drawn["tension_n"] * rng.uniform(0.9, 1.1), -3),
        "fittings_m": fittings, "ends": ends,
    }  # fmt: skip
    if leans:
        description["inclination_deg"] = round(inclination + rng.normal(0, 0.3), 1)
    if kind == "bar":
        description |= {"diameter_m": d, "density_kg_m3": 7850.0}
    else:
        description |= {
            "area_m2": drawn["area_m2"], "second_moment_m4": drawn["second_moment_m4"],
            "mass_per_length_kg_m": round(drawn["mass_kg_m"], 2),
        }  # fmt: skip
    if kind == "strand":
        description["bending_stiffness_factor"] = 0.6
    if turnbuckle:
        at, sleeve = float(rng.uniform(1.2, 1.7)), float(rng.uniform(0.3, 0.45))
        stiffer, heavier = rng.uniform(3, 7), rng.uniform(2.5, 4)
        for own in zones:
            root = math.sqrt(stiffer)
            own.append(Zone(at - sleeve / 2, at + sleeve / 2, stiffer, heavier, root))
        description["turnbuckle"] = [{
            "x_m": round(at, 2), "length_m": round(sleeve, 2),
            "mass_kg": round(heavier * drawn["mass_kg_m"] * sleeve * rng.normal(1, 0.05), 1),
            "bending_stiffness_n_m2": round(
                stiffer * drawn["modulus_pa"] * drawn["second_moment_m4"] * rng.normal(1, 0.2), -3
            ),
        }]  # fmt: skip
    bar = Bar(
        length_m=length_m + rng.normal(0, 0.003),
        modulus_pa=drawn["modulus_pa"] * rng.normal(1, 0.015),
        area_m2=drawn["area_m2"] * wider**2,
        second_moment_m4=drawn["second_moment_m4"] * bends * wider**4,
        mass_kg_m=drawn["mass_kg_m"] * wider**2 * rng.normal(1, 0.003),
        shear_area_m2=drawn["shear_area_m2"] * wider**2,
        inclination_deg=inclination,
        zones=tuple(map(tuple, zones)),
    )
    tension = drawn["tension_n"]
    return Hanger(
        number=number, kind=kind, bar=bar, tension_n=tension,
        springs=_springs(seed, number, kind, math.sqrt(tension * bar.bending_nm2)),
        diameter_m=d * wider,
        per_k=float(rng.choice([-1, 1]) * rng.uniform(0.0005, 0.003)),
        warmer_per_k=-float(rng.uniform(0.0005, 0.003)),
        traffic=float(rng.uniform(0.0005, 0.003)),
        gives=(int(rng.integers(2)), float(rng.uniform(0, 0.12))),
        description=description,
    )  # fmt: skip


def _fittings(
    kind: str, rng: np.random.Generator, diameter_m: float, length_m: float
) -> tuple[list[list[Zone]], list[float], str]:
    """Draw the zones of each plane at both ends, their stated lengths and the kind of the ends."""
    if kind == "bar":
        lengths = [rng.uniform(2, 3.5) * diameter_m] * 2
        both = [(rng.uniform(3, 8),) * 2] * 2
        mass, ends = rng.uniform(2, 4), "fork"
    elif kind == "strand":
        lengths = rng.uniform(0.3, 0.6, 2).tolist()
        both = [(rng.uniform(8, 25),) * 2] * 2
        mass, ends = rng.uniform(3, 6), "socket"
    else:
        lengths = [rng.uniform(0.3, 0.6)] * 2
        plate = (rng.uniform(0.25, 0.7), rng.uniform(3, 10))
        both = [plate, plate if rng.uniform() < 0.5 else plate[::-1]]
        mass, ends = rng.uniform(1.2, 2.0), "plate"
    starts = (0.0, length_m - lengths[1])
    # A fitting that is stiffer in bending is thicker: its shear area grows by the root.
    zones = [
        [
            Zone(start, start + length, bending[plane], mass, math.sqrt(bending[plane]))
            for start, length, bending in zip(starts, lengths, both, strict=True)
        ]
        for plane in range(2)
    ]
    return zones, [round(length, 2) for length in lengths], ends


def _springs(seed: int, number: int, kind: str, taut: float) -> Array:
    """Draw the springs (plane, end) in N m/rad from their fixity."""
    rng = draws(seed, "springs", number)
    low, high = {
        "bar": ([[0.6], [0.15]], [[0.95], [0.6]]),  # the pin lies across the bridge
        "strand": ([[0.5], [0.5]], [[0.9], [0.9]]),
        "tube": ([[0.8], [0.8]], [[0.97], [0.97]]),
    }[kind]
    fixity = rng.uniform(np.array(low), np.array(high), (2, 2))
    return fixity / (1 - fixity) * taut


# -------------------------------------------------------------------------------------- weather


@dataclass(frozen=True, eq=False)
class Weather:
    """Temperatures by the hour from `SETTLING_DAYS` before the first day."""

    air: Array
    hanger: Array
    deck: Array

    def at(self, series: Array, days: Array) -> Array:
        """Return a series at days from the season's first."""
        hours = np.arange(len(series)) / 24 - SETTLING_DAYS
        return np.asarray(np.interp(days, hours, series))


def weather(seed: int, begin_day: float, years: float) -> Weather:
    """Return the weather of a season that begins `begin_day` days after New Year."""
    rng = draws(seed, "weather")
    count = math.ceil(years * YEAR_D) + SETTLING_DAYS + 3
    daily = lfilter([1.0], [1.0, -0.75], rng.normal(0, 4 * math.sqrt(1 - 0.75**2), count))
    clear = np.clip(0.5 + 0.35 * lfilter([1.0], [1.0, -0.5], rng.normal(size=count)), 0, 1)
    hours = np.arange(24 * (count - 1))
    day = hours / 24 + begin_day - SETTLING_DAYS
    season = -np.cos(2 * np.pi * (day - 20) / YEAR_D)
    sky = np.interp(hours / 24, np.arange(count), clear)
    sun = np.clip(np.sin(2 * np.pi * (hours % 24 - 6) / 24), 0, None) * sky
    sun = sun * (0.65 + 0.35 * season)
    swing = (1.5 + 3.5 * sky) * np.cos(2 * np.pi * (hours % 24 - 15) / 24)
    air = 9.5 + 10.5 * season + np.interp(hours / 24, np.arange(count), daily) + swing
    return Weather(air, lagged(air + 7 * sun, 40 / 60), lagged(air + 4 * sun, 30.0))


# --------------------------------------------------------------------------------------- tension


def lasting(
    hangers: Sequence[Hanger], creep: Array, events: Sequence[Event], relaxation: float, days: Array
) -> Array:
    """Return the tension in N that lasts, without what comes and goes; (hangers, days)."""
    built = np.array([each.tension_n for each in hangers])
    slowing = 6 * (1 - np.exp(-days / YEAR_D / 6))  # years of the first rate
    tension = built[:, None] * (1 + creep[:, None] * slowing - relaxation * days / YEAR_D)
    for event in events:
        since = np.clip(days - event.day, 0, None)
        after = (days >= event.day).astype(float)
        sizes = {
            "tension_step": after, "retensioned": after, "tension_ramp": since / YEAR_D,
        }  # fmt: skip
        if event.kind in sizes:
            change = event.size * built[event.hanger] * sizes[event.kind]
            tension[event.hanger] += change
            for other in neighbours(event.hanger):
                tension[other] -= GAINED * change
        elif event.kind == "neighbour_lost":
            gain = event.size * built[event.hanger] * after
            lost = neighbours(event.hanger)[0]
            tension[lost] -= gain / GAINED
            for other in neighbours(lost):
                tension[other] += gain
    return np.asarray(tension)


def neighbours(number: int) -> list[int]:
    """Return the hangers next to one on its side."""
    side = number // SIDE
    return [n for n in (number - 1, number + 1) if n // SIDE == side and n >= 0]


def creep_rates(seed: int) -> Array:
    """Return the first rate of creep of each hanger, a fraction a year of its tension."""
    rng = draws(seed, "creep")
    rates = rng.normal(size=(2, SIDE))
    rates -= rates.mean(1, keepdims=True)
    rates *= rng.uniform(0, 0.004, (2, 1)) / np.abs(rates).max(1, keepdims=True)
    return rates.ravel()


# ---------------------------------------------------------------------------------------- events


def drawn_events(seed: int, years: float) -> list[Event]:
    """Draw one event for each of half of the hangers, somewhere in the middle of the years."""
    rng = draws(seed, "events")
    chosen = rng.permutation(2 * SIDE)[:SIDE]
    found = []
    for number in sorted(chosen.tolist()):
        kind = str(
            rng.choice([each for each in KINDS[1:] if each not in ("clock", "sensor_moved")])
        )
        size = {
            "tension_step": -float(rng.choice([0.01, 0.02, 0.05, 0.10])),
            "tension_ramp": -float(rng.choice([0.01, 0.02, 0.03])),
            "retensioned": float(rng.uniform(0.03, 0.1)),
            "neighbour_lost": 0.03,
            "springs": float(rng.choice([1 / 3, 1 / 10])),
            "lamp": float(rng.uniform(5, 40)),
            "section_loss": float(rng.uniform(0.02, 0.08)),
        }[kind]
        found.append(
            Event(
                kind, number, float(rng.uniform(0.35, 0.7) * years * YEAR_D), size,
                place=float(rng.uniform(0.1, 0.5)), extent=float(rng.uniform(0.05, 0.2)),
                end=str(rng.choice(["deck", "arch"])), told=bool(rng.uniform() < 0.5),
            )
        )  # fmt: skip
    return found


# ----------------------------------------------------------------------------------------- tests


def visit_days(seed: int, number: int, years: float) -> Array:
    """Return the days of a hanger's tests, with the hour as their fraction."""
    rng = draws(seed, "plan", number)
    step = float(rng.choice([30.4, 91.3, 365.25], p=[0.4, 0.4, 0.2]))
    end, first = years * YEAR_D, float(rng.uniform(0, 20))
    days = [first]
    if rng.uniform() < 0.6:
        days += np.sort(first + rng.uniform(10, 340, 9)).tolist()
    while True:
        following = days[-1] + step * rng.uniform(0.85, 1.15)
        if following > end:
            break
        days.append(following)
    gap_from, gap = rng.uniform(300, max(end - 100, 301)), rng.uniform(120, 270)
    has_gap = rng.uniform() < 1 / 3
    second = 0.6 if step > 300 else 0.12
    found: list[float] = []
    for order, day in enumerate(days):
        left_out = rng.uniform() < 0.08 and order > 0
        in_gap = has_gap and gap_from < day < gap_from + gap
        hour = rng.uniform(8, 15)
        extra_h = rng.uniform(0.5, 1.5) if rng.uniform() < second else 0.0
        if left_out or in_gap:
            continue
        found.append(math.floor(day) + hour / 24)
        if extra_h:
            found.append(found[-1] + extra_h / 24)
    return np.unique(found)


@dataclass(frozen=True, eq=False)
class _Conditions:
    """What differs from test to test of a hanger; arrays by test."""

    days: Array
    air_c: Array
    hanger_c: Array
    deck_c: Array
    traffic: Array  # standard normal
    amplitude: Array
    sensor_kg: Array
    sensor_m: Array
    coating_kg_m: Array
    clock: Array
    tested: NDArray[np.int_]  # the hanger that was really hit
    shifted: NDArray[np.bool_]  # orders off by one


def _conditions(
    seed: int, hanger: Hanger, days: Array, sky: Weather, event: Event, n: Nuisances
) -> _Conditions:
    rng = draws(seed, "conditions", hanger.number)
    size, length = len(days), hanger.bar.length_m
    air, own, deck = (sky.at(series, days) for series in (sky.air, sky.hanger, sky.deck))
    stranger = rng.uniform(size=size) < 0.15
    level = np.where(stranger, rng.uniform(1.6, 2.5, size), 1.0) * np.exp(rng.normal(0, 0.15, size))
    place = min(rng.uniform(0.22, 0.35) * length, 3.5)
    moved = rng.uniform(0.05, 0.2, size) * rng.choice([-1, 1], size)
    sensor = rng.choice([0.02, 0.1, 0.3], size)
    at = place + moved
    if event.kind == "sensor_moved":
        at = np.where(days >= event.day, event.size * length, at)
    rime = rng.exponential(0.001, size) * (rng.uniform(size=size) < 1 / 3) * (air < -1)
    coating = 600 * math.pi * rime * (hanger.diameter_m + rime)
    clock = rng.normal(0, 1e-5, size)
    tested, shifted = np.full(size, hanger.number), np.zeros(size, bool)
    rng = draws(seed, "faults", hanger.number)
    happens, whom, other = rng.uniform(size=3), rng.integers(size, size=3), rng.uniform()
    neighbour = neighbours(hanger.number)[int(other * len(neighbours(hanger.number)))]
    if n.faults:
        clock[whom[0]] += 1e-4 if happens[0] < 0.5 else 0.0
        if happens[1] < 0.25:
            shifted[whom[1]] = True
        if happens[2] < 0.25:
            tested[whom[2]] = neighbour
    if event.kind == "clock":
        clock = clock + np.where(days >= event.day, event.size, 0.0)
    return _Conditions(
        days, air, own, deck, rng.normal(size=size) if n.traffic else np.zeros(size),
        level if n.amplitude else np.ones(size), sensor if n.sensor else np.zeros(size),
        at, coating if n.ice else np.zeros(size), clock, tested, shifted,
    )  # fmt: skip


def present_tension(hanger: Hanger, lasts: Array, seen: _Conditions, n: Nuisances) -> Array:
    """Return the tension in N at each test."""
    change = hanger.traffic * seen.traffic
    if n.temperature:
        change = change + hanger.per_k * (seen.deck_c - REFERENCE_C)
        change = change + hanger.warmer_per_k * (seen.hanger_c - seen.deck_c)
    return lasts * (1 + change)


class _Solver:
    """Frequencies of the hangers of a bridge in the state of a test."""

    def __init__(self, hangers: Sequence[Hanger], events: Sequence[Event]) -> None:
        self.hangers = hangers
        self.events = {event.hanger: event for event in events if event.kind != "none"}
        self.kept: dict[tuple[int, int, bool], Plane] = {}

    def plane(self, number: int, plane: int, worn: bool) -> Plane:
        key = (number, plane, worn)
        if key not in self.kept:
            bar = self.hangers[number].bar
            if worn:
                event = self.events[number]
                half, middle = event.extent * bar.length_m / 2, event.place * bar.length_m
                left = 1 - event.size
                lost = Zone(middle - half, middle + half, left**2, left)
                bar = replace(bar, zones=tuple((*own, lost) for own in bar.zones))
            self.kept[key] = bar.plane(plane)
        return self.kept[key]

    def frequencies(
        self, number: int, tension_n: float, seen: _Conditions, at: int, n: Nuisances, count: int
    ) -> Array:
        """Return the exact frequencies (plane, order) in Hz of the hanger with its sensor on."""
        hanger, day = self.hangers[number], float(seen.days[at])
        event = self.events.get(number)
        kind = event.kind if event is not None and day >= event.day else "none"
        springs = hanger.springs.copy()
        end, gives = hanger.gives
        springs[:, end] /= 1 + gives * (seen.amplitude[at] - 1)
        # The sensor of a test at the neighbour may not find its height on a shorter bar.
        place = min(float(seen.sensor_m[at]), 0.9 * hanger.bar.length_m)
        masses = [(place, float(seen.sensor_kg[at]))]
        if event is not None and kind == "springs":
            springs[:, event.at_ends] *= event.size
        elif event is not None and kind == "retensioned":
            springs[:, 0] *= 0.85
        elif event is not None and kind == "lamp":
            masses.append((event.place * hanger.bar.length_m, event.size))
        warmer = seen.hanger_c[at] - REFERENCE_C if n.temperature else 0.0
        return np.array([
            self.plane(number, p, kind == "section_loss").solve(
                tension_n, (springs[p, 0], springs[p, 1]),
                stiffer=1 + SOFTENING_PER_K * warmer,
                masses=masses,
                coating_kg_m=float(seen.coating_kg_m[at]), count=count,
            )
            for p in range(2)
        ])  # fmt: skip


def season(
    seed: int,
    hangers: int = 2 * SIDE,
    years: float = 5.0,
    event: Event | None = None,
    relaxation_per_year: float = 0.0,
    nuisances: Nuisances | None = None,
    orders: int = 5,
) -> Season:
    """Return years of tests on `hangers` of the 24 of a bridge, and the truth.

    Without an `event` half of the hangers have one (`drawn_events`); `event.hanger` counts those
    returned, from 0.  A relaxation of 0.003 takes 0.3 % of all tensions a year.
    """
    if not 1 <= hangers <= 2 * SIDE:
        raise ValueError(f"a bridge has 1 to {2 * SIDE} hangers, not {hangers}")
    n, every = nuisances or Nuisances(), bridge(seed)
    order = draws(seed, "order").permutation(2 * SIDE)
    looked_at = order[:hangers].tolist() if hangers < 2 * SIDE else list(range(2 * SIDE))
    if event is None:
        events = drawn_events(seed, years)
    elif not 0 <= event.hanger < hangers:
        raise ValueError(f"no hanger {event.hanger}")
    else:
        events = [Event(**{**event.__dict__, "hanger": looked_at[event.hanger]})]
    begin = float(draws(seed, "hours").integers(365))
    sky = weather(seed, begin, years)
    creep = creep_rates(seed) if n.creep else np.zeros(2 * SIDE)
    solver = _Solver(every, events)
    found = []
    for number in looked_at:
        days = visit_days(seed, number, years)
        told = next((each for each in events if each.hanger == number), Event())
        common = next((each for each in events if each.kind == "clock"), told)
        seen = _conditions(seed, every[number], days, sky, common, n)
        lasts = lasting(every, creep, events, relaxation_per_year, days)
        found.append(_record(seed, begin, solver, number, told, seen, lasts, n, orders))
        alone = lasting(every, creep, [told], relaxation_per_year, days)[number]
        found[-1].truth |= {
            "creep_per_year": float(creep[number]),
            "gained_from_neighbours": (lasts[number] - alone) / every[number].tension_n,
        }
    return Season(found, events)


def _record(
    seed: int, begin: float, solver: _Solver, number: int, event: Event, seen: _Conditions,
    lasts: Array, n: Nuisances, orders: int,
) -> HangerSeason:  # fmt: skip
    """Write the tests of a hanger and their truth."""
    hanger, rng = solver.hangers[number], draws(seed, "errors", number)
    size = len(seen.days)
    exact = np.empty((size, 2, orders + 1))
    present = np.empty(size)
    for at, tested in enumerate(seen.tested.tolist()):
        one = present_tension(solver.hangers[tested], lasts[tested], seen, n)
        present[at] = one[at]
        exact[at] = solver.frequencies(tested, float(one[at]), seen, at, n, orders + 1)
    visits, mistakes = [], []
    damping = rng.uniform(0.002, 0.006, (2, orders + 1))
    for at in range(size):
        stated = np.exp(rng.uniform(np.log(3e-4), np.log(1.5e-3), (2, orders + 1)))
        worse = 1.5 if rng.uniform() < 0.3 and n.misstated else 1.0
        error = worse * stated * rng.standard_normal((2, orders + 1))
        missing = rng.uniform(size=(2, orders + 1)) < 0.02 + 0.03 * np.arange(orders + 1)
        decay = damping * np.exp(rng.normal(0, 0.15, damping.shape))
        gross, plane, order = rng.uniform(), int(rng.integers(2)), int(rng.integers(orders))
        wrong = float(rng.choice([-1, 1]) * rng.uniform(0.005, 0.02))
        knows_temperature, knows_level = rng.uniform(size=2) > (0.15, 0.3)
        read_c = float(seen.air_c[at] + rng.normal(0, 0.7))
        measured = exact[at] * (1 + seen.clock[at])
        if n.scatter:
            measured = measured * (1 + error)
        name = f"t{at + 1}"
        if n.faults and gross < 0.04:
            measured[plane, order] *= 1 + wrong
            mistakes.append({"test": name, "plane": PLANES[plane], "order": order + 1,
                             "cause": "gross"})  # fmt: skip
        if seen.shifted[at]:
            # A mode was not seen, and those above took its number.
            measured[plane, 1:-1] = measured[plane, 2:]
            mistakes.append({"test": name, "plane": PLANES[plane], "order": 2, "cause": "order"})
        if seen.tested[at] != number:
            mistakes.append({"test": name, "cause": "neighbour"})
        modes = [
            mode(PLANES[p], o + 1, measured[p, o], stated[p, o] * measured[p, o], decay[p, o])
            for p in range(2) for o in range(orders) if not (n.missing and missing[p, o])
        ]  # fmt: skip
        moment = START + timedelta(days=begin + float(seen.days[at]))
        visit: dict[str, Any] = {"id": name, "time": moment.isoformat(timespec="seconds")}
        if knows_temperature or not n.missing:
            visit["temperature_c"] = round(read_c, 1)
        if knows_level or not n.missing:
            visit["amplitude"] = round(float(seen.amplitude[at]), 2)
        visits.append(visit | {"modes": modes})
    told = event.kind == "retensioned" and event.told
    repairs = [{"day": event.day, "what": "retensioned"}] if told else []
    truth = {
        "day": seen.days, "baseline_tension_n": lasts[number], "tension_n": present,
        "built_tension_n": hanger.tension_n, "air_c": seen.air_c, "hanger_c": seen.hanger_c,
        "deck_c": seen.deck_c, "amplitude": seen.amplitude, "sensor_kg": seen.sensor_kg,
        "sensor_m": seen.sensor_m, "coating_kg_m": seen.coating_kg_m, "clock": seen.clock,
        "tested": seen.tested, "exact_hz": exact[:, :, :orders], "mistaken": mistakes,
        "event": event, "number": number, "kind": hanger.kind, "bar": hanger.bar,
        "springs_nm_rad": hanger.springs, "per_k": hanger.per_k,
    }  # fmt: skip
    return HangerSeason(dict(hanger.description), visits, repairs, truth)
