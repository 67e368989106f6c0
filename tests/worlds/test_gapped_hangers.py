"""The proof of the world of gapped hangers: closed forms first, then what it draws."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.worlds.eight_kinds import Member, Zone, natural_frequencies_hz
from tests.worlds.gapped_hangers import (
    CAUSES,
    Draws,
    Fault,
    Hanger,
    Nuisances,
    compare,
    draw_hanger,
    find_slopes,
    make_case,
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


def test_make_case_repeats() -> None:
    one, two = (make_case(3, 7, ("crack",)) for _ in range(2))
    assert (one.hanger_toml, one.modes, one.truth) == (two.hanger_toml, two.modes, two.truth)
    assert one.modes != make_case(4, 7, ("crack",)).modes


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
