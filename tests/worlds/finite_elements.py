"""An independent world of bridge hangers: natural frequencies by finite elements.

Each case is a hanger with a known tension, described the way a drawing describes it (hanger.toml)
and measured the way a field team measures it (modes, "shm.modes/1"). Nothing here is shared with
the program under test: not the equations' solution, not the random draws, not the nuisances.

Physics, one plane: a round bar by `bars.py`, held sideways at both ends on rotational springs. Own
weight lets the tension of a vertical hanger grow; the stated tension is the one at mid-length.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tests.worlds.bars import GRAVITY_M_S2, POISSON, Array, Bar, cowper, natural_frequencies_hz
from tests.worlds.cases import Case

PLANES = ("transverse", "longitudinal")
STEEL_DENSITY_KG_M3 = 7850.0
# EN 1993-1-11, table 2.2: fill factor 0.73 (spiral strand, many layers) to 0.88 (locked coil), and
# 83 kN/m3 of metallic section, which carries the lay of the wires and the corrosion protection.
STRAND_FILL = (0.73, 0.88)
STRAND_DENSITY_KG_M3 = 83e3 / GRAVITY_M_S2


@dataclass(frozen=True)
class Nuisances:
    """Everything in which a real, sound hanger and a real test differ from their description.

    Each can be switched off alone: the draws of the others stay the same. The sd of the section is
    mild against the rolling tolerance of rounds (EN 10060: +-0.8 mm at 50 mm, three sd of the
    diameter; +-0.4 mm at 12 mm, nearly seven), that of the modulus half the 3 % of the JCSS
    Probabilistic Model Code (part 3.10), that of the length the cutting tolerance L/5000 + 2 mm of
    EN 1090-2 taken as one sd at 7 m.
    """

    area_sd: float = 0.01  # as made against as described; the second moment follows the area
    modulus_sd: float = 0.015
    density_sd: float = 0.003
    length_sd: float = 0.0005
    bending_factor: tuple[float, float] = (0.4, 1.0)  # strands; described as 0.7
    sensor_mass_kg: tuple[float, float] = (0.02, 0.08)  # accelerometer left out of the description
    own_weight: bool = True  # the tension grows upwards; the truth is the one at mid-length
    scatter: float = 1.0  # scale of the random error of a frequency; 0: none
    misstated_sd: float = 0.2  # ln(real sd / stated sd), sd over the cases
    repeat_sd: tuple[float, float] = (1e-5, 5e-4)  # error of a mode that repeats in every test
    missing_order: float = 0.1  # share of planes that lack one order inside
    absent_sd: float = 0.05  # share of cases that state no sd

    @classmethod
    def none(cls) -> "Nuisances":
        """Return the world in which descriptions and frequencies are exact."""
        return cls(
            *(0.0, 0.0, 0.0, 0.0),
            bending_factor=(0.7, 0.7),
            sensor_mass_kg=(0.0, 0.0),
            own_weight=False,
            scatter=0.0,
            misstated_sd=0.0,
            repeat_sd=(0.0, 0.0),
            missing_order=0.0,
            absent_sd=0.0,
        )


@dataclass(frozen=True)
class _Draw:
    """What a population decides before the common part takes over."""

    strand: bool
    diameter_m: float
    springs: tuple[float, float, float, float]  # k L/EI: k1, k2, k3, k4
    ratio: float  # true tension / nominal
    planes: tuple[str, ...]
    modes: tuple[int, int]  # for each plane
    tests: int


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    # Always one draw, so that a nuisance switched off (0 to 0) leaves the later draws alone.
    draw = float(rng.random())
    return low * (high / low) ** draw if low > 0 else low + (high - low) * draw


def _springs(
    rng: np.random.Generator, low: float, high: float
) -> tuple[float, float, float, float]:
    k1, k2, k3, k4 = (_log_uniform(rng, low, high) for _ in range(4))
    if rng.random() < 0.5:  # both ends of a plane alike
        k3, k4 = k1, k2
    if rng.random() < 0.5:  # the two planes alike but for the details of the fork or gusset
        factor = math.exp(0.3 * rng.standard_normal())
        k2, k4 = (min(high, max(low, k * factor)) for k in (k1, k3))
    return k1, k2, k3, k4


def _sound(rng: np.random.Generator) -> _Draw:
    strand = bool(rng.random() < 0.25)
    diameter = _log_uniform(rng, *((0.020, 0.110) if strand else (0.012, 0.140)))
    kind = rng.random()
    bounds = (0.03, 10.0) if kind < 0.2 else (100.0, 1000.0) if kind < 0.4 else (0.03, 1000.0)
    springs = _springs(rng, *bounds)
    while kind >= 0.4 and (max(springs) < 10 or min(springs) > 100):  # so a fifth is a fifth
        springs = _springs(rng, *bounds)
    mix = rng.random()
    if mix < 0.2:
        ratio = _log_uniform(rng, 0.05, 0.5)
    else:
        ratio = float(rng.uniform(0.5, 1.5) if mix < 0.9 else rng.uniform(1.5, 2.0))
    share = rng.random()
    planes = PLANES if share >= 0.35 else PLANES[:1] if share < 0.25 else PLANES[1:]
    modes = (int(rng.integers(3, 15)), int(rng.integers(3, 15)))
    return _Draw(strand, diameter, springs, ratio, planes, modes, int(rng.integers(1, 6)))


def _measure(
    rng: np.random.Generator, draw: _Draw, exact: dict[str, Array], nuisances: Nuisances
) -> tuple[dict[str, object], dict[str, float | str]]:
    """Return the document of the tests, and the truth about the measurement."""
    stated = _log_uniform(rng, 1e-5, 1e-3)
    real = stated * math.exp(nuisances.misstated_sd * rng.standard_normal()) * nuisances.scatter
    repeat = _log_uniform(rng, *nuisances.repeat_sd)
    without_sd = bool(rng.random() < nuisances.absent_sd)
    bias = {p: repeat * rng.standard_normal(20) for p in PLANES}
    record: dict[str, float | str] = {}
    orders: dict[str, list[int]] = {}
    for plane, count in zip(PLANES, draw.modes, strict=True):
        lacking, which = bool(rng.random() < nuisances.missing_order), rng.random()
        gap = 2 + int(which * (count - 2)) if lacking and count > 3 else 0  # never first or last
        orders[plane] = [n for n in range(1, count + 1) if n != gap]
        record[f"modes_{plane}"] = float(len(orders[plane]) if plane in draw.planes else 0)
    record["modes"] = float(sum(len(orders[p]) for p in draw.planes))
    tests: list[dict[str, object]] = []
    for number in range(draw.tests):
        warmth = 12 + 8 * rng.standard_normal()
        error = {p: real * rng.standard_normal(20) for p in PLANES}
        modes: list[dict[str, object]] = []
        for plane in draw.planes:
            for n in orders[plane]:
                f = float(exact[plane][n - 1] * (1 + bias[plane][n - 1] + error[plane][n - 1]))
                sd = {} if without_sd else {"frequency_sd_hz": f * stated}
                modes.append({"plane": plane, "order": n, "frequency_hz": f, **sd})
        time = f"2026-{5 + number:02d}-01T10:00:00Z"
        air = round(float(warmth), 1)  # for show: the truth is the same in every test
        tests.append({"id": f"t{number + 1}", "time": time, "temperature_c": air, "modes": modes})
    record |= {"frequency_sd": stated, "scatter_sd": real, "repeat_sd": repeat}
    record |= {"sd_stated": float(not without_sd), "tests": float(draw.tests)}
    return {"schema": "shm.modes/1", "hanger": 1, "tests": tests}, record


def _groups(draw: _Draw, diameter_m: float) -> tuple[str, ...]:
    belongs = {"rods": not draw.strand, "strands": draw.strand, "slack": draw.ratio < 0.5}
    belongs |= {"slim": diameter_m < 0.030, "one plane": len(draw.planes) == 1}
    belongs |= {"soft ends": max(draw.springs) < 10}
    return tuple(name for name, yes in belongs.items() if yes)


def _case(rng: np.random.Generator, index: int, draw: _Draw, nuisances: Nuisances) -> Case:
    low = max(40.0, 2.0 / draw.diameter_m)
    length = draw.diameter_m * _log_uniform(rng, low, min(250.0, 25.0 / draw.diameter_m))
    modulus = 1e9 * float(rng.uniform(*((150, 165) if draw.strand else (195, 212))))
    fill, density = float(rng.uniform(*STRAND_FILL)), STEEL_DENSITY_KG_M3
    area = math.pi * draw.diameter_m**2 / 4
    if draw.strand:
        area, density = fill * area, STRAND_DENSITY_KG_M3
    nominal = 1e6 * float(rng.uniform(60, 250)) * area
    described: dict[str, float] = {"length_m": length, "elastic_modulus_pa": modulus}
    if draw.strand:  # "as if solid": a solid round of the metallic area
        described |= {"area_m2": area, "second_moment_m4": area**2 / (4 * math.pi)}
        described |= {"mass_per_length_kg_m": density * area, "bending_stiffness_factor": 0.7}
    else:
        described = {"diameter_m": draw.diameter_m, **described, "density_kg_m3": density}
    described["nominal_tension_n"] = nominal
    lines = ["[[hanger]]", "id = 1", *(['kind = "strand"'] if draw.strand else [])]
    toml = "\n".join(lines + [f"{key} = {value!r}" for key, value in described.items()]) + "\n"

    # As made.
    off = rng.standard_normal(4)
    true_area = area * (1 + nuisances.area_sd * float(off[0]))
    true_modulus = modulus * (1 + nuisances.modulus_sd * float(off[1]))
    true_density = density * (1 + nuisances.density_sd * float(off[2]))
    true_length = length * (1 + nuisances.length_sd * float(off[3]))
    factor = float(rng.uniform(*nuisances.bending_factor))
    second_moment = true_area**2 / (4 * math.pi)  # a round
    bending = (factor if draw.strand else 1.0) * true_modulus * second_moment
    shear = cowper() * true_modulus / (2 * (1 + POISSON)) * true_area
    mass, tension = true_density * true_area, draw.ratio * nominal
    # The accelerometer sits where a person on the deck reaches: 1 to 2.5 m up.
    sensor_kg = float(rng.uniform(*nuisances.sensor_mass_kg))
    sensor_m = min(float(rng.uniform(1.0, 2.5)), 0.45 * true_length)
    bare = Bar(
        length_m=true_length,
        tension_n=tension,
        bending_stiffness_n_m2=bending,
        mass_per_length_kg_m=mass,
        shear_stiffness_n=math.inf if draw.strand else shear,
        rotary_inertia_kg_m=true_density * second_moment,
        gravity_along_m_s2=GRAVITY_M_S2 if nuisances.own_weight else 0.0,
        masses=((sensor_m, sensor_kg),),
    )
    diameter = draw.diameter_m * math.sqrt(true_area / area)  # overall, for a strand
    rng.random(4)  # unused: seeds give the hangers that pages quote
    exact: dict[str, Array] = {}
    for plane, ends, count in zip(PLANES, ((0, 2), (1, 3)), draw.modes, strict=True):
        deck, arch = (draw.springs[i] * bending / true_length for i in ends)
        bar = replace(bare, rotation_n_m_rad=(deck, arch))
        if plane in draw.planes:
            exact[plane] = natural_frequencies_hz(bar, count)
    modes, measured = _measure(rng, draw, exact, nuisances)
    truth: dict[str, float | str] = {"tension_n": tension, "tension_ratio": draw.ratio}
    truth |= {"kind": "strand" if draw.strand else "rod", "planes": float(len(draw.planes))}
    truth |= {"diameter_m": diameter, "length_m": true_length, "area_m2": true_area}
    truth |= {"elastic_modulus_pa": true_modulus, "second_moment_m4": second_moment}
    truth |= {"bending_stiffness_n_m2": bending, "mass_per_length_kg_m": mass}
    truth |= {"bending_factor": factor if draw.strand else 1.0}
    truth |= {"sensor_mass_kg": sensor_kg, "sensor_place_m": sensor_m}
    truth |= {f"spring_k{i}": k for i, k in enumerate(draw.springs, 1)}  # k L/EI
    truth |= measured
    return Case(index, toml, modes, truth, _groups(draw, diameter))


def _population(
    draw: Callable[[np.random.Generator], _Draw], entropy: tuple[int, int], count: int, n: Nuisances
) -> list[Case]:
    generators = [np.random.default_rng(s) for s in np.random.SeedSequence(entropy).spawn(count)]
    return [_case(rng, i, draw(rng), n) for i, rng in enumerate(generators)]


def sound_hangers(seed: int, count: int, nuisances: Nuisances | None = None) -> list[Case]:
    """Return hangers with nothing wrong; case i depends on (seed, i) alone, not on the count."""
    return _population(_sound, (seed, 1), count, nuisances or Nuisances())
