"""Three years of hammer tests on the hangers of a network arch: frequencies of known truth.

**Beam.** Each hanger is a bar of `bars.py`, x from the pin at the deck up, on a mesh of its own.

Features: fork plates (a stiff, heavy length at each end, between a rotation spring at the pin and
the free hanger), lateral flexibility of each support, a turnbuckle or sleeve, a soft clamp where
two hangers cross, point masses, the sag of an inclined hanger (Irvine: Cable Structures, 1981,
its rank-one stiffening (EA/L)(m g cos(a)/T)^2 (int w dx)^2 in the plane of the arch, EA softened by
the deck and the arch).

**Strands.** EI between that of sticking and that of slipping wires, falling with the amplitude of
the vibration (Papailiou, IEEE Trans. Power Delivery 12, 1997; ratios 0.15-0.45 slipping to
0.75-1 sticking).  Rods: fork joints soften with the amplitude by a few percent.

**Season.** Air: year, day, AR(1) weather, sun through AR(1) cloud; members follow by first-order
lags.  A tension follows local temperature differences by a fixed random influence matrix,
the difference deck to arch, settlement, traffic, wind.  EN 1991-1-5 puts design differences of
member temperatures at 10-15 K; the coefficients of 1e-3 / K follow from EA alpha / T = 1.5e-2 / K
(a rod at 160 MPa) times 5-15 % restraint by a flexible deck.

**Measurement.** Three operators, Student-t errors, mistakes: see `Nuisances`.  The numbers are
those of the brief of this world where it gives them, and engineering judgement elsewhere.

**Speed.** Per hanger and plane a Galerkin reduction on modes at three states and on static
responses to every point load; each visit is an eigenproblem of size 30, exact to 1e-5 against
the full one (tested).

Every law draws from its own stream (seed, law, hanger), the same number of times on or off.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from tests.worlds import seasons
from tests.worlds.bars import (
    GRAVITY_M_S2,
    POISSON,
    Array,
    Bar,
    Matrices,
    Zone,
    cowper,
    reduced_basis,
    solve,
    solve_many,
)
from tests.worlds.seasons import PLANES, REFERENCE_C, lagged, mode, stream

EXPANSION_PER_K = 1.2e-5  # EN 1991-1-5, annex C
MODULUS_PER_K = -3.0e-4  # steel near room temperature
STEP_H = 0.5  # of the weather
START = datetime(2026, 5, 1, tzinfo=UTC)
MACHINE_HZ = (8.33, 16.67, 25.0)  # 500, 1000 and 1500 turns a minute; overtones of it


# --------------------------------------------------------------------------------------- beam


@dataclass(frozen=True)
class Beam:
    """One hanger in one plane, sound and worn; its own springs stand at (deck, arch)."""

    bar: Bar
    worn: Bar
    springs_nm: tuple[float, float]
    sag_n_m3: float = 0.0  # (EA/L)(m g cos)^2, over T^2 it is the stiffness per (int w)^2
    marks_m: tuple[float, ...] = ()  # where a point mass or a clamp may sit


@dataclass(frozen=True)
class State:
    """What varies from visit to visit, for one hanger in one plane."""

    tension_n: float
    bending_factor: float = 1.0  # slip of the wires
    spring_factors: tuple[float, float] = (1.0, 1.0)
    warmer_k: float = 0.0  # than the reference
    masses: tuple[tuple[float, float], ...] = ()  # kg at m
    lost: bool = False


class Parts:
    """Matrices whose sum is a state's, of a whole bar or in a basis."""

    def __init__(self, beam: Beam, matrices: Matrices, basis: Array | None = None) -> None:
        self.beam, m = beam, matrices
        turned = np.eye(len(m.mass)) if basis is None else basis
        deck, arch = m.turns @ turned
        sagging = m.area @ turned
        stiff = {
            "slips": m.bending, "fit": m.zone_bending + m.shear, "pull": m.pull,
            "weight": m.weight, "held": m.held,
        }  # fmt: skip
        self.stiff = {name: turned.T @ part @ turned for name, part in stiff.items()}
        self.stiff["deck"], self.stiff["arch"] = np.outer(deck, deck), np.outer(arch, arch)
        self.stiff["sag"] = np.outer(sagging, sagging)
        self.mass = turned.T @ m.mass @ turned
        self.points = dict(zip(beam.marks_m, m.rows(beam.marks_m) @ turned, strict=True))

    def of(self, states: Sequence[State]) -> tuple[Array, Array]:
        """Stiffness and mass (visit, n, n)."""
        tension, slip, warm = (
            np.array([getattr(state, name) for state in states])
            for name in ("tension_n", "bending_factor", "warmer_k")
        )
        springs = self.beam.springs_nm * np.array([state.spring_factors for state in states])
        grown = 1 + EXPANSION_PER_K * warm
        modulus = (1 + MODULUS_PER_K * warm) * grown  # EI / L^3 with I as L^4
        factors = {
            "slips": modulus * slip, "fit": modulus, "pull": tension / grown, "weight": 1 / grown,
            "held": np.ones_like(tension), "deck": springs[:, 0], "arch": springs[:, 1],
            "sag": self.beam.sag_n_m3 / tension**2,
        }  # fmt: skip
        parts = np.array([self.stiff[name] for name in factors])
        stiff = np.tensordot(np.array(list(factors.values())).T, parts, axes=1)
        mass = np.repeat(self.mass[None], len(states), axis=0)
        for i, state in enumerate(states):
            for kg, place in state.masses:
                point = self.points[round(place, 9)]
                mass[i] += kg * np.outer(point, point)
        return stiff, mass


def full_modes(beam: Beam, state: State, count: int) -> tuple[Array, Array]:
    """Frequencies (Hz) and shapes of the whole bar."""
    bar = beam.worn if state.lost else beam.bar
    stiff, mass = Parts(beam, Matrices(bar, beam.marks_m)).of([state])
    return solve(stiff[0], mass[0], count)


class Reduced:
    """Small matrices of one hanger in one plane, and the map from a state to its modes."""

    def __init__(self, beam: Beam, states: Sequence[State], count: int) -> None:
        self.parts: dict[bool, Parts] = {}
        for lost in {state.lost for state in states}:
            matrices = Matrices(beam.worn if lost else beam.bar, beam.marks_m)
            whole = Parts(beam, matrices)
            stiff, mass = whole.of([state for state in states if not lost or state.lost])
            shapes = [solve(k, m, count)[1] for k, m in zip(stiff, mass, strict=True)]
            ends = matrices.rows([0.0, beam.bar.length_m])
            loads = np.vstack([*whole.points.values(), *ends, *matrices.turns]).T
            basis = reduced_basis(stiff[0], stiff[0], [*shapes, loads])
            self.parts[lost] = Parts(beam, matrices, basis)

    def modes(self, states: Sequence[State], count: int) -> tuple[Array, dict[float, Array]]:
        """Frequencies (visit, mode) and deflections (visit, mode) of unit modal mass at marks."""
        hz = np.zeros((len(states), count))
        seen = {place: np.zeros_like(hz) for place in self.parts[False].points}
        for lost, parts in self.parts.items():
            rows = np.array([state.lost == lost for state in states])
            if rows.any():
                own = [state for state in states if state.lost == lost]
                hz[rows], shapes = solve_many(*parts.of(own), count)
                for place, point in parts.points.items():
                    seen[place][rows] = np.einsum("i,vim->vm", point, shapes)
        return hz, seen


# ------------------------------------------------------------------------------------- nuisances


@dataclass(frozen=True)
class Nuisances(seasons.Switched):
    """What separates a field record from the textbook; each is off at 0 and scales by its value.

    `none()` switches all off; `replace(Nuisances(), wind=0.0)` one.  Scales (default 1) multiply
    laws whose numbers stand in the code beside them; the others are the numbers themselves.
    """

    # the hanger against its description
    area_sd: float = 0.008  # rolled bars, EN 10060; strand mills
    modulus_sd: float = 0.02  # JCSS Probabilistic Model Code 3.2, half of its 3 % and lot to lot
    density_sd: float = 0.004
    length_sd_m: float = 0.004  # tape, and where the pin is
    length_sd_share: float = 4e-4
    tension_sd: tuple[float, float] = (0.05, 0.10)  # true tension over that of the design
    spring_log_sd: float = 0.7  # of the ends about their design value
    fork_plates: float = 1.0
    end_flexibility: float = 1.0
    sleeve_share: float = 0.3
    crossing_share: float = 0.3
    own_weight: float = 1.0
    sag: float = 1.0
    slip: float = 1.0  # strands soften with the amplitude
    # what moves the tension and the joints
    temperature: float = 1.0  # effect, not the weather itself
    redistribution: float = 1.0  # of the influence matrix off its diagonal
    settlement_sd_per_year: float = 0.0015
    traffic: float = 1.0
    wind: float = 1.0
    joint_amplitude: float = 0.03  # softening of fork joints per unit of ln(amplitude)
    # the visit
    operators: float = 1.0  # habits: hammer, optimism, thermometer
    sensor_kg: tuple[float, float] = (0.20, 0.45)
    scatter: float = 1.0  # of frequencies; 0 for exact ones
    degrees_of_freedom: float = 4.0  # Student-t; 0 for a normal law
    visit_correlation: float = 0.3
    plane_correlation: float = 0.25
    clock_ppm: float = 20.0
    clock_ppm_per_year: float = 5.0
    wrong_rate_share: float = 0.004  # of visits, +0.1 %
    irregular: float = 1.0  # jitter of the dates, days left out
    winter_gap: float = 0.9  # share of visits left out, mid December to mid February
    temperature_missing: float = 0.2
    amplitude_missing: float = 0.5
    operator_unknown: float = 0.5
    missing_modes: float = 0.05  # and those the sensor is at a node of
    mistaken: tuple[float, float] = (0.02, 0.05)  # share of modes, of a hanger
    persistent: float = 0.12  # share of hangers where one mistake comes back
    swapped: float = 0.005  # share of visits under another hanger's name


@dataclass(frozen=True)
class Event(seasons.Event):
    """An event; a moved sensor sits at a new place, `size` of the length."""

    day: float = 540.0
    place: float = 0.3
    extent: float = 0.08

    def after(self, days: Array) -> NDArray[np.bool_]:
        return np.asarray(days) >= self.day


@dataclass(frozen=True)
class Hanger:
    """True properties of one hanger; `springs_nm[plane]` at (deck, arch)."""

    name: str
    kind: str  # rod, strand
    diameter_m: float
    area_m2: float
    second_moment_m4: float
    modulus_pa: float
    density_kg_m3: float
    mass_kg_m: float
    length_m: float
    inclination_rad: float
    tension_n: float
    springs_nm: tuple[tuple[float, float], tuple[float, float]]
    flexibility_m_n: tuple[tuple[float, float], tuple[float, float]]
    zones: tuple[Zone, ...]
    stick_factor: float  # of the second moment
    slip_factor: float
    sensor_places_m: tuple[float, ...]  # by operator
    crossing: tuple[int, float, float, float] | None  # partner, place, its place, N/m
    own_weight: float
    sag: float
    description: dict[str, Any]

    def beam(self, plane: str, event: Event, marks: tuple[float, ...]) -> Beam:
        p, length = PLANES.index(plane), self.length_m
        gravity = GRAVITY_M_S2 * self.mass_kg_m
        sag = 0.3 * self.modulus_pa * self.area_m2 / length  # deck and arch give way
        sag *= (gravity * np.cos(self.inclination_rad)) ** 2 * self.sag
        deck, arch = (1 / each if each else np.inf for each in self.flexibility_m_n[p])
        bar = Bar(
            length_m=length,
            tension_n=self.tension_n,
            bending_stiffness_n_m2=self.modulus_pa * self.second_moment_m4,
            mass_per_length_kg_m=self.mass_kg_m,
            shear_stiffness_n=cowper() * self.modulus_pa / (2 + 2 * POISSON) * self.area_m2,
            rotary_inertia_kg_m=self.density_kg_m3 * self.second_moment_m4,
            zones=self.zones,
            lateral_n_m=(deck, arch),
            gravity_along_m_s2=GRAVITY_M_S2 * np.sin(self.inclination_rad) * self.own_weight,
        )
        worn = bar
        if event.kind == "section_loss":
            half, middle = event.extent * length / 2, event.place * length
            ends = max(middle - half, 0.0), min(middle + half, length)
            kept = 1 - event.size
            worn = replace(bar, zones=(*bar.zones, Zone(*ends, kept**2, kept, 1.0)))
        known = self.springs_nm[p]
        return Beam(bar, worn, known, float(sag) if plane == "longitudinal" else 0.0, marks)

    def bending_factor(self, amplitude: Array, slip: float) -> Array:
        """Share of the second moment that acts, at a relative amplitude (1: a usual blow).

        Most wires stick at the curvatures of a hammer test: a sixth of the way to full slip.
        """
        sliding = amplitude / (amplitude + 5.0) if slip else 0.0 * amplitude
        return self.stick_factor - (self.stick_factor - self.slip_factor) * sliding * slip


def bridge(seed: int, count: int, nuisances: Nuisances) -> list[Hanger]:
    """Hangers of one side of a network arch: a parabola of lengths, some rods, some strands."""
    n = nuisances
    places = stream(seed, "sensor place").uniform(1.3, 2.3, 3)  # above the deck, by operator
    style = stream(seed, "bridge")
    rise, rods = style.uniform(10.0, 22.0), style.uniform(0.3, 0.9)
    partners: dict[int, tuple[int, float, float, float]] = {}
    crossings = stream(seed, "crossing")
    draws = crossings.uniform(size=(count, 4))
    hangers = []
    for i in range(count):
        along = (i + 0.7) / (count + 0.4)
        design, true = stream(seed, "design", i), stream(seed, "true", i)
        u, z = design.uniform(size=12), true.standard_normal(24)
        length = float(max(rise * 4 * along * (1 - along) * (0.9 + 0.2 * u[0]), 3.5 + u[1]))
        rod = u[2] < rods
        if rod:
            diameter = float(np.interp(u[3], (0, 1), (0.045, 0.095)))
            area, modulus, density = np.pi * diameter**2 / 4, 210e9, 7850.0
            stress = np.interp(u[4], (0, 1), (70e6, 190e6))
            stick = slide = 1.0
        else:
            diameter = float(np.interp(u[3], (0, 1), (0.028, 0.065)))
            area, modulus, density = 0.85 * np.pi * diameter**2 / 4, 165e9, 8000.0  # filled
            stress = np.interp(u[4], (0, 1), (200e6, 480e6))
            stick, slide = (0.75 + 0.25 * u[10], 0.15 + 0.3 * u[11]) if n.slip else (1.0, 1.0)
        moment = area**2 / (4 * np.pi) if rod else 0.85 * np.pi * diameter**4 / 64
        nominal = float(stress * area)
        spread = n.tension_sd[0] + (n.tension_sd[1] - n.tension_sd[0]) * u[5]
        grown = 1 + n.area_sd * z[0]
        true_modulus = modulus * (1 + n.modulus_sd * z[1])
        true_density = density * (1 + n.density_sd * z[2])
        tension = nominal * float(np.exp(np.clip(z[3], -2.5, 2.5) * spread))
        taped = length + n.length_sd_m * z[4] + n.length_sd_share * length * z[5]
        layer = np.sqrt(modulus * moment / nominal)
        # turned across the fork the pin holds by its plates, in its plane by friction
        base = modulus * moment / layer * np.array([8.0, 8.0, 2.0, 2.0])
        k = base * np.exp(n.spring_log_sd * z[6:10])
        limp = n.end_flexibility * np.array([6e-9, 3e-9, 2e-9, 1e-9]) * np.exp(0.5 * z[10:14])
        zones: list[Zone] = []
        if n.fork_plates:
            bend, heavy = 1 + n.fork_plates * (3 + 4 * u[6]), 1 + n.fork_plates * (1 + 1.5 * u[7])
            lengths = np.minimum((2.5 + 1.5 * u[8:10]) * diameter, 0.08 * length)
            zones.append(Zone(0.0, float(lengths[0]), bend, heavy, np.sqrt(bend)))
            zones.append(Zone(length - float(lengths[1]), length, bend, heavy, np.sqrt(bend)))
        known: dict[str, float] = {}
        sleeve = stream(seed, "sleeve", i).uniform(size=4)
        if sleeve[0] < n.sleeve_share:
            start = 0.12 * length + 0.1 * sleeve[1] * length
            long = (4 + 3 * sleeve[2]) * diameter
            zones.append(Zone(start, start + long, 3 + 3 * sleeve[3], 2.5, 2.0))
            known = {"sleeve_at_m": float(start + long / 2), "sleeve_length_m": float(long)}
        j = i + 1
        if j < count and i not in partners and draws[i, 0] < n.crossing_share:
            soft = float(np.exp(np.interp(draws[i, 3], (0, 1), np.log([200.0, 3000.0]))))
            mine, other = 0.35 + 0.3 * draws[i, 1], 0.35 + 0.3 * draws[i, 2]
            partners[i], partners[j] = (j, mine, other, soft), (i, other, mine, soft)
        crossing = partners.get(i)
        if crossing:
            known["crossing_at_m"] = float(crossing[1] * length)
        description = {
            **({"diameter_m": diameter} if rod else {"area_m2": area}),
            "second_moment_m4": moment,
            "mass_per_length_kg_m": density * area,
            "length_m": float(taped),
            "nominal_tension_n": nominal,
            "modulus_pa": modulus,
            "density_kg_m3": density,
            "kind": "rod" if rod else "strand",
            **known,
        }
        hangers.append(Hanger(
            name=f"H{i + 1:02d}", kind="rod" if rod else "strand", diameter_m=diameter,
            area_m2=area * grown, second_moment_m4=moment * grown**2, modulus_pa=true_modulus,
            density_kg_m3=true_density, mass_kg_m=true_density * area * grown, length_m=length,
            inclination_rad=float(np.deg2rad(55 + 30 * stream(seed, "slope", i).uniform())),
            tension_n=tension, springs_nm=((k[0], k[1]), (k[2], k[3])),
            flexibility_m_n=((limp[0], limp[1]), (limp[2], limp[3])),
            zones=tuple(zones), stick_factor=stick, slip_factor=slide,
            sensor_places_m=tuple(float(min(p, 0.4 * length)) for p in places),
            crossing=crossing, own_weight=n.own_weight, sag=n.sag, description=description,
        ))  # fmt: skip
    return hangers


# ----------------------------------------------------------------------------------- the world


def _ar1(rng: np.random.Generator, count: int, step: float, memory: float) -> Array:
    """Unit-variance AR(1) series, memory and step in the same unit."""
    a = np.exp(-step / memory)
    z = rng.standard_normal(count) * np.sqrt(1 - a * a)
    z[0] /= np.sqrt(1 - a * a)
    return np.asarray(lfilter([1.0], [1.0, -a], z))


class Weather:
    """Half-hourly air temperature and sun (0 to 1); days count from `START`, 1 May."""

    def __init__(self, seed: int, days: float) -> None:
        rng = stream(seed, "weather")
        count = int(days * 24 / STEP_H) + 2
        hours = np.arange(count) * STEP_H
        self.hours = hours
        year = 2 * np.pi * (hours / 24 - 80) / 365.25  # warmest in late July
        height = np.sin(np.pi * (hours % 24 - 6) / 12)  # of the sun, up from 6 to 18 h
        cloud = 1 / (1 + np.exp(-1.5 * _ar1(rng, count, STEP_H, 30.0)))
        season = 0.65 + 0.35 * np.cos(2 * np.pi * (hours / 24 - 51) / 365.25)
        self.sun = np.clip(height, 0, None) * season * (1 - 0.85 * cloud)
        weather = 3.5 * _ar1(rng, count, STEP_H, 72.0)
        day = 4.0 * (0.5 + season) * (1 - 0.6 * cloud) * np.cos(2 * np.pi * (hours % 24 - 15) / 24)
        self.air = 9.5 + 9.5 * np.cos(year - 2 * np.pi * 6 / 365.25) + weather + day

    def member(self, hours: float, gain_k: float) -> Array:
        return lagged(self.air + gain_k * self.sun, hours, STEP_H)


class World:
    """Relative tension of every hanger over time, with its parts."""

    def __init__(self, seed: int, count: int, years: float, n: Nuisances) -> None:
        self.days = 365.25 * years
        self.weather = weather = Weather(seed, self.days)
        grid = len(weather.hours)
        rng = stream(seed, "influence")
        far = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
        shape = np.exp(-far / 1.5) * (1 + 0.4 * rng.standard_normal((count, count)))
        np.fill_diagonal(shape, 0.0)
        # what one hanger gives up, its neighbours carry: at most 0.15 each
        self.influence = np.eye(count) - 0.2 * n.redistribution * np.clip(shape, 0, 1.1)
        lags = np.exp(stream(seed, "lags").uniform(np.log(0.3), np.log(1.2), count))
        gains = 3.0 + 5.0 * stream(seed, "gains").uniform(size=count)
        arch, deck = weather.member(3.0, 9.0), weather.member(8.0, 8.0)
        self.own = np.array([weather.member(lag, g) for lag, g in zip(lags, gains, strict=True)])
        pick = stream(seed, "sensitivity")
        restraint = 1e-3 * pick.uniform(0.6, 2.2, count)  # per K hanger over arch
        smooth = np.exp(-((far / 4.0) ** 2))
        smooth /= np.sqrt((smooth**2).sum(1, keepdims=True))
        pattern = smooth @ pick.standard_normal(count)
        uniform = smooth @ pick.standard_normal(count)
        local = self.influence @ (-restraint[:, None] * (self.own - arch))
        total = local + 1.5e-3 * pattern[:, None] * (deck - arch)
        total += 6e-4 * uniform[:, None] * (arch - REFERENCE_C)  # bearings, unlike expansions
        self.thermal = n.temperature * total
        self.warm = n.temperature
        settle = stream(seed, "settlement")
        self.rates = n.settlement_sd_per_year * (smooth @ settle.standard_normal(count))
        self.rates += 0.3 * n.settlement_sd_per_year * settle.standard_normal(count)
        load = stream(seed, "traffic")
        kinds, sizes = load.uniform(size=grid), load.uniform(size=grid)
        where = load.uniform(0, count, grid)
        some = -0.003 * np.log(np.clip(sizes, 1e-9, 1))  # vehicles: exponential, mean 0.3 %
        self.load = n.traffic * np.where(
            kinds < 0.80, 2e-4 * sizes, np.where(kinds < 0.97, some, 0.01 + 0.05 * sizes)
        )
        self.where = where
        gust = stream(seed, "wind")
        days = int(self.days) + 2
        # daily wind, unit: a breezy day; Student-t of 3 degrees, so a gale a year or two
        self.gusts = n.wind * np.abs(gust.standard_t(3, days)) * 0.6
        self.windward = gust.standard_normal(count)

    def _index(self, days: Array) -> NDArray[np.int64]:
        return np.asarray(np.clip(days * 24 / STEP_H, 0, len(self.weather.hours) - 1), dtype=int)

    def wind(self, days: Array) -> Array:
        return np.asarray(self.gusts[np.clip(days, 0, None).astype(int)])

    def parts(self, hanger: int, days: Array) -> dict[str, Array]:
        """Shares of the tension that come and go."""
        at = self._index(days)
        reach = np.exp(-(((hanger - self.where[at]) / 5.0) ** 2))
        gale = 1e-3 * self.windward[hanger] * np.minimum(self.wind(days), 4.0) ** 2
        return {"thermal": self.thermal[hanger, at], "traffic": self.load[at] * reach, "gale": gale}

    def passing(self, hanger: int, days: Array) -> Array:
        return np.asarray(sum(self.parts(hanger, days).values()))

    def warmer(self, hanger: int, days: Array) -> Array:
        return np.asarray(self.warm * (self.own[hanger, self._index(days)] - REFERENCE_C))

    def lasting(self, hanger: int, days: Array, event: Event, relaxation: float) -> Array:
        """Tension over that of the start: settlement, relaxation, event."""
        factor = 1 + (self.rates[hanger] - relaxation) * days / 365.25
        if event.kind in ("tension_step", "tension_ramp"):
            course = event.after(days).astype(float)
            if event.kind == "tension_ramp":
                course = np.clip(days - event.day, 0, None) / 365.25
            factor = factor * (1 + event.size * course * self.influence[hanger, event.hanger])
        return np.asarray(factor)


@dataclass(frozen=True)
class Operator:
    """A person, their hammer, thermometer, sensor and logger."""

    name: str
    hammer: float  # median relative amplitude
    hammer_log_sd: float
    optimism: float  # stated over true standard deviation
    thermometer_k: float
    sensor_kg: float
    orders: int
    scatter: float
    clock: float
    clock_per_year: float


def _operators(seed: int, n: Nuisances) -> list[Operator]:
    people = []
    for i in range(3):
        rng = stream(seed, "operator", i)
        z, u = rng.standard_normal(6), rng.uniform(size=5)
        habit = n.operators
        people.append(Operator(
            name="ABC"[i], hammer=float(np.exp(habit * 0.5 * z[0])),
            hammer_log_sd=habit * (0.15 + 0.3 * u[0]),
            optimism=float(np.exp(habit * np.interp(u[1], (0, 1), np.log([0.3, 1.5])))),
            thermometer_k=habit * 1.2 * z[1],
            sensor_kg=float(np.interp(u[2], (0, 1), n.sensor_kg)),
            orders=4 + round(2 * u[3]), scatter=float(np.exp(habit * 0.3 * z[2])),
            clock=1e-6 * n.clock_ppm * z[3], clock_per_year=1e-6 * n.clock_ppm_per_year * z[4],
        ))  # fmt: skip
    return people


@dataclass
class _Visit:
    day: float
    operator: int
    measured: int  # the hanger in truth
    named: int
    truth: dict[str, Any] = field(default_factory=dict)
    test: dict[str, Any] = field(default_factory=dict)


def _schedule(seed: int, count: int, days: float, n: Nuisances) -> list[_Visit]:
    visits: list[_Visit] = []
    for i in range(count):
        rng = stream(seed, "schedule", i)
        every = (7.0, 30.4, 91.3)[int(np.searchsorted([0.2, 0.5], rng.uniform()))]
        own = int(rng.integers(3))  # who usually comes
        planned = np.arange(3.0 + every * 0.5 * rng.uniform(), days - 2, every)
        size = len(planned)
        jitter = n.irregular * every * 0.15 * rng.standard_t(4, size).clip(-4, 4)
        skip = rng.uniform(size=size) < 0.08 * n.irregular
        hours = 12 + 3.5 * n.irregular * rng.uniform(-1, 1, size)
        other, who = rng.uniform(size=size), rng.integers(3, size=size)
        for k, day in enumerate(np.floor(planned + jitter)):
            if not skip[k] and 0 <= day < days - 1:
                comes = int(who[k]) if other[k] < 0.25 else own
                visits.append(_Visit(float(day + hours[k] / 24), comes, i, i))
    batch = stream(seed, "campaigns")
    for year in range(int(np.ceil(days / 365.25))):  # spring and autumn, every hanger in a day
        for start in (15.0, 150.0):
            late, person = 20 * n.irregular * batch.uniform(), int(batch.integers(3))
            day = np.floor(365.25 * year + start + late)
            for i in range(count):
                if day < days - 1:
                    time = float(day + (8 + 9 * i / count) / 24)
                    visits.append(_Visit(time, person, i, i))
    rng = stream(seed, "winter")
    kept = []
    for visit in sorted(visits, key=lambda v: (v.day, v.named)):
        winter = 230 < visit.day % 365.25 < 291  # 17 December to 16 February
        if not (rng.uniform() < n.winter_gap and winter):
            kept.append(visit)
    mix = stream(seed, "names")
    for visit in kept:
        draw, side = mix.uniform(), int(mix.integers(2))
        if draw < n.swapped and count > 1:
            step = 1 if side else -1
            inside = 0 <= visit.named + step < count
            visit.measured = visit.named + (step if inside else -step)
    return kept


@dataclass
class HangerSeason:
    """One hanger: what a client would be told, and the truth."""

    name: str
    description: dict[str, Any]
    visits: list[dict[str, Any]]
    operators: list[str | None]  # one a visit, None where nobody noted it
    truth: dict[str, Any]


@dataclass
class Season:
    """All hangers of a bridge over some years; `truth` holds the event and the bridge's own."""

    hangers: list[HangerSeason]
    truth: dict[str, Any]


def _states(
    h: Hanger, plane: str, visits: list[_Visit], event: Event, mine: bool,
    people: list[Operator], n: Nuisances, quiet: bool = False,
) -> list[State]:  # fmt: skip
    """State of a hanger at visits whose truth holds tension, warmth, wind and amplitude."""
    amplitude = np.array([v.truth["amplitude"] for v in visits]) * (0.2 if quiet else 1.0)
    factors = h.bending_factor(amplitude, n.slip)
    states = []
    for visit, factor in zip(visits, factors, strict=True):
        changed = mine and visit.day >= event.day
        soft = 1 - 0.03 * min(visit.truth["wind"], 8.0)  # loose joints rattle
        soft *= max(1 - n.joint_amplitude * np.log(visit.truth["amplitude"]), 0.3)
        springs = [soft, soft]
        if changed and event.kind == "springs" and plane in event.planes:
            for e in event.at_ends:
                springs[e] *= event.size
        masses = []
        if not quiet and people[visit.operator].sensor_kg > 0:
            place = h.sensor_places_m[visit.operator]
            if changed and event.kind == "sensor_moved":
                place = event.size * h.length_m
            masses.append((people[visit.operator].sensor_kg, place))
        if changed and event.kind == "lamp":
            masses.append((event.size, event.place * h.length_m))
        states.append(State(
            visit.truth["tension_n"] if not quiet else visit.truth["partner_n"], float(factor),
            (springs[0], springs[1]), visit.truth["warmer_k"], tuple(masses),
            changed and event.kind == "section_loss",
        ))  # fmt: skip
    return states


def _marks(h: Hanger, event: Event, mine: bool) -> tuple[float, ...]:
    marks = list(h.sensor_places_m)
    if h.crossing:
        marks.append(h.crossing[1] * h.length_m)
    if mine and event.kind == "lamp":
        marks.append(event.place * h.length_m)
    if mine and event.kind == "sensor_moved":
        marks.append(event.size * h.length_m)
    return tuple(sorted({round(m, 9) for m in marks}))


def reduced(h: Hanger, plane: str, event: Event, mine: bool, count: int) -> Reduced:
    """The map of one hanger: modes at a middle state and at two far ones."""
    beam = h.beam(plane, event if mine else Event(), _marks(h, event, mine))
    low, high = h.slip_factor, h.stick_factor
    t = h.tension_n
    states = [State(t, (low + high) / 2), State(0.8 * t, low, (0.3, 0.3))]
    states.append(State(1.2 * t, high, (1.3, 1.3)))
    if mine and event.kind in ("tension_step", "tension_ramp"):
        share = 1 + event.size * (2.0 if event.kind == "tension_ramp" else 1.0)
        states.append(State(float(np.clip(share, 0.2, 3.0)) * t, (low + high) / 2))
    if mine and event.kind == "section_loss":
        states.append(State(t, (low + high) / 2, lost=True))
        states.append(State(0.8 * t, low, (0.3, 0.3), lost=True))
    if mine and event.kind == "lamp":
        states.append(State(t, high, masses=((event.size, event.place * h.length_m),)))
    if mine and event.kind == "springs":
        states.append(State(t, high, (max(event.size, 1e-3),) * 2))
    return Reduced(beam, states, count)


def _coupled(squares: Array, springs: Sequence[tuple[float, Array]], orders: int) -> Array:
    """Frequencies of a hanger tied to other oscillators: modes by where their energy is.

    Coordinates of unit mass with omega^2 in `squares` (visit, coordinate), the hanger's own modes
    first.  Each tie adds k v v^T; between two hangers v = (phi_1(x), -phi_2(x')), between a clamp
    and the weight of a damper v = (phi(x), -1 / sqrt(weight)).
    """
    diagonal = np.arange(squares.shape[1])
    stiff = sum(k * v[:, :, None] * v[:, None, :] for k, v in springs)
    stiff = np.array(stiff, dtype=float)
    stiff[:, diagonal, diagonal] += squares
    values, vectors = np.linalg.eigh(stiff)
    own = np.argmax(np.abs(vectors[:, :orders, :]), axis=2)
    return np.asarray(np.sqrt(np.take_along_axis(values, own, axis=1)) / (2 * np.pi))


def true_frequencies(
    i: int, hangers: Sequence[Hanger], visits: list[_Visit], event: Event,
    people: list[Operator], n: Nuisances, orders: int,
) -> tuple[Array, Array]:  # fmt: skip
    """True frequencies and shapes at the sensor (visit, plane, order) of hanger i."""
    h, mine = hangers[i], i == event.hanger
    count = orders + 4
    all_hz, all_seen = [], []
    for plane in PLANES:
        own = reduced(h, plane, event, mine, orders + 2)
        states = _states(h, plane, visits, event, mine, people, n)
        hz, at = own.modes(states, count)
        places = np.array([h.sensor_places_m[v.operator] for v in visits])
        if mine and event.kind == "sensor_moved":
            places[[v.day >= event.day for v in visits]] = event.size * h.length_m
        seen = np.array([at[round(place, 9)][v, :orders] for v, place in enumerate(places)])
        seen = np.abs(seen) * np.sqrt(h.mass_kg_m * h.length_m / 2)  # 1 at an antinode
        squares, ties = [(2 * np.pi * hz) ** 2], []
        if h.crossing:
            other, place, its, soft = h.crossing
            partner, theirs_too = hangers[other], other == event.hanger
            theirs = reduced(partner, plane, event, theirs_too, orders + 2)
            quiet = _states(partner, plane, visits, event, theirs_too, people, n, quiet=True)
            his, at_his = theirs.modes(quiet, count)
            here = at[round(place * h.length_m, 9)]
            there = at_his[round(its * partner.length_m, 9)]
            squares.append((2 * np.pi * his) ** 2)
            ties.append((soft, np.concatenate((here, -there), axis=1)))
        result = hz[:, :orders]
        if ties:
            result = _coupled(np.concatenate(squares, axis=1), ties, orders)
        all_hz.append(result)
        all_seen.append(seen)
    return np.stack(all_hz, axis=1), np.stack(all_seen, axis=1)


def _tone(hz: float, deck_hz: Array) -> tuple[float, str] | None:
    """The machine's or the deck's line one could take for this frequency."""
    lines = [(base * k, "machine") for base in MACHINE_HZ for k in range(1, 7)]
    lines += [(float(line), "deck") for line in deck_hz]
    near = min(lines, key=lambda line: abs(np.log(line[0] / hz)))
    return near if abs(np.log(near[0] / hz)) < 0.15 else None


def _mistakes(
    seed: int, i: int, table: Array, days: Array, deck_hz: Array, n: Nuisances
) -> tuple[Array, dict[tuple[int, int, int], str]]:
    """Frequencies with the wrong ones in, and their causes by (visit, plane, order - 1)."""
    rng = stream(seed, "mistakes", i)
    share = n.mistaken[0] + (n.mistaken[1] - n.mistaken[0]) * rng.uniform()
    draws = rng.uniform(size=(*table.shape, 3))
    comes, start, length = rng.uniform(size=3)
    mode = (int(rng.integers(2)), int(rng.integers(table.shape[2])))
    out, causes = table.copy(), {}
    visits, _, orders = table.shape
    for v, p, o in zip(*np.nonzero(draws[..., 0] < share), strict=True):
        kind, side = draws[v, p, o, 1], draws[v, p, o, 2]
        tone = _tone(table[v, p, o], deck_hz)
        if kind < 0.45 and tone:
            out[v, p, o], causes[v, p, o] = tone
        elif kind < 0.70:
            out[v, p, o], causes[v, p, o] = table[v, 1 - p, o], "plane"
        else:
            step = 1 if (side < 0.5 or o == 0) and o + 1 < orders else -1
            out[v, p, o], causes[v, p, o] = table[v, p, o + step], "order"
    # the same line taken for the same mode again and again, while the machine runs
    if comes < n.persistent and visits:
        middle = np.median(table[:, mode[0], mode[1]])
        tone = _tone(float(middle), deck_hz)
        first = int(start * visits)
        if tone:
            for v in range(first, min(first + 3 + int(6 * length), visits)):
                out[v, mode[0], mode[1]] = tone[0]
                causes[v, mode[0], mode[1]] = f"persistent {tone[1]}"
    return out, causes


def _scatter(rng: np.random.Generator, shape: tuple[int, int, int], n: Nuisances) -> Array:
    """Unit-variance errors: a part of the visit, of an order in both planes, of a mode alone."""
    visits, _, orders = shape
    whole = rng.standard_normal((visits, 1, 1))
    both = rng.standard_normal((visits, 1, orders))
    alone = rng.standard_normal(shape)
    nu = n.degrees_of_freedom
    chi = rng.standard_gamma(max(nu, 1.0) / 2, shape) * 2
    a, b = n.visit_correlation, n.plane_correlation
    z = np.sqrt(a) * whole + np.sqrt(b) * both + np.sqrt(1 - a - b) * alone
    return np.asarray(z * np.sqrt((nu - 2) / chi) if nu > 2 else z)


def season(
    seed: int,
    hangers: int | Sequence[Hanger] = 30,
    years: float = 3.0,
    event: Event | None = None,
    relaxation_per_year: float = 0.0,
    nuisances: Nuisances | None = None,
    orders: int = 6,
) -> Season:
    """Hammer tests of a bridge over some years, an event in one hanger, and the truth of it all.

    `event.hanger` is an index.  Truth per hanger: tension_n, baseline_tension_n (without what
    comes and goes: temperature, traffic, wind) at each visit, reference_tension_n (day 0), day,
    operator, amplitude, air_c; `mistaken`: dicts of visit id, plane, order, cause, true_hz;
    `wrong_rate` and `swapped`: visit ids; frequency_hz[plane] true ones (visit, order) of the
    hanger that was measured, with the sensor on; thermal, traffic, gale: shares of the tension.
    """
    event, n = event or Event(), nuisances or Nuisances()
    count = hangers if isinstance(hangers, int) else len(hangers)
    beams = bridge(seed, hangers, n) if isinstance(hangers, int) else list(hangers)
    if not 0 <= event.hanger < count:
        raise ValueError("the event's hanger is not on this bridge")
    world, people = World(seed, count, years, n), _operators(seed, n)
    visits = _schedule(seed, count, world.days, n)
    deck_hz = np.sort(stream(seed, "deck").uniform(2.0, 6.0, 4))

    def tension(i: int, days: Array) -> tuple[Array, Array]:
        base = beams[i].tension_n * world.lasting(i, days, event, relaxation_per_year)
        return base, base * (1 + world.passing(i, days))

    by_hanger: list[list[_Visit]] = [[] for _ in range(count)]
    for visit in visits:
        by_hanger[visit.measured].append(visit)
    for i, mine in enumerate(by_hanger):
        if mine:
            _measure(seed, i, beams, mine, world, tension, people, event, deck_hz, n, orders)
    return _collect(seed, beams, visits, world, people, event, relaxation_per_year, deck_hz, n)


def _measure(
    seed: int, i: int, beams: Sequence[Hanger], visits: list[_Visit], world: World,
    tension: Callable[[int, Array], tuple[Array, Array]], people: list[Operator], event: Event,
    deck_hz: Array, n: Nuisances, orders: int,
) -> None:  # fmt: skip
    """Fill in the truth and the modes of every visit at one hanger."""
    size, days = len(visits), np.array([v.day for v in visits])
    rng = stream(seed, "visit", i)
    hit, rate, air = rng.standard_normal(size), rng.uniform(size=size), rng.standard_normal(size)
    noted, told, known = rng.uniform(size=(3, size))
    amplitude_error = rng.standard_normal(size)
    base, actual = tension(i, days)
    crossing = beams[i].crossing
    partner = tension(crossing[0], days)[1] if crossing else actual
    warm, wind = world.warmer(i, days), world.wind(days)
    for k, visit in enumerate(visits):
        person = people[visit.operator]
        blow = float(person.hammer * np.exp(person.hammer_log_sd * hit[k]))
        visit.truth = {
            "day": visit.day, "tension_n": float(actual[k]), "baseline_tension_n": float(base[k]),
            "partner_n": float(partner[k]), "warmer_k": float(warm[k]), "wind": float(wind[k]),
            "amplitude": blow, "operator": person.name, "measured": beams[i].name,
            "wrong_rate": bool(rate[k] < n.wrong_rate_share),
            "air_c": float(world.weather.air[world._index(days[k])]),
        }  # fmt: skip
    hz, seen = true_frequencies(i, beams, visits, event, people, n, orders)
    table, causes = _mistakes(seed, i, hz, days, deck_hz, n)
    draws = stream(seed, "scatter", i)
    errors, stated = _scatter(draws, hz.shape, n), draws.standard_normal(hz.shape)
    lost, damping = draws.uniform(size=hz.shape), draws.standard_normal(hz.shape)
    for k, visit in enumerate(visits):
        person, truth = people[visit.operator], visit.truth
        clock = person.clock + person.clock_per_year * visit.day / 365.25
        clock += 1e-3 * truth["wrong_rate"]
        if event.kind == "clock" and visit.day >= event.day:
            clock += event.size
        modes, wrong = [], []
        for p, plane in enumerate(PLANES):
            for o in range(min(person.orders, orders)):
                faint = 0.01 / (0.01 + seen[k, p, o] ** 2) if n.missing_modes else 0.0
                if lost[k, p, o] < n.missing_modes + (0.6 * faint if faint > 0.45 else 0.0):
                    continue
                # damping 0.4 %, so a tenth of the half width of the peak
                relative = 4e-4 * person.scatter * (1 + 0.15 * o) * (1 + faint)
                read = table[k, p, o] * (1 + clock)
                read *= 1 + n.scatter * relative * float(np.clip(errors[k, p, o], -12, 12))
                believed = relative * person.optimism * np.exp(0.2 * n.operators * stated[k, p, o])
                ratio = 0.004 * truth["amplitude"] ** 0.2 * np.exp(0.35 * damping[k, p, o])
                sd = table[k, p, o] * believed
                modes.append(mode(plane, o + 1, read, sd, ratio))
                if (k, p, o) in causes:
                    cause = causes[k, p, o]
                    wrong.append({"plane": plane, "order": o + 1, "cause": cause,
                                  "true_hz": float(hz[k, p, o])})  # fmt: skip
        test: dict[str, Any] = {
            "time": (START + timedelta(days=visit.day)).strftime("%Y-%m-%dT%H:%M:%SZ")
        }
        if noted[k] >= n.temperature_missing:
            felt = truth["air_c"] + person.thermometer_k + 0.4 * n.operators * air[k]
            test["temperature_c"] = round(float(felt), 1)
        if told[k] >= n.amplitude_missing:
            test["amplitude"] = float(
                truth["amplitude"] * np.exp(0.1 * n.operators * amplitude_error[k])
            )
        visit.test = {**test, "modes": modes}
        truth |= {"mistaken": wrong, "frequency_hz": hz[k]}
        truth["operator_told"] = person.name if known[k] >= n.operator_unknown else None


def _collect(
    seed: int, beams: list[Hanger], visits: list[_Visit], world: World, people: list[Operator],
    event: Event, relaxation: float, deck_hz: Array, n: Nuisances,
) -> Season:  # fmt: skip
    seasons = []
    for i, h in enumerate(beams):
        own = sorted((v for v in visits if v.named == i and v.test["modes"]), key=lambda v: v.day)
        tests = [{"id": f"t{k + 1}", **v.test} for k, v in enumerate(own)]
        ids = [test["id"] for test in tests]
        pairs = list(zip(ids, own, strict=True))
        truth: dict[str, Any] = {
            name: [v.truth[name] for v in own]
            for name in ("day", "baseline_tension_n", "amplitude", "operator", "air_c", "wind")
        }
        # the tension of this hanger, even where another one was measured under its name
        days = np.array(truth["day"])
        lasting = h.tension_n * world.lasting(i, days, event, relaxation)
        truth |= {
            "baseline_tension_n": lasting,
            "tension_n": lasting * (1 + world.passing(i, days)),
            **world.parts(i, days),
            "reference_tension_n": h.tension_n,
            "event": event if event.hanger == i or event.kind == "clock" else Event(),
            "mistaken": [{"id": k, **m} for k, v in pairs for m in v.truth["mistaken"]],
            "wrong_rate": [k for k, v in pairs if v.truth["wrong_rate"]],
            "swapped": [(k, v.truth["measured"]) for k, v in pairs if v.measured != i],
            "frequency_hz": {
                plane: np.array([v.truth["frequency_hz"][p] for v in own])
                for p, plane in enumerate(PLANES)
            },
            "settlement_per_year": float(world.rates[i]),
            "hanger": h,
        }
        told = [v.truth["operator_told"] for v in own]
        seasons.append(HangerSeason(h.name, dict(h.description), tests, told, truth))
    whole = {
        "seed": seed, "event": event, "relaxation_per_year": relaxation, "operators": people,
        "deck_hz": deck_hz, "influence": world.influence, "nuisances": n, "start": START,
    }  # fmt: skip
    return Season(seasons, whole)
