"""What to measure next: closed forms of a toy, and what is proposed when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.hypotheses.contract import Hypothesis, Observations
from shm.gap.next_measurement.experiment_design import like_the_present, measured_already, proposals
from shm.gap.next_measurement.foresight import Errors, Foresight, NewTests, divergence
from shm.gap.next_measurement.measurement_plan import NO_GAP, ranked
from shm.models.effects import Conditions, Variant
from shm.simulate import PlantedEffect
from shm.values import AddedMass
from tests.helpers.gap_campaigns import fit_of, problem_of, simulated
from tests.helpers.hangers import HANGER_3
from tests.helpers.toy_gap import SD, ToyProblem, campaign, design_of, repeated, tension

MODES = [(0, order) for order in range(1, 7)]
ONE_TEST = (Conditions("t1"),)
STIFFER = Hypothesis((("bending_stiffness", Variant()),))
WARMER = Hypothesis((("temperature_tension", Variant()),))
LEVEL = Hypothesis((("joint_softening", Variant()),))


def with_order(design):
    """The cause grows with the order, whatever the conditions."""
    return _with(design, 0.002 * design.frequency_order**2)


def with_temperature(design):
    """It does the same in the test that was made, and more the warmer it is."""
    shift = np.array([c.temperature_shift_k for c in design.conditions])[design.frequency_test]
    return _with(design, 0.002 * design.frequency_order**2 + 0.002 * shift)


def with_level(design):
    level = np.array([c.amplitude for c in design.conditions])[design.frequency_test]
    return _with(design, 0.002 * design.frequency_order**2 * level)


def _with(design, own):
    column = np.zeros((design.size, 1))
    column[: design.frequencies, 0] = own
    return np.hstack([tension(design), column])


SLOPES = {
    Hypothesis(): tension,
    STIFFER: with_order,
    WARMER: with_temperature,
    LEVEL: with_level,
}


def toy(conditions=ONE_TEST, modes=MODES, places_m=()):
    design = design_of(conditions, modes, places_m)
    value = with_order(design) @ [0.4, 0.5]
    return ToyProblem(Observations(design, value, np.full(design.size, SD)), SLOPES)


def normal(mean, covariance):
    return Foresight(np.array(mean), np.array(covariance))


def test_the_divergence_of_two_normal_distributions_is_the_closed_form():
    """KL = ln(s2/s1) + (s1^2 + (m1 - m2)^2)/(2 s2^2) - 1/2 (univariate)."""
    one, other = normal([1.0], [[4.0]]), normal([3.0], [[9.0]])
    assert divergence(one, other) == pytest.approx(np.log(1.5) + (4 + 4) / 18 - 0.5)
    assert divergence(one, one) == pytest.approx(0)


def test_what_is_foreseen_of_a_linear_toy_is_its_exact_predictive_distribution():
    """Joint normal of old and new data, the model's errors shared, conditioned on the old."""
    problem, error = toy(), 2e-3
    fit = problem.fit(STIFFER, model_error=error)
    new = like_the_present(problem.observations.design)
    seen = NewTests(problem, new).foresee(fit, Errors.of(problem, fit))
    slopes = np.vstack([with_order(problem.observations.design), with_order(new)])
    shared = error**2 * repeated(new)
    joint = slopes @ slopes.T + SD**2 * np.eye(12) + np.tile(shared, (2, 2))
    gain = joint[6:, :6] @ np.linalg.inv(joint[:6, :6])
    assert seen.mean == pytest.approx(gain @ problem.observations.value, abs=1e-9)
    assert seen.covariance == pytest.approx(joint[6:, 6:] - gain @ joint[:6, 6:], abs=1e-10)


@pytest.mark.parametrize(
    ("rival", "words", "only"),
    [
        (WARMER, "on a day 20 K", "day"),
        (LEVEL, "hit, 3 times the usual level", "hit"),
    ],
)
def test_a_cause_of_conditions_asks_for_other_ones(rival, words, only):
    found = ranked(problem := toy(), [problem.fit(STIFFER), problem.fit(rival)])
    first = found[0]
    assert words in first.what
    assert first.separates == tuple(each.effects[0][0] for each in (STIFFER, rival))
    assert first.expected_log_bayes_factor > 5
    assert all(only in each.what for each in found)


def test_nothing_is_asked_of_what_is_alike_or_out_of_the_race():
    twin = Hypothesis((("distributed_mass", Variant()),))
    problem = toy()
    problem.slopes = {**SLOPES, twin: with_order}
    assert ranked(problem, [problem.fit(STIFFER), problem.fit(twin)]) == ()
    beaten = replace(problem.fit(WARMER), log_evidence=-20.0)
    assert ranked(problem, [problem.fit(STIFFER), beaten]) == ()


def test_no_gap_is_a_contender_by_that_name_and_flexible_fits_are_none():
    problem = toy()
    problem.observations = replace(problem.observations, sd=np.full(6, 0.01))
    stiffer, nothing = problem.fit(STIFFER), problem.fit()
    flexible = replace(nothing, hypothesis=Hypothesis(flexible=True))
    found = ranked(problem, [flexible, stiffer, nothing])
    assert {each.separates for each in found} == {("bending_stiffness", NO_GAP)}
    assert ranked(problem, [stiffer, flexible]) == ()


def test_of_measurements_that_are_as_good_as_certain_the_easier_comes_first():
    problem = toy()
    problem.slopes = {**SLOPES, LEVEL: lambda design: 50 * with_level(design)}
    problem.slopes[WARMER] = lambda design: 50 * with_temperature(design)
    found = ranked(problem, [problem.fit(each) for each in (LEVEL, WARMER)])
    assert [each.expected_log_bayes_factor for each in found[:2]] == [100, 100]
    assert "day" in found[0].what
    assert "hit" in found[1].what


def test_what_was_not_measured_yet_is_proposed():
    kinds = {each.kind for each in proposals(design_of(ONE_TEST, MODES), HANGER_3)}
    assert kinds == {"repeat", "other plane", "more modes", "temperature", "level", "known mass"}
    both = [(plane, order) for plane in (0, 1) for order in range(1, 17)]
    design = design_of(campaign(AddedMass(25.0, 3.6)), both)
    assert set(measured_already(design)) == {"other plane", "temperature", "level", "known mass"}
    assert [each.kind for each in proposals(design, HANGER_3)] == ["repeat"]


def test_proposals_are_worded_for_people():
    """A light hanger gets a light mass."""
    design = design_of(ONE_TEST, MODES)
    said = [each.what for each in proposals(design, HANGER_3)]
    assert "known mass of 25 kg at 3.6 m" in said
    assert "modes 7 and 8" in said
    assert "the longitudinal plane, modes 1 to 6" in said
    assert "a test on a day 20 K colder" in said
    light = replace(HANGER_3, mass_per_length_kg_m=1.5)
    assert "known mass of 0.4 kg at 3.6 m" in [each.what for each in proposals(design, light)]


def test_distributed_mass_against_bending_stiffness_asks_for_a_known_mass_first():
    """After one test of frequencies with the mass planted."""
    mass = PlantedEffect("distributed_mass", "everywhere", {"mass_change": 0.05})
    problem = problem_of(simulated(mass, hanger=HANGER_3, modes=8, shapes=False), hanger=HANGER_3)
    heavier = Hypothesis((("distributed_mass", Variant()),))
    first = ranked(problem, [fit_of(problem, each) for each in (heavier, STIFFER)])[0]
    assert first.what.startswith("known mass of 25 kg at")
    assert first.expected_log_bayes_factor > 5
