"""The structures of `recordings`: a tensioned bar with end springs, and three that are no bars.

The bar is a Timoshenko bar (or, for proofs, an Euler-Bernoulli one) under constant tension, held
laterally at both ends, turning there against rotational springs, with sensors as point masses.
Discretised by one polynomial over the whole length (Ritz): the deflection by integrals of Legendre
polynomials, which vanish at the ends, the rotation by Legendre polynomials.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import brentq

Array = NDArray[np.float64]
PLANES = ("transverse", "longitudinal")
STEEL_PA, POISSON, STEEL_KG_M3 = 2.1e11, 0.3, 7850.0
SHEAR_COEFFICIENT = 6 * (1 + POISSON) / (7 + 6 * POISSON)  # full circle, Cowper 1966
DEGREE = 44  # the 16th mode of the most string-like hanger is then right to 1e-5 or better


@dataclass(frozen=True)
class Bar:
    """A round steel bar; `springs_nm` are (deck, arch) in N m/rad, `masses` (place in m, kg)."""

    length_m: float
    diameter_m: float
    tension_n: float
    springs_nm: tuple[float, float]
    masses: tuple[tuple[float, float], ...] = ()
    timoshenko: bool = True

    @property
    def mass_kg_m(self) -> float:
        return STEEL_KG_M3 * np.pi / 4 * self.diameter_m**2

    @property
    def bending_nm2(self) -> float:
        return STEEL_PA * np.pi / 64 * self.diameter_m**4

    @property
    def shear_n(self) -> float:
        modulus = STEEL_PA / (2 + 2 * POISSON)
        return SHEAR_COEFFICIENT * modulus * np.pi / 4 * self.diameter_m**2


@dataclass(frozen=True)
class Shapes:
    """Frequencies (modes,) and mass-normalised deflections, in 1/sqrt(kg), at any place."""

    frequency_hz: Array
    at: Callable[[Sequence[float] | Array], Array]  # places in m (points,) -> (modes, points)


def _deflection(xi: Array) -> tuple[Array, Array, Array]:
    """The functions of the deflection, their first and second derivative: each (points, DEGREE)."""
    n = np.arange(1, DEGREE + 1)
    p = legendre.legvander(xi, DEGREE + 1)
    dp = legendre.legval(xi, legendre.legder(np.eye(DEGREE + 2))).T
    scale = np.sqrt((2 * n + 1) / 2)
    return (p[:, 2:] - p[:, :-2]) / (2 * scale), p[:, 1:-1] * scale, dp[:, 1:-1] * scale


def _rotation(xi: Array) -> tuple[Array, Array]:
    """The functions of the rotation and their derivative: each (points, DEGREE + 1)."""
    scale = np.sqrt(np.arange(DEGREE + 1) + 0.5)
    dp = legendre.legval(xi, legendre.legder(np.eye(DEGREE + 1))).T
    return legendre.legvander(xi, DEGREE) * scale, dp * scale


@cache
def _tables() -> tuple[Array, ...]:
    """Weights of the quadrature; w, w', w'', theta, theta' at its points; w', theta at the ends."""
    xi, weight = legendre.leggauss(DEGREE + 3)
    ends = np.array([-1.0, 1.0])
    return weight, *_deflection(xi), *_rotation(xi), _deflection(ends)[1], _rotation(ends)[0]


def _energies(bar: Bar) -> tuple[Array, Array]:
    """Stiffness and mass matrix of the coefficients (deflection, then rotation)."""
    weight, w, dw, ddw, turn, dturn, slope_end, turn_end = _tables()
    half = bar.length_m / 2
    if bar.timoshenko:
        theta, dtheta = (np.hstack([0 * w, r]) for r in (turn, dturn))
        theta_end = np.hstack([0 * slope_end, turn_end])
        w, dw = (np.hstack([a, 0 * turn]) for a in (w, dw))
        shear, rotary = bar.shear_n, bar.mass_kg_m * bar.diameter_m**2 / 16
    else:
        theta, dtheta, theta_end, shear, rotary = dw / half, ddw / half, slope_end / half, 0.0, 0.0
    dw = dw / half
    dtheta = dtheta / half

    def integral(a: Array, factor: float) -> Array:
        return np.asarray(factor * half * (a.T * weight) @ a)

    stiffness = integral(dtheta, bar.bending_nm2) + integral(dw, bar.tension_n)
    stiffness += integral(dw - theta, shear) + (theta_end.T * bar.springs_nm) @ theta_end
    mass = integral(w, bar.mass_kg_m) + integral(theta, rotary)
    for place_m, mass_kg in bar.masses:
        at = np.zeros(len(mass))
        at[:DEGREE] = _deflection(np.array([place_m / half - 1]))[0][0]
        mass += mass_kg * np.outer(at, at)
    return stiffness, mass


def bar_shapes(bar: Bar, count: int) -> Shapes:
    """The lowest `count` bending modes of one plane."""
    stiffness, mass = _energies(bar)
    squared, vectors = eigh(stiffness, mass, subset_by_index=[0, count - 1])

    def at(places_m: Sequence[float] | Array) -> Array:
        xi = 2 * np.asarray(places_m, float) / bar.length_m - 1
        return np.asarray((_deflection(xi)[0] @ vectors[:DEGREE]).T)

    return Shapes(np.sqrt(squared) / (2 * np.pi), at)


@dataclass(frozen=True)
class Hanger:
    """A bar in two planes that differ in their springs alone."""

    transverse: Bar
    longitudinal: Bar

    def planes(self) -> tuple[Bar, Bar]:
        return self.transverse, self.longitudinal

    def with_masses(self, masses: Sequence[tuple[float, float]]) -> "Hanger":
        """The same with sensors at places in m, of masses in kg."""
        a, b = (replace(bar, masses=tuple(masses)) for bar in self.planes())
        return Hanger(a, b)

    def with_tension(self, tension_n: float) -> "Hanger":
        a, b = (replace(bar, tension_n=tension_n) for bar in self.planes())
        return Hanger(a, b)


def random_hanger(rng: np.random.Generator) -> Hanger:
    """Lengths 3 to 40 m, diameters 30 to 150 mm, tensions 50 to 2000 kN at 30 to 300 MPa.

    Springs go from nearly a hinge to nearly clamped, against the stiffness of the bar's own end;
    forks and gussets make one plane 1.3 to 5 times stiffer than the other.
    """
    length_m = float(np.exp(rng.uniform(np.log(3), np.log(40))))
    while True:
        diameter_m = float(np.exp(rng.uniform(np.log(0.030), np.log(0.150))))
        tension_n = float(rng.uniform(30e6, 300e6)) * np.pi / 4 * diameter_m**2
        if 50e3 <= tension_n <= 2000e3:
            break
    bar = Bar(length_m, diameter_m, float(tension_n), (0.0, 0.0))
    own_nm = max(4 * bar.bending_nm2 / length_m, float(np.sqrt(tension_n * bar.bending_nm2)))
    deck, arch = own_nm * np.exp(rng.uniform(np.log(0.3), np.log(100), 2))
    ratio = float(np.exp(rng.uniform(np.log(1.3), np.log(5)) * rng.choice([-1, 1])))
    springs = (float(deck), float(arch))
    other = (float(deck) * ratio, float(arch) * ratio)
    return Hanger(replace(bar, springs_nm=springs), replace(bar, springs_nm=other))


def with_close_planes(hanger: Hanger, apart: float) -> Hanger:
    """The second plane's springs so that its first frequency is higher by the share `apart`.

    Springs of the first plane become a third of the bar's own end stiffness: there the frequency
    heeds them most, and even a long thin hanger reaches the distance asked for.
    """
    bar = hanger.transverse
    own = max(4 * bar.bending_nm2 / bar.length_m, float(np.sqrt(bar.tension_n * bar.bending_nm2)))
    own /= 3
    first = replace(bar, springs_nm=(own, own))
    lowest = bar_shapes(first, 1).frequency_hz[0]

    def surplus(log_ratio: float) -> float:
        stiffer = replace(bar, springs_nm=(own * np.exp(log_ratio),) * 2)
        return float(bar_shapes(stiffer, 1).frequency_hz[0] / lowest - 1 - apart)

    top = 9.0  # a clamped end, nearly
    reach = surplus(top)
    ratio = np.exp(brentq(surplus, 0.0, top)) if reach > 0 else np.exp(top)
    return Hanger(first, replace(bar, springs_nm=(own * ratio, own * ratio)))


def with_mode_at(hanger: Hanger, hz: float) -> Hanger | None:
    """The tension changed so that the transverse mode nearest to `hz` lies on it.

    None where it would take more than half the tension, or twice as much.
    """
    bar = hanger.transverse
    own = bar_shapes(bar, 16).frequency_hz
    order = int(np.argmin(np.abs(np.log(own / hz))))

    def miss(log_factor: float) -> float:
        changed = replace(bar, tension_n=bar.tension_n * np.exp(log_factor))
        return float(bar_shapes(changed, order + 1).frequency_hz[order] - hz)

    reach = float(np.log(2))
    if miss(-reach) * miss(reach) > 0:
        return None
    return hanger.with_tension(float(bar.tension_n * np.exp(brentq(miss, -reach, reach))))


@dataclass(frozen=True)
class Frame:
    """A structure that is no bar: frequencies (modes,), and shapes (modes, points) by mass."""

    name: str
    frequency_hz: Array
    shapes: Array
    places_m: tuple[float, ...]


def shear_frame(storeys: int, mass_kg: float, stiffness_n_m: float) -> Frame:
    """Equal storeys of 3.5 m: masses that move sideways, springs between, the lowest to ground."""
    stiffness = 2 * np.eye(storeys) - np.eye(storeys, k=1) - np.eye(storeys, k=-1)
    stiffness[-1, -1] = 1.0
    squared, vectors = eigh(stiffness * stiffness_n_m, mass_kg * np.eye(storeys))
    places = tuple(3.5 * (i + 1) for i in range(storeys))
    return Frame("shear frame", np.sqrt(squared) / (2 * np.pi), np.asarray(vectors.T), places)


def five_modes(rng: np.random.Generator) -> Frame:
    """Five masses in a chain between two walls, none equal: no series of a bar fits it."""
    mass = np.diag(rng.uniform(50, 200, 5))
    spring = rng.uniform(2e5, 8e5, 6)
    stiffness: Any = np.diag(spring[:-1] + spring[1:])
    stiffness = stiffness - np.diag(spring[1:-1], 1) - np.diag(spring[1:-1], -1)
    squared, vectors = eigh(stiffness, mass)
    return Frame(
        "five masses",
        np.sqrt(squared) / (2 * np.pi),
        np.asarray(vectors.T),
        tuple(float(i) for i in range(1, 6)),
    )


def bridge_deck(rng: np.random.Generator) -> Frame:
    """A deck of two edge girders: three bending and three torsional modes, two of them close.

    Eight points, four an edge.  Bending is sin(n pi x/L) on both edges, torsion has opposite signs;
    the first torsional mode lies 0.5 to 2 % above the second bending mode.
    """
    length_m, mass_kg = float(rng.uniform(40, 120)), float(rng.uniform(2e5, 9e5))
    first_hz = float(rng.uniform(0.9, 3.0))
    bending = first_hz * np.array([1.0, rng.uniform(2.2, 3.6), rng.uniform(5.0, 7.5)])
    torsion = bending[1] * np.array([rng.uniform(1.005, 1.02), rng.uniform(1.5, 1.75), 3.1])
    x = np.array([0.18, 0.37, 0.55, 0.79])
    rows = [np.sin(n * np.pi * x) for n in (1, 2, 3)]
    shapes = [np.r_[r, r] for r in rows] + [np.r_[r, -r] for r in rows]
    order = np.argsort(np.r_[bending, torsion])
    return Frame(
        "bridge deck",
        np.r_[bending, torsion][order],
        np.array(shapes)[order] * np.sqrt(2 / mass_kg),
        tuple(float(v) for v in np.r_[x, x] * length_m),
    )
