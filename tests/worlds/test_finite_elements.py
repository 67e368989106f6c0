"""The proof of the finite-element world: closed forms first, then the population it draws."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.worlds.finite_elements import (
    COWPER_ROUND,
    Array,
    Bar,
    Case,
    Nuisances,
    natural_frequencies_hz,
    sound_hangers,
)

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product

E, G, RHO, D, L = 205e9, 205e9 / 2.6, 7850.0, 0.12, 6.0
AREA, SECOND = math.pi * D**2 / 4, math.pi * D**4 / 64
EI, M = E * SECOND, RHO * AREA
EULER = Bar(L, 0.0, EI, M)
THICK = replace(EULER, shear_stiffness_n=COWPER_ROUND * G * AREA, rotary_inertia_kg_m=RHO * SECOND)
ORDERS = np.arange(1, 15)
WAVES = ORDERS * math.pi / L


def _wave_number(bar: Bar, count: int) -> Array:
    """Return beta L of the Euler beam without tension."""
    omega = 2 * math.pi * natural_frequencies_hz(bar, count)
    return bar.length_m * np.sqrt(omega * math.sqrt(M / EI))


# ---------------------------------------------------------------- closed forms


@pytest.mark.parametrize("stiffness", [0.03, 1.0, 30.0, 1000.0])
@pytest.mark.parametrize("tension_n", [0.0, 2e4, 2e6])
def test_equal_end_springs_under_tension(stiffness: float, tension_n: float) -> None:
    """Even modes about mid-length: w = cos a x / cos a l - cosh b x / cosh b l, l = L/2."""
    half = L / 2

    def moment(a: float) -> float:
        b = math.sqrt(a**2 + tension_n / EI)
        slope = a * math.sin(a * half) + b * math.tanh(b * half) * math.cos(a * half)
        return (a**2 + b**2) * math.cos(a * half) + stiffness / L * slope

    spring = stiffness * EI / L
    bar = replace(
        EULER, tension_n=tension_n, spring_deck_n_m_rad=spring, spring_arch_n_m_rad=spring
    )
    omega = 2 * math.pi * natural_frequencies_hz(bar, 13)[::2]
    for i, found in enumerate(omega):
        low = (2 * i + 1) * math.pi / L
        a = brentq(moment, low, low + math.pi / L * 0.999, xtol=1e-13)
        expected = math.sqrt(EI / M * a**2 * (a**2 + tension_n / EI))
        assert found == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("tension_n", [0.0, 2e6])
def test_pinned_timoshenko_bar(tension_n: float) -> None:
    """w = sin kx, rotation = r cos kx reduce the equations to two by two for each k, exactly."""
    shear, inertia = THICK.shear_stiffness_n, THICK.rotary_inertia_kg_m
    expected = []
    for k in WAVES:
        stiffness = [[(shear + tension_n) * k**2, -shear * k], [-shear * k, EI * k**2 + shear]]
        scale = np.diag([M**-0.5, inertia**-0.5])
        expected.append(math.sqrt(np.linalg.eigvalsh(scale @ stiffness @ scale)[0]) / 2 / math.pi)
    found = natural_frequencies_hz(replace(THICK, tension_n=tension_n), 14)
    np.testing.assert_allclose(found, expected, rtol=1e-7)
    # and the textbook root without tension (Timoshenko, 1921): a w^4 - b w^2 + c = 0
    k = WAVES[0]
    a, c = M * inertia / shear, EI * k**4
    b = M + k**2 * (inertia + EI * M / shear)
    root = math.sqrt((b - math.sqrt(b**2 - 4 * a * c)) / (2 * a)) / 2 / math.pi
    assert natural_frequencies_hz(THICK, 1)[0] == pytest.approx(root, rel=1e-6)


@pytest.mark.parametrize(("mass_kg", "support_n_m"), [(20.0, 0.0), (0.0, 3e5), (400.0, 5e6)])
def test_mass_and_support_at_the_middle(mass_kg: float, support_n_m: float) -> None:
    """Pinned Euler beam, even modes: 4 EI b^3 = (M w^2 - K)(tan z - tanh z), z = b L/2."""

    def jump(z: float) -> float:
        b = 2 * z / L
        load = mass_kg * EI / M * b**4 - support_n_m
        return 4 * EI * b**3 * math.cos(z) - load * (math.sin(z) - math.cos(z) * math.tanh(z))

    bar = replace(EULER, masses=((L / 2, mass_kg),), supports=((L / 2, support_n_m),))
    z = brentq(jump, 0.2, math.pi * 0.8, xtol=1e-13)
    found = _wave_number(bar, 3) / 2
    assert np.min(np.abs(found - z)) < 1e-7 * z
    assert np.min(np.abs(found - math.pi)) < 1e-7  # the odd mode has a node there
    thick = replace(bar, shear_stiffness_n=1e9 * EI / L**2)
    np.testing.assert_allclose(_wave_number(thick, 3) / 2, found, rtol=1e-6)


def test_loss_of_section() -> None:
    """Over the whole length: a thinner round. Over a short stretch: Rayleigh's quotient."""
    bar = replace(THICK, tension_n=1e6)
    thin = Bar(L, 1e6, 0.64 * EI, 0.8 * M, 0.8 * bar.shear_stiffness_n, 0.64 * RHO * SECOND)
    whole = natural_frequencies_hz(replace(bar, loss=(0.0, L, 0.36)), 8)
    np.testing.assert_allclose(whole, natural_frequencies_hz(thin, 8), rtol=1e-9)
    lost, width, at = 1e-3, 0.06, 0.3 * L
    part = replace(EULER, loss=(at - width / 2, at + width / 2, lost))
    change = natural_frequencies_hz(part, 3) / natural_frequencies_hz(EULER, 3) - 1
    share = np.sin(WAVES[:3] * at) ** 2 * 2 * width / L  # of curvature and of deflection alike
    np.testing.assert_allclose(change, share / 2 * (lost / 2 - lost), rtol=0.02, atol=1e-8)


@pytest.mark.parametrize("stiffness", [0.03, 1000.0])
@pytest.mark.parametrize("bending", [EI, EI / 400])
@pytest.mark.parametrize("shear", [THICK.shear_stiffness_n, math.inf])
def test_convergence(stiffness: float, bending: float, shear: float) -> None:
    spring, tension = stiffness * bending / L, 4e8 * AREA
    bar = Bar(L, tension, bending, M, shear, bending / E * RHO, spring, spring / 7, 800.0)
    bar = replace(bar, masses=((1.7, 0.08), (3.3, 9.0)), loss=(4.0, 4.3, 0.5))
    usual, fine = natural_frequencies_hz(bar, 14), natural_frequencies_hz(bar, 14, 32)
    np.testing.assert_allclose(usual, fine, rtol=5e-7)  # xi = 177, beyond the population
    assert np.all(np.diff(usual) > 0)


# ---------------------------------------------------------------- the populations


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return sound_hangers(2026, 500)


def _frequencies(case: Case) -> Array:
    modes: Any = case.modes
    return np.array([[m["frequency_hz"] for m in t["modes"]] for t in modes["tests"]])


def test_errors_of_the_frequencies_are_those_stated() -> None:
    """One knob off leaves every other draw alone, so the exact frequencies can be taken away."""
    noisy = sound_hangers(5, 150)
    biased = sound_hangers(5, 150, Nuisances(scatter=0.0))
    exact = sound_hangers(5, 150, Nuisances(scatter=0.0, repeat_sd=(0.0, 0.0)))
    scatter, repeat, misstated = [], [], []
    for one, two, three in zip(noisy, biased, exact, strict=True):
        assert one.hanger_toml == two.hanger_toml == three.hanger_toml
        assert one.truth["area_m2"] == three.truth["area_m2"]
        real, stated = float(one.truth["scatter_sd"]), float(one.truth["frequency_sd"])
        scatter.append((_frequencies(one) / _frequencies(two) - 1).ravel() / real)
        error = _frequencies(two) / _frequencies(three) - 1
        np.testing.assert_allclose(error, error[:1].repeat(len(error), 0), atol=1e-12)
        repeat.append(error[0] / float(one.truth["repeat_sd"]))
        misstated.append(math.log(real / stated))
    for values, sd in ((scatter, 1.0), (repeat, 1.0), ([np.array(misstated)], 0.2)):
        assert np.std(np.concatenate(values)) == pytest.approx(sd, rel=0.15)


def test_the_seed_decides(cases: list[Case]) -> None:
    assert sound_hangers(2026, 12) == cases[:12]  # whatever the count
    assert sound_hangers(2027, 12) != cases[:12]
