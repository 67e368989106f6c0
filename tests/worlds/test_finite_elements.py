"""The proof of the finite-element world: closed forms first, then the population it draws."""

import json
import math
import tomllib
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.worlds.finite_elements import (
    CAUSES,
    COWPER_ROUND,
    Array,
    Bar,
    Case,
    Nuisances,
    hangers_with_a_cause,
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


@pytest.mark.parametrize("tension_n", [0.0, 1e4, 1e6, 1e8])
def test_pinned_bar_under_tension(tension_n: float) -> None:
    expected = ORDERS / (2 * L) * np.sqrt((tension_n + EI * WAVES**2) / M)
    found = natural_frequencies_hz(replace(EULER, tension_n=tension_n), 14)
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_clamped_beam_without_tension() -> None:
    clamped = replace(EULER, spring_deck_n_m_rad=1e10 * EI / L, spring_arch_n_m_rad=1e10 * EI / L)
    roots = [brentq(lambda z: math.cos(z) - 1 / math.cosh(z), *(c - 1.0, c + 1.0), xtol=1e-13)
             for c in (np.arange(1, 11) + 0.5) * math.pi]  # fmt: skip
    assert roots[:2] == pytest.approx([4.73004, 7.85320], abs=1e-5)  # any handbook
    np.testing.assert_allclose(_wave_number(clamped, 10), roots, rtol=1e-7)


def test_clamped_at_one_end_only() -> None:
    fixed = 1e10 * EI / L
    for bar in (
        replace(EULER, spring_deck_n_m_rad=fixed),
        replace(EULER, spring_arch_n_m_rad=fixed),
    ):
        found = _wave_number(bar, 2)
        np.testing.assert_allclose(found, [3.92660231, 7.06858275], rtol=1e-7)


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


def test_shear_element_does_not_lock_and_tends_to_euler() -> None:
    stiff = replace(EULER, shear_stiffness_n=1e9 * EI / L**2, spring_deck_n_m_rad=5 * EI / L)
    thin = replace(stiff, shear_stiffness_n=math.inf)
    found = natural_frequencies_hz(stiff, 8)
    np.testing.assert_allclose(found, natural_frequencies_hz(thin, 8), rtol=2e-6)


def test_string_limit() -> None:
    tension_n, bending = 1e6, 1e-2
    bar = replace(EULER, tension_n=tension_n, bending_stiffness_n_m2=bending)
    found = natural_frequencies_hz(bar, 14)
    np.testing.assert_allclose(found, ORDERS / (2 * L) * math.sqrt(tension_n / M), rtol=1e-6)
    # Clamped: f (1 + 2 sqrt(EI/T)/L + ...) (Morse, Vibration and Sound, 1948).
    bar = replace(bar, bending_stiffness_n_m2=100.0)
    bar = replace(bar, spring_deck_n_m_rad=1e9, spring_arch_n_m_rad=1e9)
    ratio = natural_frequencies_hz(bar, 1, 60)[0] * 2 * L / math.sqrt(tension_n / M)
    layer = math.sqrt(100.0 / tension_n) / L
    assert ratio == pytest.approx(1 + 2 * layer + (4 + math.pi**2 / 2) * layer**2, abs=1e-7)


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


def test_own_weight_leaves_a_symmetric_bar_to_second_order() -> None:
    bar = replace(THICK, tension_n=1e6)
    first = natural_frequencies_hz(bar, 5)
    up = natural_frequencies_hz(replace(bar, tension_gradient_n_m=1e4), 5)
    down = natural_frequencies_hz(replace(bar, tension_gradient_n_m=-1e4), 5)
    half = natural_frequencies_hz(replace(bar, tension_gradient_n_m=5e3), 5)
    np.testing.assert_allclose(up, down, rtol=1e-10)
    np.testing.assert_allclose((up - first) / (half - first), 4.0, rtol=0.02)


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


def _values(cases: list[Case], key: str) -> Array:
    return np.array([float(c.truth[key]) for c in cases])


def _hanger(case: Case) -> dict[str, Any]:
    found: dict[str, Any] = tomllib.loads(case.hanger_toml)["hanger"][0]
    return found


def _frequencies(case: Case) -> Array:
    modes: Any = case.modes
    return np.array([[m["frequency_hz"] for m in t["modes"]] for t in modes["tests"]])


def test_every_group_is_there(cases: list[Case]) -> None:
    for group, low, high in (
        ("rods", 0.69, 0.81),
        ("strands", 0.19, 0.31),
        ("slack", 0.15, 0.26),
        ("slim", 0.15, 0.45),
        ("one plane", 0.28, 0.42),
        ("soft ends", 0.15, 0.26),
    ):
        share = np.mean([group in c.groups for c in cases])
        assert low < share < high, (group, share)
    clamped = np.mean(
        [min(float(c.truth[f"spring_k{i}"]) for i in range(1, 5)) > 100 for c in cases]
    )
    assert 0.15 < clamped < 0.26
    assert 0.35 < np.mean(_values(cases, "spring_k1") == _values(cases, "spring_k3")) < 0.65


def test_ranges_of_the_population(cases: list[Case]) -> None:
    for key, low, high in (
        ("tension_ratio", 0.05, 2.0),
        ("length_m", 1.99, 25.1),
        ("spring_k2", 0.03, 1000.0),
        ("frequency_sd", 1e-5, 1e-3),
        ("repeat_sd", 1e-5, 5e-4),
        ("sensor_mass_kg", 0.02, 0.08),
        ("bending_factor", 0.4, 1.0),
        ("tests", 1, 5),
    ):
        values = _values(cases, key)
        assert low <= values.min() < low + 0.2 * (high - low), key
        assert high >= values.max() > high - 0.2 * (high - low), key
    for case in cases:
        hanger, truth = _hanger(case), case.truth
        if truth["kind"] == "rod":
            assert 0.012 <= hanger["diameter_m"] <= 0.140
            assert 39.99 < hanger["length_m"] / hanger["diameter_m"] < 250.01
            assert 195e9 <= hanger["elastic_modulus_pa"] <= 212e9
            area = math.pi * hanger["diameter_m"] ** 2 / 4
        else:
            assert "diameter_m" not in hanger
            assert (hanger["kind"], hanger["bending_stiffness_factor"]) == ("strand", 0.7)
            area = hanger["area_m2"]
        assert 60e6 <= hanger["nominal_tension_n"] / area <= 250e6
        ratio = float(truth["tension_n"]) / hanger["nominal_tension_n"]
        assert ratio == pytest.approx(truth["tension_ratio"])


def test_tolerances_are_those_stated(cases: list[Case]) -> None:
    rods = [c for c in cases if c.truth["kind"] == "rod"]
    described = [_hanger(c) for c in rods]
    area = np.array([math.pi * h["diameter_m"] ** 2 / 4 for h in described])
    modulus, length, density = (
        np.array([h[key] for h in described])
        for key in ("elastic_modulus_pa", "length_m", "density_kg_m3")
    )
    true_density = _values(rods, "mass_per_length_kg_m") / _values(rods, "area_m2")
    for ratio, sd in (
        (_values(rods, "area_m2") / area, 0.01),
        (_values(rods, "elastic_modulus_pa") / modulus, 0.015),
        (true_density / density, 0.003),
        (_values(rods, "length_m") / length, 0.0005),
    ):
        assert abs(np.mean(ratio) - 1) < 4 * sd / math.sqrt(len(rods))
        assert np.std(ratio) == pytest.approx(sd, rel=0.15)
    np.testing.assert_allclose(
        _values(rods, "second_moment_m4"), _values(rods, "area_m2") ** 2 / (4 * math.pi)
    )


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


def test_no_nuisances_means_as_described() -> None:
    for case in sound_hangers(3, 20, Nuisances.none()):
        hanger, truth = _hanger(case), case.truth
        assert truth["length_m"] == hanger["length_m"]
        assert truth["elastic_modulus_pa"] == hanger["elastic_modulus_pa"]
        strand = truth["kind"] == "strand"
        assert truth["bending_factor"] == (0.7 if strand else 1.0)
        assert (truth["sensor_mass_kg"], truth["scatter_sd"], truth["repeat_sd"]) == (0, 0, 0)
        frequencies = _frequencies(case)
        np.testing.assert_array_equal(frequencies, frequencies[:1].repeat(len(frequencies), 0))


def test_the_seed_decides(cases: list[Case]) -> None:
    assert sound_hangers(2026, 12) == cases[:12]  # whatever the count
    assert sound_hangers(2027, 12) != cases[:12]
    assert hangers_with_a_cause(4, 5) == hangers_with_a_cause(4, 9)[:5]


def test_documents(cases: list[Case], tmp_path: Path) -> None:
    gaps = without_sd = planes = 0
    for case in cases:
        hanger_path, modes_path = case.write(tmp_path / str(case.index % 10))
        assert (hanger_path.name, modes_path.name) == ("hanger.toml", "case.modes.json")
        assert tomllib.loads(hanger_path.read_text())["hanger"][0]["id"] == 1
        modes = json.loads(modes_path.read_text())
        assert modes == case.modes
        assert (modes["schema"], modes["hanger"]) == ("shm.modes/1", 1)
        for test in modes["tests"]:
            assert set(test) == {"id", "time", "temperature_c", "modes"}
            found = sorted({m["plane"] for m in test["modes"]})
            assert len(found) == case.truth["planes"]
            assert set(found) <= {"transverse", "longitudinal"}
            for plane in found:
                mine = [m for m in test["modes"] if m["plane"] == plane]
                orders = [m["order"] for m in mine]
                assert orders[0] == 1
                assert 3 <= len(orders) <= 14
                assert orders[-1] - len(orders) in (0, 1)
                assert all(np.diff([m["frequency_hz"] for m in mine]) > 0)
        first = modes["tests"][0]["modes"]
        planes += len({m["plane"] for m in first})
        gaps += sum(b["order"] - a["order"] == 2 for a, b in pairwise(first))
        without_sd += "frequency_sd_hz" not in first[0]
    assert 0.05 < gaps / planes < 0.15
    assert 0.02 < without_sd / len(cases) < 0.09


def test_hangers_with_a_cause() -> None:
    cases = hangers_with_a_cause(8, 240)
    causes = [str(c.truth["cause"]) for c in cases]
    assert 0.4 < causes.count("") / len(causes) < 0.6
    assert all(causes.count(name) > 20 for name in CAUSES)
    assert {c.truth["kind"] for c in cases} == {"rod"}
    assert {c.truth["planes"] for c in cases} == {2.0}
    for case in cases:
        truth = case.truth
        assert 0.5 <= float(truth["tension_ratio"]) <= 1.5
        assert all(3 <= float(truth[f"spring_k{i}"]) <= 1000 for i in range(1, 5))
        assert len(case.modes["tests"]) in (1, 2, 3)  # type: ignore[arg-type]
        if truth["cause"]:
            place = float(truth["cause_place_m"]) / float(truth["length_m"])
            assert 0.15 <= place <= 0.85
            low, high = {"point_mass": (2, 15), "section_loss": (0.2, 0.6)}.get(
                str(truth["cause"]), (0, math.inf)
            )
            assert low <= float(truth["cause_size"]) <= high
