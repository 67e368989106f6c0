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
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.linalg import eigh

Array = NDArray[np.float64]
GRAVITY_M_S2 = 9.81
POISSON = 0.3
SHEAR_FACTOR = 6 * (1 + POISSON) / (7 + 6 * POISSON)  # Cowper 1966, solid circle
STEEL_KG_M3 = 7850.0  # EN 1991-1-1, table A.4
STATED_FACTOR = 0.7  # the bending factor of a strand, as described
PLANES = ("transverse", "longitudinal")
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
        zero = (0.0, 0.0)
        factor = (STATED_FACTOR, STATED_FACTOR)
        return cls(
            *(0.0, 0.0, 0.0, 0.0, factor, 0.0, 0.2, 0.0, zero, False),
            *(zero, 0.0, 0.0, 0.0, zero, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        )


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
    wander: Callable[[Array], Array] | None = None
    zones: tuple[EndZone, EndZone] = (EndZone(), EndZone())
    self_weight: bool = False
    sensor_kg: float = 0.0
    sensor_at_m: float = 0.0

    def section(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Mass, bending stiffness, shear stiffness and rotary inertia at x, per metre."""
        area = np.ones_like(x) if self.wander is None else 1 + self.wander(x)
        bending, mass = area**2, area.copy()  # a round section that grows: I goes with A^2
        deck, arch = self.zones
        for zone, inside in ((deck, x < deck.length_m), (arch, x > self.length_m - arch.length_m)):
            bending[inside] *= zone.bending_ratio
            mass[inside] *= zone.mass_ratio
            area[inside] *= np.sqrt(zone.bending_ratio)
        return (
            self.mass_kg_m * mass,
            self.bending_nm2 * bending,
            self.shear_n * area,
            self.rotary_kg_m * bending,
        )

    def weight_n(self, x: Array) -> Array:
        """Weight of the bar between mid length and x, positive above (x > L/2)."""
        if not self.self_weight:
            return np.zeros_like(x)
        grid = np.linspace(0.0, self.length_m, 4001)
        middle = (grid[1:] + grid[:-1]) / 2
        below = np.append(0.0, np.cumsum(self.section(middle)[0] * np.diff(grid)))
        return GRAVITY_M_S2 * (np.interp(x, grid, below) - below[2000])

    def breaks_m(self, pieces: int) -> Array:
        """Borders of the subdomains: zones, boundary layers, sensor, equal pieces between."""
        deck, arch = (zone.length_m for zone in self.zones)
        inner = np.linspace(deck + 0.05 * self.length_m, 0.95 * self.length_m - arch, pieces + 1)
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
    bar: Bar,
    tensions_n: list[float],
    ends: tuple[End, End],
    count: int,
    degree: int = 12,
    pieces: int = 5,
) -> Array:
    """First `count` frequencies in one plane for each tension at mid length (one row each).

    Solved as M v = (1/omega^2) K v: the low modes are then the large eigenvalues, which keeps
    them exact to rounding even if the shear stiffness is very high.
    """
    weights, value, slope = _reference(degree)
    points = legendre.leggauss(degree + 3)[0]
    breaks = bar.breaks_m(pieces)
    n = (len(breaks) - 1) * degree + 1  # deflections first, rotations after
    elastic, string, inertia = np.zeros((2 * n, 2 * n)), np.zeros((n, n)), np.zeros((2 * n, 2 * n))
    for e, (left, right) in enumerate(zip(breaks[:-1], breaks[1:], strict=True)):
        half = (right - left) / 2
        x = left + half * (points + 1)
        mass, bending, shear, rotary = bar.section(x)
        dx, slope_x = half * weights, slope / half
        at = slice(e * degree, (e + 1) * degree + 1)
        turn = slice(n + e * degree, n + (e + 1) * degree + 1)
        elastic[at, at] += (slope_x.T * (dx * (shear + bar.weight_n(x)))) @ slope_x
        coupling = (slope_x.T * (dx * shear)) @ value
        elastic[at, turn] -= coupling
        elastic[turn, at] -= coupling.T
        elastic[turn, turn] += (slope_x.T * (dx * bending)) @ slope_x
        elastic[turn, turn] += (value.T * (dx * shear)) @ value
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
    rows = []
    for tension_n in tensions_n:
        stiffness = elastic.copy()
        stiffness[:n, :n] += tension_n * string
        inverse = eigh(
            *(inertia[keep], stiffness[keep]),
            eigvals_only=True,
            subset_by_index=[size - count, size - 1],
            check_finite=False,
        )
        rows.append(1 / np.sqrt(inverse[::-1]) / (2 * np.pi))
    return np.array(rows)


def hub_on_plate_nm_per_rad(
    modulus_pa: float, thickness_m: float, hub_radius_m: float, outer_radius_m: float
) -> float:
    """Rotational stiffness of a rigid hub in a round plate clamped at its outer edge.

    Kirchhoff plate under a central couple, w = (A r + B r^3 + C/r + F r ln r) cos(phi), which
    gives rotation = M/(4 pi D) [ln(a/b) - (a^2-b^2)/(a^2+b^2)] (Timoshenko and
    Woinowsky-Krieger, Theory of Plates and Shells, art. 63; Roark's Formulas, trunnion).
    """
    rigidity = modulus_pa * thickness_m**3 / (12 * (1 - POISSON**2))
    a2, b2 = outer_radius_m**2, hub_radius_m**2
    return float(4 * np.pi * rigidity / (np.log(a2 / b2) / 2 - (a2 - b2) / (a2 + b2)))


def gusset_nm_per_rad(
    modulus_pa: float, thickness_m: float, width_m: float, free_length_m: float
) -> float:
    """Out-of-plane stiffness of a gusset: cantilever strip of Whitmore's width (1952), EI/l."""
    return modulus_pa * width_m * thickness_m**3 / 12 / free_length_m


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
    """A product as described in the catalogue; `soft` and `zoned` belong to its end detail."""

    rod: bool
    diameter_m: float
    modulus_pa: float
    area_m2: float
    second_moment_m4: float
    mass_kg_m: float
    stress_pa: float
    soft: bool
    zone_chance: float  # has end zones if below Nuisances.end_zone_share
    strand_chance: float  # place of the true bending factor in its range


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
    area = np.pi / 4 * diameter**2 * fill
    return _Kind(
        *(rod, diameter, modulus, area, area * diameter**2 / 16, STEEL_KG_M3 * area * lay),
        stress_pa=rng.uniform(60e6, 250e6),
        soft=bool(rng.random() < 0.2),
        zone_chance=float(rng.random()),
        strand_chance=float(rng.random()),
    )


def _draw_end(rng: np.random.Generator, kind: _Kind, unit_nm: float) -> tuple[float, float]:
    """Rotational stiffness of one end (transverse, longitudinal); unit_nm is EI/L.

    Pins with friction are drawn as k L/EI.  Plates follow from their size in diameters; a nut
    bears on part of its face only (contact 2 to 100 %).  Thread and bearing add compliance in
    series, so that no end is stiffer than 1000 EI/L.
    """
    u = rng.random(8)
    d, steel = kind.diameter_m, 205e9
    if kind.soft:  # spherical bearing or loose pin, both planes
        low = 0.03 * (9.9 / 0.03) ** u[:2]
        return float(low[0] * unit_nm), float(low[1] * unit_nm)
    if u[0] < 0.3:  # clevis: turns about its pin, the fork holds across
        pair = [0.03 * (10 / 0.03) ** u[1] * unit_nm, 15 * (300 / 15) ** u[2] * unit_nm]
    elif u[0] < 0.7:  # nut on a plate
        stiff = hub_on_plate_nm_per_rad(steel, d * (0.4 + u[1]), 0.9 * d, d * (2 + 4 * u[2]))
        pair = [stiff * 0.02**q for q in u[3:5]]
    else:  # gusset: bends across its plane, holds within it
        strip = gusset_nm_per_rad(steel, d * (0.3 + 0.5 * u[1]), d * (3 + 3 * u[2]), d * (2 + u[3]))
        pair = [strip, strip * 100]
    if u[5] < 0.5:
        pair.reverse()
    first, second = (max(1 / (1 / k + 1 / (1000 * unit_nm)), 0.03 * unit_nm) for k in pair)
    return float(first), float(second)


def _wander(
    rng: np.random.Generator, length_m: float, sd: float, share: float
) -> Callable[[Array], Array]:
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
        return np.cos(angle) @ a + np.sin(angle) @ b

    return relative


def _toml(kind: _Kind, length_m: float, hanger: int, family: str | None) -> str:
    lines = ["[[hanger]]", f"id = {hanger}"]
    if family is not None:
        lines.append(f'family = "{family}"')
    if kind.rod:
        lines.append(f"diameter_m = {kind.diameter_m!r}")
    else:
        lines.append('kind = "strand"')
    lines.append(f"length_m = {length_m!r}")
    lines.append(f"elastic_modulus_pa = {kind.modulus_pa!r}")
    if kind.rod:
        lines.append(f"density_kg_m3 = {STEEL_KG_M3!r}")
    else:
        lines.append(f"area_m2 = {float(kind.area_m2)!r}")
        lines.append(f"second_moment_m4 = {float(kind.second_moment_m4)!r}")
        lines.append(f"mass_per_length_kg_m = {float(kind.mass_kg_m)!r}")
        lines.append(f"bending_stiffness_factor = {STATED_FACTOR!r}")
    lines.append(f"nominal_tension_n = {float(kind.stress_pa * kind.area_m2)!r}")
    return "\n".join(lines) + "\n"


def _build(
    kind: _Kind,
    root: np.random.SeedSequence,
    knobs: Nuisances,
    index: int,
    batch: Array,
    own: float,
    hanger: int = 1,
    family: str | None = None,
    reading: bool = False,
) -> Case:
    """One case; `batch` holds standard deviates (area, modulus, density) of the rolling batch."""
    design, made, ends_rng, field, errors = (np.random.default_rng(s) for s in root.spawn(5))
    d = kind.diameter_m
    slender = _log_uniform(design, max(40.0, 2.0 / d), min(250.0, 25.0 / d))
    stated_length = round(min(max(slender * d, 2.0), 25.0), 3)
    slack = design.random() < 0.2
    ratio = _log_uniform(design, *((0.05, 0.5) if slack else (0.5, 2.0)))
    tension = ratio * kind.stress_pa * kind.area_m2

    # As made.
    deviates = batch + own * made.standard_normal(3)
    area_off, modulus_off, density_off = 1 + deviates * [
        *(knobs.area_sd, knobs.modulus_sd, knobs.density_sd),
    ]
    length = stated_length * (1 + knobs.length_sd * made.standard_normal())
    low, high = knobs.strand_factor
    factor = 1.0 if kind.rod else low + (high - low) * kind.strand_chance
    area = kind.area_m2 * area_off
    modulus = kind.modulus_pa * modulus_off
    second_moment = kind.second_moment_m4 * area_off**2
    mass = kind.mass_kg_m * area_off * density_off
    wander = _wander(made, length, knobs.wander_sd, knobs.wander_length_share)
    shares, stiffer = made.uniform(0.01, 0.03, 2), made.uniform(1.2, 4.0, 2)
    heavier = made.uniform(1.1, 2.0, 2)
    zoned = kind.zone_chance < knobs.end_zone_share
    zones = [
        EndZone(length * shares[i], stiffer[i], heavier[i]) if zoned else EndZone() for i in (0, 1)
    ]
    height = min(field.uniform(1.0, 2.2), field.uniform(0.15, 0.40) * length)  # within reach
    sensor = field.uniform(*knobs.sensor_kg)
    bar = Bar(
        *(length, mass, factor * modulus * second_moment),
        shear_n=SHEAR_FACTOR * modulus / (2 * (1 + POISSON)) * area,
        rotary_kg_m=mass * second_moment / area,
        wander=wander if knobs.wander_sd > 0 else None,
        zones=(zones[0], zones[1]),
        self_weight=knobs.self_weight,
        sensor_kg=sensor,
        sensor_at_m=height,
    )
    unit = bar.bending_nm2 / length
    stiffness = dict(zip(("k1", "k2"), _draw_end(ends_rng, kind, unit), strict=True))
    stiffness |= zip(("k3", "k4"), _draw_end(ends_rng, kind, unit), strict=True)
    ends = {
        k: End(v, _log_uniform(ends_rng, *knobs.lateral_flexibility_m_per_n))
        for k, v in stiffness.items()
    }

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
    started = datetime(2026, 5, 1, 10, tzinfo=UTC)
    documents: list[dict[str, Any]] = []
    for t in range(tests):
        time = (started + timedelta(days=7 * t)).strftime("%Y-%m-%dT%H:%M:%SZ")
        document = {"id": f"t{t + 1}", "time": time, "temperature_c": float(temperature[t])}
        documents.append({**document, "modes": []})
    read_at, read_off = int(field.integers(0, tests)), field.standard_normal()
    if reading:  # at mid length: the crew has allowed for the weight below
        read = float(forces[read_at] * (1 + knobs.reading_error_sd * read_off))
        documents[read_at] |= {"tension_read_n": read, "tension_read_sd_n": 0.01 * read}
    exact: dict[str, list[float]] = {}
    mistaken: list[tuple[str, int]] = []
    for plane in planes:
        deck, arch = (ends[k] for k in SPRINGS[plane])
        many = count[plane] + 1
        table = natural_frequencies_hz(bar, [tension, *forces], (deck, arch), many)
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
                if is_stated:
                    mode["frequency_sd_hz"] = stated_sd * hz
                document["modes"].append(mode)
    relative = {k: v / unit for k, v in stiffness.items()}
    flags = {
        "rods": kind.rod,
        "strands": not kind.rod,
        "slack": ratio < 0.5,
        "slim": d < 0.030,
        "one plane": len(planes) == 1,
        "soft ends": max(relative.values()) < 10,
    }
    mean_area = area * (1 + float(wander(np.linspace(0, length, 201)).mean()))
    truth = {
        "tension_n": float(tension),
        "tension_ratio": float(ratio),
        "reference_temperature_c": reference,
        "diameter_m": d,
        "kind": "rod" if kind.rod else "strand",
        "length_m": float(length),
        "area_m2": float(mean_area),
        "modulus_pa": float(modulus),
        "mass_kg_m": float(mass * mean_area / area),
        "bending_nm2": float(bar.bending_nm2),
        "bending_factor": float(factor),
        "end_stiffness_nm_per_rad": stiffness,
        "end_kl_over_ei": relative,
        "end_zones": [vars(z) for z in zones] if zoned else [],
        "sensor_kg": float(sensor),
        "sensor_at_m": float(height),
        "planes": list(planes),
        "modes": {p: len(orders[p]) for p in planes},
        "tests": tests,
        "stated_sd": stated_sd if is_stated else None,
        "frequency_sd": float(real_sd),
        "repeat_sd": repeat_sd,
        "clock": float(clock),
        "exact_frequency_hz": exact,
        "mistaken": mistaken,
    }
    document = {"schema": "shm.modes/1", "hanger": hanger, "tests": documents}
    toml = _toml(kind, stated_length, hanger, family)
    return Case(index, toml, document, truth, tuple(k for k, v in flags.items() if v))


def sound_hangers(seed: int, count: int, nuisances: Nuisances | None = None) -> list[Case]:
    """Sound hangers; case i depends on (seed, i) only, not on the count."""
    knobs = Nuisances() if nuisances is None else nuisances
    cases = []
    for i in range(count):
        root = np.random.SeedSequence(seed, spawn_key=(0, i))
        kind = _draw_kind(np.random.default_rng(root))
        cases.append(_build(kind, root, knobs, i, np.zeros(3), 1.0))
    return cases


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
        result.append(
            [
                _build(kind, root, knobs, m, batch, 0.2, m + 1, "A", reading=m == 0)
                for m, root in enumerate(roots)
            ]
        )
    return result
