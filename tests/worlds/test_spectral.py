"""Proof of the spectral world against closed forms and solutions of another kind."""

import json
import tomllib
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import jv, yv

from tests.worlds import spectral
from tests.worlds.spectral import (
    GROUPS,
    SPRINGS,
    Array,
    Bar,
    Case,
    End,
    EndZone,
    Nuisances,
    families,
    hub_on_plate_nm,
    natural_frequencies_hz,
    sound_hangers,
)

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product

LENGTH_M, MASS_KG_M, BENDING_NM2, TENSION_N = 8.0, 15.4, 6.3e4, 2.0e5
SHEAR_N, ROTARY_KG_M = 1.37e8, 2.4e-3
PINS = (End(0.0), End(0.0))
STRING = Bar(LENGTH_M, MASS_KG_M, 1e-6, SHEAR_N, 0.0)
TIMOSHENKO = Bar(LENGTH_M, MASS_KG_M, BENDING_NM2, SHEAR_N, ROTARY_KG_M)


def boundary_determinant(
    bar: Bar, tension_n: float, ends: tuple[End, End], frequency_hz: float, slices: int
) -> float:
    """Zero at a natural frequency: the strong form, carried along by matrix exponentials.

    State (w, theta, M, V) with V = kGA (w' - theta) + T w'; constant within a slice.  The columns
    are made orthonormal on the way so that the growing solution does not swallow the other.
    """
    w2 = (2 * np.pi * frequency_hz) ** 2
    marks = bar.breaks_m()
    grids = [
        np.linspace(a, b, 1 + max(1, round(slices * (b - a) / bar.length_m)))
        for a, b in pairwise(marks)
    ]
    borders = np.unique(np.concatenate(grids))
    x = (borders[1:] + borders[:-1]) / 2
    mass, bending, shear, rotary = bar.section(x)
    force = tension_n + bar.weight_n(x)
    a = np.zeros((len(x), 4, 4))
    a[:, 0, 1], a[:, 0, 3] = shear / (shear + force), 1 / (shear + force)
    a[:, 1, 2] = 1 / bending
    a[:, 2, 1] = shear - rotary * w2 - shear**2 / (shear + force)
    a[:, 2, 3] = -shear / (shear + force)
    a[:, 3, 0] = -mass * w2
    unit = 1e6  # of M and V against w and theta, for conditioning only
    a[:, :2, 2:] *= unit
    a[:, 2:, :2] /= unit
    a *= np.diff(borders)[:, None, None] / 2**10
    steps = np.eye(4) + a @ (np.eye(4) + a / 2 @ (np.eye(4) + a / 3 @ (np.eye(4) + a / 4)))
    for _ in range(10):
        steps = steps @ steps
    deck, arch = ends
    lateral_m, turning = deck.lateral_flexibility_m_per_n * unit, deck.rotation_nm_per_rad / unit
    columns = np.array([[lateral_m, 0], [0, 1], [0, turning], [1, 0]])
    for i, (step, border) in enumerate(zip(steps, borders[1:], strict=True)):
        columns = step @ columns
        if bar.sensor_kg > 0 and abs(border - bar.sensor_at_m) < 1e-9:
            columns[3] -= bar.sensor_kg * w2 / unit * columns[0]
        if i % 8 == 0:
            q, r = np.linalg.qr(columns)
            columns = q * np.sign(np.diag(r))
    w, theta, moment, lateral = columns
    rows = [
        w + arch.lateral_flexibility_m_per_n * unit * lateral,
        moment + arch.rotation_nm_per_rad / unit * theta,
    ]
    return float(np.linalg.det(rows))


def assert_roots(
    bar: Bar, tension_n: float, ends: tuple[End, End], count: int, tolerance: float, slices: int
) -> None:
    """Each frequency of the spectral method encloses a root of the strong form."""
    for hz in natural_frequencies_hz(bar, [tension_n], ends, count)[0]:
        sides = [
            boundary_determinant(bar, tension_n, ends, hz * (1 + s * tolerance), slices)
            for s in (-1, 1)
        ]
        assert sides[0] * sides[1] < 0


def euler_hz(tension_n: float, ends: tuple[End, End], count: int) -> Array:
    """Rotary inertia off; shear stiffness 20, 40 and 80 fold, extrapolated to infinite.

    The frequency is a smooth function of 1/kGA, here a parabola (Richardson).
    """
    bars = [replace(TIMOSHENKO, shear_n=s * SHEAR_N, rotary_kg_m=0.0) for s in (20, 40, 80)]
    hz = [natural_frequencies_hz(bar, [tension_n], ends, count)[0] for bar in bars]
    return np.asarray((hz[0] - 6 * hz[1] + 8 * hz[2]) / 3)


def test_pinned_euler_bar_under_tension() -> None:
    n = np.arange(1, 15)
    stiffening = BENDING_NM2 * (n * np.pi / LENGTH_M) ** 2
    exact = n / (2 * LENGTH_M) * np.sqrt((TENSION_N + stiffening) / MASS_KG_M)
    found = euler_hz(TENSION_N, PINS, 14)
    np.testing.assert_allclose(found, exact, rtol=1e-7)


def test_clamped_euler_bar_without_tension() -> None:
    roots = [brentq(lambda b: np.cos(b) - 1 / np.cosh(b), lo, lo + 1.5) for lo in (4.0, 7.1, 10.3)]
    np.testing.assert_allclose(roots, [4.73004, 7.85320, 10.9956], atol=1e-5)
    exact = np.square(roots) / (2 * np.pi * LENGTH_M**2) * np.sqrt(BENDING_NM2 / MASS_KG_M)
    clamps = (End(1e9 * BENDING_NM2), End(1e9 * BENDING_NM2))
    found = euler_hz(0.0, clamps, 3)
    np.testing.assert_allclose(found, exact, rtol=1e-7)


def test_pinned_timoshenko_bar_under_tension() -> None:
    """w = sin, theta = cos: a 2 x 2 problem for each order."""
    exact = []
    for n in range(1, 15):
        b = n * np.pi / LENGTH_M
        shear_b = -SHEAR_N * b
        k = [[(SHEAR_N + TENSION_N) * b**2, shear_b], [shear_b, BENDING_NM2 * b**2 + SHEAR_N]]
        exact.append(np.sqrt(eigh(k, np.diag([MASS_KG_M, ROTARY_KG_M]))[0][0]) / (2 * np.pi))
    found = natural_frequencies_hz(TIMOSHENKO, [TENSION_N], PINS, 14)[0]
    np.testing.assert_allclose(found, exact, rtol=1e-9)


def test_string_limit() -> None:
    exact = np.arange(1, 15) / (2 * LENGTH_M) * np.sqrt(TENSION_N / MASS_KG_M)
    found = natural_frequencies_hz(STRING, [TENSION_N], PINS, 14)[0]
    np.testing.assert_allclose(found, exact, rtol=1e-8)


def test_hanging_string_with_its_own_weight() -> None:
    """T = T0 + m g x: w is J0 and Y0 of (2 omega / g) sqrt(T / m)."""
    bar = replace(STRING, self_weight=True)
    tension_n = 2000.0  # weight: 1.2 kN
    half = MASS_KG_M * 9.81 * LENGTH_M / 2

    def determinant(hz: float) -> float:
        z0, z1 = (
            4 * np.pi * hz / 9.81 * np.sqrt((tension_n + s) / MASS_KG_M) for s in (-half, half)
        )
        return float(jv(0, z0) * yv(0, z1) - jv(0, z1) * yv(0, z0))

    found = natural_frequencies_hz(bar, [tension_n], PINS, 6)[0]
    exact = [brentq(determinant, hz * 0.999, hz * 1.001, rtol=1e-12) for hz in found]
    np.testing.assert_allclose(found, exact, rtol=1e-7)
    assert abs(found[0] / np.sqrt(tension_n / MASS_KG_M) * 2 * LENGTH_M - 1) > 1e-3


@pytest.mark.parametrize("stiffness", [0.03, 5.0, 1000.0])
def test_stepped_bar_on_springs_with_a_sensor(stiffness: float) -> None:
    zones = (EndZone(0.12, 3.1, 1.8), EndZone(0.21, 1.6, 1.3))
    bar = replace(TIMOSHENKO, zones=zones, sensor_kg=0.08, sensor_at_m=1.7)
    ends = (End(stiffness * BENDING_NM2 / LENGTH_M), End(2e4, 5e-9))
    assert_roots(bar, TENSION_N, ends, 10, tolerance=2e-8, slices=20)


def test_cases_of_the_population_against_the_strong_form(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wandering section, weight, zones, sensor, soft supports: all at once."""
    seen: list[tuple[Bar, list[float], tuple[End, End], int]] = []

    def spy(bar: Bar, tensions_n: list[float], ends: tuple[End, End], count: int) -> Array:
        seen.append((bar, tensions_n, ends, count))
        return natural_frequencies_hz(bar, tensions_n, ends, count)

    monkeypatch.setattr(spectral, "natural_frequencies_hz", spy)
    sound_hangers(8, 5)
    for bar, tensions_n, ends, count in seen:
        assert_roots(bar, tensions_n[0], ends, min(count, 4), tolerance=2e-6, slices=600)


def test_x_runs_up_from_the_deck() -> None:
    zones = (EndZone(0.1, 2.0, 1.5), EndZone(0.2, 3.0, 1.2))
    bar = replace(TIMOSHENKO, zones=zones, self_weight=True)
    mass, bending, _, _ = bar.section(np.array([0.05, 0.15, 7.7, 7.85]))
    np.testing.assert_allclose(mass / MASS_KG_M, [1.5, 1.0, 1.0, 1.2])
    np.testing.assert_allclose(bending / BENDING_NM2, [2.0, 1.0, 1.0, 3.0])
    weight = bar.weight_n(np.array([0.0, LENGTH_M / 2, LENGTH_M])) / (MASS_KG_M * 9.81)
    np.testing.assert_allclose(weight, [-4.05, 0.0, 4.04], atol=2e-3)  # most tension on top


def test_wandering_section() -> None:
    """Standard deviation, correlation exp(-1) at a fifth of the bar, and I as the area squared."""
    rng = np.random.default_rng(1)
    x = np.array([0.0, LENGTH_M / 5, LENGTH_M])
    laws = [spectral._wander(rng, LENGTH_M, 0.003, 0.2) for _ in range(4000)]
    values = np.array([law(x) for law in laws])
    np.testing.assert_allclose(values.std(axis=0), 0.003, rtol=0.05)
    correlation = np.corrcoef(values.T)
    np.testing.assert_allclose(correlation[0, 1:], [np.exp(-1), 0.0], atol=0.05)
    ratio = values[0] + 1
    mass, bending, shear, rotary = replace(TIMOSHENKO, wander=laws[0]).section(x)
    np.testing.assert_allclose([mass / MASS_KG_M, shear / SHEAR_N], [ratio, ratio])
    np.testing.assert_allclose(bending / BENDING_NM2, ratio**2)
    np.testing.assert_allclose(rotary / ROTARY_KG_M, ratio**2)


def test_convergence() -> None:
    """The degree in use is good to 1e-7, far below the least error of measurement (1e-5)."""
    for case_tension_n, bending in ((5e3, BENDING_NM2), (4e5, BENDING_NM2 / 8)):
        zones = (EndZone(0.12, 4.0, 2.0), EndZone(0.21, 1.2, 1.1))
        wave = replace(TIMOSHENKO, zones=zones, wander=lambda x: 0.01 * np.sin(3 * x))
        bar = replace(wave, bending_nm2=bending, self_weight=True, sensor_kg=0.05, sensor_at_m=1.5)
        ends = (End(1e6), End(1e3, 1e-8))
        fine = natural_frequencies_hz(bar, [case_tension_n], ends, 14, degree=20)
        errors = [
            np.abs(natural_frequencies_hz(bar, [case_tension_n], ends, 14, n) / fine - 1).max()
            for n in (6, 9, 12)
        ]
        assert errors[0] > errors[1] > errors[2]
        assert errors[2] < 1e-7


def test_hub_on_plate_against_energy() -> None:
    """Ritz with polynomials in r: U = pi D/2 int (f'' + f'/r - f/r^2)^2 r dr, stiffness 2 U."""
    a, b = 3.0, 0.9
    poly = np.polynomial.Polynomial
    edge = poly([-a, 1]) ** 2
    slope = (1 + 2 * b / (a - b)) / (a - b) ** 2  # f(b) = b, f'(b) = 1, clamped at a
    start = edge * (b / (a - b) ** 2 + slope * poly([-b, 1]))
    trials = [edge * poly([-b, 1]) ** 2 * poly([-2, 1]) ** n for n in range(9)]
    points, weights = np.polynomial.legendre.leggauss(40)
    r = (a + b) / 2 + (a - b) / 2 * points
    root = np.sqrt(np.pi * (a - b) / 2 * weights * r)
    strain = [root * (f.deriv(2)(r) + f.deriv()(r) / r - f(r) / r**2) for f in (start, *trials)]
    residual = np.linalg.lstsq(np.array(strain[1:]).T, -strain[0], rcond=None)[1]
    assert hub_on_plate_nm(1.0, b, a) == pytest.approx(float(residual[0]), rel=1e-6)


def parse(case: Case) -> dict[str, Any]:
    return dict(tomllib.loads(case.hanger_toml)["hanger"][0])


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A string instead of the beam, for statistics of many cases."""

    def string(bar: Bar, tensions_n: list[float], ends: tuple[End, End], count: int) -> Array:
        speed = np.sqrt(np.array(tensions_n) / bar.mass_kg_m) / (2 * bar.length_m)
        return np.asarray(np.multiply.outer(speed, np.arange(1, count + 1)))

    monkeypatch.setattr(spectral, "natural_frequencies_hz", string)


def test_statistics_of_the_population(quick: None) -> None:
    cases = sound_hangers(11, 1000)
    described = [parse(c) for c in cases]
    truths = [c.truth for c in cases]
    share = {g: np.mean([g in c.groups for c in cases]) for g in GROUPS}
    for group, wanted in (("strands", 0.25), ("slack", 0.2), ("one plane", 0.35)):
        assert share[group] == pytest.approx(wanted, abs=0.05)
    assert share["rods"] + share["strands"] == pytest.approx(1)
    assert 0.15 < share["soft ends"] < 0.25
    assert 0.2 < share["slim"] < 0.45
    area = [
        t["area_m2"] / d.get("area_m2", np.pi / 4 * t["diameter_m"] ** 2)
        for t, d in zip(truths, described, strict=True)
    ]
    modulus = [
        t["modulus_pa"] / d["elastic_modulus_pa"] for t, d in zip(truths, described, strict=True)
    ]
    length = [t["length_m"] / d["length_m"] for t, d in zip(truths, described, strict=True)]
    for ratio, sd in ((area, 0.0101), (modulus, 0.015), (length, 5e-4)):
        assert np.mean(ratio) == pytest.approx(1, abs=sd / 5)
        assert np.std(ratio) == pytest.approx(sd, rel=0.1)
    relative = np.array([list(t["end_kl_over_ei"].values()) for t in truths])
    assert 0.0299 < relative.min() < 0.05
    assert 900 < relative.max() <= 1000
    for t, d in zip(truths, described, strict=True):
        assert 0.05 <= t["tension_ratio"] <= 2.0
        assert t["tension_n"] == pytest.approx(t["tension_ratio"] * d["nominal_tension_n"])
        assert 2.0 <= d["length_m"] <= 25.0
        assert 39.9 < d["length_m"] / t["diameter_m"] < 250.1
        assert all(2 <= n <= 14 for n in t["modes"].values())
    missing = np.mean(
        [any(t["modes"][p] < len(t["exact_frequency_hz"][p]) for p in t["planes"]) for t in truths]
    )
    assert missing == pytest.approx(0.1, abs=0.03)
    assert np.mean([t["stated_sd"] is None for t in truths]) == pytest.approx(0.05, abs=0.02)
    assert np.mean([bool(t["end_zones"]) for t in truths]) == pytest.approx(0.5, abs=0.05)
    spread = [np.log(t["frequency_sd"] / t["stated_sd"]) for t in truths if t["stated_sd"]]
    assert np.std(spread) == pytest.approx(0.2, rel=0.1)


def test_errors_of_the_frequencies(quick: None) -> None:
    knobs = Nuisances(temperature_sd_k=0.0, clock_sd=0.0)
    repeats, scatters = [], []
    for case in sound_hangers(12, 400, knobs):
        t = case.truth
        if t["tests"] < 4:
            continue
        log = np.array([[m["frequency_hz"] for m in test["modes"]] for test in case.modes["tests"]])
        exact = [
            t["exact_frequency_hz"][m["plane"]][m["order"] - 1]
            for m in case.modes["tests"][0]["modes"]
        ]
        error = log / np.array(exact) - 1
        scatters.append(error.std(axis=0, ddof=1).mean() / t["frequency_sd"])
        size = np.hypot(t["repeat_sd"], t["frequency_sd"] / np.sqrt(t["tests"]))
        repeats.append(np.sqrt(np.mean(error.mean(axis=0) ** 2)) / size)
    assert np.mean(scatters) == pytest.approx(0.93, abs=0.04)  # mean of s / sigma, 4 and 5 tests
    assert np.mean(repeats) == pytest.approx(0.98, abs=0.05)


def test_mistaken_modes(quick: None) -> None:
    cases = sound_hangers(13, 300, replace(Nuisances.none(), mistaken_mode_share=0.2))
    modes = sum(sum(c.truth["modes"].values()) for c in cases)
    assert sum(len(c.truth["mistaken"]) for c in cases) / modes == pytest.approx(0.2, abs=0.03)
    for case in cases:
        for mode in case.modes["tests"][0]["modes"]:
            exact = case.truth["exact_frequency_hz"][mode["plane"]][mode["order"] - 1]
            wrong = (mode["plane"], mode["order"]) in case.truth["mistaken"]
            assert (abs(mode["frequency_hz"] / exact - 1) > 0.005) == wrong


def test_nothing_but_the_textbook_without_nuisances() -> None:
    for case in sound_hangers(5, 6, Nuisances.none()):
        d, t = parse(case), case.truth
        assert t["length_m"] == d["length_m"]
        assert t["modulus_pa"] == d["elastic_modulus_pa"]
        assert t["bending_factor"] == d.get("bending_stiffness_factor", 1.0)
        section = d.get("second_moment_m4", np.pi / 64 * t["diameter_m"] ** 4)
        area = d.get("area_m2", np.pi / 4 * t["diameter_m"] ** 2)
        mass = d.get("mass_per_length_kg_m", 7850 * area)
        modulus = d["elastic_modulus_pa"]
        bending, shear = t["bending_factor"] * modulus * section, 7.8 / 8.8 * modulus / 2.6 * area
        bar = Bar(d["length_m"], mass, bending, shear, mass * section / area)
        for plane in t["planes"]:
            deck, arch = (End(t["end_stiffness_nm_per_rad"][k]) for k in SPRINGS[plane])
            count = len(t["exact_frequency_hz"][plane])
            hz = natural_frequencies_hz(bar, [t["tension_n"]], (deck, arch), count)[0]
            for test in case.modes["tests"]:
                modes = [m for m in test["modes"] if m["plane"] == plane]
                assert [m["order"] for m in modes] == list(range(1, count + 1))
                found = [m["frequency_hz"] for m in modes]
                np.testing.assert_allclose(found, hz, rtol=1e-8)


def test_same_seed_same_answer() -> None:
    many, few = sound_hangers(3, 5), sound_hangers(3, 2)
    assert many[:2] == few
    assert many[0].modes != sound_hangers(4, 1)[0].modes


def test_switching_nuisances_off_leaves_the_rest(quick: None) -> None:
    for real, plain in zip(
        sound_hangers(3, 40), sound_hangers(3, 40, Nuisances.none()), strict=True
    ):
        said, bare = (tomllib.loads(each.hanger_toml)["hanger"][0] for each in (real, plain))
        said.pop("fittings_m", None)
        assert said == bare
        for key in ("tension_n", "planes", "tests"):
            assert real.truth[key] == plain.truth[key]
        assert min(plain.truth["end_kl_over_ei"].values()) >= 0.0299
        assert len(set(plain.truth["test_tension_n"])) == 1


def test_written_files_parse(tmp_path: Path) -> None:
    for case in sound_hangers(7, 6):
        toml_path, modes_path = case.write(tmp_path / str(case.index))
        assert (toml_path.name, modes_path.name) == ("hanger.toml", "case.modes.json")
        hanger = tomllib.loads(toml_path.read_text())["hanger"][0]
        assert ("diameter_m" in hanger) == (case.truth["kind"] == "rod")
        assert hanger.get("kind") == (None if "rods" in case.groups else "strand")
        document = json.loads(modes_path.read_text())
        assert document["schema"] == "shm.modes/1"
        assert len(document["tests"]) == case.truth["tests"]
        assert json.loads(json.dumps(case.truth))["tension_n"] == case.truth["tension_n"]


def test_families(quick: None) -> None:
    groups = families(9, 60, 4)
    ratios = []
    for siblings in groups:
        described = [parse(c) for c in siblings]
        assert [d["id"] for d in described] == [1, 2, 3, 4]
        assert [c.modes["hanger"] for c in siblings] == [1, 2, 3, 4]
        assert {d["family"] for d in described} == {"A"}
        assert len({d["elastic_modulus_pa"] for d in described}) == 1
        assert len({d["length_m"] for d in described}) == 4
        ratios.append(
            [c.truth["modulus_pa"] / described[0]["elastic_modulus_pa"] for c in siblings]
        )
        read = [[t for t in c.modes["tests"] if "tension_read_n" in t] for c in siblings]
        assert [len(r) for r in read] == [1, 0, 0, 0]
        reading = read[0][0]
        assert reading["tension_read_sd_n"] == pytest.approx(0.01 * reading["tension_read_n"])
        assert reading["tension_read_n"] == pytest.approx(siblings[0].truth["tension_n"], rel=0.06)
    assert np.std(np.mean(ratios, axis=1)) == pytest.approx(0.015, rel=0.3)
    assert np.mean(np.std(ratios, axis=1, ddof=1)) == pytest.approx(0.003 * 0.92, rel=0.2)
