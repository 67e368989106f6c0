"""An independent world of bridge hangers: natural frequencies by finite elements.

Each case is a hanger with a known tension, described the way a drawing describes it (hanger.toml)
and measured the way a field team measures it (modes, "shm.modes/1"). Nothing here is shared with
the program under test: not the equations' solution, not the random draws, not the nuisances.

Physics, one plane. A straight bar between two supports that do not deflect, x from the deck end:

* Timoshenko bending and rotary inertia (Timoshenko, Phil. Mag. 41, 1921), shear coefficient of the
  solid round 6(1 + nu)/(7 + 6 nu) (Cowper, J. Appl. Mech. 33, 1966);
* the tension works on the slope of the axis, T w'^2/2 (Timoshenko & Gere, Theory of Elastic
  Stability, the Engesser form); with own weight it grows upwards by m g per metre (a vertical
  hanger) and the stated tension is the one at mid-length;
* rotational springs on the rotation of the end sections; point masses, lateral springs and a
  stretch of reduced section anywhere.

Elements. The deflection is split as w = b + s, where b' is the rotation of the section and s' the
shear strain. b is C1 (Hermite cubic plus bubbles from Legendre polynomials integrated twice), s is
C0 (linear plus Legendre polynomials integrated once; Szabo & Babuska, Finite Element Analysis,
1991), both of degree 8. Zero shear strain is s = 0, so nothing can lock, and leaving s out gives
the bar without shear flexibility exactly. Nodes lie on every mass, support and change of section.
"""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.linalg import eigh

Array = NDArray[np.float64]

PLANES = ("transverse", "longitudinal")
GRAVITY_M_S2 = 9.81
POISSON = 0.3  # EN 1993-1-1, 3.2.6
COWPER_ROUND = 6 * (1 + POISSON) / (7 + 6 * POISSON)  # Cowper (1966), solid circle: 0.8864
STEEL_DENSITY_KG_M3 = 7850.0
# EN 1993-1-11, table 2.2: fill factor 0.73 (spiral strand, many layers) to 0.88 (locked coil), and
# 83 kN/m3 of metallic section, which carries the lay of the wires and the corrosion protection.
STRAND_FILL = (0.73, 0.88)
STRAND_DENSITY_KG_M3 = 83e3 / GRAVITY_M_S2
DEGREE = 8  # of the deflection inside an element


@dataclass(frozen=True)
class Bar:
    """One plane of a hanger as it really is."""

    length_m: float
    tension_n: float  # at mid-length
    bending_stiffness_n_m2: float
    mass_per_length_kg_m: float
    shear_stiffness_n: float = math.inf  # coefficient x G x A; inf: no shear flexibility
    rotary_inertia_kg_m: float = 0.0  # density x second moment; 0: none
    spring_deck_n_m_rad: float = 0.0
    spring_arch_n_m_rad: float = 0.0
    tension_gradient_n_m: float = 0.0  # growth of the tension towards the arch
    masses: tuple[tuple[float, float], ...] = ()  # (place_m, mass_kg)
    supports: tuple[tuple[float, float], ...] = ()  # (place_m, stiffness_n_m)
    loss: tuple[float, float, float] = (0.0, 0.0, 0.0)  # from_m, to_m, lost part of EI


@cache
def _reference() -> dict[str, Array]:
    """Integrals of the shape functions over the element -1..1, rows [b functions, s functions].

    The two slope functions of b are those for a unit slope in the coordinate -1..1; the element
    of length h scales them by h/2.
    """
    hermite = ([2, -3, 0, 1], [1, -1, -1, 1], [2, 3, 0, -1], [-1, -1, 1, 1])
    bending = [legendre.poly2leg(c) / 4 for c in hermite]
    bending += [legendre.legint(np.eye(j + 1)[j], m=2, lbnd=-1) for j in range(2, DEGREE - 1)]
    shear = [np.array([0.5, -0.5]), np.array([0.5, 0.5])]
    shear += [legendre.legint(np.eye(j + 1)[j], lbnd=-1) for j in range(1, DEGREE)]
    point, weight = legendre.leggauss(DEGREE + 2)  # exact to degree 19; 17 is needed

    def values(order: int, with_b: bool = True, with_s: bool = True) -> Array:
        rows = [(c, with_b) for c in bending] + [(c, with_s) for c in shear]
        return np.array([on * legendre.legval(point, legendre.legder(c, order)) for c, on in rows])

    def gram(rows: Array, factor: Array) -> Array:
        return (rows * (weight * factor)) @ rows.T

    one = np.ones_like(point)
    return {
        "curvature": gram(values(2, with_s=False), one),
        "rotation": gram(values(1, with_s=False), one),
        "strain": gram(values(1, with_b=False), one),
        "slope": gram(values(1), one),
        "slope_x": gram(values(1), point),
        "deflection": gram(values(0), one),
    }


def _mesh(bar: Bar, elements: int) -> Array:
    stations = {0.0, bar.length_m, *(x for x, _ in bar.masses), *(x for x, _ in bar.supports)}
    if bar.loss[2] > 0:
        stations |= {bar.loss[0], bar.loss[1]}
    if bar.tension_n > 0:  # elements of their own for the end layers, exp(-x sqrt(T/EI))
        layer = 5 * math.sqrt(bar.bending_stiffness_n_m2 / bar.tension_n)
        if layer < bar.length_m / elements:
            stations |= {layer, bar.length_m - layer}
    marks = sorted(stations)
    nodes = [0.0]
    for start, end in pairwise(marks):
        parts = max(1, math.ceil((end - start) / bar.length_m * elements - 1e-9))
        nodes.extend(start + (end - start) * i / parts for i in range(1, parts + 1))
    return np.array(nodes)


def natural_frequencies_hz(bar: Bar, count: int, elements: int | None = None) -> Array:
    """Return the first `count` natural frequencies of the bar in one plane.

    By default one element of degree 8 a mode: half a wave each, far below 1e-6 (see the tests).
    """
    x = _mesh(bar, elements or max(8, count))
    reference, parts = _reference(), len(x) - 1
    with_shear = math.isfinite(bar.shear_stiffness_n)
    b_inner, s_inner = DEGREE - 3, DEGREE - 1
    local = 4 + b_inner + (2 + s_inner if with_shear else 0)
    # Unknowns: deflection b, rotation b' and deflection s of each node, then the inner ones.
    node = np.arange(3 * (parts + 1)).reshape(-1, 3)
    inner = 3 * (parts + 1) + np.arange(parts * (b_inner + s_inner)).reshape(parts, -1)
    size = 3 * (parts + 1) + inner.size
    stiffness, mass = np.zeros((size, size)), np.zeros((size, size))
    for e in range(parts):
        h, middle = x[e + 1] - x[e], (x[e] + x[e + 1]) / 2
        lost = bar.loss[2] if bar.loss[0] <= middle <= bar.loss[1] else 0.0
        second_moment, area = 1 - lost, math.sqrt(1 - lost)  # a round thinned all around: I ~ A^2
        tension = bar.tension_n + bar.tension_gradient_n_m * (middle - bar.length_m / 2)
        half = h / 2
        k = second_moment * bar.bending_stiffness_n_m2 / half**3 * reference["curvature"]
        k += tension / half * reference["slope"] + bar.tension_gradient_n_m * reference["slope_x"]
        m = area * bar.mass_per_length_kg_m * half * reference["deflection"]
        m += second_moment * bar.rotary_inertia_kg_m / half * reference["rotation"]
        if with_shear:
            k += area * bar.shear_stiffness_n / half * reference["strain"]
        scale = np.ones(local)
        scale[[1, 3]] = half
        where = np.concatenate(
            (node[e, :2], node[e + 1, :2], inner[e, :b_inner])
            + ((node[e : e + 2, 2], inner[e, b_inner:]) if with_shear else ())
        )
        block = np.ix_(where, where)
        stiffness[block] += scale[:, None] * k[:local, :local] * scale
        mass[block] += scale[:, None] * m[:local, :local] * scale
    stiffness[node[0, 1], node[0, 1]] += bar.spring_deck_n_m_rad
    stiffness[node[-1, 1], node[-1, 1]] += bar.spring_arch_n_m_rad
    for matrix, lumps in ((mass, bar.masses), (stiffness, bar.supports)):
        for place, amount in lumps:
            at = node[int(np.argmin(np.abs(x - place)))][[0, 2]]  # the deflection is b + s
            matrix[np.ix_(at, at)] += amount
    # No deflection at the ends: b = s = 0 at the deck (which also settles how a constant is shared
    # between b and s), b + s = 0 at the arch.
    fixed = {int(node[0, 0]), int(node[0, 2]), int(node[-1, 2])}
    if with_shear:
        for matrix in (stiffness, mass):
            matrix[node[-1, 0], :] -= matrix[node[-1, 2], :]
            matrix[:, node[-1, 0]] -= matrix[:, node[-1, 2]]
    else:
        fixed |= {int(node[-1, 0]), *node[:, 2].tolist(), *inner[:, b_inner:].ravel().tolist()}
    free = np.array([i for i in range(size) if i not in fixed])
    keep = np.ix_(free, free)
    # M v = (1/omega^2) K v: the low modes are the large values, the ones that rounding spares.
    values = eigh(mass[keep], stiffness[keep], eigvals_only=True, check_finite=False)
    return 1 / (2 * math.pi * np.sqrt(values[::-1][:count]))


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
class Case:
    """A hanger as described and as measured, and the truth about it."""

    index: int
    hanger_toml: str
    modes: dict[str, object]
    truth: dict[str, float | str]
    groups: tuple[str, ...]

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Write hanger.toml and case.modes.json into the folder (made if need be)."""
        folder.mkdir(parents=True, exist_ok=True)
        hanger, modes = folder / "hanger.toml", folder / "case.modes.json"
        hanger.write_text(self.hanger_toml, encoding="utf-8")
        modes.write_text(json.dumps(self.modes, indent=1) + "\n", encoding="utf-8")
        return hanger, modes


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
    shear = COWPER_ROUND * true_modulus / (2 * (1 + POISSON)) * true_area
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
        tension_gradient_n_m=mass * GRAVITY_M_S2 if nuisances.own_weight else 0.0,
        masses=((sensor_m, sensor_kg),),
    )
    diameter = draw.diameter_m * math.sqrt(true_area / area)  # overall, for a strand
    rng.random(4)  # unused: seeds give the hangers that pages quote
    exact: dict[str, Array] = {}
    for plane, ends, count in zip(PLANES, ((0, 2), (1, 3)), draw.modes, strict=True):
        deck, arch = (draw.springs[i] * bending / true_length for i in ends)
        bar = replace(bare, spring_deck_n_m_rad=deck, spring_arch_n_m_rad=arch)
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
