"""Mistaken modes of a baseline are found, and nothing else is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from shm.values import BaselineCheck, Hanger, ModalTest, Plane
from shm.watch.baseline_check import check_baseline
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import EVERYTHING, frequencies, measured, misnamed

THETA = (1.05, 0.99, 7.4, 7.1, 7.9, 7.3)


def baseline(tests: int, seed: int = 0) -> list[ModalTest]:
    """Sound ones, whose tension and modes differ a little."""
    rng = np.random.default_rng(seed)
    found = []
    for n in range(tests):
        theta = (THETA[0] * (1 + 0.005 * rng.standard_normal()), *THETA[1:])
        hz = frequencies(theta) * np.exp(5e-4 * rng.standard_normal((2, 6)))
        found.append(replace(measured(hz, rng=rng), id=f"t{n}"))
    return found


def told(tests: Sequence[ModalTest]) -> list[tuple[str, str, int]]:
    check = check_baseline(tests, HANGER_3)
    kept = check.accepted_tests(tests)
    left = [len(before.modes) - len(after.modes) for before, after in zip(tests, kept, strict=True)]
    assert sum(left) == len(check.modes)
    return [(each.test, each.plane, each.order) for each in check.modes]


def test_mistakes_of_a_baseline_of_five_are_found_with_what_was_expected() -> None:
    tests = baseline(5)
    tests[1] = misnamed(tests[1], "transverse", 2)
    tests[3] = misnamed(tests[3], "longitudinal", 1)

    check = check_baseline(tests, HANGER_3)
    kept, mistaken = check.accepted_tests(tests), check.modes

    assert [(each.test, each.plane, each.order) for each in mistaken] == [
        ("t1", "transverse", 2),
        ("t3", "longitudinal", 1),
    ]
    own = {(str(mode.plane), mode.order): mode.frequency_hz for mode in tests[0].modes}
    for each in mistaken:
        assert each.expected_hz == pytest.approx(own[each.plane, each.order], rel=0.02)
        assert str(each).startswith(f"{each.plane} {each.order} of test {each.test}: ")
    assert ("transverse", 2) not in {(mode.plane, mode.order) for mode in kept[1].modes}
    assert kept[0] == tests[0]


@pytest.mark.parametrize(("plane", "order"), [("transverse", 1), ("longitudinal", 3)])
def test_a_mistake_of_a_baseline_of_one_is_found_against_the_description(
    plane: Plane, order: int
) -> None:
    assert told([misnamed(baseline(1)[0], plane, order)]) == [("t0", plane, order)]


@pytest.mark.parametrize("tests", [1, 2, 3, 5])
def test_sound_tests_are_left_as_they_are(tests: int) -> None:
    for seed in range(2):
        given = baseline(tests, seed)
        assert check_baseline(given, HANGER_3) == BaselineCheck()


def test_a_cold_day_that_moved_the_tension_by_a_fortieth_is_no_mistake() -> None:
    given = baseline(5)
    cold = measured(frequencies((0.975 * THETA[0], *THETA[1:])))

    assert told([*given, replace(cold, id="cold")]) == []


def test_a_test_of_few_modes_says_nothing_of_its_own_mistakes() -> None:
    test = misnamed(baseline(1)[0], "transverse", 1)

    assert told([replace(test, modes=test.modes[:4])]) == []


THIN = replace(
    HANGER_3,
    length_m=20.0,
    area_m2=np.pi * 0.05**2 / 4,
    second_moment_m4=np.pi * 0.05**4 / 64,
    mass_per_length_kg_m=7800 * np.pi * 0.05**2 / 4,
    nominal_tension_n=300e3,
    diameter_m=0.05,
    plate=None,
)
IN_ONE_PLANE: list[tuple[Plane, int]] = [("transverse", order) for order in range(1, 5)]
SEEDS = pytest.mark.parametrize(
    "seeds", [range(1), pytest.param(range(1, 6), marks=pytest.mark.trial)], ids=["one", "five"]
)
CASES = pytest.mark.parametrize(
    ("hanger", "springs", "modes"),
    [
        (HANGER_3, (7.4, 7.1, 7.9, 7.3), EVERYTHING),
        (HANGER_3, (7.4, 7.1, 7.9, 7.3), IN_ONE_PLANE),
        (THIN, (5.8, 5.6, 6.2, 5.9), EVERYTHING),
        (THIN, (5.8, 5.6, 6.2, 5.9), IN_ONE_PLANE),
    ],
    ids=["thick", "thick, one plane", "thin", "thin, one plane"],
)


def unlike(
    hanger: Hanger,
    springs: Sequence[float],
    modes: Sequence[tuple[Plane, int]],
    seed: int,
    tests: int = 5,
) -> list[ModalTest]:
    """Whose tensions lie within 15 % of each other's, and whose springs within a factor of two."""
    rng, found = np.random.default_rng(seed), []
    for n in range(tests):
        shift = rng.uniform(-0.15, 0.15, len(springs))
        theta = (1 + rng.uniform(-0.15, 0.15), 1.0, *np.add(springs, shift))
        hz = frequencies(theta, hanger=hanger) * np.exp(5e-4 * rng.standard_normal((2, 6)))
        found.append(replace(measured(hz, modes, rng=rng, temperature_c=11.0), id=f"t{n}"))
    return found


@SEEDS
@CASES
def test_other_tensions_and_looser_ends_within_a_baseline_are_no_mistakes(
    hanger: Hanger, springs: Sequence[float], modes: Sequence[tuple[Plane, int]], seeds: range
) -> None:
    for seed in seeds:
        assert check_baseline(unlike(hanger, springs, modes, seed), hanger).left_out == ()


@SEEDS
@CASES
def test_a_wrong_order_a_tone_and_the_other_planes_mode_are_found_all_the_same(
    hanger: Hanger, springs: Sequence[float], modes: Sequence[tuple[Plane, int]], seeds: range
) -> None:
    for seed in seeds:
        tests = unlike(hanger, springs, modes, seed)
        known = {(mode.plane, mode.order): mode.frequency_hz for mode in tests[0].modes}
        wrong = {
            "t0": ("transverse", 2, known["transverse", 3]),
            "t2": ("transverse", 3, 1.04 * tests[2].modes[2].frequency_hz),
        }
        for n, test in enumerate(tests):
            if test.id in wrong:
                plane, order, hz = wrong[test.id]
                changed = tuple(
                    replace(mode, frequency_hz=hz)
                    if (mode.plane, mode.order) == (plane, order)
                    else mode
                    for mode in test.modes
                )
                tests[n] = replace(test, modes=changed)
        found = [
            (each.test, each.plane, each.order) for each in check_baseline(tests, hanger).modes
        ]
        assert found == [("t0", "transverse", 2), ("t2", "transverse", 3)]


@pytest.mark.parametrize("percent", [-1.2, 1.2, 3.0, -10.0])
def test_a_test_with_a_wrong_clock_is_left_out_as_a_whole_and_said(percent: float) -> None:
    tests = [replace(each, temperature_c=11.0) for each in baseline(5)]
    off = tuple(
        replace(mode, frequency_hz=mode.frequency_hz * (1 + percent / 100))
        for mode in tests[1].modes
    )
    tests[1] = replace(tests[1], modes=off)

    check = check_baseline(tests, HANGER_3)

    assert [each.test for each in check.tests] == ["t1"]
    assert "another hanger, or a wrong clock" in str(check.tests[0])
    said = float(str(check.tests[0]).split(" by ")[1].split()[0])
    assert said == pytest.approx(percent, abs=0.3)
    assert check.modes == ()
    assert [test.id for test in check.accepted_tests(tests)] == ["t0", "t2", "t3", "t4"]


def test_a_mode_that_all_tests_number_wrongly_is_a_misfit_not_left_out() -> None:
    tests = [misnamed(each, "transverse", 3) for each in baseline(4)]
    check = check_baseline(tests, HANGER_3)
    assert check.left_out == ()
    assert check.misfit.startswith("transverse 3 of all its tests is +")


def test_a_test_whose_modes_fit_no_state_of_the_description_is_a_misfit() -> None:
    test = baseline(1)[0]
    wild = np.random.default_rng(5).uniform(0.7, 1.4, len(test.modes))
    modes = tuple(
        replace(mode, frequency_hz=mode.frequency_hz * factor)
        for mode, factor in zip(test.modes, wild.tolist(), strict=True)
    )
    check = check_baseline([replace(test, modes=modes)], HANGER_3)
    assert "fit no tension and no end stiffness" in check.misfit
    assert check.left_out == ()


def test_a_check_says_where_it_could_not_have_found_anything() -> None:
    few = replace(baseline(1)[0], modes=baseline(1)[0].modes[:4])
    assert "4 modes" in check_baseline([few], HANGER_3).unchecked
    none = replace(few, modes=())
    assert check_baseline([none], HANGER_3).unchecked
