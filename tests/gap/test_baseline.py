"""The class that a diagnosis starts from is the beam that the data prefer."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shm.errors import UsageError
from shm.gap import GapOptions, diagnose
from shm.gap.baseline import AS_DESCRIBED, choose_baseline, find_richer
from shm.gap.contract import Hypothesis
from shm.models.effects import Variant
from shm.values import PLANES, Diagnosis, Hanger, ModalTest, Mode, Supports
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import HANGER, campaign, problem_of
from tests.helpers.timoshenko import clamped_frequencies_hz

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
    exact_hz = clamped_frequencies_hz(hanger, hanger.length_m, hanger.nominal_tension_n, modes)
    rng = np.random.default_rng(1)
    rows = [
        (plane, n, float(hz * (1 + SD * rng.standard_normal())))
        for plane in PLANES
        for n, hz in enumerate(exact_hz, 1)
    ]
    return ModalTest("t1", tuple(Mode(plane, n, hz, SD * hz) for plane, n, hz in rows))


@cache
def diagnosed(baseline: str) -> Diagnosis:
    return diagnose([measured(STOCKY)], STOCKY, GapOptions(baseline, without=FEW))


def chosen(test: ModalTest, hanger: Hanger, baseline: str = "") -> str:
    options = GapOptions(baseline)
    return choose_baseline([test], hanger, options, np.random.default_rng(1)).model.name


def test_choose_baseline_stocky_sheared() -> None:
    assert chosen(measured(STOCKY), STOCKY) == "beam3"


def test_choose_baseline_given() -> None:
    assert chosen(measured(STOCKY), STOCKY, "beam2") == "beam2"


def test_choose_baseline_unknown_refused() -> None:
    with pytest.raises(UsageError, match="beam9"):
        chosen(measured(STOCKY), STOCKY, "beam9")


def test_choose_baseline_ends_as_described() -> None:
    """Free ends are no beam class's: what takes the ends as they are described applies."""
    free = replace(STOCKY, supports=Supports("free", "free"), nominal_tension_n=0.0)
    assert chosen(measured(STOCKY), free) == AS_DESCRIBED


def test_choose_baseline_clamped_slender() -> None:
    """Of a clamped slender bar no class with springs is much likelier than the clamped one."""
    (test,) = campaign(tests=1)
    assert chosen(test, HANGER) == "beam1"


def test_sheared_bar_is_no_gap() -> None:
    found = diagnosed("")
    assert found.baseline == "beam3"
    assert found.leads == "no gap"
    low, high = found.tension_after_n.q025, found.tension_after_n.q975
    assert low < STOCKY.nominal_tension_n < high


def test_sheared_bar_without_shear_shows_it() -> None:
    found = diagnosed("beam1")
    assert found.leading is not None
    assert "shear_and_rotary_inertia" in found.leading.effect.split(" + ")


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
    problem = problem_of(campaign(tests=1), baseline)
    found = find_richer(problem, Hypothesis(tuple((each, Variant("")) for each in effects)))
    assert (found.model.name if found else None) == richer


def test_diagnose_with_richer_beam() -> None:
    """A stocky bar with a mass is one of beam3 with a mass, not of beam1 with two causes."""
    few = all_but("shear_and_rotary_inertia", "point_mass")
    test = measured(STOCKY)
    found = diagnose([test], STOCKY, GapOptions(without=few))
    assert found.baseline == "beam3"
    assert "shear_and_rotary_inertia" not in [each.effect for each in found.causes]
