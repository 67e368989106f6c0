"""An independent world of hangers with a known cause of the gap between description and tests.

Each case is a hanger as its drawing describes it (hanger.toml), hammer tests as a field team gives
them ("shm.modes/1"), and the truth: tension, causes, their sizes. Nothing is shared with the
program under test: neither the equations (`bars.py`) nor the draws nor the nuisances.

Hangers are round bars, tubes and strands with sockets; three in ten lean. Ends are clamped, as
described (springs of 10,000 to 1,000,000 EI/L), but where a cause says otherwise. Tension 0.5 to
1.5 times the nominal one; of a hanger whose sag nobody described 0.15 to 0.6 times.

Sizes: once the tension is fitted, and section, material and length within their tolerances, the
largest change of a single datum (or of a tolerance) is 5 to 100 of its standard errors.

`CAUSES[...].accepted` are the names that a catalogue of effects may give to a cause; none where it
knows no such cause. A plain bar clamped at both ends also differs from a sound hanger: by its
described fittings, by shear and rotary inertia, by the sag of a described lean, by sensors whose
places are not stated. Where these can be seen, `truth["inherent"]` holds their names with how many
standard errors they are: an answer that names them is not false.

Left out: modes of both planes that mix where they are close (their errors are correlated, half of
the time), wrong orders, blunders. The planes' springs differ by their details alone.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import eigh

from tests.worlds.bars import POISSON, Array, Bar, Modes, Zone, cowper, solve_modes
from tests.worlds.cases import Case, Draws

PLANES = ("transverse", "longitudinal")  # the weight of a leaning hanger acts in the second
GRAVITY_M_S2 = 9.81
STEEL_KG_M3 = 7850.0
STRAND_KG_M3 = 8460.0  # of the metallic section, with the filler
SENSOR_PLACE_SD_M = 0.01


@dataclass(frozen=True)
class Cause:
    """A cause that can be planted, with the range of its size.

    `accepted` are the right names of it; `needs` what the tests must have.
    """

    accepted: tuple[str, ...]
    low: float
    high: float
    unit: str
    needs: tuple[str, ...] = ()


CAUSES: dict[str, Cause] = {
    "mass at a point": Cause(("point_mass",), 3e-4, 0.1, "of the hanger's mass"),
    "guide": Cause(("intermediate_support",), 1e-3, 5.0, "of the bar's lateral stiffness there"),
    "end that turns": Cause(("rotational_end_flexibility",), 1e-3, 5.0, "EI / k L"),
    "end that gives": Cause(("translational_end_flexibility",), 2e-4, 0.3, "(T/L + 12 EI/L^3) / k"),
    "corroded stretch": Cause(("section_loss",), 0.03, 0.5, "of the area"),
    "other stiffness": Cause(("bending_stiffness",), 0.06, 0.4, "of EI"),
    "mass all along": Cause(("distributed_mass",), 0.04, 0.4, "of the mass"),
    "mass over a stretch": Cause(("partial_mass",), 0.03, 1.0, "of the mass there"),
    "other length": Cause(("effective_length",), 0.008, 0.08, "of the length"),
    "stiff end": Cause(("stiff_end_zones",), 4e-3, 0.08, "of the length"),
    "tension with temperature": Cause(
        ("temperature_tension",), 8e-4, 0.015, "of the tension / K", ("temperatures",)
    ),
    "joints that soften": Cause(
        ("joint_softening",), 1e-3, 3.0, "EI / k L at level 1", ("levels",)
    ),
    "clock in all tests": Cause(("timebase",), 0.02, 0.08, "of the frequency"),
    "clock in one test": Cause(("timebase",), 1.5e-3, 0.05, "of the frequency", ("tests",)),
    "turned sensor": Cause(("sensor_misalignment",), 8.0, 45.0, "deg", ("shapes",)),
    "sag": Cause(("sag",), 8.0, 65.0, "deg from the vertical", ("slack",)),
    "absorber": Cause((), 5e-4, 0.03, "of the hanger's mass"),
    "loose wire": Cause((), 1e-3, 5.0, "of the bar's lateral stiffness there", ("levels",)),
    "crack": Cause((), 5e-4, 0.5, "EI / k L"),
    "clamp to a neighbour": Cause((), 1e-3, 2.0, "of the bar's lateral stiffness there"),
}

SECOND = tuple(name for name in CAUSES if CAUSES[name].accepted and name != "sag")
VISIBLE = (5.0, 100.0)  # standard errors
INHERENT = 3.0


@dataclass(frozen=True)
class Nuisances:
    """Differences of a sound hanger and an honest test from their description. Sds, but ranges."""

    area: float = 0.01
    modulus: float = 0.015
    density: float = 0.003
    length: float = 0.0005
    strand_bending: float = 0.1
    along: float = 0.001  # of the area, from sixth to sixth of the bar
    lean_deg: float = 0.5
    tension_between_tests: float = 0.001
    tension_per_kelvin: float = 1e-4
    thermometer_k: float = 0.5
    stated_error: tuple[float, float] = (1e-4, 5e-4)
    misstated: float = 0.2  # of the logarithm of real over stated error
    repeat: tuple[float, float] = (5e-6, 5e-5)  # error of a mode that repeats in all tests
    close_planes: float = 0.004  # up to this difference errors of both planes are correlated
    missing: float = 0.1  # share of planes that lack one order
    gain: float = 0.015
    turn_deg: float = 1.5
    cross_axis: float = 0.02
    sensor_kg: tuple[float, float] = (0.02, 0.1)
    sensor_mass: float = 0.1  # of the logarithm: real over stated


@dataclass(frozen=True)
class Visit:
    """The conditions of one test."""

    temperature_c: float
    level: float
    tension_factor: float = 1.0


@dataclass(frozen=True)
class Fault:
    """A planted cause: its size in the unit of `CAUSES`, and where and how it acts."""

    cause: str
    size: float
    place: float = 0.5  # fraction of the length
    extent: float = 0.1  # fraction of the length
    sign: float = 1.0
    ends: tuple[int, ...] = (0, 1)
    planes: tuple[int, ...] = (0, 1)
    test: int = 0
    sensor: int = 0
    detail: float = 0.5  # of the cause's law, 0 to 1
    more: float = 0.5


@dataclass(frozen=True)
class Hanger:
    """A hanger as made and instrumented; `visits` are its tests."""

    kind: str
    bars: tuple[Bar, Bar]
    visits: tuple[Visit, ...]
    sensors_m: tuple[float, ...]  # where they are
    counts: tuple[int, ...]  # modes in each plane; 0: not measured
    has_shapes: bool
    stated_error: float
    shape_sd: float
    area_power: float  # of the second moment over the area
    described: dict[str, Any] = field(default_factory=dict)
    stated: tuple[str, ...] = ()  # tables of the description below its keys

    @property
    def reference_c(self) -> float:
        """Return the mean temperature of the tests."""
        return sum(visit.temperature_c for visit in self.visits) / len(self.visits)


def lateral_stiffness(bar: Bar, x: float) -> float:
    """Return the stiffness of a pinned bar in tension against a force across, roughly."""
    a, b = x, bar.length_m - x
    length = bar.length_m
    return bar.tension_n * length / (a * b) + 3 * bar.bending_stiffness_n_m2 * length / (a * b) ** 2


def _soften(bar: Bar, ends: tuple[int, ...], compliance: float) -> Bar:
    """Add the compliance, in L/EI, to the rotational springs of some ends."""
    unit = bar.length_m / bar.bending_stiffness_n_m2
    springs = [
        1 / (1 / k + compliance * unit) if end in ends else k
        for end, k in enumerate(bar.rotation_n_m_rad)
    ]
    return replace(bar, rotation_n_m_rad=(springs[0], springs[1]))


def plant(fault: Fault, bar: Bar, plane: int, number: int, hanger: Hanger) -> Bar:
    """Return a plane of the hanger with the fault, as it is in test `number`."""
    if plane not in fault.planes:
        return bar
    size, length, x = fault.size, bar.length_m, fault.place * bar.length_m
    visit, mass = hanger.visits[number], bar.mass_per_length_kg_m * bar.length_m
    span = (max(0.0, x - fault.extent * length / 2), min(length, x + fault.extent * length / 2))
    match fault.cause:
        case "mass at a point":
            return replace(bar, masses=(*bar.masses, (x, size * mass)))
        case "guide":
            return replace(bar, springs=(*bar.springs, (x, size * lateral_stiffness(bar, x))))
        case "end that turns":
            return _soften(bar, fault.ends, size)
        case "joints that soften":  # c ~ level^p, p from 0.5 to 1
            return _soften(bar, fault.ends, size * visit.level ** (0.5 + fault.detail / 2))
        case "end that gives":
            give = size / (bar.tension_n / length + 12 * bar.bending_stiffness_n_m2 / length**3)
            both = [
                1 / (1 / k + give) if end in fault.ends else k
                for end, k in enumerate(bar.lateral_n_m)
            ]
            return replace(bar, lateral_n_m=(both[0], both[1]))
        case "corroded stretch":
            rest = 1 - size
            lost = Zone(*span, rest**hanger.area_power, rest)
            return replace(bar, zones=(*bar.zones, lost))
        case "other stiffness":
            return replace(
                bar, bending_stiffness_n_m2=bar.bending_stiffness_n_m2 * (1 + fault.sign * size)
            )
        case "mass all along":
            return replace(bar, mass_per_length_kg_m=bar.mass_per_length_kg_m * (1 + size))
        case "mass over a stretch":
            return replace(bar, zones=(*bar.zones, Zone(*span, 1.0, 1 + size, 1.0)))
        case "other length":
            return _lengthen(bar, fault.sign * size * length)
        case "stiff end":
            factors = 5 + 15 * fault.detail, 1 + fault.more, 1.0
            zones = [Zone(0.0, size * length, *factors)]
            zones += [Zone(length * (1 - size), length, *factors)]
            put_on = [zones[end] for end in fault.ends]
            return replace(bar, zones=(*bar.zones, *put_on))
        case "tension with temperature":
            change = fault.sign * size * (visit.temperature_c - hanger.reference_c)
            return replace(bar, tension_n=bar.tension_n * (1 + change))
        case "sag":
            lean = math.radians(size)
            along, across = GRAVITY_M_S2 * math.cos(lean), GRAVITY_M_S2 * math.sin(lean)
            across = across if plane == 1 else 0.0
            return replace(bar, gravity_along_m_s2=along, gravity_across_m_s2=across)
        case "absorber":  # tuned to one of the first three orders, within 8 %
            order = int(1 + 3 * fault.detail)
            tuned = solve_modes(bar, order).frequencies_hz[-1] * (0.92 + 0.16 * fault.more)
            return replace(bar, absorbers=((x, size * mass, float(tuned)),))
        case "crack":
            return replace(bar, cracks=((x, bar.bending_stiffness_n_m2 / (size * length)),))
        case "clamp to a neighbour":
            longer, tauter = 0.9 + 0.2 * fault.detail, 0.8 + 0.4 * fault.more
            other = replace(
                bar,
                length_m=length * longer,
                tension_n=bar.tension_n * tauter,
                masses=(),
                zones=(),
            )
            return replace(bar, neighbour=other, clamp=(x, size * lateral_stiffness(bar, x)))
    return bar


def _lengthen(bar: Bar, metres: float) -> Bar:
    """Return the bar with so much more length at its upper end, fittings and all."""

    def move(x: float) -> float:
        return x + metres if x > bar.length_m / 2 else x

    zones = tuple(
        replace(each, start_m=move(each.start_m), end_m=move(each.end_m)) for each in bar.zones
    )
    return replace(bar, length_m=bar.length_m + metres, zones=zones)


@dataclass(frozen=True)
class Data:
    """Exact modes of each test and measured plane; of sensors the angle that each is off, in rad.

    `clock` is what each test's frequencies are multiplied by.
    """

    modes: dict[tuple[int, int], Modes]  # [test, plane]
    clock: tuple[float, ...]
    turned: tuple[float, ...]


def _hit_wire(fault: Fault, bar: Bar, hanger: Hanger, number: int, count: int) -> Modes:
    """Return the modes while a wire with play is hit: a stiffness by the describing function."""
    place, many = fault.place * bar.length_m, 40
    free = solve_modes(bar, many, (*hanger.sensors_m, place), many // 2)
    at = free.shapes[-1]
    reach = np.abs(at[:count]) / np.abs(at[:count]).max() / np.arange(1, count + 1)
    top = max(visit.level for visit in hanger.visits)
    play = (0.3 + 0.5 * fault.detail) * top * reach[0]
    k = fault.size * lateral_stiffness(bar, place)
    square, shapes = (2 * math.pi * free.frequencies_hz) ** 2, free.shapes[:-1].copy()
    found, mixed = free.frequencies_hz[:count].copy(), shapes[:, :count].copy()
    for n in range(count):
        swing = hanger.visits[number].level * reach[n]
        if swing > play:
            d = play / swing
            fraction = 1 - 2 / math.pi * (math.asin(d) + d * math.sqrt(1 - d**2))
            values, vectors = eigh(np.diag(square) + fraction * k * np.outer(at, at))
            found[n] = math.sqrt(values[n]) / (2 * math.pi)
            mixed[:, n] = shapes @ vectors[:, n]
    return Modes(found, mixed, free.tension_share[:count])


def solve(hanger: Hanger, faults: tuple[Fault, ...]) -> Data:
    """Return the exact data of the hanger with the faults."""
    modes: dict[tuple[int, int], Modes] = {}
    known: dict[tuple[int, Bar], Modes] = {}
    wires = [each for each in faults if each.cause == "loose wire"]
    for number, visit in enumerate(hanger.visits):
        for plane, count in enumerate(hanger.counts):
            if not count:
                continue
            bar = hanger.bars[plane]
            bar = replace(bar, tension_n=bar.tension_n * visit.tension_factor)
            for fault in sorted(faults, key=lambda each: each.cause != "other length"):
                bar = plant(fault, bar, plane, number, hanger)
            hit = [each for each in wires if plane in each.planes]
            if hit:
                modes[number, plane] = _hit_wire(hit[0], bar, hanger, number, count)
                continue
            if (plane, bar) not in known:
                known[plane, bar] = solve_modes(bar, count, hanger.sensors_m)
            modes[number, plane] = known[plane, bar]
    clock = [1.0] * len(hanger.visits)
    turned = [0.0] * len(hanger.sensors_m)
    for fault in faults:
        if fault.cause == "clock in all tests":
            clock = [each * (1 + fault.sign * fault.size) for each in clock]
        if fault.cause == "clock in one test":
            clock[fault.test] *= 1 + fault.sign * fault.size
        if fault.cause == "turned sensor":
            turned[fault.sensor] += math.radians(fault.sign * fault.size)
    return Data(modes, tuple(clock), tuple(turned))


def find_slopes(hanger: Hanger, sound: Data, n: Nuisances) -> Array:
    """Return what a sound hanger may differ by, as changes of ln f: a row a datum.

    The first column is the tension's, which is free. The others are a standard deviation each: of
    area, modulus, density, length, a strand's bending, and of the tension of each test.
    """
    step = 0.01

    def stiffen(bar: Bar) -> Bar:
        return replace(bar, bending_stiffness_n_m2=bar.bending_stiffness_n_m2 * (1 + step))

    def weigh(bar: Bar) -> Bar:
        return replace(bar, mass_per_length_kg_m=bar.mass_per_length_kg_m * (1 + step))

    def thicken(bar: Bar) -> Bar:
        bending = bar.bending_stiffness_n_m2 * (1 + step) ** hanger.area_power
        return weigh(replace(bar, bending_stiffness_n_m2=bending))

    def lengthen(bar: Bar) -> Bar:
        return _lengthen(bar, step * bar.length_m)

    bending = math.hypot(n.modulus, n.strand_bending if hanger.kind == "strand" else 0.0)
    ways = ((stiffen, bending), (weigh, n.density), (thicken, n.area), (lengthen, n.length))
    share = np.concatenate([sound.modes[key].tension_share for key in sound.modes])
    columns = [share]
    for change, sd in ways:
        other = solve(replace(hanger, bars=(change(hanger.bars[0]), change(hanger.bars[1]))), ())
        columns.append(_subtract(other, sound) * sd / step)
    numbers = np.concatenate(
        [[key[0]] * len(sound.modes[key].tension_share) for key in sound.modes]
    )
    for number in range(len(hanger.visits)):
        columns.append(share * (numbers == number) * n.tension_between_tests)
    return np.stack(columns, axis=1)


def _subtract(one: Data, other: Data) -> Array:
    """Return the differences of ln f, in the order of the modes of `other`."""
    return np.concatenate(
        [
            np.log(one.modes[key].frequencies_hz / other.modes[key].frequencies_hz)
            + math.log(one.clock[key[0]] / other.clock[key[0]])
            for key in other.modes
        ]
    )


def compare(hanger: Hanger, sound: Data, faulty: Data, slopes: Array) -> tuple[float, float]:
    """Return the largest change of a datum in stated errors, fitted and raw.

    Fitted are the tension, and within their tolerances section, material, length and the tension of
    each test; what these would have to be off by, in standard deviations, counts as a datum, too.
    """
    change = _subtract(faulty, sound)
    scaled, tolerances = slopes / hanger.stated_error, np.eye(slopes.shape[1])[1:]
    data = np.concatenate((change / hanger.stated_error, np.zeros(len(tolerances))))
    rows = np.vstack((scaled, tolerances))
    left = data - rows @ np.linalg.lstsq(rows, data, rcond=None)[0]
    visible, raw = float(np.abs(left).max()), float(np.abs(change).max()) / hanger.stated_error
    if hanger.has_shapes and faulty.turned != sound.turned:
        for modes in sound.modes.values():
            size = np.abs(modes.shapes) / np.abs(modes.shapes).max(axis=0)
            off = np.abs(np.sin(np.array(faulty.turned) - np.array(sound.turned)))[:, None]
            seen = float((size * off).max()) / hanger.shape_sd
            visible, raw = max(visible, seen), max(raw, seen)
    return visible, raw


def find_inherent(hanger: Hanger, sound: Data, slopes: Array) -> dict[str, float]:
    """Return by what a sound hanger is seen to differ from a plain clamped bar, in standard errors.

    Names are those of a catalogue of effects.
    """
    plain = {
        "stiff_end_zones": [
            replace(bar, zones=tuple(each for each in bar.zones if each.bending_factor < 2))
            for bar in hanger.bars
        ],
        "shear_and_rotary_inertia": [
            replace(bar, shear_stiffness_n=math.inf, rotary_inertia_kg_m=0.0) for bar in hanger.bars
        ],
        "sag": [replace(bar, gravity_across_m_s2=0.0) for bar in hanger.bars],
    }
    if not hanger.has_shapes:  # places of the sensors are not stated
        plain["sensor_mass"] = [replace(bar, masses=()) for bar in hanger.bars]
    found = {}
    for name, bars in plain.items():
        if tuple(bars) != hanger.bars:
            without = solve(replace(hanger, bars=(bars[0], bars[1])), ())
            found[name] = compare(hanger, without, sound, slopes)[0]
    return {name: size for name, size in found.items() if size >= INHERENT}


# ---------------------------------------------------------------- what is drawn


@dataclass(frozen=True)
class _Section:
    kind: str
    area_m2: float
    second_m4: float  # of a strand as if solid
    mass_kg_m: float
    modulus_pa: float
    outer_m: float
    power: float
    shear: float  # coefficient; inf: no shear
    described: dict[str, Any]


def _draw_section(draws: Draws, slack: bool) -> _Section:
    kind = draws.pick("bar", "bar", "tube", "strand", "strand")
    if slack:
        kind = draws.pick("bar", "strand", "strand")
    if kind == "bar":
        d = round(draws.log(0.030, 0.050) if slack else draws.log(0.030, 0.140), 3)
        area, modulus = math.pi * d**2 / 4, draws.pick(205e9, 210e9)
        stated = {"diameter_m": d, "elastic_modulus_pa": modulus, "density_kg_m3": STEEL_KG_M3}
        mass, second = STEEL_KG_M3 * area, math.pi * d**4 / 64
        return _Section(kind, area, second, mass, modulus, d, 2.0, cowper(), stated)
    if kind == "tube":
        outer = round(draws.log(0.060, 0.140), 3)
        inner = outer - 2 * round(draws.log(0.004, 0.010), 3)
        area, second = math.pi / 4 * (outer**2 - inner**2), math.pi / 64 * (outer**4 - inner**4)
        modulus, mass, power, coefficient = 210e9, STEEL_KG_M3 * area, 1.0, cowper(inner / outer)
    else:
        outer, locked = round(draws.log(0.030, 0.090), 3), draws.chance(0.5)
        fill = draws.between(0.81, 0.88) if locked else draws.between(0.73, 0.77)
        modulus = 160e9 if locked else 150e9
        area, second = fill * math.pi * outer**2 / 4, fill * math.pi * outer**4 / 64
        mass, power, coefficient = STRAND_KG_M3 * area, 2.0, math.inf
    stated = {
        "elastic_modulus_pa": modulus,
        "area_m2": area,
        "second_moment_m4": second,
        "mass_per_length_kg_m": mass,
    }
    if kind == "strand":
        factor = round(draws.between(0.4, 0.7), 2)
        stated |= {"kind": "strand", "bending_stiffness_factor": factor}
    return _Section(kind, area, second, mass, modulus, outer, power, coefficient, stated)


def draw_hanger(draws: Draws, needs: frozenset[str], n: Nuisances) -> Hanger:
    """Draw a sound hanger with its tests; `needs` are those of the causes to come."""
    slack = "slack" in needs
    section = _draw_section(draws, slack)
    strand, bar_like = section.kind == "strand", section.kind != "strand"
    if strand:
        length = round(draws.log(15.0, 40.0) if slack else draws.log(8.0, 40.0), 2)
        stress = draws.between(200e6, 450e6)
    else:
        longest = min(18.0, 220 * section.outer_m)
        length = round(draws.log(longest / 2 if slack else min(4.0, longest / 2), longest), 2)
        stress = draws.between(60e6, 180e6)
    nominal = round(stress * section.area_m2, -3)
    described = {**section.described, "length_m": length, "nominal_tension_n": nominal}
    stated: list[str] = []

    size = 1 + draws.normal(n.area)
    area, second = section.area_m2 * size, section.second_m4 * size**section.power
    modulus = section.modulus_pa * (1 + draws.normal(n.modulus))
    per_length = section.mass_kg_m * size * (1 + draws.normal(n.density))
    true_length = length * (1 + draws.normal(n.length))
    tension = nominal * (draws.between(0.15, 0.6) if slack else draws.between(0.5, 1.5))
    bending = modulus * second
    if strand:
        bending *= section.described["bending_stiffness_factor"]
        bending *= 1 + draws.normal(n.strand_bending)
        stated.append(f"[hanger.scatter]\nbending_factor = {n.strand_bending}")

    leaning = not slack and draws.chance(0.3)
    lean_deg = round(draws.between(8.0, 45.0)) if leaning else 0.0
    if not slack and (leaning or draws.chance(0.7)):
        described["inclination_deg"] = 90.0 - lean_deg
    lean = math.radians(lean_deg + draws.normal(n.lean_deg))

    stretches: list[Zone] = []
    edges = np.linspace(0.0, true_length, 7)
    factors = 1 + n.along * draws.rng.standard_normal(6)
    factors /= factors.mean()
    for (start, end), f in zip(pairwise(edges.tolist()), factors.tolist(), strict=True):
        stretches.append(Zone(start, end, f**section.power, f))
    fittings: list[list[Zone]] = [[], []]
    if draws.chance(0.6 if strand else 0.3):  # else taped between the fittings' faces
        share = draws.between(4.0, 8.0) * section.outer_m if strand else draws.between(0.15, 0.35)
        share = round(share, 2)
        described["fittings_m"] = [share, share]
        stiffer = draws.log(5.0, 25.0) if strand else draws.log(4.0, 16.0)
        heavier = draws.between(3.0, 7.0) if strand else draws.between(2.5, 5.0)
        for zones in fittings:
            factor = stiffer * math.exp(draws.normal(0.1))
            for start, end in ((0.0, share), (true_length - share, true_length)):
                zones.append(Zone(start, end, factor, heavier))

    has_shapes = "shapes" in needs or draws.chance(0.5)
    two_planes = bool({"shapes", "slack"} & needs) or draws.chance(0.75)
    count = int(draws.rng.integers(2, 5)) if has_shapes else int(draws.rng.integers(1, 3))
    top = min(0.45 * length, 5.0) if has_shapes else 2.5
    top = max(min(top, 0.45 * length), 1.2)
    taped = np.round(np.linspace(0.9, top, count) + draws.rng.uniform(-0.1, 0.1, count), 2)
    there = taped + SENSOR_PLACE_SD_M * draws.rng.standard_normal(count)
    kilograms = round(draws.between(*n.sensor_kg), 3)
    stated.append(
        "[hanger.assumptions]\naccelerometer_mass_kg = "
        f'{{value = {kilograms}, sd = {n.sensor_mass * kilograms!r}, reason = "weighed"}}'
    )
    real_kg = kilograms * math.exp(draws.normal(n.sensor_mass))
    base = Bar(
        length_m=true_length,
        tension_n=tension,
        bending_stiffness_n_m2=bending,
        mass_per_length_kg_m=per_length,
        shear_stiffness_n=section.shear * modulus / (2 * (1 + POISSON)) * area
        if bar_like
        else math.inf,
        rotary_inertia_kg_m=per_length / area * second if bar_like else 0.0,
        axial_stiffness_n=modulus * area,
        axial_n_m=(draws.log(1e8, 1e9), math.inf),
        masses=tuple((x, real_kg) for x in there.tolist()),
        gravity_along_m_s2=GRAVITY_M_S2 * math.cos(lean),
    )
    bars = []
    stiff = [draws.log(1e4, 1e6) for _ in range(2)]
    rigid = [draws.log(1e4, 1e6) for _ in range(2)]
    for plane in range(2):
        unit = bending / true_length
        turn = [k * unit * math.exp(draws.normal(0.3)) for k in stiff]
        push = (tension / true_length + 12 * bending / true_length**3) * 3
        give = [k * push * math.exp(draws.normal(0.3)) for k in rigid]
        bars.append(
            replace(
                base,
                zones=(*stretches, *fittings[plane]),
                rotation_n_m_rad=(turn[0], turn[1]),
                lateral_n_m=(give[0], give[1]),
                gravity_across_m_s2=GRAVITY_M_S2 * math.sin(lean) if plane == 1 else 0.0,
            )
        )

    fewest = 3 if {"tests", "temperatures", "levels"} & needs else 1
    tests = int(draws.rng.integers(fewest, 5))
    warmth = [draws.between(-2.0, 28.0) for _ in range(tests)]
    levels = [draws.log(0.3, 3.0) for _ in range(tests)]
    if "temperatures" in needs:
        warmth[:2] = [draws.between(-2.0, 6.0), draws.between(18.0, 28.0)]
    if "levels" in needs:
        levels[:2] = [draws.log(0.3, 0.6), draws.log(1.5, 3.0)]
    mean, per_kelvin = sum(warmth) / tests, draws.normal(n.tension_per_kelvin)
    visits = tuple(
        Visit(c, level, 1 + per_kelvin * (c - mean) + draws.normal(n.tension_between_tests))
        for c, level in zip(warmth, levels, strict=True)
    )
    counts = [int(draws.rng.integers(5, 10)) for _ in range(2)]
    if not two_planes:
        counts[int(draws.rng.integers(2))] = 0
    described["sensors"] = taped.tolist()
    return Hanger(
        *(section.kind, (bars[0], bars[1]), visits, tuple(there.tolist()), tuple(counts)),
        has_shapes=has_shapes,
        stated_error=draws.log(*n.stated_error),
        shape_sd=draws.log(0.004, 0.02),
        area_power=section.power,
        described=described,
        stated=tuple(stated),
    )


def draw_fault(draws: Draws, cause: str, hanger: Hanger) -> Fault:
    """Draw where and how a cause acts; its size is still that of the lower limit."""
    ends = draws.pick((0,), (1,), (0, 1))
    planes: tuple[int, ...] = (0, 1)
    if cause in ("guide", "end that turns", "end that gives", "clamp to a neighbour"):
        planes = draws.pick((0, 1), (0, 1), (0,), (1,))
    extent = draws.between(0.05, 0.3)
    if cause == "mass over a stretch":
        extent = draws.between(0.1, 0.5)
    place = draws.between(0.1, 0.9)
    if cause == "joints that soften":
        ends = draws.pick((0,), (1,), (0, 1), (0, 1))
    return Fault(
        cause,
        CAUSES[cause].low,
        place=place,
        extent=extent,
        sign=draws.pick(-1.0, 1.0),
        ends=ends,
        planes=planes,
        test=int(draws.rng.integers(len(hanger.visits))),
        sensor=int(draws.rng.integers(len(hanger.sensors_m))),
        detail=draws.between(0.0, 1.0),
        more=draws.between(0.0, 1.0),
    )


def _size_fault(
    draws: Draws, fault: Fault, hanger: Hanger, sound: Data, slopes: Array
) -> Fault | None:
    """Return the fault in a size that a user would notice; None where there is none."""
    cause, target = CAUSES[fault.cause], draws.log(*VISIBLE)
    low, high = cause.low, cause.high
    if hanger.kind == "strand" and fault.cause == "other stiffness":
        low, high = 0.35, 0.7  # the tolerance of its bending stiffness is ten times a bar's

    def see(size: float) -> float:
        return compare(hanger, sound, solve(hanger, (replace(fault, size=size),)), slopes)[0]

    least, most = see(low), see(high)
    if most < VISIBLE[0] or least > VISIBLE[1]:
        return None
    for _ in range(8):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if see(middle) < target else (low, middle)
    size = math.sqrt(low * high)
    return replace(fault, size=size) if VISIBLE[0] <= see(size) <= 1.1 * VISIBLE[1] else None


# ---------------------------------------------------------------- a case


def describe(hanger: Hanger) -> str:
    """Return the hanger as its owner states it."""
    lines = ["[[hanger]]", "id = 1"]
    lines += [f"{k} = {json.dumps(v)}" for k, v in hanger.described.items() if k != "sensors"]
    for table in hanger.stated:
        lines += ["", table]
    return "\n".join(lines) + "\n"


def measure(draws: Draws, hanger: Hanger, data: Data, n: Nuisances) -> dict[str, Any]:
    """Return the document of the tests: the exact data with the errors of a field team."""
    real = hanger.stated_error * math.exp(draws.normal(n.misstated))
    repeat = draws.log(*n.repeat) * draws.rng.standard_normal((2, 20))
    are_alike = draws.chance(0.5)  # errors of close planes
    lacking = [
        int(draws.rng.integers(2, max(count, 3))) if draws.chance(n.missing) else 0
        for count in hanger.counts
    ]
    sensors = len(hanger.sensors_m)
    gain = 1 + n.gain * draws.rng.standard_normal((sensors, 2))
    turn = np.array(data.turned) + math.radians(n.turn_deg) * draws.rng.standard_normal(sensors)
    cross = n.cross_axis * draws.rng.standard_normal((sensors, 2))
    tests = []
    for number, visit in enumerate(hanger.visits):
        error = real * draws.rng.standard_normal((2, 20))
        noise = hanger.shape_sd * draws.rng.standard_normal((2, 20, sensors, 2))
        if are_alike and all(hanger.counts):
            first, second = (data.modes[number, plane].frequencies_hz for plane in range(2))
            for order in range(min(hanger.counts)):
                if abs(second[order] / first[order] - 1) < n.close_planes:
                    error[1, order] = 0.4 * error[0, order] + math.sqrt(0.84) * error[1, order]
        modes = []
        for plane, count in enumerate(hanger.counts):
            for order in range(count):
                if order + 1 == lacking[plane]:
                    continue
                found = data.modes[number, plane]
                hz = found.frequencies_hz[order] * data.clock[number]
                hz *= 1 + error[plane, order] + repeat[plane, order]
                mode: dict[str, Any] = {
                    "plane": PLANES[plane],
                    "order": order + 1,
                    "frequency_hz": float(hz),
                    "frequency_sd_hz": float(hz * hanger.stated_error),
                }
                if hanger.has_shapes:
                    shape = found.shapes[:, order] / np.abs(found.shapes[:, order]).max()
                    motion = np.zeros((sensors, 2))
                    motion[:, plane] = shape
                    errors = (turn, gain, cross, noise[plane, order])
                    mode["shape"] = _sense(hanger, motion, plane, *errors)
                modes.append(mode)
        tests.append(
            {
                "id": f"t{number + 1}",
                "time": f"2026-{2 + 2 * number:02d}-15T10:00:00Z",
                "temperature_c": round(visit.temperature_c + draws.normal(n.thermometer_k), 1),
                "amplitude": round(visit.level, 3),
                "modes": modes,
            }
        )
    return {"schema": "shm.modes/1", "hanger": 1, "tests": tests}


def _sense(
    hanger: Hanger,
    motion: Array,
    plane: int,
    turn: Array,
    gain: Array,
    cross: Array,
    noise: Array,
) -> list[dict[str, float]]:
    """Return what the sensors' axes show of a motion; turned from transverse to longitudinal."""
    across, along = motion[:, 0], motion[:, 1]
    seen = np.stack(
        [
            np.cos(turn) * across + np.sin(turn) * along,
            -np.sin(turn) * across + np.cos(turn) * along,
        ],
        axis=1,
    )
    seen = gain * (seen + cross * seen[:, ::-1]) + noise
    points = []
    for i, x in enumerate(hanger.described["sensors"]):
        point = {"x_m": x, "value": float(seen[i, plane]), "sd": hanger.shape_sd}
        if all(hanger.counts):
            point["cross"] = float(seen[i, 1 - plane])
        points.append(point)
    return points


def make_case(
    seed: int, index: int, causes: tuple[str, ...], nuisances: Nuisances | None = None
) -> Case:
    """Make case `index` of a seed with the causes; it depends on these alone.

    Where a cause cannot be seen in a hanger, another hanger is drawn.
    """
    n = nuisances or Nuisances()
    needs = frozenset(need for name in causes for need in CAUSES[name].needs)
    for attempt in range(200):
        draws = Draws(seed, index, attempt + 1, 1847)
        hanger = draw_hanger(draws, needs, n)
        quiet = replace(
            hanger, visits=tuple(replace(visit, tension_factor=1.0) for visit in hanger.visits)
        )
        sound, faults = solve(quiet, ()), []
        slopes = find_slopes(quiet, sound, n)
        for name in causes:
            fault = _size_fault(draws, draw_fault(draws, name, quiet), quiet, sound, slopes)
            if fault is None:
                break
            faults.append(fault)
        else:
            return _finish(index, draws, (hanger, quiet), (sound, slopes), tuple(faults), n)
    raise RuntimeError(f"{causes} are seen in no hanger of seed {seed}, case {index}")


def _finish(
    index: int,
    draws: Draws,
    hangers: tuple[Hanger, Hanger],
    alone: tuple[Data, Array],
    faults: tuple[Fault, ...],
    n: Nuisances,
) -> Case:
    """Measure the first hanger; the second is the same in tests of one tension.

    `alone` are the sound data of the second, and their slopes.
    """
    (hanger, quiet), (sound, slopes) = hangers, alone
    bar = hanger.bars[0]
    truth: dict[str, Any] = {
        "tension_n": bar.tension_n,
        "tension_ratio": bar.tension_n / hanger.described["nominal_tension_n"],
        "kind": hanger.kind,
        "xi": bar.length_m * math.sqrt(bar.tension_n / bar.bending_stiffness_n_m2),
        "length_m": bar.length_m,
        "counts": list(hanger.counts),
        "tests": len(hanger.visits),
        "shapes": hanger.has_shapes,
        "inherent": find_inherent(quiet, sound, slopes),
        "causes": [],
    }
    for fault in faults:
        visible, raw = compare(quiet, sound, solve(quiet, (fault,)), slopes)
        told = {key: getattr(fault, key) for key in ("place", "extent", "sign", "detail", "more")}
        truth["causes"].append(
            {
                "cause": fault.cause,
                "accepted": list(CAUSES[fault.cause].accepted),
                "size": fault.size,
                "unit": CAUSES[fault.cause].unit,
                "visible": visible,  # largest change over its stated error, fitted
                "raw": raw,  # the same without a fit
                "ends": list(fault.ends),
                "planes": list(fault.planes),
                **told,
            }
        )
    document = measure(draws, hanger, solve(hanger, faults), n)
    return Case(index, describe(hanger), document, truth)
