"""The class that a diagnosis starts from is the beam that the data prefer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap import GapOptions, diagnose
from shm.gap.causes.baseline import AS_DESCRIBED, choose_baseline, find_richer, place_sensors
from shm.gap.causes.search import find_starts
from shm.gap.hypotheses.contract import Hypothesis
from shm.gap.hypotheses.problem import GapProblem
from shm.gap.hypotheses.target import Target
from shm.inference.sampler.density import find_peaks, laplace
from shm.models import MODELS, AsMade
from shm.models.effects import Conditions, Variant
from shm.values import PLANES, Hanger, ModalTest, Mode, ShapePoint, Supports
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import HANGER, PLACES_M, campaign, problem_of
from tests.helpers.timoshenko import legendre_hz

FIRM = tuple(
    replace(HANGER.assumptions[name], sd=1e-12)
    for name in ("support_compliance_m_n", "accelerometer_mass_kg")
)
STOCKY = replace(
    HANGER,
    length_m=2.5,
    nominal_tension_n=200e3,
    assumptions=HANGER.assumptions.with_rows(*FIRM),
)
FEW = all_but("shear_and_rotary_inertia", "point_mass", "bending_stiffness")
SD = 2e-4


def measured(hanger: Hanger, modes: int = 6) -> ModalTest:
    """Make a test of a sheared bar with clamped ends, by polynomials."""
    exact_hz = legendre_hz(hanger, hanger.length_m, hanger.nominal_tension_n, modes)
    rng = np.random.default_rng(1)
    rows = [
        (plane, n, float(hz * (1 + SD * rng.standard_normal())))
        for plane in PLANES
        for n, hz in enumerate(exact_hz, 1)
    ]
    return ModalTest("t1", tuple(Mode(plane, n, hz, SD * hz) for plane, n, hz in rows))


SLENDER = campaign(tests=1)
FREE = replace(STOCKY, supports=Supports("free", "free"), nominal_tension_n=0.0)


@pytest.mark.parametrize(
    ("test", "hanger", "given", "expected"),
    [
        (measured(STOCKY), STOCKY, "beam2", "beam2"),
        # Free ends are no beam class's: what takes the ends as they are described applies.
        (measured(STOCKY), FREE, "", AS_DESCRIBED),
        # Of a clamped slender bar no class with springs is much likelier than the clamped one.
        (SLENDER[0], HANGER, "", "beam1"),
    ],
)
def test_choose_baseline(test: ModalTest, hanger: Hanger, given: str, expected: str) -> None:
    found = choose_baseline([test], hanger, GapOptions(given), np.random.default_rng(1))
    assert found.model.name == expected


@pytest.mark.parametrize("baseline", ["", "beam1"])
def test_sheared_bar_is_no_gap_but_by_a_class_without_shear(baseline: str) -> None:
    """The class that the data prefer has shear itself, so that it is no cause."""
    found = diagnose([measured(STOCKY)], STOCKY, GapOptions(baseline, without=FEW))
    shear = "shear_and_rotary_inertia"
    if baseline:
        assert found.leading is not None
        assert shear in found.leading.effect.split(" + ")
        return
    assert found.baseline == "beam3"
    assert found.leads == "no gap"
    assert shear not in [each.effect for each in found.causes]
    low, high = found.tension_after_n.q025, found.tension_after_n.q975
    assert low < STOCKY.nominal_tension_n < high


@pytest.mark.parametrize(
    ("baseline", "effects", "richer"),
    [
        ("beam1", ("shear_and_rotary_inertia", "point_mass"), "beam3"),
        ("beam2", ("section_loss", "shear_and_rotary_inertia"), "beam3"),
        ("beam1", ("rotational_end_flexibility",), "beam2"),
        ("beam1", ("rotational_end_flexibility", "shear_and_rotary_inertia"), "beam3"),
        ("beam3", ("shear_and_rotary_inertia",), None),
        ("beam1", ("point_mass",), None),
    ],
)
def test_find_richer(baseline: str, effects: tuple[str, ...], richer: str | None) -> None:
    """What a beam has itself is no cause of a gap: the diagnosis goes on with that beam."""
    problem = problem_of(SLENDER, baseline)
    found = find_richer(problem, Hypothesis(tuple((each, Variant("")) for each in effects)))
    assert (found.model.name if found else None) == richer


@pytest.mark.parametrize("off_m", [0.0, 0.004, 0.025])
def test_moved_sensors_leave_the_evidence_where_all_is_nearly_linear(off_m: float) -> None:
    tests = [_at(test, PLACES_M[2], PLACES_M[2] - off_m) for test in campaign(shape_sd=0.002)]
    problem = problem_of(tests)
    placed = place_sensors(problem)
    moved_m = np.array(placed.design.places_m) - np.array(problem.design.places_m)
    # The first three also move as a bar of another length has them.
    assert moved_m[2] - moved_m[1:2] == pytest.approx(off_m - 0.007, abs=0.003)
    assert placed.design.survey == problem.design.survey  # what reports name stays
    there = GapProblem(problem.model, tests, placed)
    assert _log_evidence(there) == pytest.approx(_log_evidence(problem), abs=1.0)


def test_sensor_an_inch_off_costs_a_stocky_bar_its_prior_alone() -> None:
    """The stated place is a twentieth of a half wave off in the eighth mode."""
    hanger = replace(HANGER, length_m=4.7, nominal_tension_n=160e3)
    test = shaped(hanger, (0.97, 2.16), 8)
    there, stated = (problem_of([each], hanger=hanger) for each in (test, _at(test, 2.16, 2.185)))
    moved = GapProblem(stated.model, stated.tests, place_sensors(stated))
    true, first_order, found = (_log_evidence(each) for each in (there, stated, moved))
    assert first_order < found - 1
    assert found == pytest.approx(true - 2.5**2 / 2, abs=0.3)  # standard deviations


def _log_evidence(problem: GapProblem) -> float:
    return laplace(find_peaks(Target(problem, Hypothesis()), find_starts(problem)))


def _at(test: ModalTest, real_m: float, stated_m: float) -> ModalTest:
    """State another place of the sensor that is at `real_m`."""
    modes = [
        replace(
            mode,
            shape=tuple(
                replace(point, x_m=stated_m) if point.x_m == real_m else point
                for point in mode.shape
            ),
        )
        for mode in test.modes
    ]
    return replace(test, modes=tuple(modes))


def shaped(hanger: Hanger, places_m: tuple[float, ...], modes: int) -> ModalTest:
    """Make a test of a clamped bar as described, with exact shapes that are good to 0.5 %."""
    model = AsMade(MODELS["beam1"](hanger))
    usual = {"theta_F": 1.0, "theta_L": 1.0} | {name: model.usual(name) for name in model.terms}
    theta = np.array([[usual.get(name, 0.0) for name in model.parameter_names]])
    found = model.with_effects((), places_m).modes(theta, Conditions(), modes)
    rows = [
        Mode(
            plane,
            n + 1,
            float(found.frequency_hz[0, p, n]),
            SD * float(found.frequency_hz[0, p, n]),
            shape=tuple(
                ShapePoint(x_m, float(value[p]), float(value[1 - p]), 0.005)
                for x_m, value in zip(places_m, found.shape[0, p, n], strict=True)
            ),
        )
        for p, plane in enumerate(PLANES)
        for n in range(modes)
    ]
    return ModalTest("t1", tuple(rows), hanger=3)
