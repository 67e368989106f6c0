"""Tensions that were read: what they shift, what their errors leave, and what they save."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.assumptions import DEFAULTS
from shm.gap import GapOptions, diagnose
from shm.gap.hypotheses.contract import Hypothesis
from shm.gap.hypotheses.data_checks import usable
from shm.gap.hypotheses.observations import observed
from shm.models.effects import EFFECTS
from shm.models.hanger import PhysicalHanger, solve
from shm.report.diagnosis_wording import is_of_the_measurement
from shm.values import NAN, FloatArray, ModalTest, Mode, Supports, group_causes
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import problem_of
from tests.helpers.hangers import HANGER_3

ORDERS = (1, 2, 3, 4)
READ_N = (600e3, 650e3, 700e3, 760e3)
SD_N = 10e3
FEW = GapOptions(without=all_but("bending_stiffness", "effective_length", "timebase"), seed=1)
STRING = replace(HANGER_3, bending_stiffness_factor=1e-4, supports=Supports("pinned", "pinned"))


def frequencies_hz(tension_n: FloatArray) -> FloatArray:
    """Of hanger 3 (tests, orders)."""
    bar = PhysicalHanger.clamped(HANGER_3, tension_n)
    return solve(bar, len(ORDERS), np.empty(0), shapes=False).frequency_hz[:, 0]


def loadings(frequency_hz: FloatArray, read_n: tuple[float, ...], sd_n: float) -> list[ModalTest]:
    return [
        ModalTest(
            f"t{number}",
            tuple(
                Mode("transverse", order, float(f), 1e-4 * float(f))
                for order, f in zip(ORDERS, row, strict=True)
            ),
            tension_read_n=read,
            tension_read_sd_n=sd_n if np.isfinite(read) else NAN,
        )
        for number, (row, read) in enumerate(zip(frequency_hz, read_n, strict=True))
    ]


@pytest.mark.parametrize(
    ("read_n", "sd_n", "shifts_n", "shift_sds_n"),
    [
        ((600e3, NAN, 800e3), SD_N, [-100e3, 0.0, 100e3], [SD_N, 0.0, SD_N]),
        ((600e3, NAN), SD_N, [0.0, 0.0], None),  # one alone says nothing
        ((600e3, 650e3), SD_N, [-25e3, 25e3], None),
        ((600e3, 650e3), NAN, [-25e3, 25e3], None),
    ],
)
def test_shifts_count_from_the_mean_of_all_readings(
    read_n: tuple[float, ...], sd_n: float, shifts_n: list[float], shift_sds_n: list[float] | None
) -> None:
    tests = loadings(frequencies_hz(np.full(len(read_n), 7e5)), read_n, sd_n)
    conditions = observed(tests, HANGER_3).design.conditions
    assert [each.tension_shift_n for each in conditions] == shifts_n
    if shift_sds_n is not None:
        assert [each.tension_shift_sd_n for each in conditions] == shift_sds_n


@pytest.mark.parametrize(
    ("read_n", "is_said"),
    [
        ((6e5, 6e5, NAN), True),
        ((6e5, NAN, NAN), True),
        ((6e5, 7e5, NAN), False),
        ((NAN, NAN, NAN), False),
    ],
)
def test_readings_without_a_difference_are_said_to_be_unused(
    read_n: tuple[float, ...], is_said: bool
) -> None:
    hz = frequencies_hz(np.array([7e5, 7.1e5, 7.2e5]))
    remarks = " ".join(usable(loadings(hz, read_n, SD_N), HANGER_3).remarks)
    assert ("The tension read, 600 kN, is not used" in remarks) == is_said


def test_a_readings_error_moves_all_modes_of_its_test_together() -> None:
    """Of a string d ln f/dT = 1/(2 T): half the reading's fraction, in every mode."""
    tests = loadings(np.outer([1.0, 1.0], 3.45 * np.array(ORDERS)), (690e3, 732e3), SD_N)
    problem = problem_of(tests, hanger=STRING)
    level_n = float(problem.tension_n(Hypothesis(), problem.near)[0])
    loads = problem.tensions_of(problem.design)
    assert loads.shape == (8, 2)
    for test, shift_n in enumerate((-21e3, 21e3)):
        own = problem.design.frequency_test == test
        np.testing.assert_allclose(loads[own, test], SD_N / 2 / (level_n + shift_n), rtol=2e-3)
        assert not loads[~own, test].any()


def test_the_tension_differs_a_little_from_test_to_test() -> None:
    """Of a string half of `tension_between_tests` in every mode; a lone test has no other."""
    same = np.outer(np.ones(3), 3.45 * np.array(ORDERS))
    tests = loadings(same, (NAN, NAN, NAN), NAN)
    problem = problem_of(tests, hanger=STRING)
    loads, own = problem.repeated.tensions, problem.design.frequency_test
    share = DEFAULTS.tension_between_tests.value / 2
    level = float(problem.tension_n(Hypothesis(), problem.near)[0]) / STRING.nominal_tension_n
    np.testing.assert_allclose(loads, share / level * (own[:, None] == np.arange(3)), rtol=2e-3)
    alone = problem_of(tests[:1], hanger=STRING)
    assert not alone.repeated.tensions.any()


@pytest.mark.slow
def test_tensions_that_differ_between_tests_are_no_gap_where_they_were_read() -> None:
    """Four loadings, each read to 10 kN, of frequencies that are exact to 0.01 %."""
    rng = np.random.default_rng(3)
    true_n = np.array(READ_N) + SD_N * rng.standard_normal(4)
    measured = frequencies_hz(true_n) * (1 + 1e-4 * rng.standard_normal((4, len(ORDERS))))
    found = diagnose(loadings(measured, READ_N, SD_N), HANGER_3, FEW)
    assert found.leading is None
    assert found.no_gap_probability > 0.5
    tension = found.tension_after_n
    assert tension.q025 < true_n.mean() < tension.q975


SCALES = GapOptions(
    without=all_but("bending_stiffness", "effective_length", "timebase", "load_scale"), seed=1
)


def test_a_cell_that_reads_a_fifth_too_much_is_the_measurements_and_leaves_the_tension() -> None:
    """Four loadings whose frequencies follow the true tensions, while the cell shows 1.2 times."""
    rng = np.random.default_rng(3)
    true_n = np.array(READ_N)
    measured = frequencies_hz(true_n) * (1 + 1e-4 * rng.standard_normal((4, len(ORDERS))))
    read_n = tuple(float(each) for each in 1.2 * true_n)
    found = diagnose(loadings(measured, read_n, 1e3), HANGER_3, SCALES)
    assert found.leading is not None
    assert found.leading.effect == "load_scale"
    assert is_of_the_measurement(group_causes(found.causes)[0])
    (error,) = found.leading.parameters
    assert error.q05 < 0.2 < error.q95
    assert found.tension_after_n.q025 < true_n.mean() < found.tension_after_n.q975


def test_only_a_load_scale_parts_the_true_tension_from_the_one_at_rest() -> None:
    """A known tension that was read a quarter too high is four fifths of it."""
    weighed = replace(HANGER_3, scatter=replace(HANGER_3.scatter, tension=0.01))
    tests = loadings(frequencies_hz(np.full(2, 7e5)), (NAN, NAN), SD_N)
    problem = problem_of(tests, hanger=weighed)
    for name, effect in EFFECTS.items():
        for variant in effect.variants(weighed, problem.design.survey):
            hypothesis = Hypothesis(((name, variant),))
            coordinates = problem.coordinates(hypothesis)
            z = np.zeros((1, coordinates.dimension))
            if name == "load_scale":
                z[:, -1:] = coordinates.effect_z(np.array([[0.25]]), z.shape[1] - 1)
            share = 0.8 if name == "load_scale" else 1.0
            expected = share * weighed.nominal_tension_n
            assert problem.tension_n(hypothesis, z) == pytest.approx(expected), name
