"""Mistaken modes of a baseline are found, and nothing else is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from shm.models import described
from shm.values import ModalTest, Plane
from shm.watch.baseline_check import without_mistaken
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import frequencies, measured

THETA = (1.05, 0.99, 7.4, 7.1, 7.9, 7.3)
MODEL = described("beam2", HANGER_3)


def baseline(tests: int, seed: int = 0) -> list[ModalTest]:
    """Sound ones, whose tension and modes differ a little."""
    rng = np.random.default_rng(seed)
    found = []
    for n in range(tests):
        theta = (THETA[0] * (1 + 0.005 * rng.standard_normal()), *THETA[1:])
        hz = frequencies(theta) * np.exp(5e-4 * rng.standard_normal((2, 6)))
        found.append(replace(measured(hz, rng=rng), id=f"t{n}"))
    return found


def misnamed(test: ModalTest, plane: Plane, order: int) -> ModalTest:
    """With the mode above instead of that of `order`."""
    known = {(mode.plane, mode.order): mode.frequency_hz for mode in test.modes}
    modes = tuple(
        replace(mode, frequency_hz=known[plane, order + 1])
        if (mode.plane, mode.order) == (plane, order)
        else mode
        for mode in test.modes
    )
    return replace(test, modes=modes)


def told(tests: Sequence[ModalTest]) -> list[tuple[str, str, int]]:
    kept, mistaken = without_mistaken(tests, MODEL)
    left = [len(before.modes) - len(after.modes) for before, after in zip(tests, kept, strict=True)]
    assert sum(left) == len(mistaken)
    return [(each.test, each.plane, each.order) for each in mistaken]


def test_mistakes_of_a_baseline_of_five_are_found_with_what_was_expected() -> None:
    tests = baseline(5)
    tests[1] = misnamed(tests[1], "transverse", 2)
    tests[3] = misnamed(tests[3], "longitudinal", 1)

    kept, mistaken = without_mistaken(tests, MODEL)

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
        assert without_mistaken(given, MODEL) == (tuple(given), ())


def test_a_cold_day_that_moved_the_tension_by_a_fortieth_is_no_mistake() -> None:
    given = baseline(5)
    cold = measured(frequencies((0.975 * THETA[0], *THETA[1:])))

    assert told([*given, replace(cold, id="cold")]) == []


def test_a_mode_that_two_tests_alone_have_is_left() -> None:
    tests = baseline(5)
    few = [replace(test, modes=test.modes[:-1]) for test in tests[:3]]
    tests[4] = misnamed(tests[4], "longitudinal", 5)
    lacking = [*few, tests[3], replace(tests[4], modes=tests[4].modes)]

    assert told(lacking) == [("t4", "longitudinal", 5)]


def test_a_test_of_few_modes_says_nothing_of_its_own_mistakes() -> None:
    test = misnamed(baseline(1)[0], "transverse", 1)

    assert told([replace(test, modes=test.modes[:4])]) == []
