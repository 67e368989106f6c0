"""A world of seasons: years of hammer tests on the hangers of a tied-arch bridge, as frequencies.

Independent of the program under test: it shares neither equations solved, nor draws, nor ideas
of what is a nuisance.  Everything of the field is on by default and can be switched (`Nuisances`);
one thing can go wrong at a known day (`Event`); the truth is written down (`truth`).

Physics
-------
Frame.  Each side of the bridge is a plane frame (`Frame`): arch and tie are Euler beams with axial
stiffness, rigidly joined at the springings, hangers are vertical bars with their own axial
stiffness; pinned at one end, on rollers at the other, so outside statically determinate: only
differences of temperature between members make forces.  It is linear, therefore

    T(t) = T_ref(t) + B (member temperatures - 10 deg C) + lines . traffic,

where T_ref is the tension at 10 deg C without traffic.  Any T_ref is in equilibrium (n hangers
can be shortened by n amounts; arch and tie bend).  A hanger that loses tension alone (slip, creep,
a turned nut) is one that got longer: its neighbours gain C_ji/C_ii times the loss, C being the
tensions from unit elongations.

Temperatures.  Air: season, weather of some days (AR(1)), day and night; sun from the sun's height
at 50 deg north and a clearness of the day.  Each member is a first-order lag with a sun excess:
steel box arch of either side 1.5 h, 14 K at 1000 W/m2 (absorptivity 0.6, 20 W/m2K, half of the
faces lit); tie with concrete deck 14 h, 12 K, plus a top-bottom difference (3 h, 8 K) that bends
it (EN 1991-1-5, table 6.1 allows 15 K); hanger rho c D/(4 h) with h = 30 W/m2K - 15 to 65 minutes
-, 6 K (a round bar shows the sun 1/pi of its skin).

Hanger.  A round bar of `bars.py` that grows taut by own weight; forks at the ends; rotational
springs, other ones in either plane, stated as fixity r = k/(k + sqrt(T EI)): sqrt(T EI) is the
rotational stiffness of the end of a long tensioned bar, hence r says how much of the end's
stiffening a spring gives, whatever its size.  The modulus falls by 3.5e-4 per K (Ledbetter and
Reed, J. Phys. Chem. Ref. Data 2, 1973).  Each season projects the bar once on modes of its extreme
states and solves all visits in that basis, which is checked against the full matrices at run time
(1e-5).

Measurement.  The random sd of a frequency is f sqrt(zeta/(2 pi f duration)), the long-data law of
modal identification (Au, Mech. Syst. Signal Process. 48, 2014): 0.1 % at 6 Hz, zeta 0.3 % and 60 s.

Not in it: the frame's second order (arch under thrust), creep and shrinkage of the deck, sticking
bearings, new asphalt, ice on the bars, wind pushing the arch, dynamic coupling of hangers with each
other or with the deck, hangers that touch each other, inclined hangers, strands and ropes.

x runs up from the deck end.  Every nuisance draws from a stream of its own: two seasons with one
seed differ only by what was switched, and by the event.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from tests.worlds import bars, seasons
from tests.worlds.bars import (
    POISSON,
    Array,
    Matrices,
    Zone,
    cowper,
    reduced_basis,
    solve,
    solve_many,
)
from tests.worlds.seasons import ENDS, PLANES, REFERENCE_C, YEAR_D, lagged, mode, stream

EXPANSION = 1.2e-5  # 1/K, steel (EN 1991-1-5, table C.1; concrete 1.0e-5 there, 0.95 to 1.2 built)
MODULUS_PER_K = -3.5e-4
ORDERS = 5  # reported
SOLVED = ORDERS + 1  # one more, for whom mistakes the order
DAY_H = 24.0
STEP_H = 0.25  # of the temperature record
LEAD_D = 20  # days of weather before the first visit, so that the lags have settled


@dataclass(frozen=True)
class Nuisances(seasons.Switched):
    """What separates the field from the textbook.  A scale is 1 as found in the field, 0 for off.

    Tolerances: JCSS Probabilistic Model Code, part 3 (area 1 %, modulus 1.5 %, density 0.3 %), the
    taped length 8 mm + 0.1 % (where does the bar begin in its fork?).
    """

    temperature: float = 1.0  # scale of the air's departure from 10 deg C
    sun: float = 1.0
    traffic: float = 1.0  # scale of cars on the deck, and of the parked load
    parked_share: float = 0.08  # share of tests with a van or a lift parked in the neighbourhood
    softening: float = 1.0  # scale of the joints' 0 to 5 % of fixity per unit of amplitude
    softening_days: float = 0.15
    seating_sd: float = 0.002  # of the fixity, from visit to visit: joints never sit alike
    cold_joints: float = 1.0  # scale of 0 to 0.03 % of fixity lost per K (sleeves, paint, rust)
    sensor_kg: tuple[float, float] = (0.2, 0.45)
    sensor_place_sd_m: float = 0.15
    sensor_elsewhere: float = 0.15  # share of visits with the sensor anywhere in reach of a ladder
    forks: float = 1.0  # scale of the ends' additional stiffness and mass
    support_flexibility: float = 1.0  # scale of 1e-9 to 1e-8 m/N lateral, arch and deck
    own_weight: bool = True
    tolerances: float = 1.0
    nominal_error: float = 1.0  # scale of the 5 to 10 % between design and built tension
    irregular: float = 1.0  # 0: every hanger every 14 days at 10 h
    skipped: float = 0.08  # share of hangers left out at a visit
    twice: float = 0.08  # share of days with a second round of tests
    temperature_missing: float = 0.2
    thermometer: float = 1.0  # scale of the error; 0 reads the air exactly, without rounding
    temperature_typos: float = 0.005  # share of those noted 10 deg C off, or with the other sign
    amplitude_sd: float = 0.5  # ln, of the hits as they were (median 1)
    amplitude_recorded_sd: float = 0.3  # ln, recorded over real
    amplitude_missing: float = 0.2
    scatter: float = 1.0  # scale of the random error of frequencies and damping
    misstated: float = 1.0  # scale of ln(real sd / stated sd), which lies in 0.5 to 3
    common: float = 0.3  # part of the variance common to a day (half) and to a test (half)
    missing: float = 1.0  # scale of the probability that a mode is not identified
    mistaken: tuple[float, float] = (0.02, 0.05)  # share of modes, drawn for the season
    wrong_hanger: float = 0.005  # share of tests that were done on the neighbour


@dataclass(frozen=True)
class Event(seasons.Event):
    """An event; a moved sensor is a new one of `size` kg at `place`."""

    hanger: int = 1


# ---------------------------------------------------------------------------------------- hanger


@dataclass(frozen=True)
class Bar:
    """A hanger as made, without what changes from visit to visit."""

    length_m: float
    diameter_m: float
    modulus_pa: float
    density_kg_m3: float
    own_weight: bool = True
    fork: tuple[float, float, float] = (0.0, 1.0, 1.0)  # length, factors on EI and on mass
    flexibility_m_per_n: tuple[float, float] = (0.0, 0.0)  # lateral, deck and arch
    loss: tuple[float, float, float] = (0.0, 0.0, 0.0)  # from, to (m), lost part of the area
    lamp: tuple[float, float] = (0.0, 0.0)  # place (m), kg

    @property
    def area_m2(self) -> float:
        """Area of the sound section."""
        return math.pi * self.diameter_m**2 / 4

    @property
    def bending_nm2(self) -> float:
        """EI of the sound section at 10 deg C."""
        return self.modulus_pa * self.area_m2**2 / (4 * math.pi)

    @property
    def mass_kg_m(self) -> float:
        """Mass per metre of the sound section."""
        return self.density_kg_m3 * self.area_m2


@dataclass(frozen=True)
class State:
    """What a bar is in at one visit or (as arrays of one length) at many."""

    tension_n: Array  # at mid-length
    springs: Array  # (..., plane, end), N m/rad
    temperature_c: Array
    sensor_kg: Array
    sensor_at_m: Array

    def part(self, which: Any) -> "State":
        """Those visits alone."""
        return State(*(value[which] for value in vars(self).values()))


def _matrices(bar: Bar, elements: int) -> Matrices:
    """A bar of `bars.py` at 10 deg C, without springs at its ends."""
    length, (fork, stiffer, heavier) = bar.length_m, bar.fork
    ends = Zone(0.0, fork, stiffer, heavier, math.sqrt(stiffer))
    zones = [ends, replace(ends, start_m=length - fork, end_m=length)] if fork else []
    low, high, lost = bar.loss
    if lost:
        zones.append(Zone(low, high, (1 - lost) ** 2, 1 - lost))
    shear = cowper() * bar.modulus_pa / (2 * (1 + POISSON)) * bar.area_m2
    lateral = [1 / each if each else math.inf for each in bar.flexibility_m_per_n]
    made = bars.Bar(
        length, 0.0, bar.bending_nm2, bar.mass_kg_m, shear,
        bar.density_kg_m3 * bar.area_m2**2 / (4 * math.pi),
        zones=tuple(zones),
        masses=(bar.lamp,) if bar.lamp[1] else (),
        lateral_n_m=(lateral[0], lateral[1]),
        gravity_along_m_s2=bars.GRAVITY_M_S2 * bar.own_weight,
    )  # fmt: skip
    return Matrices(made, elements=elements)


def _factors(temperature_c: Array) -> tuple[Array, Array]:
    """On the elastic stiffness, and on what the tension and the weight do."""
    strain = EXPANSION * (temperature_c - REFERENCE_C)
    return (1 + MODULUS_PER_K * (temperature_c - REFERENCE_C)) * (1 + strain), 1 / (1 + strain)


def _stiffness(m: Matrices, tension: float, springs: Array, temperature_c: Any) -> Array:
    """Sum of the parts in one state, one plane (springs of its two ends)."""
    soft, pulled = _factors(temperature_c)
    total = soft * (m.stiffness(0.0, (0.0, 0.0)) - m.weight)
    total += pulled * (tension * m.pull + m.weight)
    return np.asarray(total + (m.turns.T * springs) @ m.turns)


def frequencies_full(bar: Bar, state: State, index: int, count: int = SOLVED) -> Array:
    """Frequencies (plane, order) of one visit from the full matrices, eight elements."""
    m, one = _matrices(bar, 8), state.part(index)
    mass = m.with_masses([(float(one.sensor_at_m), float(one.sensor_kg))])
    both = [_stiffness(m, float(one.tension_n), k, one.temperature_c) for k in one.springs]
    return np.array([solve(each, mass, count)[0] for each in both])


def frequencies(bar: Bar, state: State, count: int = SOLVED) -> tuple[Array, Array]:
    """Frequencies (visit, plane, order) of all visits and how well the sensor saw each mode.

    Modes of the extreme states (least and most tension and springs, either plane) span a basis of
    some 40 vectors, orthonormal in the bar's mass; the stiffness of a visit is a sum in it.
    """
    m = _matrices(bar, 5)
    span: list[Array] = []
    warm = float(np.median(state.temperature_c))
    tensions = (float(state.tension_n.min()), float(state.tension_n.max()))
    heavy = m.with_masses([(float(state.sensor_at_m.mean()), float(state.sensor_kg.mean()))])
    seen: set[tuple[float, ...]] = set()
    for plane in range(2):
        springs = state.springs[:, plane]
        for tension, k in zip(tensions, (springs.min(axis=0), springs.max(axis=0)), strict=True):
            if (key := (tension, *k.tolist())) not in seen:
                seen.add(key)
                span.append(solve(_stiffness(m, tension, k, warm), heavy, count + 4)[1])
    # A light bar bends visibly about its sensor: the deflections under a force where it was put.
    forces = m.rows(np.quantile(state.sensor_at_m, np.linspace(0, 1, 7))).T
    middle = _stiffness(m, sum(tensions) / 2, state.springs.mean(axis=(0, 1)), warm)
    basis = reduced_basis(middle, m.mass, [*span, forces])
    plain = m.stiffness(0.0, (0.0, 0.0)) - m.weight
    elastic, string, weight = (basis.T @ k @ basis for k in (plain, m.pull, m.weight))
    turns = m.turns @ basis
    soft, pulled = (each[:, None, None] for each in _factors(state.temperature_c))
    total = soft * elastic + pulled * (state.tension_n[:, None, None] * string + weight)
    full = total[:, None] + np.einsum("vpe,ei,ej->vpij", state.springs, turns, turns)
    rows = m.rows(state.sensor_at_m) @ basis  # (visit, basis)
    mass = np.eye(rows.shape[1])
    mass = mass + state.sensor_kg[:, None, None] * rows[:, :, None] * rows[:, None, :]
    found, shapes = solve_many(full, mass[:, None], count)
    seen_by = np.abs(np.einsum("vi,vpin->vpn", rows, shapes))
    seen_by *= math.sqrt(bar.mass_kg_m * bar.length_m / 2)
    check = len(state.tension_n) // 2
    error = np.abs(found[check] / frequencies_full(bar, state, check, count) - 1).max()
    if not error < 1e-5:
        raise ArithmeticError(f"reduced basis is off by {error:.1e}")
    return found, seen_by


# ----------------------------------------------------------------------------------------- frame


@dataclass(frozen=True)
class Frame:
    """One side of the bridge.  Areas and second moments as of steel (a composite tie: reduced)."""

    span_m: float
    rise_m: float
    places_m: tuple[float, ...]  # of the hangers
    hanger_stiffness_n_m: tuple[float, ...]  # EA over the free length
    hanger_length_m: tuple[float, ...]
    modulus_pa: float = 2.1e11
    arch: tuple[float, float] = (0.06, 0.008)  # m2, m4
    tie: tuple[float, float] = (0.2, 0.035)
    tie_depth_m: float = 1.3
    tie_expansion: float = EXPANSION

    @property
    def count(self) -> int:
        """Number of hangers."""
        return len(self.places_m)

    def heights(self) -> Array:
        """Height of the arch above the tie at the hangers (a parabola)."""
        x = np.array(self.places_m)
        return np.asarray(4 * self.rise_m * x * (self.span_m - x) / self.span_m**2)

    # Nodes: 0 and n+1 the springings (shared by arch and tie), 1..n the arch, n+2..2n+1 the tie.
    def nodes(self) -> Array:
        """Coordinates (x, y)."""
        x = np.array(self.places_m)
        top = np.column_stack((x, self.heights()))
        low = np.column_stack((x, np.zeros_like(x)))
        return np.vstack(([[0.0, 0.0]], top, [[self.span_m, 0.0]], low))

    def _strained(self, member: "_Member", load: "Load") -> Array:
        """Forces at the ends, own axes, that hold a member with its free strain in place."""
        warm, expansion, curve = load.arch_k, EXPANSION, 0.0
        if member.tie:
            warm, expansion = load.tie_k, self.tie_expansion
            curve = -expansion * load.tie_difference_k / self.tie_depth_m  # a warm top hogs
        axial, moment = member.axial_n * expansion * warm, member.bending_nm2 * curve
        return np.array([axial, 0.0, moment, -axial, 0.0, -moment])

    def _loads(self, load: "Load") -> Array:
        n = self.count
        force = np.zeros(3 * (2 * n + 2))
        for member in _members(self):
            force[member.where] -= member.turn.T @ self._strained(member, load)
            if not member.tie:
                continue
            h, across = member.length_m, member.where[[1, 2, 4, 5]]
            force[across] -= load.line_n_m * np.array([h / 2, h**2 / 12, h / 2, -(h**2) / 12])
            for place, down in load.weights:
                t = (place - member.start_m) / h
                if 0 <= t < 1 or place == self.span_m == member.start_m + h:
                    shape = [1 - 3 * t**2 + 2 * t**3, h * (t - 2 * t**2 + t**3)]
                    shape += [3 * t**2 - 2 * t**3, h * (t**3 - t**2)]
                    force[across] -= down * np.array(shape)
        free = EXPANSION * np.array(load.hanger_k) * np.array(self.hanger_length_m)
        push = np.array(self.hanger_stiffness_n_m) * (free + np.array(load.longer_m))
        force[4 : 3 * n + 4 : 3] += push  # a longer hanger pushes its ends apart
        force[3 * (n + 2) + 1 :: 3] -= push
        return force

    def _assembled(self) -> Array:
        n = self.count
        stiffness = np.zeros((3 * (2 * n + 2),) * 2)
        for m in _members(self):
            stiffness[np.ix_(m.where, m.where)] += m.turn.T @ m.stiffness @ m.turn
        for i, k in enumerate(self.hanger_stiffness_n_m):
            at = [3 * (i + 1) + 1, 3 * (n + 2 + i) + 1]
            stiffness[np.ix_(at, at)] += k * np.array([[1, -1], [-1, 1]])
        return stiffness

    def respond(self, loads: Iterable["Load"]) -> list["Response"]:
        """Tensions, reactions and end forces of arch and tie for each load."""
        loads = list(loads)
        n = self.count
        stiffness = self._assembled()
        held = [0, 1, 3 * (n + 1) + 1]
        free = np.setdiff1d(np.arange(len(stiffness)), held)
        forces = np.array([self._loads(load) for load in loads]).T
        moved = np.zeros_like(forces)
        moved[free] = np.linalg.solve(stiffness[np.ix_(free, free)], forces[free])
        reactions = (stiffness @ moved - forces)[held]
        answers = []
        for load, u, r in zip(loads, moved.T, reactions.T, strict=True):
            k = np.array(self.hanger_stiffness_n_m)
            apart = u[4 : 3 * n + 4 : 3] - u[3 * (n + 2) + 1 :: 3]
            grown = EXPANSION * np.array(load.hanger_k) * np.array(self.hanger_length_m)
            tension = k * (apart - grown - np.array(load.longer_m))
            answers.append(Response(tension, r, u))
        return answers

    def unit(self, **what: Any) -> "Load":
        """A load of this frame, zero but for what is named."""
        nothing = (0.0,) * self.count
        return replace(Load(hanger_k=nothing, longer_m=nothing), **what)


@dataclass(frozen=True)
class _Member:
    """An element of arch or tie: stiffness in its own axes, the turn to them, its unknowns."""

    tie: bool
    start_m: float
    length_m: float
    axial_n: float
    bending_nm2: float
    stiffness: Array
    turn: Array
    where: NDArray[np.int64]


@lru_cache(maxsize=16)
def _members(frame: Frame) -> list[_Member]:
    n, points = frame.count, frame.nodes()
    chains = ((range(1, n + 1), frame.arch, False), (range(n + 2, 2 * n + 2), frame.tie, True))
    members = []
    for middle, (area, second), tie in chains:
        for a, b in pairwise([0, *middle, n + 1]):
            delta = points[b] - points[a]
            h = float(np.hypot(*delta))
            c, s = delta / h
            axial, bend = frame.modulus_pa * area, frame.modulus_pa * second
            k = np.zeros((6, 6))
            k[np.ix_([0, 3], [0, 3])] = axial / h * np.array([[1, -1], [-1, 1]])
            k[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])] = (bend / h**3) * np.array(
                [
                    [12, 6 * h, -12, 6 * h],
                    [6 * h, 4 * h * h, -6 * h, 2 * h * h],
                    [-12, -6 * h, 12, -6 * h],
                    [6 * h, 2 * h * h, -6 * h, 4 * h * h],
                ]
            )
            turn = np.kron(np.eye(2), np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))
            where = np.concatenate((np.arange(3 * a, 3 * a + 3), np.arange(3 * b, 3 * b + 3)))
            start = float(points[a][0])
            members.append(_Member(tie, start, h, axial, bend, k, turn, where))
    return members


@dataclass(frozen=True)
class Load:
    """Departures from 10 deg C, elongations and loads on the tie."""

    hanger_k: tuple[float, ...]
    longer_m: tuple[float, ...]
    arch_k: float = 0.0
    tie_k: float = 0.0
    tie_difference_k: float = 0.0  # top over bottom
    line_n_m: float = 0.0
    weights: tuple[tuple[float, float], ...] = ()  # place (m), N downwards


@dataclass(frozen=True)
class Response:
    """Tensions of the hangers, reactions (x and y left, y right), displacements."""

    tension_n: Array
    reactions_n: Array
    moved: Array


@dataclass(frozen=True)
class _Influence:
    """The frame differentiated once (it is linear)."""

    arch: Array  # N/K
    tie: Array
    difference: Array
    hanger: Array  # (tension of, temperature of)
    line: Array  # N per N/m
    places: Array
    point: Array  # (tension of, place), N/N
    longer: Array  # (tension of, elongation of), N/m


def _influence(frame: Frame) -> _Influence:
    n = frame.count
    one = np.eye(n)
    places = np.linspace(0.0, frame.span_m, 121)
    loads = [
        frame.unit(arch_k=1.0),
        frame.unit(tie_k=1.0),
        frame.unit(tie_difference_k=1.0),
        frame.unit(line_n_m=1.0),
        *(frame.unit(hanger_k=tuple(row)) for row in one),
        *(frame.unit(longer_m=tuple(row)) for row in one),
        *(frame.unit(weights=((float(x), 1.0),)) for x in places),
    ]
    t = np.array([r.tension_n for r in frame.respond(loads)]).T
    hanger, longer, point = t[:, 4 : 4 + n], t[:, 4 + n : 4 + 2 * n], t[:, 4 + 2 * n :]
    return _Influence(t[:, 0], t[:, 1], t[:, 2], hanger, t[:, 3], places, point, longer)


# ---------------------------------------------------------------------------------------- bridge


@dataclass(frozen=True)
class Hanger:
    """A hanger as it is, and as it is described."""

    number: int
    side: int
    index: int  # along its side
    bar: Bar
    tension_n: float  # at 10 deg C, as built
    springs: Array = field(repr=False)  # (plane, end)
    softening: Array = field(repr=False)  # (plane, end), part of fixity per unit of amplitude
    cold: Array = field(repr=False)  # (plane, end), part of fixity lost per K
    damping: Array = field(repr=False)  # (plane, order)
    sensor_at_m: float = 1.6
    description: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Bridge:
    """Two frames and their hangers."""

    frames: tuple[Frame, ...]
    hangers: tuple[Hanger, ...]
    heading_deg: float  # of the outward normal of side 0, from north by east

    def neighbour(self, number: int) -> int:
        """The next hanger of the same side (the last: the one before)."""
        h = self.hangers[number - 1]
        mates = [g.number for g in self.hangers if g.side == h.side]
        return number + 1 if number + 1 in mates else number - 1


def bridge(seed: int, hangers: int, nuisances: Nuisances) -> Bridge:
    """A road bridge of 60 to 100 m: 4 to 15 m of hanger, 40 to 130 mm, 100 to 900 kN."""
    if hangers < 4:
        raise ValueError("a bridge has four hangers at least")
    rng, off = stream(seed, "bridge"), stream(seed, "tolerances")
    sides = (hangers - hangers // 2, hangers // 2)
    n = sides[0]
    span = float(np.clip(rng.uniform(5.5, 8.0) * (n - 1) / 0.78, 60, 100))
    rise = float(np.clip(span * rng.uniform(0.15, 0.19), 12.4, 15.6))
    mean = 180e3 * (750 / 180) ** float(rng.random())  # N, of dead load a hanger
    stress = float(rng.uniform(60e6, 130e6))
    diameter = float(
        np.clip(round(math.sqrt(4 * mean / (math.pi * stress)) / 5e-3) * 5e-3, 0.04, 0.12)
    )
    thicker = bool(rng.random() < 0.3)  # the outermost ones
    modulus, density = 2.1e11 if rng.random() < 0.6 else 2.05e11, 7850.0
    arch_area = (
        mean / (0.78 * span / (n - 1)) * span**2 / (8 * rise) / float(rng.uniform(70e6, 110e6))
    )
    arch = (arch_area, arch_area * (0.38 * span / float(rng.uniform(65, 90))) ** 2)
    tie_depth = span / float(rng.uniform(40, 95))  # a slim steel tie to a stiff concrete one
    tie_area = float(rng.uniform(1.3, 6.0)) * arch_area
    tie_expansion = float(rng.uniform(0.95e-5, 1.2e-5))  # concrete by its aggregate, or steel
    tie = (tie_area, tie_area * (0.35 * tie_depth) ** 2)
    pinned = bool(rng.random() < 0.5)
    heading, gusset = float(rng.uniform(0, 360)), float(rng.uniform(0.5, 0.7))
    sensor = float(rng.uniform(1.3, 3.5))  # from the deck by hand to a ladder
    fork = (
        float(rng.uniform(0.12, 0.3)),
        float(rng.uniform(1.5, 4.0)),
        float(rng.uniform(1.2, 2.5)),
    )
    frames: list[Frame] = []
    made: list[Hanger] = []
    for side, count in enumerate(sides):
        places = span * np.linspace(0.11, 0.89, count)
        heights = 4 * rise * places * (span - places) / span**2
        bars: list[Bar] = []
        for i in range(count):
            number = len(made) + 1
            one = stream(seed, "hanger", number)
            nominal = mean * (1 + 0.06 * float(one.standard_normal()))
            if i in (0, count - 1):
                nominal *= float(one.uniform(0.75, 1.05))
            d = diameter + (0.01 if thicker and i in (0, count - 1) else 0.0)
            e = off.standard_normal(5) * nuisances.tolerances
            miss = float(off.uniform(0.05, 0.10)) * (1 if off.random() < 0.5 else -1)
            tension = nominal * (1 + miss * nuisances.nominal_error)
            length = float(heights[i]) - gusset
            scale = nuisances.forks
            flexible = (1e-9 * 10 ** one.random(2) * nuisances.support_flexibility).tolist()
            bar = Bar(
                length_m=length,
                diameter_m=d * (1 + 0.005 * float(e[0])),
                modulus_pa=modulus * (1 + 0.015 * float(e[1])),
                density_kg_m3=density * (1 + 0.003 * float(e[2])),
                own_weight=nuisances.own_weight,
                fork=(fork[0] * (scale > 0), 1 + scale * (fork[1] - 1), 1 + scale * (fork[2] - 1)),
                flexibility_m_per_n=(flexible[0], flexible[1]),
            )
            taped = length + 0.008 * float(e[3]) + 0.001 * length * float(e[4])
            # A pin leaves longitudinal rotation to friction; a gusset bends across its plane.
            soft = one.uniform(0.25, 0.7, 2) if pinned else one.uniform(0.5, 0.85, 2)
            fixity = np.array([one.uniform(0.75, 0.95, 2), soft])
            layer = math.sqrt(tension * bar.bending_nm2)
            made.append(
                Hanger(
                    number,
                    side,
                    i,
                    bar,
                    tension,
                    springs=fixity / (1 - fixity) * layer,
                    softening=0.05 * one.random((2, 2)),
                    cold=3e-4 * one.random((2, 2)),
                    damping=0.003 * np.exp(0.35 * one.standard_normal((2, SOLVED))),
                    sensor_at_m=min(sensor + 0.1 * float(one.standard_normal()), 0.45 * length),
                    description={
                        "id": number,
                        "diameter_m": round(d, 4),
                        "length_m": round(taped, 3) if nuisances.tolerances else length,
                        "elastic_modulus_pa": modulus,
                        "density_kg_m3": density,
                        "nominal_tension_n": nominal,
                    },
                )
            )
            bars.append(bar)
        frames.append(
            Frame(
                span,
                rise,
                tuple(places.tolist()),
                tuple(b.modulus_pa * b.area_m2 / b.length_m for b in bars),
                tuple(b.length_m for b in bars),
                arch=arch,
                tie=tie,
                tie_depth_m=tie_depth,
                tie_expansion=tie_expansion,
            )
        )
    return Bridge(tuple(frames), tuple(made), heading)


# --------------------------------------------------------------------------------------- weather


@dataclass(frozen=True)
class Weather:
    """Temperatures (deg C) every quarter of an hour, from LEAD_D days before the first day on."""

    air: Array
    shade: Array  # what a thermometer with an hour and a half of lag makes of it
    arch: Array  # (side, time)
    tie: Array
    tie_difference: Array
    sun_w_m2: Array  # (side, time), as a vertical bar sees it

    def at(self, series: Array, day: Array) -> Array:
        """Interpolate at days since the first."""
        return np.interp(day, np.arange(len(series)) * STEP_H / DAY_H - LEAD_D, series)

    def hanger(self, diameter_m: float, side: int) -> Array:
        """Temperature of a bar: rho c D/(4 h), 470 J/kgK, 30 W/m2K; 6 K of sun."""
        lag_h = 7850 * 470 * diameter_m / (4 * 30) / 3600
        return lagged(self.air + 6e-3 * self.sun_w_m2[side], lag_h, STEP_H)


def weather(seed: int, start_day: float, years: float, heading: float, n: Nuisances) -> Weather:
    """Middle Europe, 50 deg north: 10 deg C +- 9.5 over the year, +- 4 weather, 2 to 6 the day."""
    rng = stream(seed, "weather")
    days = LEAD_D + math.ceil(years * YEAR_D) + 3
    hours = np.arange(round(days * DAY_H / STEP_H)) * STEP_H
    whole = (hours // DAY_H).astype(int)
    date = start_day - LEAD_D + hours / DAY_H  # day of the year
    shock = rng.standard_normal(days)
    front = lfilter([math.sqrt(1 - 0.75**2)], [1, -0.75], shock)  # e-folding of 3.5 days
    clear = np.where(
        rng.random(days) < 0.35, rng.uniform(0.8, 1.0, days), rng.uniform(0.05, 0.5, days)
    )
    declination = np.radians(23.44) * np.sin(2 * math.pi * (284 + date) / YEAR_D)
    angle = 2 * math.pi * (hours % DAY_H - 12) / DAY_H
    latitude = math.radians(50)
    height = np.sin(latitude) * np.sin(declination)
    height = height + np.cos(latitude) * np.cos(declination) * np.cos(angle)
    up = np.maximum(height, 0.0)
    azimuth = np.arctan2(
        -np.cos(declination) * np.sin(angle),
        np.sin(declination) * np.cos(latitude)
        - np.cos(declination) * np.sin(latitude) * np.cos(angle),
    )
    beam = n.sun * clear[whole] * 950 * up**0.25 * (up > 0)  # across the ray
    air = -9.5 * np.cos(2 * math.pi * (date - 20) / YEAR_D)
    air = air + 4 * np.interp(hours / DAY_H, np.arange(days) + 0.5, front)
    air = air + (2 + 4 * clear[whole]) * np.cos(2 * math.pi * (hours % DAY_H - 15) / DAY_H) * (
        0.4 + 0.6 * up
    )
    air = REFERENCE_C + n.temperature * air
    flat = np.sqrt(1 - np.minimum(up, 1) ** 2)
    arch, lit = [], []
    for side in range(2):
        normal = math.radians(heading + 180 * side)
        face = np.maximum(np.cos(azimuth - normal), 0.0) * flat  # the outer web
        arch.append(lagged(air + 14e-3 * beam * (0.6 * up + 0.7 * face), 1.5, STEP_H))
        lit.append(
            beam * flat * np.where(np.cos(azimuth - normal) > -0.7, 1.0, 0.6)
        )  # arch's shade
    tie = lagged(air + 12e-3 * beam * up, 14.0, STEP_H)
    difference = (
        lagged(8e-3 * beam * up, 3.0, STEP_H) * 1.6
        - n.temperature * 0.5 * (lagged(air, 14.0, STEP_H) - air) / 4
    )
    return Weather(air, lagged(air, 1.5, STEP_H), np.array(arch), tie, difference, np.array(lit))


# ---------------------------------------------------------------------------------------- season


@dataclass(frozen=True)
class HangerSeason:
    """One hanger: what the owner has (description, visits) and what is so (truth)."""

    description: dict[str, float]
    visits: list[dict[str, Any]]
    truth: dict[str, Any]


@dataclass(frozen=True)
class Season:
    """All hangers of a bridge (by number) over some years, and the event."""

    hangers: dict[int, HangerSeason]
    event: Event
    bridge: Bridge
    truth: dict[str, Any]


@dataclass(frozen=True)
class _Rounds:
    """Rounds of tests on the bridge: one a day, or two."""

    day: Array  # with its fraction
    date: NDArray[np.int64]  # whole days, for what is common to a day
    operator: NDArray[np.int64]
    stretch: NDArray[np.int64]


def _rounds(seed: int, years: float, n: Nuisances) -> _Rounds:
    """Gaps of two weeks in the median, lognormal, at most three months; one long gap for sure.

    The long gap (60 to 92 days: a contract ends, the next one starts) parts the season into two
    stretches; nobody is told.
    """
    rng, total = stream(seed, "rounds"), years * YEAR_D
    if n.irregular == 0:
        day = np.floor(np.arange(0.0, total, 14.0)) + 10 / DAY_H
        zero = np.zeros(len(day), dtype=np.int64)
        return _Rounds(day, day.astype(np.int64), zero, zero)
    breaks = float(rng.uniform(0.2, 0.5)) * total
    long = float(rng.uniform(60, 92))
    days, hours, operators, stretches = [], [], [], []
    now, stretch = float(rng.uniform(0, 5)), 0
    while now < total:
        operator, hour = int(rng.choice(3, p=(0.55, 0.3, 0.15))), float(rng.uniform(7.5, 14.0))
        again, later = rng.random(), float(rng.uniform(2.5, 4.5))
        for each in (hour, hour + later) if again < n.twice else (hour,):
            days.append(math.floor(now))
            hours.append(each)
            operators.append(operator)
            stretches.append(stretch)
        gap = float(np.clip(14 * math.exp(0.6 * n.irregular * rng.standard_normal()), 1, 92))
        if stretch == 0 and now > breaks:
            gap, stretch = long, 1
        now += gap
    date = np.array(days, dtype=np.int64)
    return _Rounds(date + np.array(hours) / DAY_H, date, np.array(operators), np.array(stretches))


def _by_date(rounds: _Rounds, draw: Array) -> Array:
    """One draw a date, for each round (draws are made for as many dates as there are rounds)."""
    _, which = np.unique(rounds.date, return_inverse=True)
    return np.asarray(draw[which])


def _reference_tensions(
    b: Bridge,
    influences: list[_Influence],
    event: Event,
    relaxation: float,
    day: Array,
) -> Array:
    """(round, hanger): tensions at 10 deg C without traffic."""
    built = np.array([h.tension_n for h in b.hangers])
    out = np.tile(built, (len(day), 1))

    def alone(number: int, part: Any) -> None:
        h = b.hangers[number - 1]
        c = influences[h.side].longer[:, h.index]
        mates = [g.number - 1 for g in b.hangers if g.side == h.side]
        out[:, mates] += np.outer(part * h.tension_n, c / c[h.index])

    out -= np.outer(relaxation * day / YEAR_D, built)
    if event.kind == "tension_step":
        alone(event.hanger, event.size * (day >= event.day))
    elif event.kind == "tension_ramp":
        alone(event.hanger, event.size * np.maximum(day - event.day, 0) / YEAR_D)
    return out


def season(
    seed: int,
    hangers: int = 20,
    years: float = 3.0,
    event: Event | None = None,
    relaxation_per_year: float = 0.0,
    nuisances: Nuisances | None = None,
) -> Season:
    """Return some years of hammer tests on all hangers of a bridge.

    `hangers` counts both sides (1 .. n of side 0, the rest of side 1, from the left).  A relaxation
    of 0.01 takes 1 % of the built tension of all hangers a year (the tie takes what they leave).
    """
    n, event = nuisances or Nuisances(), event or Event()
    b = bridge(seed, hangers, n)
    if not 1 <= event.hanger <= hangers:
        raise ValueError(f"no hanger {event.hanger}")
    influences = [_influence(frame) for frame in b.frames]
    start = int(stream(seed, "start").integers(0, 365))
    sky = weather(seed, float(start), years, b.heading_deg, n)
    rounds = _rounds(seed, years, n)
    count = len(rounds.day)
    common = _common(seed, rounds, n)
    # One batch of visits for each hanger in the records; who was really tested, visit by visit.
    plans = [_plan(seed, h, rounds, common, n) for h in b.hangers]
    for plan in plans:
        number = plan["hanger"]
        tested = np.full(count, number)
        tested[plan["astray"]] = b.neighbour(number)
        plan["tested"] = tested
        plan |= _tensions(b, influences, sky, event, relaxation_per_year, plan)
    shape = (count, 2, SOLVED)
    for plan in plans:
        plan |= {"exact": np.zeros(shape), "seen": np.ones(shape)}
    for h in b.hangers:
        _solve(seed, h, plans, event, n)
    share = float(stream(seed, "mistaken").uniform(*n.mistaken))
    tones = np.sort(stream(seed, "tones").uniform(4, 60, 4))  # pumps, fans, a crossing line
    first = datetime(2022, 1, 1, tzinfo=UTC) + timedelta(days=start)
    concerned = _concerned(b, influences, event)
    out = {
        h.number: _record(
            seed, h, plan, common, rounds, n, (share, tones, first), event, concerned[h.number]
        )
        for h, plan in zip(b.hangers, plans, strict=True)
    }
    truth: dict[str, Any] = {
        "event": event,
        "relaxation_per_year": relaxation_per_year,
        "mistaken_share": share,
    }
    truth |= {"tones_hz": tones.tolist(), "first_day": first.date().isoformat()}
    return Season(out, event, b, truth)


def _common(seed: int, rounds: _Rounds, n: Nuisances) -> dict[str, Array]:
    """What all hangers of a round, or of a date, or of an operator, have in common."""
    rng, count = stream(seed, "common"), len(rounds.day)
    soft = _by_date(rounds, rng.random(count)) < n.softening_days
    wind = _by_date(rounds, rng.exponential(0.5, count))
    kits = np.array(n.sensor_kg)[0] + np.ptp(n.sensor_kg) * rng.random(
        2
    )  # the usual one, the spare
    kit = np.where(_by_date(rounds, rng.random(count)) < 0.8, kits[0], kits[1])
    cars = rng.exponential(150.0, count) * n.traffic  # N/m on both sides together
    unread = _by_date(rounds, rng.random(count)) < 0.7 * n.temperature_missing
    habit = rng.standard_normal((3, 2))[rounds.operator]
    ratio = 0.2 + 0.35 * habit[:, 0] + 0.3 * _by_date(rounds, rng.standard_normal(count))
    ratio = np.exp(n.misstated * np.clip(ratio, math.log(0.5), math.log(3.0)))
    seconds = np.where(n.scatter > 0, rng.uniform(40, 90, count), 60.0)
    return {
        "soft": soft,
        "wind": wind * soft,
        "kit": kit,
        "cars": cars,
        "unread": unread,
        "thermometer": 0.8 * habit[:, 1] + 0.6 * _by_date(rounds, rng.standard_normal(count)),
        "ratio": ratio,  # real sd over stated
        "seconds": seconds,
        "error": _by_date(rounds, rng.standard_normal(count)),
    }


def _plan(
    seed: int, h: Hanger, rounds: _Rounds, common: dict[str, Array], n: Nuisances
) -> dict[str, Any]:
    """When and how this hanger is tested in each round (all rounds; `done` says which)."""
    rng, count = stream(seed, "plan", h.number), len(rounds.day)
    minutes = 9.0 * h.number + rng.uniform(0, 6, count)
    day = rounds.day + (minutes / 60 / DAY_H if n.irregular else 0.0)
    amplitude = np.exp(n.amplitude_sd * rng.standard_normal(count))
    where = h.sensor_at_m + n.sensor_place_sd_m * rng.standard_normal(count)
    elsewhere = rng.random(count) < n.sensor_elsewhere
    where = np.where(elsewhere, rng.uniform(1.0, min(4.0, 0.6 * h.bar.length_m), count), where)
    parked = rng.random(count) < n.parked_share
    van = np.where(parked, rng.uniform(15e3, 120e3, count) * n.traffic, 0.0)
    van_at, share = 12 * rng.standard_normal(count), rng.uniform(0.2, 0.8, count)
    parted = np.flatnonzero(np.diff(rounds.day) > 45)  # no hanger is left out beside a long gap
    beside = np.isin(np.arange(count), (parted, parted + 1))
    return {
        "hanger": h.number,
        "day": day,
        "done": (rng.random(count) >= n.skipped) | beside,
        "amplitude": amplitude,
        "kit": common["kit"],
        "sensor_at_m": np.clip(where, 0.3, 0.9 * h.bar.length_m),
        "van": van,  # N, its share on each side: lever of the lane
        "van_at": van_at,  # m from the hanger
        "van_share": share,
        "cars": common["cars"],
        "car_share": rng.uniform(0.3, 0.7, count),
        "astray": rng.random(count) < n.wrong_hanger,
        "seating": n.seating_sd * rng.standard_normal((count, 2, 2)),
        "loud": (amplitude + common["wind"]) * common["soft"],
    }


def _tensions(
    b: Bridge,
    influences: list[_Influence],
    sky: Weather,
    event: Event,
    relaxation: float,
    plan: dict[str, Any],
) -> dict[str, Any]:
    """Tensions of all hangers at the visits of one (the frame is one body), and temperatures."""
    day, own = plan["day"], b.hangers[plan["hanger"] - 1]
    reference = _reference_tensions(b, influences, event, relaxation, day)
    thermal, traffic = np.zeros_like(reference), np.zeros_like(reference)
    tie, difference = sky.at(sky.tie, day), sky.at(sky.tie_difference, day)
    warm: dict[int, Array] = {}
    arches = []
    for side, (frame, i) in enumerate(zip(b.frames, influences, strict=True)):
        mates = [h for h in b.hangers if h.side == side]
        at = [h.number - 1 for h in mates]
        series = {d: sky.hanger(d, side) for d in {round(h.bar.diameter_m, 2) for h in mates}}
        read = {d: sky.at(s, day) for d, s in series.items()}
        arch = sky.at(sky.arch[side], day)
        arches.append(arch)
        bars = np.column_stack([read[round(h.bar.diameter_m, 2)] for h in mates]) - REFERENCE_C
        thermal[:, at] += np.outer(arch - REFERENCE_C, i.arch) + np.outer(tie - REFERENCE_C, i.tie)
        thermal[:, at] += np.outer(difference, i.difference) + bars @ i.hanger.T
        warm |= {h.number: bars[:, k] + REFERENCE_C for k, h in enumerate(mates)}
        lane = plan["van_share"] if side == own.side else 1 - plan["van_share"]
        cars = plan["car_share"] if side == 0 else 1 - plan["car_share"]
        place = np.clip(b.frames[own.side].places_m[own.index] + plan["van_at"], 0, frame.span_m)
        lines = np.array([np.interp(place, i.places, row) for row in i.point]).T
        traffic[:, at] += (plan["van"] * lane)[:, None] * lines
        traffic[:, at] += np.outer(plan["cars"] * cars, i.line)
    total = reference + thermal + traffic
    return {
        "total": np.maximum(total, 1e3),  # a rod that goes slack hangs by its own weight
        "reference": reference,
        "warm": warm,
        "air": sky.at(sky.air, day),
        "shade": sky.at(sky.shade, day),
        "arch": arches[own.side],
        "tie": tie,
        "difference": difference,
        "traffic": traffic,
    }


def _solve(seed: int, h: Hanger, plans: list[dict[str, Any]], event: Event, n: Nuisances) -> None:
    """Put the exact frequencies of this hanger where it was the one tested."""
    mine = event.hanger == h.number
    layer = math.sqrt(h.tension_n * h.bar.bending_nm2)
    gather: list[tuple[dict[str, Any], Any, State, Any]] = []
    for plan in plans:
        which = np.flatnonzero(plan["done"] & (plan["tested"] == h.number))
        if len(which) == 0:
            continue
        day, size = plan["day"][which], len(which)
        after = (day >= event.day) & mine
        springs = np.tile(h.springs, (size, 1, 1))
        kg, at = (
            plan["kit"][which].copy(),
            np.minimum(plan["sensor_at_m"][which], 0.9 * h.bar.length_m),
        )
        if event.kind == "springs":
            for p, plane in enumerate(PLANES):
                for e, end in enumerate(ENDS):
                    if plane in event.planes and event.end in (end, "both"):
                        springs[after, p, e] *= event.size
        elif event.kind == "sensor_moved":
            scatter = at - h.sensor_at_m
            kg = np.where(after, event.size, kg)
            at = np.where(
                after,
                np.clip(event.place * h.bar.length_m + scatter, 0.1, 0.95 * h.bar.length_m),
                at,
            )
        fixity = springs / (springs + layer)
        loss = n.softening * h.softening * plan["loud"][which][:, None, None]
        above = plan["warm"][h.number][which] - REFERENCE_C
        loss = loss + n.cold_joints * h.cold * above[:, None, None]
        fixity = fixity * (1 - np.clip(loss, -0.1, 0.5)) * np.exp(plan["seating"][which])
        springs = np.minimum(fixity, 0.999) / (1 - np.minimum(fixity, 0.999)) * layer
        tension = plan["total"][which, h.number - 1]
        gather.append(
            (plan, which, State(tension, springs, plan["warm"][h.number][which], kg, at), after)
        )
    if not gather:
        return
    states = State(
        *(np.concatenate([getattr(g[2], name) for g in gather]) for name in vars(gather[0][2]))
    )
    after = np.concatenate([g[3] for g in gather])
    exact, seen = np.zeros((len(after), 2, SOLVED)), np.zeros((len(after), 2, SOLVED))
    changed = h.bar
    if event.kind == "lamp":
        changed = replace(h.bar, lamp=(event.place * h.bar.length_m, event.size))
    elif event.kind == "section_loss":
        ends = (event.place + half * event.extent for half in (-0.5, 0.5))
        low, high = (float(np.clip(end, 0, 1)) * h.bar.length_m for end in ends)
        changed = replace(h.bar, loss=(low, high, event.size))
    apart = mine and changed is not h.bar
    for bar, part in ((h.bar, ~after), (changed, after)) if apart else ((h.bar, after | True),):
        if part.any():
            exact[part], seen[part] = frequencies(bar, states.part(part))
    begin = 0
    for plan, which, state, _ in gather:
        size = len(which)
        plan["exact"][which], plan["seen"][which] = (
            exact[begin : begin + size],
            seen[begin : begin + size],
        )
        plan.setdefault("state", {}).update({int(v): state.part(k) for k, v in enumerate(which)})
        begin += size


def _record(
    seed: int,
    h: Hanger,
    plan: dict[str, Any],
    common: dict[str, Array],
    rounds: _Rounds,
    n: Nuisances,
    season_wide: tuple[float, Array, datetime],
    event: Event,
    concerned: str,
) -> HangerSeason:
    """What the team hands in for one hanger, and the truth about it."""
    share, tones, first = season_wide
    rng, count = stream(seed, "identification", h.number), len(rounds.day)
    shape = (count, 2, ORDERS)
    test_error, mode_error = rng.standard_normal(count), rng.standard_normal(shape)
    guess, rub = rng.standard_normal(shape), rng.standard_normal(shape)
    lacking, whole = rng.random(shape), rng.random((count, 2))
    wrong, which_kind, which_way = rng.random(shape), rng.random(shape), rng.random(shape)
    prone = 0.6 + 2.4 * (rng.random(shape[1:]) < 1 / 6)  # some modes are easily taken for others
    shift, highest = rng.random((count, 2)), rng.integers(ORDERS - 1, ORDERS + 1, count)
    thermometer, amplitude = rng.standard_normal(count), rng.standard_normal(count)
    unread, unheard, typo = rng.random(count), rng.random(count), rng.random(count)
    visits: list[dict[str, Any]] = []
    rows: list[dict[str, Any]] = []
    mistaken: list[dict[str, Any]] = []
    for v in np.flatnonzero(plan["done"]):
        name, exact, seen = f"t{len(visits) + 1}", plan["exact"][v], plan["seen"][v]
        when = first + timedelta(days=float(plan["day"][v]))
        visit: dict[str, Any] = {"id": name, "time": when.strftime("%Y-%m-%dT%H:%M:%SZ")}
        air = float(plan["air"][v])
        if not (common["unread"][v] or unread[v] < 0.35 * n.temperature_missing):
            felt = float(plan["shade"][v] + common["thermometer"][v] + 0.5 * thermometer[v])
            felt = air + n.thermometer * (felt - air)
            if typo[v] < n.temperature_typos:
                felt = -felt if typo[v] < n.temperature_typos / 2 else felt + 10
            visit["temperature_c"] = float(round(felt)) if n.thermometer else felt
        if unheard[v] >= n.amplitude_missing:
            read = float(plan["amplitude"][v] * math.exp(n.amplitude_recorded_sd * amplitude[v]))
            visit["amplitude"] = float(f"{read:.2g}") if n.amplitude_recorded_sd else read
        clock = 1 + event.size if event.kind == "clock" and plan["day"][v] >= event.day else 1.0
        modes: list[dict[str, Any]] = []
        zeta = h.damping * (1 + 0.5 * plan["loud"][v] * n.softening)  # rubbing joints
        law = np.sqrt(zeta[:, :ORDERS] / (2 * math.pi * exact[:, :ORDERS] * common["seconds"][v]))
        mixed = math.sqrt(n.common / 2) * (common["error"][v] + test_error[v])
        error = law * n.scatter * (mixed + math.sqrt(1 - n.common) * mode_error[v])
        stated = law / common["ratio"][v] * np.exp(0.15 * n.misstated * guess[v])
        for p, plane in enumerate(PLANES):
            moved = shift[v, p] < 0.003 * share / 0.035
            if whole[v, p] < 0.03 * n.missing:
                continue
            for k in range(min(ORDERS, int(highest[v])) if n.missing else ORDERS):
                blind = math.exp(-((seen[p, k] / 0.12) ** 2))  # the sensor sits near a node
                if lacking[v, p, k] < n.missing * min(0.05 + 0.03 * k + 0.5 * blind, 0.9):
                    continue
                truth_hz, kind = float(exact[p, k]), ""
                if moved:
                    truth_hz, kind = float(exact[p, k + 1]), "order_shift"
                elif wrong[v, p, k] < max(share - 0.003, 0.0) * prone[p, k]:
                    truth_hz, kind = _mistake(
                        exact, p, k, which_kind[v, p, k], which_way[v, p, k], tones
                    )
                read = truth_hz * clock * (1 + float(error[p, k]))
                sd = read * float(stated[p, k])
                damping = float(zeta[p, k]) * math.exp(0.25 * n.scatter * float(rub[v, p, k]))
                modes.append(mode(plane, k + 1, read, sd, damping))
                if kind:
                    off = truth_hz / float(exact[p, k]) - 1
                    place = {"test": name, "plane": plane, "order": k + 1}
                    mistaken.append(place | {"kind": kind, "relative_shift": off})
        if not modes:
            continue
        visits.append(visit | {"modes": modes})
        state, tested = plan["state"][int(v)], int(plan["tested"][v])
        rows.append(
            {
                "test": name,
                "day": float(plan["day"][v]),
                "stretch": int(rounds.stretch[v]),
                "operator": int(rounds.operator[v]),
                "tested_hanger": tested,
                "tension_n": float(plan["total"][v, h.number - 1]),  # of this hanger
                "reference_tension_n": float(plan["reference"][v, h.number - 1]),
                "tested_tension_n": float(state.tension_n),
                "traffic_tension_n": float(plan["traffic"][v, h.number - 1]),
                "air_c": air,
                "hanger_c": float(plan["warm"][h.number][v]),
                "arch_c": float(plan["arch"][v]),
                "tie_c": float(plan["tie"][v]),
                "tie_difference_k": float(plan["difference"][v]),
                "amplitude": float(plan["amplitude"][v]),
                "softening_day": bool(common["soft"][v]),
                "springs_nm_rad": state.springs.tolist(),
                "sensor_kg": float(state.sensor_kg),
                "sensor_at_m": float(state.sensor_at_m),
                "clock": clock,
                "real_over_stated_sd": float(common["ratio"][v]) * n.scatter,
                "exact_hz": {p: exact[i, :ORDERS].tolist() for i, p in enumerate(PLANES)},
            }
        )
    truth = {
        "event": event,
        "concerned": concerned,
        "built_tension_n": h.tension_n,
        "bar": h.bar,
        "springs_nm_rad": h.springs.tolist(),
        "visits": rows,
        "mistaken": mistaken,
    }
    return HangerSeason(dict(h.description), visits, truth)


def _concerned(b: Bridge, influences: list[_Influence], event: Event) -> dict[int, str]:
    """Which hangers an event moves: "event", "frame" (tension by more than 0.1 %) or ""."""
    out = {h.number: "event" if event.kind == "clock" else "" for h in b.hangers}
    if event.kind == "none":
        return out
    own = b.hangers[event.hanger - 1]
    if event.kind in ("tension_step", "tension_ramp"):
        c = influences[own.side].longer[:, own.index]
        for h in (h for h in b.hangers if h.side == own.side):
            change = event.size * own.tension_n * c[h.index] / c[own.index] / h.tension_n
            out[h.number] = "frame" if abs(change) > 1e-3 else ""
    return out | {event.hanger: "event"}


def _mistake(
    exact: Array, p: int, k: int, kind: float, way: float, tones: Array
) -> tuple[float, str]:
    """A wrong frequency under the name of order k+1 in plane p."""
    own = float(exact[p, k])
    tone = float(tones[int(np.argmin(np.abs(tones / own - 1)))])
    if kind < 0.3 and abs(tone / own - 1) < 0.2:
        return tone * (1 + 0.002 * (way - 0.5)), "tone"
    if kind < 0.65:
        return float(exact[1 - p, k]), "other_plane"
    other = k + 1 if k == 0 or way < 0.5 else k - 1
    return float(exact[p, other]), "wrong_order"
