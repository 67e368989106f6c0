"""Where a local cause is looked for, and found."""

from __future__ import annotations

import numpy as np
import pytest

from shm.gap.contract import Hypothesis, Observations
from shm.gap.places import Change, Misfit, places
from shm.simulate import HangerState, PlantedEffect
from tests.helpers.gap_campaigns import fit_of, problem_of
from tests.helpers.hangers import HANGER_3
from tests.helpers.toy_gap import BASELINE, SD, ToyProblem, design_of, tension
from tests.helpers.toy_gap import campaign as conditions
from tests.worlds.simulated.campaign import CampaignPlan, campaign

STATE = HangerState(711e3)
SHAPES = CampaignPlan(temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0, as_made=False)
FREQUENCIES = CampaignPlan(
    temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0, as_made=False, shapes=False
)


def diagnosed(effect, plan, seed=1):
    """The places of a campaign with `effect` planted, by kind."""
    tests = campaign(HANGER_3, STATE, (effect,), plan, np.random.default_rng(seed))
    problem = problem_of(tests, hanger=HANGER_3)
    before = fit_of(problem, Hypothesis())
    return {place.kind: place for place in places(problem, before)}


def fourth_mode_off():
    """A toy whose fourth mode lies 1 % above what the tension can follow, in five tests."""
    design = design_of(conditions(), [(0, order) for order in range(1, 7)])
    noise = SD * np.random.default_rng(1).standard_normal(design.size)
    value = 0.01 * (design.frequency_order == 4) + noise
    return ToyProblem(Observations(design, value, np.full(design.size, SD)), {BASELINE: tension})


def clamp(x_m, mass_kg=12.0):
    return PlantedEffect("point_mass", "everywhere", {"mass_kg": mass_kg, "x_m": x_m})


def test_a_cause_of_the_wrong_sign_or_too_large_explains_no_more_than_its_bounds_allow():
    problem = fourth_mode_off()
    misfit = Misfit.of(problem, problem.fit())
    right = (problem.observations.design.frequency_order == 4)[None].astype(float)
    deviation = misfit.deviation[None]
    assert Change(deviation, -right, np.inf).left(misfit)[0] == pytest.approx(misfit.total)
    assert Change(deviation, right, 0.001).sizes(misfit)[0] == 0.001


@pytest.fixture(scope="module")
def clamped_at_3_4():
    return diagnosed(clamp(3.4), SHAPES)


def test_a_mass_is_found_where_it_was_clamped_on(clamped_at_3_4):
    found = clamped_at_3_4["point mass"]
    assert found.x_m == pytest.approx(3.4, abs=0.1)
    assert found.low_m - 0.05 < 3.4 < found.high_m + 0.05
    assert found.high_m - found.low_m < 0.5
    assert found.share > 0.9


def test_a_mass_explains_more_of_its_gap_than_other_kinds(clamped_at_3_4):
    assert max(clamped_at_3_4.values(), key=lambda place: place.share).kind == "point mass"


def test_frequencies_alone_show_the_place_and_its_mirror_image():
    found = diagnosed(clamp(3.4), FREQUENCIES)["point mass"]
    x_m, density = np.array(found.profile).T
    assert density[x_m < 6].sum() / density.sum() == pytest.approx(0.5, abs=0.25)
    assert density[np.abs(np.abs(x_m - 6) - 2.6) < 0.3].sum() / density.sum() > 0.99
    assert min(found.x_m, 12.0 - found.x_m) == pytest.approx(3.4, abs=0.2)
    assert found.low_m < 3.6
    assert found.high_m > 8.4


def test_the_profile_is_a_density_along_the_whole_hanger(clamped_at_3_4):
    x_m, density = np.array(clamped_at_3_4["point mass"].profile).T
    assert density.sum() * (x_m[1] - x_m[0]) == pytest.approx(1)
    assert (x_m[0], x_m[-1]) == pytest.approx((0, 12), abs=0.05)


@pytest.mark.parametrize(
    ("at", "name", "x_m"), [("deck end", "log10_k", 0.0), ("arch end", "log10_k", 12.0)]
)
def test_an_end_that_turns_is_found_at_its_end(at, name, x_m):
    first = 1 if at == "deck end" else 3
    springs = {f"{name}{first}": 7.0, f"{name}{first + 1}": 7.0}
    found = diagnosed(PlantedEffect("rotational_end_flexibility", at, springs), SHAPES)
    best = max(found.values(), key=lambda place: place.share)
    assert found["flexible end"].x_m == x_m
    assert found["flexible end"].low_m == found["flexible end"].high_m == x_m
    assert best.share - found["flexible end"].share < 0.05


def test_a_spring_is_found_where_it_holds_the_hanger():
    spring = {"stiffness_n_m": 4e5, "x_m": 2.0}
    found = diagnosed(PlantedEffect("intermediate_support", "everywhere", spring), SHAPES)
    assert found["lateral spring"].x_m == pytest.approx(2.0, abs=0.2)
    assert found["lateral spring"].share > 0.9


def test_where_nothing_is_wrong_no_place_is_claimed():
    tests = campaign(HANGER_3, STATE, (), SHAPES, np.random.default_rng(3))
    problem = problem_of(tests, hanger=HANGER_3)
    before = fit_of(problem, Hypothesis())
    assert all(place.share < 0.3 for place in places(problem, before))
