"""Proof of the spectral world against closed forms and solutions of another kind."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import eigh

from tests.worlds import spectral
from tests.worlds.spectral import (
    Array,
    Bar,
    End,
    EndZone,
    Nuisances,
    natural_frequencies_hz,
    sound_hangers,
)

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product

LENGTH_M, MASS_KG_M, BENDING_NM2, TENSION_N = 8.0, 15.4, 6.3e4, 2.0e5
SHEAR_N, ROTARY_KG_M = 1.37e8, 2.4e-3
PINS = (End(0.0), End(0.0))
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


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A string instead of the beam, for statistics of many cases."""

    def string(bar: Bar, tensions_n: list[float], ends: tuple[End, End], count: int) -> Array:
        speed = np.sqrt(np.array(tensions_n) / bar.mass_kg_m) / (2 * bar.length_m)
        return np.asarray(np.multiply.outer(speed, np.arange(1, count + 1)))

    monkeypatch.setattr(spectral, "natural_frequencies_hz", string)


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


def test_same_seed_same_answer() -> None:
    many, few = sound_hangers(3, 5), sound_hangers(3, 2)
    assert many[:2] == few
    assert many[0].modes != sound_hangers(4, 1)[0].modes
