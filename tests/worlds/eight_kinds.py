"""An independent world of sound hangers of arch bridges: eight kinds, by finite elements.

Each case is a hanger whose tension is known, described as its drawing describes it (hanger.toml)
and measured as a field team measures it (one test, "shm.modes/1"). Nothing is shared with the
program under test: neither the equations' solution nor the draws nor the nuisances.

Physics, one plane, by `bars.py`: shear and rotary inertia but for strands, own weight, sag in the
plane of the weight, zones (forks, sockets, end plates, turnbuckles), a rotational and a lateral
spring at both ends, sensors as point masses.

The fork of a bar turns about its pin softly in one plane and stiffly in the other. Rotational
springs are given as multiples of EI/L, those of strands as multiples of sqrt(EI T).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache

from tests.worlds.bars import GRAVITY_M_S2, POISSON, Zone, cowper, natural_frequencies_hz
from tests.worlds.bars import Bar as Member
from tests.worlds.cases import Case, Draws

__all__ = ["Member", "Zone", "natural_frequencies_hz"]  # by which models are held against it

PLANES = ("transverse", "longitudinal")  # the weight of a leaning hanger acts in the second
STEEL_DENSITY_KG_M3 = 7850.0
STRAND_DENSITY_KG_M3 = 83e3 / GRAVITY_M_S2  # EN 1993-1-11, table 2.2: of the metallic section


# ---------------------------------------------------------------- what is drawn


@dataclass(frozen=True)
class Section:
    """A round section as designed, and how its second moment follows the area."""

    area_m2: float
    second_moment_m4: float
    mass_per_length_kg_m: float
    modulus_pa: float
    outer_m: float
    second_moment_power: float = 2.0  # I ~ A^2 for a round, ~ A for the wall of a tube
    shear_coefficient: float = math.inf  # inf: no shear flexibility
    bending_factor: float = 1.0  # of a strand, real over solid
    described: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Ends:
    """Both ends of both planes: springs, fittings."""

    name: str  # socket, fork, plate, threaded or welded
    springs: tuple[float, float, float, float]  # k1 to k4, in units of `unit`
    unit: str = "EI/L"  # or "sqrt(EI T)"
    fittings_m: tuple[float, float] = (0.0, 0.0)
    bending_factors: tuple[float, float] = (1.0, 1.0)  # transverse, longitudinal
    mass_factor: float = 1.0


@dataclass(frozen=True)
class Turnbuckle:
    """A coupler: its middle, and factors on the bar's bending stiffness and mass."""

    x_m: float
    length_m: float
    bending_factor: float
    mass_factor: float
    error: float = 0.0  # sd of the logarithms of its described stiffness and mass


@dataclass(frozen=True)
class Design:
    """A hanger as designed, and the tension that it came to carry."""

    section: Section
    length_m: float
    stress_pa: float
    tension_ratio: float  # true over nominal
    ends: Ends
    inclination_deg: float = 90.0  # from the horizontal
    leaning: bool = False  # by design: the drawing shows the inclination
    turnbuckles: tuple[Turnbuckle, ...] = ()


def draw_bar(draws: Draws, low_m: float, high_m: float) -> Section:
    """Draw a solid round bar."""
    d = round(draws.log(low_m, high_m), 3)
    area, modulus = math.pi * d**2 / 4, float(draws.pick("205e9", "210e9"))
    stated = {
        "diameter_m": d,
        "elastic_modulus_pa": modulus,
        "density_kg_m3": STEEL_DENSITY_KG_M3,
    }
    per_length = STEEL_DENSITY_KG_M3 * area
    moment = math.pi * d**4 / 64
    return Section(
        *(area, moment, per_length, modulus, d), shear_coefficient=cowper(0.0), described={**stated}
    )


def draw_tube(draws: Draws) -> Section:
    """Draw a circular hollow section."""
    outer = round(draws.log(0.060, 0.140), 3)
    wall = round(draws.log(0.004, 0.010), 3)
    inner, modulus = outer - 2 * wall, 210e9
    area = math.pi / 4 * (outer**2 - inner**2)
    moment = math.pi / 64 * (outer**4 - inner**4)
    per_length = STEEL_DENSITY_KG_M3 * area
    return Section(
        *(area, moment, per_length, modulus, outer),
        second_moment_power=1.0,
        shear_coefficient=cowper(inner / outer),
        described={
            "elastic_modulus_pa": modulus,
            "area_m2": area,
            "second_moment_m4": moment,
            "mass_per_length_kg_m": per_length,
        },
    )


def draw_strand(
    draws: Draws, diameter_m: tuple[float, float], locked: bool, bending: tuple[float, float]
) -> Section:
    """Draw a strand; fill factors and moduli of EN 1993-1-11, tables 2.2 and 3.1."""
    d = round(draws.log(*diameter_m), 3)
    fill = draws.between(0.81, 0.88) if locked else draws.between(0.73, 0.77)
    modulus = 160e9 if locked else 150e9
    area, moment = fill * math.pi * d**2 / 4, fill * math.pi * d**4 / 64
    per_length = STRAND_DENSITY_KG_M3 * area
    return Section(
        *(area, moment, per_length, modulus, d),
        bending_factor=draws.between(*bending),
        described={
            "kind": "strand",
            "elastic_modulus_pa": modulus,
            "area_m2": area,
            "second_moment_m4": moment,
            "mass_per_length_kg_m": per_length,
            "bending_stiffness_factor": 0.5,
        },
    )


def draw_springs(
    draws: Draws, low: float, high: float, between_ends: float = 0.4, between_planes: float = 0.3
) -> tuple[float, float, float, float]:
    """Draw k1 to k4 (odd ones transverse, the last two at the arch); deviations are logarithmic.

    Half of the time the ends of a plane differ by their details only, likewise the planes.
    """
    k = [[draws.log(low, high) for _ in range(2)] for _ in range(2)]  # [end][plane]
    if draws.chance(0.5):
        k[1] = [value * draws.lognormal(between_ends) for value in k[0]]
    if draws.chance(0.5):
        for end in k:
            end[1] = end[0] * draws.lognormal(between_planes)
    one, two, three, four = (min(high, max(low, value)) for end in k for value in end)
    return one, two, three, four


def draw_forks(draws: Draws) -> Ends:
    """Draw two forks; each turns softly about its pin and stiffly across it."""
    soft, stiff = draws.log(0.05, 3.0), draws.log(20.0, 500.0)
    deck_soft_plane = int(draws.rng.integers(2))
    arch_soft_plane = deck_soft_plane if draws.chance(0.7) else 1 - deck_soft_plane
    k1, k2, k3, k4 = (
        (soft if plane == soft_plane else stiff) * draws.lognormal(0.4)
        for soft_plane in (deck_soft_plane, arch_soft_plane)
        for plane in range(2)
    )
    size, base = draws.between(0.15, 0.35), draws.log(4.0, 16.0)
    factors = base * draws.lognormal(0.3), base * draws.lognormal(0.3)
    fittings = round(size, 2), round(min(0.35, max(0.15, size * draws.lognormal(0.1))), 2)
    return Ends("fork", (k1, k2, k3, k4), "EI/L", fittings, factors, draws.between(2.5, 5.0))


def draw_plates(draws: Draws, name: str) -> Ends:
    """Draw plates welded to both ends: stiff in their plane, hardly stiffer than the bar across.

    The plates of both ends lie in one plane.
    """
    stiff = draw_springs(draws, 20.0, 1000.0)
    weak = draw_springs(draws, 3.0, 100.0)
    factors = [draws.log(1.5, 8.0), draws.log(0.7, 3.0)]
    springs = [stiff[0], weak[1], stiff[2], weak[3]]
    if draws.chance(0.5):  # the plates lie along the bridge
        factors, springs = factors[::-1], [weak[0], stiff[1], weak[2], stiff[3]]
    length = round(draws.between(0.1, 0.3), 2)
    k1, k2, k3, k4 = springs
    mass = draws.between(1.3, 3.5)
    return Ends(name, (k1, k2, k3, k4), "EI/L", (length, length), (factors[0], factors[1]), mass)


def draw_threads(draws: Draws, low: float, high: float) -> Ends:
    """Draw threaded ends in nuts: springs without fittings."""
    return Ends("threaded", draw_springs(draws, low, high))


def draw_sockets(
    draws: Draws,
    diameter_m: float,
    diameters: tuple[float, float],
    stiffness: tuple[float, float],
    mass: tuple[float, float],
) -> Ends:
    """Draw sockets, three in ten of them clamped."""
    springs = (1e4, 1e4, 1e4, 1e4) if draws.chance(0.3) else draw_springs(draws, 1.5, 60.0)
    length = round(draws.between(*diameters) * diameter_m, 2)
    factor = draws.log(*stiffness)
    other_plane = min(stiffness[1], max(stiffness[0], factor * draws.lognormal(0.1)))
    weight = draws.between(*mass)
    return Ends("socket", springs, "sqrt(EI T)", (length, length), (factor, other_plane), weight)


def _draw_ratio(draws: Draws) -> float:
    return draws.lognormal(math.log(1.25))


def _length(draws: Draws, low: float, high: float) -> float:
    return round(draws.log(low, high), 2)


def _bar_stress(draws: Draws) -> float:
    return draws.between(50e6, 180e6)  # of the permanent loads


def _strand_stress(draws: Draws) -> float:
    return draws.between(200e6, 500e6)


def draw_fork_bar(draws: Draws) -> Design:
    """Draw a solid bar with forks."""
    section, length = draw_bar(draws, 0.040, 0.100), _length(draws, 4.0, 16.0)
    return Design(section, length, _bar_stress(draws), _draw_ratio(draws), draw_forks(draws))


def draw_soft_ended_bar(draws: Draws) -> Design:
    """Draw a bar with springs of 0.5 to 10 EI/L at its ends."""
    section, length = draw_bar(draws, 0.040, 0.100), _length(draws, 4.0, 16.0)
    ends = draw_threads(draws, 0.5, 10.0)
    return Design(section, length, _bar_stress(draws), _draw_ratio(draws), ends)


def draw_slack_bar(draws: Draws) -> Design:
    """Draw a bar or tube that carries 2 to 20 % of its nominal tension."""
    tube = draws.chance(0.4)
    section = draw_tube(draws) if tube else draw_bar(draws, 0.040, 0.100)
    ends = draw_plates(draws, "plate") if tube or draws.chance(0.5) else draw_forks(draws)
    lean = draws.between(0.0, 25.0)
    return Design(
        section,
        _length(draws, 4.0, 16.0),
        _bar_stress(draws),
        draws.log(0.02, 0.20),
        ends,
        inclination_deg=90.0 - lean,
        leaning=lean > 2.0,
    )


def draw_turnbuckle_bar(draws: Draws) -> Design:
    """Draw a bar with one or two turnbuckles of 3 to 8 diameters, most of them below 5."""
    section, length = draw_bar(draws, 0.040, 0.100), _length(draws, 4.0, 16.0)
    ends = draw_forks(draws) if draws.chance(0.5) else draw_threads(draws, 5.0, 300.0)
    first, error = draws.between(0.12, 0.35), draws.between(0.1, 0.3)
    places = [first] if draws.chance(0.6) else [first, draws.between(0.6, 0.88)]
    size = draws.between(3.0, 5.0) if draws.chance(0.7) else draws.between(5.0, 8.0)
    one = Turnbuckle(
        0.0,
        round(size * section.outer_m, 2),
        draws.log(3.0, 15.0),
        draws.between(2.0, 5.0),
        error,
    )
    couplers = tuple(replace(one, x_m=round(place * length, 2)) for place in places)
    return Design(
        *(section, length, _bar_stress(draws), _draw_ratio(draws), ends), turnbuckles=couplers
    )


def draw_network_hanger(draws: Draws) -> Design:
    """Draw a slender bar or strand of a network arch."""
    if draws.chance(0.5):
        section, length = draw_bar(draws, 0.040, 0.080), _length(draws, 8.0, 25.0)
        ends = draw_forks(draws) if draws.chance(0.5) else draw_plates(draws, "plate")
        stress = _bar_stress(draws)
    else:
        section = draw_strand(draws, (0.030, 0.070), True, (0.3, 0.8))
        length, stress = _length(draws, 10.0, 35.0), _strand_stress(draws)
        ends = draw_sockets(draws, section.outer_m, (4.0, 8.0), (5.0, 25.0), (3.0, 8.0))
    ratio, inclination = _draw_ratio(draws), draws.between(45.0, 75.0)
    return Design(section, length, stress, ratio, ends, inclination, leaning=True)


def draw_tube_hanger(draws: Draws) -> Design:
    """Draw a tube with welded end plates."""
    section, length = draw_tube(draws), _length(draws, 4.0, 16.0)
    ends = draw_plates(draws, "welded")
    return Design(section, length, _bar_stress(draws), _draw_ratio(draws), ends)


def draw_locked_coil(draws: Draws) -> Design:
    """Draw a locked coil strand with sockets."""
    section = draw_strand(draws, (0.040, 0.110), True, (0.3, 0.8))
    length, ratio = _length(draws, 10.0, 45.0), _draw_ratio(draws)
    ends = draw_sockets(draws, section.outer_m, (4.0, 8.0), (5.0, 25.0), (3.0, 8.0))
    return Design(section, length, _strand_stress(draws), ratio, ends)


def draw_spiral_strand(draws: Draws) -> Design:
    """Draw a spiral strand with sockets: thinner and shorter, lighter sockets, looser wires."""
    section = draw_strand(draws, (0.020, 0.080), False, (0.3, 0.7))
    length, ratio = _length(draws, 6.0, 35.0), _draw_ratio(draws)
    ends = draw_sockets(draws, section.outer_m, (3.0, 7.0), (4.0, 20.0), (2.5, 7.0))
    return Design(section, length, _strand_stress(draws), ratio, ends)


KINDS: dict[str, Callable[[Draws], Design]] = {
    "fork bars": draw_fork_bar,
    "bars with soft ends": draw_soft_ended_bar,
    "slack bars": draw_slack_bar,
    "bars with turnbuckles": draw_turnbuckle_bar,
    "network hangers": draw_network_hanger,
    "tubes": draw_tube_hanger,
    "locked coil strands": draw_locked_coil,
    "spiral strands": draw_spiral_strand,
}


# ---------------------------------------------------------------- a case


@dataclass(frozen=True)
class Tolerances:
    """Standard deviations of the hanger as made from the hanger as described."""

    area: float = 0.01
    density: float = 0.003
    modulus: float = 0.015
    length: float = 0.0005
    length_m: float = 0.005  # of taping, on top
    turnbuckle_place_m: float = 0.01


def describe(draws: Draws, design: Design) -> str:
    """Return the hanger as its drawing states it."""
    section = design.section
    nominal = round(design.stress_pa * section.area_m2, -3)
    stated = {**section.described, "length_m": design.length_m, "nominal_tension_n": nominal}
    lines = ["[[hanger]]", "id = 1"]
    lines += [f"{key} = {json.dumps(value)}" for key, value in stated.items()]
    if any(design.ends.fittings_m):
        lines.append(f"fittings_m = {list(design.ends.fittings_m)}")
    for coupler in design.turnbuckles:
        bending = section.modulus_pa * section.second_moment_m4 * coupler.bending_factor
        mass = section.mass_per_length_kg_m * coupler.length_m * coupler.mass_factor
        lines += [
            *("", "[[hanger.turnbuckle]]", f"x_m = {coupler.x_m}"),
            f"length_m = {coupler.length_m}",
            f"mass_kg = {mass * draws.lognormal(coupler.error)!r}",
            f"bending_stiffness_n_m2 = {bending * draws.lognormal(coupler.error)!r}",
        ]
    return "\n".join(lines) + "\n"


def make_members(
    draws: Draws, design: Design, tolerances: Tolerances
) -> tuple[tuple[Member, Member], dict[str, float | str]]:
    """Make both planes of the hanger as built and as instrumented, with the truth about it."""
    section, ends = design.section, design.ends
    size = 1 + draws.normal(tolerances.area)
    area = section.area_m2 * size
    moment = section.second_moment_m4 * size**section.second_moment_power
    modulus = section.modulus_pa * (1 + draws.normal(tolerances.modulus))
    per_length = section.mass_per_length_kg_m * size * (1 + draws.normal(tolerances.density))
    length = design.length_m * (1 + draws.normal(tolerances.length))
    length += draws.normal(tolerances.length_m)
    tension = design.tension_ratio * round(design.stress_pa * section.area_m2, -3)
    bending = section.bending_factor * modulus * moment
    shear = section.shear_coefficient * modulus / (2 * (1 + POISSON)) * area
    inclination = design.inclination_deg
    if not design.leaning:  # out of plumb
        inclination -= abs(draws.normal(1.0))
    lean = math.radians(inclination)
    unit = bending / length if ends.unit == "EI/L" else math.sqrt(bending * tension)
    k1, k2, k3, k4 = (k * unit for k in ends.springs)
    lateral = [draws.log(1e8, 1e9) for _ in range(4)]  # as k1 to k4
    axial = draws.log(1e8, 1e9), draws.log(1e8, 1e9)
    places = sorted(draws.between(1.0, 2.5) for _ in range(int(draws.rng.integers(1, 4))))
    sensors = tuple((min(x, 0.45 * length), draws.between(0.020, 0.090)) for x in places)
    couplers = []
    for coupler in design.turnbuckles:
        middle = coupler.x_m + draws.normal(tolerances.turnbuckle_place_m)
        start, end = middle - coupler.length_m / 2, middle + coupler.length_m / 2
        couplers.append(Zone(start, end, coupler.bending_factor, coupler.mass_factor))
    deck, arch = ends.fittings_m
    base = Member(
        length_m=length,
        tension_n=tension,
        bending_stiffness_n_m2=bending,
        mass_per_length_kg_m=per_length,
        shear_stiffness_n=shear,
        rotary_inertia_kg_m=per_length / area * moment,
        axial_stiffness_n=modulus * area,
        masses=sensors,
        axial_n_m=axial,
        gravity_along_m_s2=GRAVITY_M_S2 * math.sin(lean),
    )
    members = []
    for plane, springs in enumerate(((k1, k3), (k2, k4))):
        factor, heavier = ends.bending_factors[plane], ends.mass_factor
        fittings = [Zone(0.0, deck, factor, heavier), Zone(length - arch, length, factor, heavier)]
        zones = [zone for zone in fittings if zone.end_m > zone.start_m] + couplers
        members.append(
            replace(
                base,
                zones=tuple(zones),
                rotation_n_m_rad=springs,
                lateral_n_m=(lateral[plane], lateral[plane + 2]),
                gravity_across_m_s2=GRAVITY_M_S2 * math.cos(lean) if plane == 1 else 0.0,
            )
        )
    truth: dict[str, float | str] = {
        "tension_n": tension,
        "tension_ratio": design.tension_ratio,
        "ends": ends.name,
        "inclination_deg": inclination,
        "length_m": length,
        "area_m2": area,
        "elastic_modulus_pa": modulus,
        "bending_stiffness_n_m2": bending,
        "mass_per_length_kg_m": per_length,
        "bending_factor": section.bending_factor,
        "xi": length * math.sqrt(tension / bending),
        "fitting_bending_transverse": ends.bending_factors[0],
        "fitting_bending_longitudinal": ends.bending_factors[1],
        "fitting_mass": ends.mass_factor,
        "spring_unit": ends.unit,
        "turnbuckles": float(len(couplers)),
    }
    truth |= {f"spring_k{i}": k for i, k in enumerate(ends.springs, 1)}
    return (members[0], members[1]), truth


def measure(
    draws: Draws, members: tuple[Member, Member], missing: float = 0.1
) -> tuple[dict[str, object], dict[str, float | str]]:
    """Return the document of one test, and the truth about its errors."""
    planes = (draws.pick(*PLANES),) if draws.chance(0.45) else PLANES
    real = draws.log(1e-4, 1e-3)
    stated = real * draws.lognormal(0.2)
    modes: list[dict[str, object]] = []
    for plane, member in zip(PLANES, members, strict=True):
        if plane not in planes:
            continue
        count = int(draws.rng.integers(4, 9))
        exact = natural_frequencies_hz(member, count)
        lost = int(draws.rng.integers(1, count)) if draws.chance(missing) else 0  # never the last
        for order, frequency in enumerate(exact.tolist(), 1):
            measured = frequency * (1 + draws.normal(real))
            if order != lost:
                modes.append(
                    {
                        "plane": plane,
                        "order": order,
                        "frequency_hz": measured,
                        "frequency_sd_hz": measured * stated,
                    }
                )
    test = {"id": "t1", "time": "2026-05-01T10:00:00Z", "temperature_c": 12.0, "modes": modes}
    record: dict[str, float | str] = {"scatter_sd": real, "frequency_sd": stated}
    record |= {"modes": float(len(modes)), "planes": float(len(planes))}
    return {"schema": "shm.modes/1", "hanger": 1, "tests": [test]}, record


@lru_cache(maxsize=4096)
def make_hanger(seed: int, index: int) -> Case:
    """Make one case; its kind follows from the index, so that all kinds are equally many."""
    draws = Draws(seed, index, 8)
    kind = list(KINDS)[index % len(KINDS)]
    design = KINDS[kind](draws)
    toml = describe(draws, design)
    members, truth = make_members(draws, design, Tolerances())
    extra: dict[str, float | str] = {"ends": design.ends.name}
    if draws.chance(0.5) and design.leaning:
        extra["inclination_deg"] = round(design.inclination_deg, 1)
    modes, measured = measure(draws, members)
    return Case(index, toml, modes, {"kind": kind, **truth, **measured}, (kind,), extra)


def sound_hangers(seed: int, count: int) -> list[Case]:
    """Return hangers with nothing wrong; case i depends on (seed, i) alone, not on the count."""
    return [make_hanger(seed, index) for index in range(count)]
