"""Bars held otherwise than by clamps: closed forms, and what can act at which end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.linalg import eigh
from scipy.optimize import brentq

from shm.errors import UsageError
from shm.models import applicable, build, check_baseline
from shm.models.composed import Baseline, ComposedHanger
from shm.models.effects import EFFECTS, Conditions, Survey, Variant, parameters_of
from shm.models.hanger import LateralSpring, PhysicalHanger, solve
from shm.values import PLANES, FloatArray, Hanger, Scatter, Supports
from tests.helpers.hangers import HANGER_3
from tests.helpers.physical_hangers import EI, LENGTH, MASS, NOWHERE, TENSION

UNIT_HZ = np.sqrt(EI / MASS) / LENGTH**2 / (2 * np.pi)
ORDERS = np.arange(1, 7)
EVERYTHING = Survey(("t1", "t2"), PLANES, (6.0,), True, (0.0, 20.0), (0.5, 1.0), ())
FREE = Supports("free", "free")
PINNED = Supports("pinned", "pinned")
HANGING = Supports("free", "pinned", 500.0)


def held(supports: Supports, tension_n: float) -> PhysicalHanger:
    return PhysicalHanger.held(replace(HANGER_3, supports=supports), np.array([tension_n]))


def both_ways(physical: PhysicalHanger, modes: int) -> list[FloatArray]:
    """The transverse frequencies found without shapes and with them."""
    alone = solve(physical, modes, NOWHERE, shapes=False)
    seen = solve(physical, modes, np.array([1.0, 5.0]))
    return [alone.frequency_hz[0, 0], seen.frequency_hz[0, 0]]


def roots(fault: Callable[[float], float], about: FloatArray) -> FloatArray:
    """One root about 0.3 around each."""
    return np.array([brentq(fault, each - 0.3, each + 0.3, xtol=1e-14) for each in about])


def test_a_bar_hanging_free_has_its_bending_modes_and_no_motion_as_a_whole() -> None:
    """Cosh q cos q = 1 (Blevins 1979, table 8-1)."""
    q = roots(lambda q: float(np.cos(q) - 1 / np.cosh(q)), (ORDERS + 0.5) * np.pi)
    for found in both_ways(held(FREE, 0.0), 6):
        np.testing.assert_allclose(found, q**2 * UNIT_HZ, rtol=1e-9)


@pytest.mark.parametrize("supports", [Supports("pinned", "free"), Supports("free", "pinned")])
def test_a_bar_pinned_at_one_end_swings_and_that_is_no_mode(supports: Supports) -> None:
    """Tan q = tanh q, without tension (Blevins 1979, table 8-1)."""
    q = roots(lambda q: float(np.sin(q) - np.cos(q) * np.tanh(q)), (ORDERS + 0.25) * np.pi)
    for found in both_ways(held(supports, 0.0), 6):
        np.testing.assert_allclose(found, q**2 * UNIT_HZ, rtol=1e-9)


@pytest.mark.parametrize("tension_n", [0.0, 1e3, TENSION, 5e7])
def test_a_pinned_bar_is_a_sum_of_string_and_beam(tension_n: float) -> None:
    """(omega/unit)^2 = (n pi)^4 + T L^2/EI (n pi)^2."""
    waves = ORDERS * np.pi
    expected = np.sqrt(waves**4 + tension_n * LENGTH**2 / EI * waves**2) * UNIT_HZ
    for found in both_ways(held(PINNED, tension_n), 6):
        np.testing.assert_allclose(found, expected, rtol=1e-8)


@pytest.mark.parametrize(("tension_n", "mass_kg"), [(TENSION, 72e3), (1e4, 1e3), (3e6, 50.0)])
@pytest.mark.parametrize("end", [0, 1])
def test_a_rod_with_a_mass_at_its_end_is_a_pendulum(
    tension_n: float, mass_kg: float, end: int
) -> None:
    """Hinged above, at the mass no moment and EI w''' - T w' = -M omega^2 w.

    The first mode is the pendulum's, near sqrt(T/(M L)); it is a mode.
    """
    xi_squared = tension_n * LENGTH**2 / EI

    def fault(omega: float) -> float:
        wave = MASS * omega**2 * LENGTH**4 / EI
        root = np.sqrt(xi_squared**2 / 4 + wave)
        a, b = np.sqrt(root - xi_squared / 2), np.sqrt(root + xi_squared / 2)
        hyperbolic = (a / b) ** 2 * np.sin(a)
        slope = a * np.cos(a) + hyperbolic * b / np.tanh(b)
        third = -(a**3) * np.cos(a) + hyperbolic * b**3 / np.tanh(b)
        moved = np.sin(a) + hyperbolic
        return float(third - xi_squared * slope + mass_kg / (MASS * LENGTH) * wave * moved)

    omega = np.linspace(0.02, 1500.0, 60_001)
    signs = np.sign([fault(each) for each in omega])
    at = np.flatnonzero(signs[1:] != signs[:-1])[:4]
    expected = np.array([brentq(fault, omega[i], omega[i + 1]) for i in at]) / (2 * np.pi)
    supports = (Supports("free", "pinned", mass_kg), Supports("pinned", "free", mass_kg))[end]
    for found in both_ways(held(supports, tension_n), 4):
        np.testing.assert_allclose(found, expected, rtol=1e-8)


def test_a_cord_that_holds_a_free_bar_adds_no_mode() -> None:
    bar = held(FREE, 0.0)
    cord = LateralSpring(np.array([5.0]), np.full((1, 2), 1e-3 * EI / LENGTH**3), np.zeros(1))
    for found in both_ways(replace(bar, springs=(cord,)), 5):
        np.testing.assert_allclose(found, both_ways(bar, 5)[0], rtol=1e-4)


def test_shear_and_rotary_inertia_lower_a_free_bars_high_modes() -> None:
    """To first order df/f = -(r^2/2) (1 + E/(kappa G)) q^2 for short waves (Timoshenko 1921).

    Here against the exact roots of a free Timoshenko beam with the same end conditions, found by
    another discretisation: 60 Legendre polynomials for deflection and rotation each.
    """
    hanger = replace(HANGER_3, supports=FREE, nominal_tension_n=0.0)
    composed = ComposedHanger(hanger, "beam1", [("shear_and_rotary_inertia", Variant())], ())
    theta = np.array([[0.0, 0.0, 0.0, 0.0, 1.0]])
    found = composed.modes(theta, Conditions(), 6, shapes=False).frequency_hz[0, 0]
    np.testing.assert_allclose(found, free_timoshenko_hz(hanger, 6), rtol=2e-6)


def free_timoshenko_hz(hanger: Hanger, modes: int) -> FloatArray:
    x, weights = legendre.leggauss(120)
    weights = weights * hanger.length_m / 2
    value = legendre.legvander(x, 59).T
    unit = np.eye(60)
    slope = np.array([legendre.legval(x, legendre.legder(row)) for row in unit])
    slope = slope * 2 / hanger.length_m
    ratio, modulus = hanger.poissons_ratio, hanger.elastic_modulus_pa
    shear = 6 * (1 + ratio) / (7 + 6 * ratio) * modulus / (2 * (1 + ratio)) * hanger.area_m2
    inertia = hanger.mass_per_length_kg_m / hanger.area_m2 * hanger.second_moment_m4

    def integral(left: FloatArray, right: FloatArray) -> FloatArray:
        return np.asarray((left * weights) @ right.T)

    bending = hanger.bending_stiffness_n_m2 * integral(slope, slope)
    corner = -shear * integral(slope, value)
    whole = bending + shear * integral(value, value)
    stiffness = np.block([[shear * integral(slope, slope), corner], [corner.T, whole]])
    own, none = integral(value, value), np.zeros((60, 60))
    mass = np.block([[hanger.mass_per_length_kg_m * own, none], [none, inertia * own]])
    squared = eigh(stiffness, mass, eigvals_only=True)[2 : 2 + modes]
    return np.asarray(np.sqrt(squared) / (2 * np.pi))


@pytest.mark.parametrize(
    ("supports", "ends"),
    [(Supports(), {(0,), (1,), (0, 1)}), (HANGING, {(1,)}), (FREE, set())],
)
@pytest.mark.parametrize(
    "name", ["rotational_end_flexibility", "translational_end_flexibility", "support_motion"]
)
def test_what_needs_a_held_end_does_not_act_at_a_free_one(
    name: str, supports: Supports, ends: set[tuple[int, ...]]
) -> None:
    hanger = replace(HANGER_3, supports=supports)
    variants = EFFECTS[name].variants(hanger, EVERYTHING)
    assert {each.ends for each in variants} == {e for e in ends if len(e) == 1 or name[0] != "s"}
    assert bool(EFFECTS[name].invisible(hanger, EVERYTHING)) == (not ends)


@pytest.mark.parametrize("name", ["joint_softening", "skewed_principal_axes"])
def test_only_a_clamp_can_soften_or_be_askew(name: str) -> None:
    mixed = replace(HANGER_3, supports=Supports("clamped", "pinned"))
    assert {each.ends for each in EFFECTS[name].variants(mixed, EVERYTHING)} == {(0,)}
    assert EFFECTS[name].invisible(replace(HANGER_3, supports=PINNED), EVERYTHING)


@pytest.mark.parametrize("name", ["sag", "temperature_tension", "geometric_hardening"])
@pytest.mark.parametrize("supports", [HANGING, FREE])
def test_nothing_stretches_a_bar_with_a_free_end(name: str, supports: Supports) -> None:
    assert EFFECTS[name].invisible(replace(HANGER_3, supports=supports), EVERYTHING)
    assert not EFFECTS[name].invisible(HANGER_3, EVERYTHING)


@pytest.mark.parametrize("name", EFFECTS)
@pytest.mark.parametrize("supports", [FREE, HANGING, PINNED])
@pytest.mark.parametrize("tension_n", [0.0, TENSION])
def test_every_effect_that_may_act_gives_finite_frequencies(
    name: str, supports: Supports, tension_n: float
) -> None:
    hanger = replace(HANGER_3, supports=supports, nominal_tension_n=tension_n)
    if EFFECTS[name].invisible(hanger, EVERYTHING):
        return
    for variant in EFFECTS[name].variants(hanger, EVERYTHING):
        composed = ComposedHanger(hanger, "beam1", [(name, variant)], (6.0,))
        middle = [float(each.value(np.array(0.4))) for each in parameters_of(name, hanger, variant)]
        plain = [1.0] * (tension_n > 0) + [0.0] * 4
        modes = composed.modes(np.array([plain + middle]), Conditions("t1"), 4)
        assert np.isfinite(modes.frequency_hz).all(), variant
        assert (modes.frequency_hz > 0).all(), variant
        assert np.isfinite(modes.shape).all(), variant


@pytest.mark.parametrize(("log10_k", "like"), [(12.0, Supports()), (-3.0, PINNED)])
def test_a_hinge_that_resists_turning_lies_between_hinge_and_clamp(
    log10_k: float, like: Supports
) -> None:
    hanger = replace(HANGER_3, supports=PINNED)
    effect = EFFECTS["rotational_end_flexibility"]
    variant = effect.variants(hanger, EVERYTHING)[-1]
    assert variant.at == "both ends, both planes alike"
    (size,) = effect.parameters(hanger, variant)
    assert size.zero == -np.inf
    bar = held(PINNED, TENSION)
    stiff = effect.applied(bar, np.array([[log10_k]]), variant, Conditions(), hanger)
    np.testing.assert_allclose(both_ways(stiff, 5)[0], both_ways(held(like, TENSION), 5)[0], 1e-5)


def test_a_bar_without_tension_has_no_parameter_of_it() -> None:
    hanger = replace(HANGER_3, supports=FREE, nominal_tension_n=0.0)
    baseline = Baseline("beam1", hanger)
    assert baseline.names == ()
    assert baseline.physical(np.empty((3, 0)), 2).tension_n.tolist() == [0.0, 0.0, 0.0]


def test_a_weighed_load_has_a_normal_prior_about_the_nominal_tension() -> None:
    weighed = replace(HANGER_3, scatter=Scatter(tension=0.02))
    (tension,) = Baseline("beam1", weighed).parameters
    share = np.array([0.5, 0.8413447])
    np.testing.assert_allclose(tension.value(share), [1.0, 1.02], atol=1e-8)
    np.testing.assert_allclose(tension.share(tension.value(share)), share)
    (usual,) = Baseline("beam1", HANGER_3).parameters
    assert (usual.lower, usual.upper, usual.spread) == (0.02, 5.0, "logarithmic")
    assert np.isinf(HANGER_3.scatter.tension)


@pytest.mark.parametrize(
    ("changed", "why"),
    [({"supports": PINNED}, "pinned"), ({"nominal_tension_n": 0.0}, "no tension")],
)
def test_the_classes_of_updating_refuse_what_is_held_otherwise(
    changed: dict[str, object], why: str
) -> None:
    hanger = replace(HANGER_3, **changed)  # type: ignore[arg-type]
    fitting, reasons = applicable(hanger, ["beam1", "beam2", "s1", "solid2"])
    assert fitting == ()
    assert all(why in reason for reason in reasons.values())
    with pytest.raises(UsageError, match=why):
        build("beam1", hanger)


def test_a_diagnosis_takes_beam1_as_it_is_described_and_no_other_class() -> None:
    hanger = replace(HANGER_3, supports=HANGING)
    check_baseline("beam1", hanger)
    check_baseline("solid2", HANGER_3)
    with pytest.raises(UsageError, match="free"):
        check_baseline("beam2", hanger)
    with pytest.raises(UsageError, match="unknown"):
        check_baseline("beam9", hanger)
    admits = replace(hanger, models=("beam2",))
    with pytest.raises(UsageError, match="admits"):
        check_baseline("beam1", admits)
