"""The class that a diagnosis starts from is the beam that the data prefer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap import GapOptions, diagnose
from shm.gap.causes.baseline import AS_DESCRIBED, choose_baseline, find_richer
from shm.gap.hypotheses.contract import Hypothesis
from shm.models.effects import Variant
from shm.values import PLANES, Hanger, ModalTest, Mode, Supports
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import HANGER, campaign, problem_of
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
