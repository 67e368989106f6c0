"""The bar of all worlds against closed forms, and against another route to its frequencies."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import j0, y0

from tests.worlds.bars import (
    POISSON,
    Array,
    Bar,
    Zone,
    cowper,
    natural_frequencies_hz,
    solve_modes,
)

pytestmark = pytest.mark.trial  # of the worlds alone: they share nothing with the product

D, L, T = 0.08, 8.0, 3e5
AREA, SECOND = math.pi * D**2 / 4, math.pi * D**4 / 64
EI, EA, M = 205e9 * SECOND, 205e9 * AREA, 7850 * AREA
PINNED, STRING, LIMP = Bar(L, T, EI, M), Bar(L, T, 1e-3, M), Bar(L, T, 1e-7 * T * L**2, M)
SHEAR, ROTARY = cowper() * EA / (2 * (1 + POISSON)), 7850 * SECOND
THICK = replace(PINNED, shear_stiffness_n=SHEAR, rotary_inertia_kg_m=ROTARY)
WAVES = np.arange(1, 15) * math.pi / L


def angular(bar: Bar, count: int) -> Array:
    return 2 * math.pi * natural_frequencies_hz(bar, count)


def wave_numbers(omega: float, tension_n: float) -> tuple[float, float]:
    """Return the trigonometric and the hyperbolic wave number of a tensioned Euler beam."""
    half, inertia = tension_n / EI / 2, M * omega**2 / EI
    root = math.sqrt(half**2 + inertia)
    return math.sqrt(root - half), math.sqrt(root + half)


def root_near(function: Callable[[float], float], value: float) -> float:
    """Return the root within 0.5 % of a value; without a change of sign there, fail."""
    return float(brentq(function, 0.995 * value, 1.005 * value, xtol=1e-13 * value))


# ---------------------------------------------------------------- ends


@pytest.mark.parametrize("stiffness", [0.03, 0.5, 1.0, 10.0, 30.0, 1000.0])
@pytest.mark.parametrize("tension_n", [0.0, 2e4, 3e5, 2e6])
def test_equal_end_springs(stiffness: float, tension_n: float) -> None:
    """Even modes w = cos as / cos(aL/2) - cosh bs / cosh(bL/2); EI w'' + k w' = 0 at the end."""
    spring = stiffness * EI / L

    def moment(a: float) -> float:
        b = math.sqrt(a**2 + tension_n / EI)
        slope = a * math.sin(a * L / 2) + b * math.tanh(b * L / 2) * math.cos(a * L / 2)
        return (a**2 + b**2) * math.cos(a * L / 2) + stiffness / L * slope

    bar = replace(PINNED, tension_n=tension_n, rotation_n_m_rad=(spring, spring))
    for i, found in enumerate(angular(bar, 13)[::2]):
        low = (2 * i + 1) * math.pi / L
        a = brentq(moment, low, low + math.pi / L * 0.999, xtol=1e-13)
        expected = math.sqrt(EI / M * a**2 * (a**2 + tension_n / EI))
        assert found == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("tension_n", [1e3, 3e5, 3e6])
def test_clamped_ends(tension_n: float) -> None:
    """Even about mid-length: a tan(aL/2) + b tanh(bL/2) = 0; odd: b tan(aL/2) = a tanh(bL/2)."""

    def even(omega: float) -> float:
        a, b = wave_numbers(omega, tension_n)
        return a * math.sin(a * L / 2) + b * math.tanh(b * L / 2) * math.cos(a * L / 2)

    def odd(omega: float) -> float:
        a, b = wave_numbers(omega, tension_n)
        return b * math.sin(a * L / 2) - a * math.tanh(b * L / 2) * math.cos(a * L / 2)

    clamped = replace(PINNED, tension_n=tension_n, rotation_n_m_rad=(math.inf, math.inf))
    for i, found in enumerate(angular(clamped, 8)):
        assert found == pytest.approx(root_near((even, odd)[i % 2], found), rel=2e-6)
    stiff = replace(clamped, rotation_n_m_rad=(1e6 * EI / L, 1e6 * EI / L))
    np.testing.assert_allclose(angular(stiff, 8), angular(clamped, 8), rtol=1e-5)


def test_lateral_end_springs() -> None:
    """A lateral spring at an end of a taut string: tan z = -T z / (k L)."""
    k = 20 * T / L
    root = brentq(lambda z: math.sin(z) + math.cos(z) * T * z / (k * L), 2.0, math.pi)
    found = angular(replace(LIMP, lateral_n_m=(math.inf, k)), 1)[0]
    assert found == pytest.approx(root / L * math.sqrt(T / M), rel=1e-3)
    assert angular(replace(LIMP, lateral_n_m=(k, math.inf)), 1)[0] == pytest.approx(found)
    clamped = replace(THICK, rotation_n_m_rad=(math.inf, math.inf))
    turning = replace(PINNED, rotation_n_m_rad=(1e3 * EI / L, 1e3 * EI / L))
    longer = replace(PINNED, length_m=L * (1 + 2e-3), rotation_n_m_rad=(math.inf, math.inf))
    # a spring k is as EI/k more of length
    assert angular(turning, 3) == pytest.approx(angular(longer, 3), rel=1e-4)
    held = replace(clamped, lateral_n_m=(1e15, 1e15))
    np.testing.assert_allclose(angular(held, 8), angular(clamped, 8), rtol=1e-6)


# ---------------------------------------------------------------- shear, weight and sag


@pytest.mark.parametrize("tension_n", [0.0, 1e6, 2e6])
@pytest.mark.parametrize("inner_over_outer", [0.0, 0.95])
def test_pinned_timoshenko_bar(tension_n: float, inner_over_outer: float) -> None:
    """w = sin kx, rotation = r cos kx reduce the equations to two by two for each k, exactly."""
    shear, expected = cowper(inner_over_outer) * EA / (2 * (1 + POISSON)), []
    for k in WAVES:
        stiffness = [[(shear + tension_n) * k**2, -shear * k], [-shear * k, EI * k**2 + shear]]
        scale = np.diag([M**-0.5, ROTARY**-0.5])
        expected.append(math.sqrt(np.linalg.eigvalsh(scale @ stiffness @ scale)[0]))
    bar = replace(THICK, tension_n=tension_n, shear_stiffness_n=shear)
    np.testing.assert_allclose(angular(bar, 14), expected, rtol=1e-7)
    assert np.all(angular(replace(bar, shear_stiffness_n=math.inf), 14) > np.array(expected))
    if not tension_n:  # the textbook root (Timoshenko, 1921): a w^4 - b w^2 + c = 0
        k = WAVES[0]
        a, c = M * ROTARY / shear, EI * k**4
        b = M + k**2 * (ROTARY + EI * M / shear)
        root = math.sqrt((b - math.sqrt(b**2 - 4 * a * c)) / (2 * a))
        assert angular(bar, 1)[0] == pytest.approx(root, rel=1e-6)


@pytest.mark.parametrize("irvine", [0.1, 0.5, 2.0, 5.0, 20.0, 30.0, 60.0, 500.0])
def test_sagging_string(irvine: float) -> None:
    """Irvine: tan z = z - 4 z^3 / lambda^2, z = omega L sqrt(m/T) / 2; odd modes do not feel it."""
    gravity = 9.81
    axial = irvine * T**3 / (M * gravity * L) ** 2
    sagging = replace(STRING, axial_stiffness_n=axial, gravity_across_m_s2=gravity)

    def symmetric(z: float) -> float:
        return math.sin(z) - (z - 4 * z**3 / irvine) * math.cos(z)

    # One symmetric mode in each half turn above pi/2 (Irvine, figure 3.5).
    roots = [
        brentq(symmetric, (n + 0.5) * math.pi + 1e-9, (n + 1.5) * math.pi - 1e-9) for n in range(3)
    ]
    assert (roots[0] < math.pi) == (irvine < 4 * math.pi**2)  # Irvine's crossover
    expected = sorted([*roots, math.pi, 2 * math.pi])[:4]
    z = L / 2 * math.sqrt(M / T) * angular(sagging, 4)
    np.testing.assert_allclose(z, expected, rtol=3e-5)
    stiffer = replace(sagging, axial_stiffness_n=2 * axial, axial_n_m=(4 * axial / L,) * 2)
    np.testing.assert_allclose(angular(stiffer, 4), angular(sagging, 4), rtol=1e-9)  # in series


def test_hanging_string() -> None:
    """A vertical string: with s = T/(m g), w = A J0(2 omega sqrt(s/g)) + B Y0(the same)."""
    gravity = 9.81
    weight = M * gravity
    tension_n = 0.7 * weight * L  # at mid-length; a fifth of the weight at the deck
    low, high = tension_n / weight - L / 2, tension_n / weight + L / 2

    def both_ends(omega: float) -> float:
        one, two = (2 * omega * math.sqrt(s / gravity) for s in (low, high))
        return float(j0(one) * y0(two) - j0(two) * y0(one))

    hanging = replace(STRING, tension_n=tension_n, gravity_along_m_s2=gravity)
    uniform = angular(replace(hanging, gravity_along_m_s2=0.0), 4)
    for found, without in zip(angular(hanging, 4), uniform, strict=True):
        assert found == pytest.approx(root_near(both_ends, found), rel=2e-4)
        assert found < 0.98 * without


# ---------------------------------------------------------------- what a bar has along it


@pytest.mark.parametrize("mass_factor", [1.0, 6.0])
@pytest.mark.parametrize("tension_n", [1e4, 1e6])
def test_hinged_rigid_zones(mass_factor: float, tension_n: float) -> None:
    """A rigid link on a pin at each end: w' = w/a and EI (a w''' - w'') = J omega^2 w'.

    The tension drops out of the link's balance: its work on the link, T a w'^2/2, is what the
    beam's end loses.
    """
    link, span = 0.4, L - 0.8
    inertia = mass_factor * M * link**3 / 3

    def residual(omega: float, even: bool) -> float:
        a, b = wave_numbers(omega, tension_n)
        s = -span / 2
        if even:
            trig = (math.cos(a * s), -a * math.sin(a * s))
            hyper = (math.cosh(b * s), b * math.sinh(b * s))
        else:
            trig = (math.sin(a * s), a * math.cos(a * s))
            hyper = (math.sinh(b * s), b * math.cosh(b * s))
        rows = []
        for (w, slope), square in ((trig, -(a**2)), (hyper, b**2)):
            balance = EI * square * (link * slope - w) - inertia * omega**2 * slope
            rows.append((w - link * slope, balance))
        return (rows[0][0] * rows[1][1] - rows[1][0] * rows[0][1]) / math.cosh(b * s) ** 2

    zones = (Zone(0.0, link, 1e6, mass_factor), Zone(L - link, L, 1e6, mass_factor))
    for i, omega in enumerate(angular(replace(PINNED, tension_n=tension_n, zones=zones), 6)):
        root = root_near(lambda value, even=i % 2 == 0: residual(value, even), omega)  # type: ignore[misc]
        assert omega == pytest.approx(root, rel=1e-5)


def test_zone_of_another_section() -> None:
    """Over the whole length: a thinner round. Over a short stretch: Rayleigh's quotient."""
    bar = replace(THICK, tension_n=1e6)
    thin = Bar(L, 1e6, 0.64 * EI, 0.8 * M, 0.8 * SHEAR, 0.64 * ROTARY)
    whole = angular(replace(bar, zones=(Zone(0.0, L, 0.64, 0.8),)), 8)
    np.testing.assert_allclose(whole, angular(thin, 8), rtol=1e-9)
    lost, width, at = 1e-3, 0.06, 0.3 * L
    euler = replace(PINNED, tension_n=0.0)
    part = Zone(at - width / 2, at + width / 2, 1 - lost, math.sqrt(1 - lost))
    change = angular(replace(euler, zones=(part,)), 3) / angular(euler, 3) - 1
    share = np.sin(WAVES[:3] * at) ** 2 * 2 * width / L  # of curvature and of deflection alike
    np.testing.assert_allclose(change, share / 2 * (lost / 2 - lost), rtol=0.02, atol=1e-8)


def test_a_stiff_fitting_shortens_and_its_mass_slows() -> None:
    clamped = replace(PINNED, tension_n=2e5, rotation_n_m_rad=(math.inf, math.inf))
    stiff = angular(replace(clamped, zones=(Zone(0.0, 0.5, 1e4),)), 1)[0]
    assert stiff == pytest.approx(angular(replace(clamped, length_m=7.5), 1)[0], rel=2e-3)
    assert stiff > angular(clamped, 1)[0]
    light, heavy = (replace(PINNED, zones=(Zone(3.5, 4.5, 1e4, mass),)) for mass in (1.0, 4.0))
    assert angular(heavy, 1)[0] < angular(light, 1)[0]


@pytest.mark.parametrize(("mass_kg", "spring_n_m"), [(12.0, 0.0), (0.0, 2.5e4), (240.0, 4.2e5)])
def test_mass_and_spring_at_the_middle(mass_kg: float, spring_n_m: float) -> None:
    """Pinned Euler beam, even modes: 4 EI b^3 = (M w^2 - K)(tan z - tanh z), z = b L/2."""

    def jump(z: float) -> float:
        b = 2 * z / L
        load = mass_kg * EI / M * b**4 - spring_n_m
        return 4 * EI * b**3 * math.cos(z) - load * (math.sin(z) - math.cos(z) * math.tanh(z))

    def wave_number(bar: Bar) -> Array:
        return L / 2 * np.sqrt(angular(bar, 3) * math.sqrt(M / EI))

    bar = replace(PINNED, tension_n=0.0, masses=((L / 2, mass_kg),), springs=((L / 2, spring_n_m),))
    z = brentq(jump, 0.2, math.pi * 0.8, xtol=1e-13)
    found = wave_number(bar)
    assert np.min(np.abs(found - z)) < 1e-7 * z
    assert np.min(np.abs(found - math.pi)) < 1e-7  # the odd mode has a node there
    thick = replace(bar, shear_stiffness_n=1e9 * EI / L**2)
    np.testing.assert_allclose(wave_number(thick), found, rtol=1e-6)


def test_spring_crack_and_absorber() -> None:
    """A spring of infinite stiffness halves the bar; a crack of none is a hinge there."""
    half = angular(replace(PINNED, length_m=L / 2), 1)[0]
    held = angular(replace(PINNED, springs=((L / 2, 1e9),)), 2)
    assert held[0] == pytest.approx(half, rel=1e-4)
    whole = angular(replace(PINNED, cracks=((L / 2, 1e10),)), 9)
    assert whole == pytest.approx(angular(PINNED, 9), rel=1e-5)
    hinged = angular(replace(PINNED, cracks=((L / 2, 1.0),)), 2)
    assert hinged[1] == pytest.approx(half, rel=1e-4)
    light = solve_modes(replace(PINNED, absorbers=((L / 2, 1e-6, 3.0),)), 4)
    assert 2 * math.pi * light.frequencies_hz == pytest.approx(angular(PINNED, 4), rel=1e-5)


def test_neighbour_alike() -> None:
    """Two equal bars joined by a spring: half of the modes know nothing of it."""
    bar = replace(PINNED, neighbour=PINNED, clamp=(0.3 * L, 1e4))
    apart = replace(PINNED, springs=((0.3 * L, 2e4),))
    both = np.concatenate([angular(PINNED, 3), angular(apart, 3)]) / (2 * math.pi)
    found = solve_modes(bar, 3).frequencies_hz
    assert all(np.abs(both / hz - 1).min() < 1e-5 for hz in found)


def test_shapes_and_share_of_tension() -> None:
    """Sines of unit modal mass; omega^2 = (EI k^4 + T k^2) / m."""
    x = np.linspace(0, L, 57)
    found = solve_modes(PINNED, 9, x)
    exact = -math.sqrt(2 / (M * L)) * np.sin(np.outer(x, WAVES[:9]))
    np.testing.assert_allclose(found.shapes, exact, atol=1e-6)
    share = T / (EI * WAVES[:9] ** 2 + T) / 2
    np.testing.assert_allclose(found.tension_share, share, rtol=1e-6)


# ---------------------------------------------------------------- everything at once


@pytest.mark.parametrize("stiffness", [0.03, 1000.0])
@pytest.mark.parametrize("bending", [EI, EI / 400])
@pytest.mark.parametrize("shear", [SHEAR, math.inf])
def test_convergence(stiffness: float, bending: float, shear: float) -> None:
    spring = stiffness * bending / L
    bar = Bar(
        *(L, 1e8 * AREA, bending, M, shear, bending / EI * ROTARY),  # xi up to 177
        zones=(Zone(5.3, 5.7, 0.5, math.sqrt(0.5)),),
        masses=((2.3, 0.08), (4.4, 9.0)),
        rotation_n_m_rad=(spring, spring / 7),
        gravity_along_m_s2=9.81,
    )
    usual, fine = natural_frequencies_hz(bar, 14), natural_frequencies_hz(bar, 14, 32)
    np.testing.assert_allclose(usual, fine, rtol=5e-7)
    assert np.all(np.diff(usual) > 0)


def dynamic_stiffness_hz(bar: Bar, near_hz: float, pieces: int = 60) -> float:
    """Return the frequency near a guess by another route, which knows no shape functions.

    State (w, th, F, M) with F = kGA (w' - th) + T w': u' = A(omega) u per piece, transfer matrix
    exp(A h), folded into dynamic stiffness; the root of its smallest eigenvalue. The tension goes
    in steps.
    """
    cuts = [*np.linspace(0, bar.length_m, pieces + 1), *(p for p, _ in bar.masses)]
    cuts += [edge for zone in bar.zones for edge in (zone.start_m, zone.end_m)]
    x = np.unique(np.round(cuts, 9))
    middle, h = (x[1:] + x[:-1]) / 2, np.diff(x)
    stiff, heavy, wide = (np.ones_like(middle) for _ in range(3))
    for zone in bar.zones:
        inside = (zone.start_m < middle) & (middle < zone.end_m)
        stiff[inside] *= zone.bending_factor
        heavy[inside] *= zone.mass_factor
        wide[inside] *= zone.mass_factor if zone.area_factor is None else zone.area_factor
    hanging = np.concatenate(([0.0], np.cumsum(h * heavy)))
    below = np.interp(middle, x, hanging) - np.interp(bar.length_m / 2, x, hanging)
    pull = bar.tension_n + bar.gravity_along_m_s2 * bar.mass_per_length_kg_m * below

    def smallest(hz: float) -> float:
        square = (2 * np.pi * hz) ** 2
        total = np.zeros((2 * len(x), 2 * len(x)))
        for i in range(len(h)):
            ei, ga = bar.bending_stiffness_n_m2 * stiff[i], bar.shear_stiffness_n * wide[i]
            mass, rotary = bar.mass_per_length_kg_m * heavy[i], bar.rotary_inertia_kg_m * stiff[i]
            a = np.array([
                [0, ga / (ga + pull[i]), 1 / (ga + pull[i]), 0],
                [0, 0, 0, 1 / ei],
                [-mass * square, 0, 0, 0],
                [0, ga - ga * ga / (ga + pull[i]) - rotary * square, -ga / (ga + pull[i]), 0],
            ])  # fmt: skip
            t = expm(a * h[i])
            uu, uf, fu, ff = t[:2, :2], t[:2, 2:], t[2:, :2], t[2:, 2:]
            inverse = np.linalg.inv(uf)
            s = slice(2 * i, 2 * i + 4)
            total[s, s] += np.block([
                [inverse @ uu, -inverse], [fu - ff @ inverse @ uu, ff @ inverse],
            ])  # fmt: skip
        for end, node in enumerate((0, len(x) - 1)):
            total[2 * node + 1, 2 * node + 1] += bar.rotation_n_m_rad[end]
            total[2 * node, 2 * node] += min(bar.lateral_n_m[end], 1e14)
        for place, kg in bar.masses:
            at = 2 * int(np.argmin(np.abs(x - place)))
            total[at, at] -= kg * square
        scale = np.sqrt(np.abs(np.diag(total)))
        values = np.linalg.eigvalsh((total + total.T) / 2 / np.outer(scale, scale))
        return float(values[np.argmin(np.abs(values))])

    low, high = near_hz * (1 - 2e-3), near_hz * (1 + 2e-3)
    return float(brentq(smallest, low, high, xtol=1e-9 * near_hz, rtol=1e-12))


@pytest.mark.parametrize("bending", [EI, 0.4 * EI, EI / 30])
def test_another_route_finds_the_same_frequencies(bending: float) -> None:
    """Fittings, a sleeve, rust, sensors, springs of both kinds and own weight together."""
    zones = ((0.0, 0.3, 6.0, 3.0, 2.5), (7.6, L, 5.0, 3.0, 2.2))
    zones += ((1.1, 1.5, 4.0, 2.5, 2.0), (4.0, 4.5, 0.6, 0.8, 1.0))
    bar = Bar(
        *(L, T, bending, M, SHEAR * bending / EI, ROTARY * bending / EI),
        zones=tuple(Zone(*each) for each in zones),
        masses=((1.84, 0.4), (3.0, 2.0)),
        rotation_n_m_rad=(3e5, 1e6),
        lateral_n_m=(1.6e8, 5e8),
        gravity_along_m_s2=8.1,
    )
    for hz in natural_frequencies_hz(bar, 6)[[0, 3, 5]]:
        assert dynamic_stiffness_hz(bar, hz) == pytest.approx(hz, rel=1e-6)
