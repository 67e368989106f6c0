"""A world of sound hangers: measured natural frequencies whose tension is known.

Each hanger is a Timoshenko beam under tension, solved by a Legendre spectral Galerkin method on
several subdomains (Canuto, Hussaini, Quarteroni, Zang: Spectral Methods, 2007).  Potential energy

    V = 1/2 int EI th'^2 + kGA (w' - th)^2 + T w'^2 dx  +  1/2 sum of springs at the ends,

kinetic energy of m w_t^2 + rho I th_t^2 and of the sensor, a point mass.  The axial force acts
along the tangent of the axis (Engesser's model; Timoshenko and Gere, Theory of Elastic
Stability, 1961, art. 2.17).  Shear factor of the round section after Cowper (1966).

The nuisances of the field are on by default (`Nuisances`), nothing is wrong with the hangers.
x runs up from the deck end.  k1 (deck) and k3 (arch) act in the transverse plane, k2 and k4 in
the longitudinal one.  Every law draws from its own stream with the same number of draws whether
it is on or off, so that two trials with the same seed differ only by what was switched.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.linalg import eigh

Array = NDArray[np.float64]
Law = Callable[[Array], Array]
GRAVITY_M_S2 = 9.81
POISSON = 0.3
SHEAR_FACTOR = 6 * (1 + POISSON) / (7 + 6 * POISSON)  # Cowper 1966, solid circle
STEEL_KG_M3 = 7850.0  # EN 1991-1-1, table A.4
STATED_FACTOR = 0.7  # the bending factor of a strand, as described
PLANES = ("transverse", "longitudinal")
GROUPS = ("rods", "strands", "slack", "slim", "one plane", "soft ends")
SPRINGS = {"transverse": ("k1", "k3"), "longitudinal": ("k2", "k4")}


@dataclass(frozen=True)
class Nuisances:
    """What separates a real measurement of a sound hanger from the textbook.

    Sources of the tolerances: area, modulus and density within JCSS Probabilistic Model Code,
    parts 2.1 and 3.2 (modulus 3 % for steels at large, half of it for one mill); taped length
    after OIML R 35 (class II, 0.3 mm + 0.2 mm/m); strand bending between slipping and sticking
    wires after Papailiou (IEEE Trans. Power Delivery 12, 1997); clock 10 ppm, the usual tolerance
    of a quartz crystal.  The others are the ranges asked for in the brief of this world.
    """

    area_sd: float = 0.01  # true over described, fraction
    modulus_sd: float = 0.015
    density_sd: float = 0.003
    length_sd: float = 5e-4
    strand_factor: tuple[float, float] = (0.4, 1.0)  # true bending factor, uniform
    wander_sd: float = 0.003  # of the area along the bar
    wander_length_share: float = 0.2  # correlation length over length
    end_zone_share: float = 0.5  # share of cases with threads, sockets or forks
    lateral_flexibility_m_per_n: tuple[float, float] = (1e-9, 1e-8)  # of each support
    self_weight: bool = True
    sensor_kg: tuple[float, float] = (0.020, 0.080)
    clock_sd: float = 1e-5  # of the logger, one a case
    scatter_scale: float = 1.0  # 0 takes the random error of the frequencies away
    scatter_log_sd: float = 0.2  # ln(real scatter / stated)
    repeat_sd: tuple[float, float] = (1e-5, 5e-4)  # error of a mode, the same in all tests
    temperature_sd_k: float = 3.0
    tension_per_k: float = -5e-4  # fraction of the tension: a warm hanger is longer
    missing_order_share: float = 0.10  # share of cases
    unstated_sd_share: float = 0.05  # share of cases
    reading_error_sd: float = 0.01  # true error of a lift-off reading
    mistaken_mode_share: float = 0.0  # share of modes replaced by a wrong frequency

    @classmethod
    def none(cls) -> "Nuisances":
        """The textbook: uniform bar as described, exact frequencies, all modes."""
        off: dict[str, Any] = {
            name: (0.0, 0.0) if isinstance(value, tuple) else type(value)()
            for name, value in vars(cls()).items()
        }
        factor = (STATED_FACTOR, STATED_FACTOR)
        return cls(**off | {"strand_factor": factor, "wander_length_share": 0.2})


@dataclass(frozen=True)
class EndZone:
    """Thread, socket or fork: a short length with more stiffness and mass."""

    length_m: float = 0.0
    bending_ratio: float = 1.0
    mass_ratio: float = 1.0


@dataclass(frozen=True)
class End:
    """Restraint of one end in one plane; a lateral flexibility of 0 is a rigid support."""

    rotation_nm_per_rad: float
    lateral_flexibility_m_per_n: float = 0.0


@dataclass(frozen=True)
class Bar:
    """Bar by its mean properties, a relative wander of its area, and its end zones."""

    length_m: float
    mass_kg_m: float
    bending_nm2: float
    shear_n: float
    rotary_kg_m: float
    wander: Law | None = None
    zones: tuple[EndZone, ...] = (EndZone(), EndZone())
    self_weight: bool = False
    sensor_kg: float = 0.0
    sensor_at_m: float = 0.0

    def section(self, x: Array) -> tuple[Array, ...]:
        """Mass, bending stiffness, shear stiffness and rotary inertia at x, per metre."""
        area = np.ones_like(x) if self.wander is None else 1 + self.wander(x)
        bending, mass = area**2, area.copy()  # a round section that grows: I goes with A^2
        deck, arch = self.zones
        for zone, inside in ((deck, x < deck.length_m), (arch, x > self.length_m - arch.length_m)):
            bending[inside] *= zone.bending_ratio
            mass[inside] *= zone.mass_ratio
            area[inside] *= np.sqrt(zone.bending_ratio)
        per_m = (self.mass_kg_m, self.bending_nm2, self.shear_n, self.rotary_kg_m)
        ratios = (mass, bending, area, bending)
        return tuple(base * ratio for base, ratio in zip(per_m, ratios, strict=True))

    def weight_n(self, x: Array) -> Array:
        """Weight of the bar between mid length and x, positive above (x > L/2)."""
        if not self.self_weight:
            return np.zeros_like(x)
        grid = np.linspace(0.0, self.length_m, 4001)
        middle = (grid[1:] + grid[:-1]) / 2
        below = np.append(0.0, np.cumsum(self.section(middle)[0] * np.diff(grid)))
        return np.asarray(GRAVITY_M_S2 * (np.interp(x, grid, below) - below[2000]))

    def breaks_m(self) -> Array:
        """Borders of the subdomains: zones, boundary layers, sensor, five equal pieces between."""
        deck, arch = (zone.length_m for zone in self.zones)
        inner = np.linspace(deck + 0.05 * self.length_m, 0.95 * self.length_m - arch, 6)
        marks = [0.0, deck, *inner, self.length_m - arch, self.length_m]
        if self.sensor_kg > 0:
            marks.append(self.sensor_at_m)
        return np.unique(np.round(marks, 12))


@lru_cache(maxsize=8)
def _reference(degree: int) -> tuple[Array, Array, Array]:
    """Gauss weights, and the Lagrange basis on Lobatto nodes (values, slopes) on [-1, 1]."""
    inner = legendre.Legendre.basis(degree).deriv().roots()
    nodes = np.concatenate(([-1.0], np.sort(inner.real), [1.0]))
    points, weights = legendre.leggauss(degree + 3)
    to_legendre = np.linalg.inv(legendre.legvander(nodes, degree))
    slopes = legendre.legval(points, legendre.legder(np.eye(degree + 1))).T
    return weights, legendre.legvander(points, degree) @ to_legendre, slopes @ to_legendre


def natural_frequencies_hz(
    bar: Bar, tensions_n: list[float], ends: tuple[End, End], count: int, degree: int = 12
) -> Array:
    """First `count` frequencies in one plane for each tension at mid length (one row each).

    Solved as M v = (1/omega^2) K v, of which only the few largest eigenvalues are wanted.  Good
    to 1e-8 with the shear stiffness of steel; a very high one costs digits.
    """
    weights, value, slope = _reference(degree)
    points = legendre.leggauss(degree + 3)[0]
    breaks = bar.breaks_m()
    n = (len(breaks) - 1) * degree + 1  # deflections first, rotations after
    elastic, string, inertia = np.zeros((2 * n, 2 * n)), np.zeros((n, n)), np.zeros((2 * n, 2 * n))
    halves = np.diff(breaks) / 2
    x = (breaks[:-1, None] + halves[:, None] * (points + 1)).ravel()
    laws = [*bar.section(x), bar.weight_n(x)]
    per_piece = zip(*(law.reshape(len(halves), -1) for law in laws), strict=True)
    for e, (mass, bending, shear, rotary, weight) in enumerate(per_piece):
        dx, slope_x = halves[e] * weights, slope / halves[e]
        at = slice(e * degree, (e + 1) * degree + 1)
        turn = slice(n + e * degree, n + (e + 1) * degree + 1)
        elastic[at, at] += (slope_x.T * (dx * (shear + weight))) @ slope_x
        coupling = (slope_x.T * (dx * shear)) @ value
        elastic[at, turn] -= coupling
        elastic[turn, at] -= coupling.T
        bent, sheared = (slope_x.T * (dx * bending)) @ slope_x, (value.T * (dx * shear)) @ value
        elastic[turn, turn] += bent + sheared
        string[at, at] += (slope_x.T * dx) @ slope_x
        inertia[at, at] += (value.T * (dx * mass)) @ value
        inertia[turn, turn] += (value.T * (dx * rotary)) @ value
    if bar.sensor_kg > 0:
        node = degree * int(np.argmin(np.abs(breaks - bar.sensor_at_m)))
        inertia[node, node] += bar.sensor_kg
    free = np.ones(2 * n, dtype=bool)
    for end, node in zip(ends, (0, n - 1), strict=True):
        elastic[n + node, n + node] += end.rotation_nm_per_rad
        if end.lateral_flexibility_m_per_n > 0:
            elastic[node, node] += 1 / end.lateral_flexibility_m_per_n
        else:
            free[node] = False
    keep, size = np.ix_(free, free), int(free.sum())
    wanted = [size - count, size - 1]
    rows = []
    for tension_n in tensions_n:
        stiffness = elastic.copy()
        stiffness[:n, :n] += tension_n * string
        inverse = eigh(inertia[keep], stiffness[keep], eigvals_only=True, subset_by_index=wanted)
        rows.append(1 / np.sqrt(inverse[::-1]) / (2 * np.pi))
    return np.array(rows)


def hub_on_plate_nm(rigidity_nm: float, hub_radius_m: float, outer_radius_m: float) -> float:
    """Rotational stiffness of a rigid hub in a round plate clamped at its outer edge.

    Kirchhoff plate under a central couple, w = (A r + B r^3 + C/r + F r ln r) cos(phi), which
    gives rotation = M/(4 pi D) [ln(a/b) - (a^2-b^2)/(a^2+b^2)] (Timoshenko and
    Woinowsky-Krieger, Theory of Plates and Shells, art. 63; Roark's Formulas, trunnion).
    """
    a2, b2 = outer_radius_m**2, hub_radius_m**2
    return float(4 * np.pi * rigidity_nm / (np.log(a2 / b2) / 2 - (a2 - b2) / (a2 + b2)))


@dataclass(frozen=True)
class Case:
    """One hanger as described and measured, and the truth about it."""

    index: int
    hanger_toml: str
    modes: dict[str, Any]
    truth: dict[str, Any]
    groups: tuple[str, ...]

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Write hanger.toml and case.modes.json into the folder (made if it is not there)."""
        folder.mkdir(parents=True, exist_ok=True)
        toml_path, modes_path = folder / "hanger.toml", folder / "case.modes.json"
        toml_path.write_text(self.hanger_toml, encoding="utf-8")
        modes_path.write_text(json.dumps(self.modes, indent=1), encoding="utf-8")
        return toml_path, modes_path


@dataclass(frozen=True)
class _Kind:
    """A product as described in the catalogue, and its detailing at the ends."""

    rod: bool
    diameter_m: float
    modulus_pa: float
    area_m2: float
    second_moment_m4: float
    mass_kg_m: float
    stress_pa: float
    soft: bool  # spherical bearings or loose pins at both ends
    zone_chance: float  # has end zones if below Nuisances.end_zone_share
    strand_chance: float  # place of the true bending factor in its range
    deck_style: float  # pin below 0.3, nut on a plate below 0.7, else gusset
    arch_style: float


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    u = float(rng.random())
    return low * (high / low) ** u if low > 0 else 0.0


def _draw_kind(rng: np.random.Generator) -> _Kind:
    """Rod or strand; modulus and fill of strands after EN 1993-1-11, tables 3.1 and 2.2."""
    rod = bool(rng.random() < 0.75)
    diameter = round(_log_uniform(rng, *((0.012, 0.140) if rod else (0.020, 0.110))), 3)
    modulus = round(rng.uniform(*((195, 212) if rod else (150, 165)))) * 1e9
    fill, lay = rng.uniform(0.73, 0.88), rng.uniform(1.0, 1.03)  # lay: filler and helix of wires
    fill, lay = (1.0, 1.0) if rod else (fill, lay)
    area = float(np.pi / 4 * diameter**2 * fill)
    section = (area, area * diameter**2 / 16, STEEL_KG_M3 * area * lay)
    stress, chance = rng.uniform(60e6, 250e6), rng.random(5).tolist()
    return _Kind(rod, diameter, modulus, *section, stress, chance[0] < 0.2, *chance[1:])


def _draw_end(
    rng: np.random.Generator, kind: _Kind, style: float, unit_nm: float
) -> tuple[float, float]:
    """Rotational stiffness of one end (transverse, longitudinal); unit_nm is EI/L.

    Pins with friction are drawn as k L/EI.  Plates follow from their size in diameters; a nut
    bears on part of its face only (contact 2 to 100 %).  Thread and bearing add compliance in
    series, so that no end is stiffer than 1000 EI/L.
    """
    u = rng.random(6)
    d, steel = kind.diameter_m, 205e9
    if kind.soft:
        pair = [0.03 * (9.9 / 0.03) ** q * unit_nm for q in u[:2]]
    elif style < 0.3:  # clevis: turns about its pin, the fork holds across
        pair = [0.03 * (10 / 0.03) ** u[1] * unit_nm, 15 * (300 / 15) ** u[2] * unit_nm]
    elif style < 0.7:  # nut on a plate
        rigidity = steel * (d * (0.4 + u[1])) ** 3 / (12 * (1 - POISSON**2))
        stiff = hub_on_plate_nm(rigidity, 0.9 * d, d * (2 + 4 * u[2]))
        pair = [stiff * 0.02**q for q in u[3:5]]
    else:  # gusset: bends across its plane, holds within it
        thick, width, free = d * (0.3 + 0.5 * u[1]), d * (3 + 3 * u[2]), d * (2 + u[3])
        strip = steel * width * thick**3 / 12 / free  # EI/l over Whitmore's width (1952)
        pair = [strip, strip * 100]
    if u[5] < 0.5:
        pair.reverse()
    first, second = (max(1 / (1 / k + 1 / (1000 * unit_nm)), 0.03 * unit_nm) for k in pair)
    return float(first), float(second)


def _wander(rng: np.random.Generator, length_m: float, sd: float, share: float) -> Law:
    """Smooth Gaussian field of correlation exp(-(s/l)^2) by the spectral representation.

    Shinozuka and Deodatis, Applied Mechanics Reviews 44 (1991); period 2 L.
    """
    order = np.arange(25)
    power = np.exp(-((np.pi * order * share) ** 2) / 4)
    power[0] /= 2
    amplitude = sd * np.sqrt(power / power.sum())
    a, b = rng.standard_normal((2, 25)) * amplitude

    def relative(x: Array) -> Array:
        angle = np.pi / length_m * np.multiply.outer(x, order)
        return np.asarray(np.cos(angle) @ a + np.sin(angle) @ b)

    return relative


def _toml(
    kind: _Kind, length_m: float, hanger: int, family: str | None, fittings_m: list[float]
) -> str:
    rod = {"diameter_m": kind.diameter_m, "density_kg_m3": STEEL_KG_M3}
    strand = {"kind": "strand", "area_m2": kind.area_m2, "second_moment_m4": kind.second_moment_m4}
    strand |= {"mass_per_length_kg_m": kind.mass_kg_m, "bending_stiffness_factor": STATED_FACTOR}
    entry: dict[str, Any] = {"id": hanger} | ({} if family is None else {"family": family})
    entry |= rod if kind.rod else strand
    entry |= {"length_m": length_m, "elastic_modulus_pa": kind.modulus_pa}
    entry |= {"nominal_tension_n": kind.stress_pa * kind.area_m2}
    entry |= {"fittings_m": fittings_m} if any(fittings_m) else {}  # what anybody sees and tapes
    lines = (f"{k} = {json.dumps(v)}\n" for k, v in entry.items())  # also right for TOML
    return "[[hanger]]\n" + "".join(lines)


def _build(
    kind: _Kind, root: np.random.SeedSequence, knobs: Nuisances, index: int, batch: Array | None
) -> Case:
    """One case; `batch`: standard deviates (area, modulus, density) of a family, or None."""
    alone = batch is None
    hanger, family = (1, None) if alone else (index + 1, "A")
    design, made, ends_rng, field, errors = (np.random.default_rng(s) for s in root.spawn(5))
    d = kind.diameter_m
    slender = _log_uniform(design, max(40.0, 2.0 / d), min(250.0, 25.0 / d))
    stated_length = round(min(max(slender * d, 2.0), 25.0), 3)
    slack = design.random() < 0.2
    ratio = _log_uniform(design, *((0.05, 0.5) if slack else (0.5, 2.0)))
    tension = ratio * kind.stress_pa * kind.area_m2

    # As made.
    sds = np.array([knobs.area_sd, knobs.modulus_sd, knobs.density_sd])
    deviates = made.standard_normal(3)
    made_as = 1 + sds * (deviates if batch is None else batch + deviates / 5)
    area_off, modulus_off, density_off = (float(v) for v in made_as)
    length = stated_length * (1 + knobs.length_sd * made.standard_normal())
    factor = 1.0 if kind.rod else float(np.interp(kind.strand_chance, [0, 1], knobs.strand_factor))
    area, second_moment = kind.area_m2 * area_off, kind.second_moment_m4 * area_off**2
    modulus = kind.modulus_pa * modulus_off
    mass = kind.mass_kg_m * area_off * density_off
    wander = _wander(made, length, knobs.wander_sd, knobs.wander_length_share)
    zoned = kind.zone_chance < knobs.end_zone_share
    low, high = np.array([[0.01 * length, 1.2, 1.1], [0.03 * length, 4.0, 2.0]])
    drawn = (EndZone(*(float(v) for v in made.uniform(low, high))) for _ in range(2))
    zones = tuple(drawn) if zoned else (EndZone(), EndZone())
    seen = [round(zone.length_m, 2) for zone in zones] if zoned else [0.0, 0.0]
    height = min(field.uniform(1.0, 2.2), field.uniform(0.15, 0.40) * length)  # within reach
    sensor = field.uniform(*knobs.sensor_kg)
    shear, rotary = SHEAR_FACTOR * modulus * area / (2 + 2 * POISSON), mass * second_moment / area
    mean = (mass, factor * modulus * second_moment, shear, rotary)
    field_of_area = wander if knobs.wander_sd > 0 else None
    bar = Bar(length, *mean, field_of_area, zones, knobs.self_weight, sensor, height)
    unit = bar.bending_nm2 / length
    stiffness = dict(
        zip(("k1", "k2"), _draw_end(ends_rng, kind, kind.deck_style, unit), strict=True)
    )
    stiffness |= zip(("k3", "k4"), _draw_end(ends_rng, kind, kind.arch_style, unit), strict=True)
    soft = [_log_uniform(ends_rng, *knobs.lateral_flexibility_m_per_n) for _ in range(4)]
    ends = {k: End(v, f) for (k, v), f in zip(stiffness.items(), soft, strict=True)}

    # As measured.
    single, which = field.random() < 0.35, field.random()
    planes = PLANES if not single else (PLANES[0 if which < 0.75 else 1],)
    count = dict(zip(PLANES, (int(c) for c in field.integers(3, 15, 2)), strict=True))
    orders = {p: list(range(1, count[p] + 1)) for p in planes}
    missing, in_plane, at = field.random(3)
    if missing < knobs.missing_order_share:
        chosen = orders[planes[int(in_plane * len(planes))]]
        chosen.pop(1 + int(at * (len(chosen) - 2)))  # neither the first nor the last
    tests = int(field.integers(1, 6))
    temperature = field.uniform(0, 25) + knobs.temperature_sd_k * field.standard_normal(5)
    temperature = np.round(temperature[:tests], 1)
    reference = float(temperature.mean())
    forces = tension * (1 + knobs.tension_per_k * (temperature - reference))
    stated_sd = _log_uniform(field, 1e-5, 1e-3)
    real_sd = stated_sd * knobs.scatter_scale * np.exp(knobs.scatter_log_sd * field.normal())
    repeat_sd = _log_uniform(field, *knobs.repeat_sd)
    clock = 1 + knobs.clock_sd * field.standard_normal()
    is_stated = field.random() >= knobs.unstated_sd_share
    documents: list[dict[str, Any]] = [
        {
            "id": f"t{t + 1}",
            "time": f"2026-05-{t + 1:02}T10:00:00Z",
            "temperature_c": c,
            "modes": [],
        }
        for t, c in enumerate(temperature.tolist())
    ]
    read_at, read_off = int(field.integers(0, tests)), field.standard_normal()
    if not alone and index == 0:  # at mid length: the crew has allowed for the weight below
        read = float(forces[read_at] * (1 + knobs.reading_error_sd * read_off))
        documents[read_at] |= {"tension_read_n": read, "tension_read_sd_n": 0.01 * read}
    exact: dict[str, list[float]] = {}
    mistaken: list[tuple[str, int]] = []
    for plane in planes:
        deck, arch = (ends[k] for k in SPRINGS[plane])
        table = natural_frequencies_hz(bar, [tension, *forces], (deck, arch), count[plane] + 1)
        exact[plane] = [float(f) for f in table[0, : count[plane]]]
        repeat = repeat_sd * errors.standard_normal(14)
        scatter = real_sd * errors.standard_normal((5, 14))
        wrong, side, share = errors.random((3, 14))
        for o in orders[plane]:
            move = 0.0
            if wrong[o - 1] < knobs.mistaken_mode_share:  # a peak between this mode and the next
                move = (0.1 + 0.3 * share[o - 1]) * (1 if side[o - 1] < 0.5 else -1)
                mistaken.append((plane, o))
            for t, document in enumerate(documents):
                gap = table[t + 1, o] - table[t + 1, o - 1]
                true_hz = table[t + 1, o - 1] + move * min(gap, table[t + 1, o - 1])
                hz = float(true_hz * clock * (1 + repeat[o - 1]) * (1 + scatter[t, o - 1]))
                mode: dict[str, Any] = {"plane": plane, "order": o, "frequency_hz": hz}
                document["modes"].append(
                    mode | ({"frequency_sd_hz": stated_sd * hz} if is_stated else {})
                )
    relative = {k: v / unit for k, v in stiffness.items()}
    flags = (kind.rod, not kind.rod, ratio < 0.5, d < 0.030, len(planes) == 1)
    groups = zip(GROUPS, (*flags, max(relative.values()) < 10), strict=True)
    mean_area = area * (1 + float(wander(np.linspace(0, length, 201)).mean()))
    truth: dict[str, Any] = {
        "end_stiffness_nm_per_rad": stiffness,
        "end_kl_over_ei": relative,
        "end_zones": [vars(z) for z in zones] if zoned else [],
        "modes": {p: len(orders[p]) for p in planes},
        "exact_frequency_hz": exact,
        "test_tension_n": forces.tolist(),
    }
    truth |= {"kind": "rod" if kind.rod else "strand", "diameter_m": d, "planes": list(planes)}
    truth |= {"tension_n": float(tension), "tension_ratio": float(ratio), "tests": tests}
    truth |= {"reference_temperature_c": reference, "length_m": float(length)}
    truth |= {"area_m2": float(mean_area), "modulus_pa": float(modulus)}
    truth |= {"mass_kg_m": float(mass * mean_area / area), "bending_nm2": float(bar.bending_nm2)}
    truth |= {"bending_factor": float(factor), "clock": float(clock), "mistaken": mistaken}
    truth |= {"sensor_kg": float(sensor), "sensor_at_m": float(height), "repeat_sd": repeat_sd}
    truth |= {"stated_sd": stated_sd if is_stated else None, "frequency_sd": float(real_sd)}
    measured = {"schema": "shm.modes/1", "hanger": hanger, "tests": documents}
    names = tuple(name for name, yes in groups if yes)
    return Case(index, _toml(kind, stated_length, hanger, family, seen), measured, truth, names)


def sound_hangers(seed: int, count: int, nuisances: Nuisances | None = None) -> list[Case]:
    """Sound hangers; case i depends on (seed, i) only, not on the count."""
    knobs = Nuisances() if nuisances is None else nuisances
    roots = [np.random.SeedSequence(seed, spawn_key=(0, i)) for i in range(count)]
    kinds = [_draw_kind(np.random.default_rng(root)) for root in roots]
    pairs = zip(kinds, roots, strict=True)
    return [_build(kind, root, knobs, i, None) for i, (kind, root) in enumerate(pairs)]


def families(
    seed: int, count: int, members: int, nuisances: Nuisances | None = None
) -> list[list[Case]]:
    """Siblings of one rolling batch; the first member has one test with a lift-off reading."""
    knobs = Nuisances() if nuisances is None else nuisances
    result = []
    for i in range(count):
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1, i)))
        kind, batch = _draw_kind(rng), rng.standard_normal(3)
        roots = [np.random.SeedSequence(seed, spawn_key=(1, i, m)) for m in range(members)]
        result.append([_build(kind, root, knobs, m, batch) for m, root in enumerate(roots)])
    return result
