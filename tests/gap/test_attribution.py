"""Which effect: planted in campaigns by the simulator, which shares no code with the models."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shm.gap.contract import GapOptions, Hypothesis
from shm.gap.probabilities import ScoredHypothesis
from shm.gap.search import Attribution, Explanation, attribute, hardly_behind
from shm.simulate import HangerState, PlantedEffect
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import HANGER, problem_of
from tests.helpers.slow import few_of
from tests.worlds.simulated.campaign import CampaignPlan, campaign

CLAMP = PlantedEffect("point_mass", "everywhere", {"mass_kg": 4.0, "x_m": 3.4})
SWING = PlantedEffect("geometric_hardening", "everywhere", {"hardening": 0.003})
KNOWN = ("point_mass", "geometric_hardening", "timebase")
MORE = (*KNOWN, "temperature_tension", "sensor_mass")
STATE = HangerState(711e3)
PLAN = CampaignPlan(modes=5, temperatures_c=(0.0, 20.0), amplitudes=(1.0, 2.0))


@cache
def _found(
    *effects: str, known: tuple[str, ...] = KNOWN, seed: int = 1
) -> tuple[Attribution, tuple[tuple[str, float], ...]]:
    planted = [each for each in (CLAMP, SWING) if each.name in effects]
    tests = campaign(HANGER, STATE, planted, PLAN, np.random.default_rng(seed))
    problem = problem_of(tests)
    told: list[tuple[str, float]] = []
    found = attribute(
        problem,
        GapOptions(without=all_but(*known)),
        np.random.default_rng(seed),
        lambda label, fraction: told.append((label, fraction)),
    )
    return found, tuple(told)


def test_nothing_planted_is_no_gap() -> None:
    found, _ = _found(known=MORE)
    assert found.leading is None
    assert found.no_gap_probability > 0.5
    assert all(each.log_occam <= 0 for each in found.explanations)


def test_the_planted_effect_is_named_with_its_size() -> None:
    found, _ = _found("point_mass")
    assert found.leading is not None
    assert found.leading.effect == "point_mass"
    assert found.leading.probability > 0.7
    assert found.p_value > 0.01


@pytest.mark.parametrize(
    ("effects", "known"),
    few_of(
        [((), MORE), (("point_mass",), KNOWN), (("point_mass", "geometric_hardening"), KNOWN)], 1
    ),
)
def test_probabilities_add_to_one(effects: tuple[str, ...], known: tuple[str, ...]) -> None:
    found, _ = _found(*effects, known=known)
    causes = sum(each.probability for each in found.explanations)
    total = causes + found.no_gap_probability + found.unexplained_probability
    assert total == pytest.approx(1.0)


@pytest.mark.slow
def test_two_planted_effects_are_named_as_a_pair() -> None:
    found, _ = _found("point_mass", "geometric_hardening")
    assert found.leading is not None
    assert set(found.leading.effect.split(" + ")) == {"point_mass", "geometric_hardening"}


def test_an_effect_that_is_not_in_the_catalogue_is_unexplained() -> None:
    known = tuple(name for name in KNOWN if name != "point_mass")
    found, _ = _found("point_mass", known=known)
    assert found.unexplained_probability > 0.9
    assert found.unexplained.hypothesis.flexible


def test_evidence_is_what_the_fit_gains_less_what_freedom_costs() -> None:
    found, _ = _found("point_mass")
    for each in found.explanations:
        assert each.log_bayes_factor == pytest.approx(each.log_fit + each.log_occam)
        assert each.log_occam <= 1e-9
    assert found.explanations[0].log_occam < 0


def test_explanations_come_likeliest_first() -> None:
    chances = [each.probability for each in _found("point_mass")[0].explanations]
    assert chances == sorted(chances, reverse=True)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_answer() -> None:
    known = ("point_mass", "timebase")
    again = _found.__wrapped__("point_mass", known=known)[0]
    first = _found.__wrapped__("point_mass", known=known)[0]
    assert [e.probability for e in again.explanations] == [
        e.probability for e in first.explanations
    ]


@pytest.mark.slow
def test_progress_is_told_and_never_goes_back() -> None:
    _, told = _found("point_mass", "geometric_hardening")
    fractions = [fraction for _, fraction in told]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


def test_attribute_drowned_effect_alone() -> None:
    """Where the data can show no effect that is left, there is none to explain anything."""
    plan = replace(PLAN, modes=2, shapes=False, mass_share=0.0, frequency_sd=0.03)
    plan = replace(plan, temperatures_c=(10.0,), amplitudes=(1.0,))
    problem = problem_of(campaign(HANGER, STATE, (), plan, np.random.default_rng(1)))
    options = GapOptions(without=all_but("point_mass"))
    found = attribute(problem, options, np.random.default_rng(1))
    assert "drown" in dict(found.invisible)["point_mass"]
    assert found.leading is None
    assert found.explanations == ()


@pytest.mark.parametrize(
    ("log_bayes_factor", "log_fit", "alike"),
    [(7.5, 9.0, True), (6.5, 9.0, False), (6.5, 11.5, True), (2.5, 12.0, False)],
)
def test_a_cause_that_fits_as_well_is_not_told_apart_by_what_its_freedom_costs(
    log_bayes_factor: float, log_fit: float, alike: bool
) -> None:
    best, other = _cause(10.0, 12.0), _cause(log_bayes_factor, log_fit)
    assert hardly_behind(other, best) == alike


def _cause(log_bayes_factor: float, log_fit: float) -> Explanation:
    return Explanation(ScoredHypothesis(Hypothesis(), 0.0, 0.0), (), 0.1, log_bayes_factor, log_fit)
