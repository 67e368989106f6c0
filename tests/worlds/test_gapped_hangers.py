"""The proof of the world of gapped hangers: closed forms first, then what it draws."""

import json
import math
import tomllib
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.worlds.eight_kinds import Member, Zone, natural_frequencies_hz
from tests.worlds.gapped_hangers import (
    CAUSES,
    Case,
    Draws,
    Fault,
    Hanger,
    Nuisances,
    compare,
    draw_hanger,
    find_slopes,
    make_case,
    plant,
    solve,
)
from tests.worlds.hermite_bars import Array, Bar, Stretch, solve_modes

pytestmark = pytest.mark.trial  # of the world alone: it shares nothing with the product

L, T, EI, M = 10.0, 2e5, 4e5, 40.0
PINNED = replace(Bar(L, T, EI, M), rotation_n_m=(0.0, 0.0))
ORDERS = np.arange(1, 10)
WAVES = ORDERS * math.pi / L


def frequencies(bar: Bar, count: int = 9, elements: int = 90) -> Array:
    return solve_modes(bar, count, elements=elements).frequencies_hz


def test_solve_modes_pinned_in_tension() -> None:
    exact = np.sqrt((WAVES**2 * T + WAVES**4 * EI) / M) / (2 * math.pi)
    assert frequencies(PINNED) == pytest.approx(exact, rel=1e-5)
    assert frequencies(PINNED, elements=180) == pytest.approx(exact, rel=1e-6)


def test_solve_modes_string() -> None:
    string = replace(PINNED, bending_n_m2=1e-6 * T * L**2)
    assert frequencies(string) == pytest.approx(WAVES * math.sqrt(T / M) / (2 * math.pi), rel=1e-3)
    exact = np.sqrt((WAVES**2 * T + WAVES**4 * string.bending_n_m2) / M) / (2 * math.pi)
    assert frequencies(string) == pytest.approx(exact, rel=1e-5)


def test_solve_modes_clamped() -> None:
    def zero(z: float) -> float:
        return math.cos(z) - 1 / math.cosh(z)

    middle = (ORDERS + 0.5) * math.pi
    roots = np.array([brentq(zero, z - 1, z + 1) for z in middle])
    exact = roots**2 / L**2 * math.sqrt(EI / M) / (2 * math.pi)
    assert frequencies(Bar(L, 0.0, EI, M)) == pytest.approx(exact, rel=2e-5)


def test_solve_modes_clamped_in_tension() -> None:
    """2 p q (1 - cos q cosh p) + (p^2 - q^2) sin q sinh p = 0, p^2 - q^2 = T L^2 / EI."""
    xi2 = T * L**2 / EI

    def zero(q: float) -> float:
        p = math.sqrt(q**2 + xi2)
        return 2 * p * q * (1 / math.cosh(p) - math.cos(q)) + xi2 * math.sin(q) * math.tanh(p)

    grid = np.linspace(0.5, 33.0, 4000)
    signs = [zero(q) for q in grid]
    roots = [
        brentq(zero, grid[i], grid[i + 1])
        for i in range(len(grid) - 1)
        if signs[i] * signs[i + 1] < 0
    ]
    q = np.array(roots[:9])
    exact = q * np.sqrt(q**2 + xi2) / L**2 * math.sqrt(EI / M) / (2 * math.pi)
    assert frequencies(Bar(L, T, EI, M)) == pytest.approx(exact, rel=1e-5)


def test_solve_modes_timoshenko_pinned() -> None:
    """The pinned Timoshenko beam with the tension along its axis, which waves solve exactly."""
    shear, rotary = 5 * EI, 0.02 * M
    square = []
    for k in WAVES:
        stiffness = np.array([[(shear + T) * k**2, -shear * k], [-shear * k, shear + EI * k**2]])
        values = np.linalg.eigvals(np.diag([1 / M, 1 / rotary]) @ stiffness)
        square.append(values.real.min())
    bar = replace(PINNED, shear_n=shear, rotary_kg_m=rotary)
    exact = np.sqrt(square) / (2 * math.pi)
    assert frequencies(bar) == pytest.approx(exact, rel=2e-5)
    assert frequencies(bar, elements=180) == pytest.approx(exact, rel=1e-6)


def test_solve_modes_shear_never_locks() -> None:
    slender = replace(PINNED, shear_n=1e6 * EI, rotary_kg_m=1e-7 * M)
    assert frequencies(slender) == pytest.approx(frequencies(PINNED), rel=1e-5)


@pytest.mark.parametrize("parameter", [0.1, 2.0, 20.0])
def test_solve_modes_sag_irvine(parameter: float) -> None:
    """tan z = z - 4 z^3 / lambda^2 with z = omega L sqrt(m/T) / 2; even orders are as they were."""
    string = replace(PINNED, bending_n_m2=1e-7 * T * L**2, axial_n=1e9)
    across = T / (M * L) * math.sqrt(parameter * T / string.axial_n)
    found = frequencies(replace(string, gravity_across_m_s2=across), 4)

    def zero(z: float) -> float:
        return math.sin(z) - math.cos(z) * (z - 4 * z**3 / parameter)

    root = brentq(zero, math.pi / 2 + 1e-9, 3 * math.pi / 2 - 1e-9)
    assert found[0] == pytest.approx(root * math.sqrt(T / M) / (L * math.pi), rel=2e-3)
    assert found[1] == pytest.approx(frequencies(string, 2)[1], rel=1e-6)


def test_solve_modes_free_hanging_weight() -> None:
    """A chain hung from its top, without force at its foot: omega = j_0n sqrt(g / L) / 2."""
    weight = M * 9.81 * L
    chain = Bar(
        *(L, weight / 2, 1e-7 * weight * L**2, M),
        rotation_n_m=(0.0, 0.0),
        lateral_n_m=(0.0, math.inf),
        gravity_along_m_s2=9.81,
    )
    exact = np.array([2.404826, 5.520078, 8.653728]) / 2 * math.sqrt(9.81 / L) / (2 * math.pi)
    assert frequencies(chain, 3, 400) == pytest.approx(exact, rel=3e-3)


def test_solve_modes_point_mass_converges() -> None:
    """A pinned bar with a mass at the middle: odd orders from the receptance of its halves."""
    heavy, x = 0.05 * M * L, 0.3 * L
    waves = np.arange(1, 4001) * math.pi / L
    square = (waves**2 * T + waves**4 * EI) / M
    at = np.sin(waves * x) ** 2 * 2 / (M * L)

    def zero(omega: float) -> float:
        return 1 - omega**2 * heavy * float(np.sum(at / (square - omega**2)))

    edges = [0.0, *np.sqrt(square[:6])]
    exact = [
        brentq(zero, low * (1 + 1e-9) + 1e-9, high * (1 - 1e-9)) / (2 * math.pi)
        for low, high in pairwise(edges)
    ]
    bar = replace(PINNED, masses=((x, heavy),))
    coarse, fine = frequencies(bar, 6), frequencies(bar, 6, 360)
    assert fine == pytest.approx(exact, rel=1e-6)
    assert coarse == pytest.approx(fine, rel=1e-5)


def test_solve_modes_spring_crack_absorber() -> None:
    """A spring of infinite stiffness halves the bar; a crack of none is a hinge there."""
    half = frequencies(replace(PINNED, length_m=L / 2), 1)[0]
    held = frequencies(replace(PINNED, springs=((L / 2, 1e9),)), 2)
    assert held[0] == pytest.approx(half, rel=1e-4)
    whole = frequencies(replace(PINNED, cracks=((L / 2, 1e10),)))
    assert whole == pytest.approx(frequencies(PINNED), rel=1e-5)
    hinged = frequencies(replace(PINNED, cracks=((L / 2, 1.0),)), 2)
    assert hinged[1] == pytest.approx(half, rel=1e-4)
    light = replace(PINNED, absorbers=((L / 2, 1e-6, 3.0),))
    assert frequencies(light, 4) == pytest.approx(frequencies(PINNED, 4), rel=1e-5)


def test_solve_modes_absorber_is_a_mass() -> None:
    """An absorber far above the bar's modes moves with the bar, one far below holds it."""
    stiff = frequencies(replace(PINNED, absorbers=((0.3 * L, 5.0, 4000.0),)), 4)
    assert stiff == pytest.approx(frequencies(replace(PINNED, masses=((0.3 * L, 5.0),)), 4), 1e-5)
    hz = 0.01
    soft = frequencies(replace(PINNED, absorbers=((0.3 * L, 5e6, hz),)), 4)
    spring = 5e6 * (2 * math.pi * hz) ** 2
    held = frequencies(replace(PINNED, springs=((0.3 * L, spring),)), 4)
    assert soft == pytest.approx(held, 1e-3)


def test_solve_modes_neighbour_alike() -> None:
    """Two equal bars joined by a spring: half of the modes know nothing of it."""
    bar = replace(PINNED, neighbour=PINNED, clamp=(0.3 * L, 1e4))
    apart = replace(PINNED, springs=((0.3 * L, 2e4),))
    both = np.concatenate([frequencies(PINNED, 3), frequencies(apart, 3)])
    found = frequencies(bar, 3)
    assert all(np.abs(both / hz - 1).min() < 1e-5 for hz in found)


def test_solve_modes_end_springs() -> None:
    """A lateral spring at an end of a taut string: tan z = -T z / (k L)."""
    k = 20 * T / L
    string = replace(PINNED, bending_n_m2=1e-7 * T * L**2, lateral_n_m=(math.inf, k))
    root = brentq(lambda z: math.sin(z) + math.cos(z) * T * z / (k * L), 2.0, math.pi)
    exact = root / L * math.sqrt(T / M) / (2 * math.pi)
    assert frequencies(string, 1)[0] == pytest.approx(exact, rel=1e-3)
    turning = replace(PINNED, rotation_n_m=(1e3 * EI / L, 1e3 * EI / L))
    longer = Bar(L * (1 + 2e-3), T, EI, M)  # a spring k is as EI/k more of length
    assert frequencies(turning, 3) == pytest.approx(frequencies(longer, 3), rel=1e-4)


def test_solve_modes_tension_share() -> None:
    modes, more = solve_modes(PINNED, 5), solve_modes(replace(PINNED, tension_n=T * 1.001), 5)
    slope = np.log(more.frequencies_hz / modes.frequencies_hz) / math.log(1.001)
    assert modes.tension_share == pytest.approx(slope, rel=1e-3)


def test_solve_modes_stretch_split() -> None:
    """A change along all of the bar, given as two stretches, is a change of the bar."""
    halves = (Stretch(0, 4.0, 1.3, 1.2, 1.2), Stretch(4.0, L, 1.3, 1.2, 1.2))
    changed = Bar(L, T, 1.3 * EI, 1.2 * M)
    assert frequencies(Bar(L, T, EI, M, stretches=halves)) == pytest.approx(
        frequencies(changed), rel=1e-5
    )


@pytest.mark.parametrize("sheared", [True, False])
def test_solve_modes_against_eight_kinds(sheared: bool) -> None:
    """Everything at once, against the elements of another world."""
    shear, rotary = (8e7, 0.03) if sheared else (math.inf, 0.0)
    shared = {"axial": 4e8, "along": 8.1, "across": 5.6}
    zones = (Stretch(0.0, 0.3, 8.0, 3.0, 3.0), Stretch(L - 0.4, L, 8.0, 3.0, 3.0))
    bar = Bar(
        *(L, T, EI, M, shear, rotary, shared["axial"], zones, (3e5, 1e6), (4e7, 5e7)),
        supports_axial_n_m=1e8,
        masses=((1.7, 0.8),),
        gravity_along_m_s2=shared["along"],
        gravity_across_m_s2=shared["across"],
    )
    member = Member(
        *(L, T, EI, M, shear, rotary, shared["axial"]),
        zones=tuple(Zone(each.start_m, each.end_m, each.bending, each.mass) for each in zones),
        masses=((1.7, 0.8),),
        rotation_n_m_rad=(3e5, 1e6),
        lateral_n_m=(4e7, 5e7),
        axial_n_m=(2e8, 2e8),
        gravity_along_m_s2=shared["along"],
        gravity_across_m_s2=shared["across"],
    )
    assert frequencies(bar) == pytest.approx(natural_frequencies_hz(member, 9, 1200), rel=1e-5)


# ---------------------------------------------------------------- what is drawn


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    each = [(name,) for name in CAUSES] + [()]
    return [make_case(3, index, causes) for index, causes in enumerate(each)]


def test_make_case_repeats() -> None:
    one, two = (make_case(3, 7, ("crack",)) for _ in range(2))
    assert (one.hanger_toml, one.modes, one.truth) == (two.hanger_toml, two.modes, two.truth)
    assert one.modes != make_case(4, 7, ("crack",)).modes


def test_make_case_sizes(cases: list[Case]) -> None:
    for case in cases:
        for each in case.truth["causes"]:
            cause = CAUSES[each["cause"]]
            assert 5 <= each["visible"] <= 111
            assert cause.low <= each["size"] <= cause.high or each["cause"] == "other stiffness"
            assert each["accepted"] == list(cause.accepted)
    assert {each["cause"] for case in cases for each in case.truth["causes"]} == set(CAUSES)
    assert any(not case.truth["causes"] for case in cases)
    assert {case.truth["kind"] for case in cases} == {"bar", "tube", "strand"}


def test_make_case_documents(cases: list[Case], tmp_path: Path) -> None:
    for case in cases:
        hanger_file, modes_file = case.write(tmp_path / str(case.index))
        described = tomllib.loads(hanger_file.read_text(encoding="utf-8"))["hanger"][0]
        assert described["nominal_tension_n"] > 0
        document = json.loads(modes_file.read_text(encoding="utf-8"))
        assert 1 <= len(document["tests"]) <= 4
        for test in document["tests"]:
            hz: dict[str, list[float]] = {plane: [] for plane in ("transverse", "longitudinal")}
            for mode in test["modes"]:
                hz[mode["plane"]].append(mode["frequency_hz"])
                assert 8e-5 < mode["frequency_sd_hz"] / mode["frequency_hz"] < 6e-4
                assert len(mode.get("shape", ())) in (0, 2, 3, 4)
            assert all(values == sorted(values) for values in hz.values())
            assert all(len(values) == 0 or 4 <= len(values) <= 9 for values in hz.values())


def test_measure_errors_are_as_stated() -> None:
    """Without nuisances the tests of a sound hanger differ by the stated error alone."""
    quiet = Nuisances(
        tension_between_tests=0.0, tension_per_kelvin=0.0, misstated=0.0, repeat=(1e-9, 2e-9)
    )
    z = []
    for index in range(40):
        case = make_case(9, index, (), quiet)
        tests = case.modes["tests"]
        for one, two in pairwise(tests):
            for a, b in zip(one["modes"], two["modes"], strict=True):
                sd = math.hypot(a["frequency_sd_hz"], b["frequency_sd_hz"])
                z.append((a["frequency_hz"] - b["frequency_hz"]) / sd)
    assert len(z) > 500
    assert np.std(z) == pytest.approx(1.0, abs=0.1)


def _hanger(*needs: str) -> Hanger:
    return draw_hanger(Draws(12, 1), frozenset(needs), Nuisances())


@pytest.mark.parametrize("cause", CAUSES)
def test_plant_vanishes_with_its_size(cause: str) -> None:
    hanger = _hanger("shapes", "levels", "temperatures")
    sound = solve(hanger, ())
    slopes = find_slopes(hanger, sound, Nuisances())
    faults = [Fault(cause, size * CAUSES[cause].low, 0.37) for size in (0.005, 1.0)]
    small, large = (compare(hanger, sound, solve(hanger, (fault,)), slopes)[1] for fault in faults)
    assert small < 0.1 * large
    assert large > 0


@pytest.mark.parametrize(
    ("cause", "sign"),
    [
        *(("mass at a point", -1), ("guide", 1), ("end that turns", -1), ("end that gives", -1)),
        *(("mass all along", -1), ("mass over a stretch", -1), ("stiff end", 1), ("crack", -1)),
        *(("joints that soften", -1), ("loose wire", 1), ("other length", -1)),
        *(("clock in all tests", 1), ("other stiffness", 1)),
    ],
)
def test_plant_changes_frequencies_by_sign(cause: str, sign: int) -> None:
    hanger = _hanger("levels")
    fault = Fault(cause, CAUSES[cause].low * 3, 0.37)
    sound, faulty = solve(hanger, ()), solve(hanger, (fault,))
    changes = np.concatenate(
        [
            faulty.modes[key].frequencies_hz * faulty.clock[key[0]] / modes.frequencies_hz - 1
            for key, modes in sound.modes.items()
        ]
    )
    assert (sign * changes > -1e-6).all()  # other nodes
    assert (sign * changes > 1e-5).any()


def test_plant_temperature_and_level() -> None:
    hanger = _hanger("levels", "temperatures")
    warm = Fault("tension with temperature", 0.002)
    tensions = [plant(warm, hanger.bars[0], 0, i, hanger).tension_n for i in range(2)]
    cold_c, warm_c = (visit.temperature_c for visit in hanger.visits[:2])
    assert tensions[1] - tensions[0] == pytest.approx(
        0.002 * hanger.bars[0].tension_n * (warm_c - cold_c)
    )
    wire = solve(hanger, (Fault("loose wire", 0.5, 0.37, detail=1.0),))
    sound = solve(hanger, ())
    softest = min(range(len(hanger.visits)), key=lambda i: hanger.visits[i].level)
    for (number, plane), modes in wire.modes.items():
        changed = modes.frequencies_hz / sound.modes[number, plane].frequencies_hz - 1
        if number == softest:
            assert np.abs(changed).max() < 1e-6


def test_compare_forgives_tolerances() -> None:
    """A bar that is stiffer by two standard deviations is sound; by twenty it is not."""
    hanger, n = _hanger(), Nuisances()
    sound = solve(hanger, ())
    slopes = find_slopes(hanger, sound, n)
    seen = [
        compare(hanger, sound, solve(hanger, (Fault("other stiffness", size),)), slopes)
        for size in (2 * n.modulus, 20 * n.modulus)
    ]
    assert seen[0][0] < 2.0 < seen[1][0]
    assert seen[0][1] > 5.0
