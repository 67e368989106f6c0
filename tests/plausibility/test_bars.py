"""Whose modes a test holds: planted swaps, rates and planes are doubted, real changes are not.

Frequencies come from the classes' own bar, exact but for a scatter of 0.01 %: what is tested is the
reasoning.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.models import build
from shm.models.classes.base import Conditions
from shm.plausibility.bars import Known, OtherOrigin, doubt_of
from shm.values import PLANES, AddedMass, Hanger, ModalTest, Mode
from tests.helpers.hangers import HANGER_3

LENGTHS = (5.0, 7.0, 9.0, 11.0, 12.0)
BRIDGE = tuple(
    replace(HANGER_3, id=number, plate=None, length_m=length)
    for number, length in enumerate(LENGTHS, start=1)
)
NINE, ELEVEN = BRIDGE[2], BRIDGE[3]
TENSIONS = dict(zip(BRIDGE, (0.9, 1.1, 1.0, 0.95, 1.05), strict=True))


def a_test(
    hanger: Hanger,
    seed: int = 1,
    *,
    tension: float = 1.0,
    ends: float = 1.0,
    deck: float = 1.0,
    mass: AddedMass | None = None,
    modes: int = 6,
) -> ModalTest:
    """Both planes of a bar on springs of 20 and 60 EI/L, each times `ends`, at the deck `deck`."""
    model = build("beam3", hanger)
    unit = hanger.bending_stiffness_n_m2 / hanger.length_m
    springs = np.log10(np.array([20 * deck, 60 * deck, 25, 50]) * ends * unit)
    known = dict(zip((f"log10_k{n}" for n in (1, 2, 3, 4)), springs, strict=True))
    known |= {"theta_F": tension * TENSIONS.get(hanger, 1.0), "theta_L": 1.0}
    theta = model.pack({name: known.get(name, 0.0) for name in model.parameter_names})
    exact = model.frequencies_at(theta[None], modes, Conditions(added_mass=mass))[0]
    rng = np.random.default_rng(seed)
    found = tuple(
        Mode(plane, order + 1, float(f * np.exp(1e-4 * rng.standard_normal())), float(1e-4 * f))
        for plane, row in zip(PLANES, exact, strict=True)
        for order, f in enumerate(row)
    )
    return ModalTest(f"t{seed}", found, hanger=hanger.id)


def known(hanger: Hanger, tests: int) -> Known:
    """With tests of slightly different temperatures."""
    warmth = 1 + 0.005 * np.random.default_rng(hanger.id).standard_normal(tests)
    return Known(
        hanger, tuple(a_test(hanger, 10 + n, tension=float(t)) for n, t in enumerate(warmth))
    )


def doubted(
    test: ModalTest, hanger: Hanger, tests: int, of_others: int | None = None
) -> OtherOrigin | None:
    rest = tests if of_others is None else of_others
    others = [known(other, rest) for other in BRIDGE if other is not hanger]
    return doubt_of(test, known(hanger, tests), others)


def scaled(test: ModalTest, factor: float) -> ModalTest:
    return replace(
        test,
        modes=tuple(replace(m, frequency_hz=factor * m.frequency_hz) for m in test.modes),
    )


@pytest.mark.parametrize(("tests", "of_others"), [(0, 0), (0, 1), (1, 0), (1, 1), (5, 5)])
def test_another_hangers_modes_are_doubted_and_that_hanger_is_named(
    tests: int, of_others: int
) -> None:
    """An 11 m hanger's test filed under the 9 m one, which a free length would have taken."""
    found = doubted(a_test(ELEVEN), NINE, tests, of_others)
    assert found is not None
    assert (found.kind, found.hanger) == ("hanger", ELEVEN.id)
    assert found.text == "The modes fit hanger 4 rather than hanger 3: right hanger?"
    assert found.probability > 0.95


@pytest.mark.parametrize("tests", [0, 1, 5])
@pytest.mark.parametrize(
    "change",
    [
        {},
        {"tension": 0.95},
        {"tension": 0.8},
        {"ends": 1 / 3},
        {"deck": 1 / 3},
        {"mass": AddedMass(8.0, 3.1)},
    ],
    ids=str,
)
def test_a_real_change_is_of_the_same_hanger(change: dict[str, float], tests: int) -> None:
    assert doubted(a_test(NINE, **change), NINE, tests) is None  # type: ignore[arg-type]


@pytest.mark.parametrize("tests", [1, 5])
@pytest.mark.parametrize("factor", [2.0, 0.5, 1.024, 1000 / 1024, 0.1, 0.8])
def test_a_wrong_rate_is_told_from_a_tension(factor: float, tests: int) -> None:
    """A tension moves high modes of a bar that bends less than low ones, a time base all alike."""
    found = doubted(scaled(a_test(NINE), factor), NINE, tests)
    assert found is not None
    assert found.kind == "time base"
    assert found.factor == pytest.approx(factor, rel=0.02)
    assert "right sampling rate?" in found.text


@pytest.mark.parametrize("factor", [2.0, 0.1])
def test_a_first_test_at_a_rate_that_is_wrong_by_far_is_doubted(factor: float) -> None:
    found = doubted(scaled(a_test(NINE), factor), NINE, 0)
    assert found is not None
    assert found.probability > 0.95


def test_exchanged_planes_are_doubted_where_they_differ() -> None:
    test = a_test(NINE)
    other = {"transverse": "longitudinal", "longitudinal": "transverse"}
    crossed = tuple(replace(m, plane=other[m.plane]) for m in test.modes)  # type: ignore[arg-type]
    found = doubted(replace(test, modes=crossed), NINE, 3)
    assert found is not None
    assert found.kind == "planes"


def test_a_bar_that_is_not_of_the_bridge_is_doubted_by_the_description_alone() -> None:
    """A 60 mm bar's modes filed under hanger 3 of 130 mm."""
    thin = replace(
        HANGER_3,
        plate=None,
        diameter_m=0.06,
        area_m2=np.pi * 0.06**2 / 4,
        second_moment_m4=np.pi * 0.06**4 / 64,
        mass_per_length_kg_m=7800 * np.pi * 0.06**2 / 4,
        nominal_tension_n=150e3,
    )
    found = doubt_of(a_test(thin), Known(HANGER_3), [])
    assert found is not None
    assert found.kind == "unknown bar"
    assert "right hanger, right description?" in found.text


def test_twins_without_a_test_of_their_own_are_not_told_apart() -> None:
    twin = replace(NINE, id=9)
    assert doubt_of(a_test(NINE), Known(twin), [known(NINE, 3)]) is None


@pytest.mark.parametrize(("tension", "doubt"), [(1.0, False), (1.1, True)])
def test_a_hanger_back_at_its_baseline_is_not_its_sister(tension: float, doubt: bool) -> None:
    """An identical one hangs as tight as it once did, or tighter: then it is that one."""
    baseline = known(NINE, 4).tests
    lost = tuple(a_test(NINE, 20 + n, tension=0.85) for n in range(5))
    sister = replace(NINE, id=9)
    of_sister = [a_test(NINE, 30 + n, tension=tension * 1.003) for n in range(2)]
    mine = Known(NINE, (*baseline, *lost), baseline)
    found = doubt_of(a_test(NINE, tension=tension), mine, [Known(sister, tuple(of_sister))])
    assert (found is not None and found.hanger == sister.id) is doubt


def test_one_mistaken_mode_and_missing_ones_are_no_other_hanger() -> None:
    test = a_test(NINE)
    wrong = replace(test.modes[3], frequency_hz=test.modes[4].frequency_hz * 0.97)
    left = (*test.modes[1:3], wrong, *test.modes[5:])
    assert doubted(replace(test, modes=left), NINE, 3) is None


def test_a_known_mass_clamped_on_is_allowed_for() -> None:
    mass = AddedMass(25.0, 2.7)
    test = replace(a_test(NINE, mass=mass), added_mass=mass)
    assert doubted(test, NINE, 3) is None
