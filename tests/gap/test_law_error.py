"""An allowance for the error of an effect's own law."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shm.gap.contract import Fit, Hypothesis
from shm.gap.fit import baseline_fit, fitted
from shm.gap.law_error import ByLaws, by_its_laws
from shm.gap.model_probabilities import CALIBRATION
from shm.gap.observations import observed
from shm.gap.problem import GapProblem
from shm.gap.residuals import predictions, predictive_p_value
from shm.models.effects import EFFECTS
from shm.simulate import HangerState, PlantedEffect
from shm.values import FloatArray
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.campaign import CampaignPlan, campaign
from tests.worlds.simulated.reality import Reality

WORN = PlantedEffect("section_loss", "everywhere", {"loss": 0.3, "x_m": 4.0, "extent_m": 2.0})
TENSION_N = 711e3


@cache
def _by_laws(effect: str, own_laws: bool) -> tuple[ByLaws, Fit, GapProblem]:
    """A fit of `effect` to worn bars, by its laws and before, and the problem."""
    plan = CampaignPlan(
        modes=6, temperatures_c=(10.0,), amplitudes=(1.0,), reality=Reality(own_laws=own_laws)
    )
    tests = campaign(HANGER_3, HangerState(TENSION_N), [WORN], plan, np.random.default_rng(3))
    problem = problem_of(tests)
    rng = np.random.default_rng(1)
    baseline = fit_alone(problem, rng)
    (variant, *_) = EFFECTS[effect].variants(HANGER_3, problem.design.survey)
    before = fitted(problem, Hypothesis(((effect, variant),)), rng)
    return by_its_laws(problem, baseline, before, rng), before, problem


def _off(problem: GapProblem, fit: Fit, draws: FloatArray) -> float:
    """How far its loss is off the planted one, in standard deviations."""
    own = problem.names(fit.hypothesis).index("loss")
    loss = problem.theta(fit.hypothesis, draws)[:, own]
    return float(abs(loss.mean() - WORN.values["loss"]) / loss.std())


def test_corrosion_without_edges_is_still_corrosion_and_its_size_is_right() -> None:
    found, before, problem = _by_laws("section_loss", True)
    assert found.gain > 20
    assert found.fit.log_fit > before.log_fit + 10
    assert _off(problem, before, found.draws) < 3 < _off(problem, before, before.draws)


def test_the_fit_by_a_law_that_is_off_has_draws_of_its_own() -> None:
    found, _, _ = _by_laws("section_loss", True)
    sd = np.sqrt(np.diag(found.fit.covariance))
    assert np.all(abs(found.fit.draws.mean(axis=0) - found.fit.z) < 0.3 * sd)
    assert found.fit.draws.std(axis=0) == pytest.approx(sd, rel=0.2)


def test_an_exact_law_pays_little_for_the_allowance() -> None:
    found, before, _ = _by_laws("section_loss", False)
    assert np.log(CALIBRATION.exact.own) <= found.gain < 1.0
    assert found.fit is before


@pytest.mark.slow
def test_what_is_exactly_an_effect_hardly_is_something_unknown_that_passes_for_it() -> None:
    exact, *_ = _by_laws("section_loss", False)
    wrong, *_ = _by_laws("point_mass", True)
    assert exact.mimic < exact.gain - 0.5
    assert wrong.mimic > wrong.gain + 0.5


def test_another_effect_is_not_excused_by_its_laws() -> None:
    """A mass in place of the corrosion: what it does not do, no law of it does."""
    right, corrosion, _ = _by_laws("section_loss", True)
    wrong, mass, _ = _by_laws("point_mass", True)
    assert mass.log_evidence + wrong.gain < corrosion.log_evidence + right.gain - 20


@pytest.mark.slow
def test_a_law_that_shifts_its_action_from_mode_to_mode_is_forgiven() -> None:
    """Modes that the catalogue leaves alone move as much as the others, by a tenth of these."""
    _, fit, problem = _by_laws("section_loss", False)
    rng = np.random.default_rng(1)
    baseline, count = fit_alone(problem, rng), problem.design.frequencies
    typical = np.sqrt(np.mean((fit.predicted - baseline.predicted)[:count] ** 2))
    away = problem.observations.value.copy()
    away[:count] += 0.2 * typical * rng.standard_normal(count)
    moved = GapProblem(HANGER_3, "beam1", replace(problem.observations, value=away))
    assert by_its_laws(moved, baseline, fit, rng).gain > 50


def test_where_a_law_is_far_off_the_fit_goes_all_the_way() -> None:
    """A joint that slips by another power: one straight step from the exact law does not do."""
    soft = PlantedEffect("joint_softening", "both ends", {"log10_k_at_reference_level": 7.6})
    plan = CampaignPlan(
        modes=6, temperatures_c=(10.0,), mass_share=0.0, shapes=False, reality=Reality()
    )
    tests = campaign(HANGER_3, HangerState(TENSION_N), [soft], plan, np.random.default_rng(3))
    problem = problem_of(tests)
    rng = np.random.default_rng(1)
    baseline = fit_alone(problem, rng)
    variants = EFFECTS["joint_softening"].variants(HANGER_3, problem.design.survey)
    (variant,) = [each for each in variants if each.at == "both ends"]
    before = fitted(problem, Hypothesis((("joint_softening", variant),)), rng)
    found = by_its_laws(problem, baseline, before, rng)
    p_before, p_found = (
        predictive_p_value(problem.observations, predictions(problem, fit), fit.noise)
        for fit in (before, found.fit)
    )
    assert p_before < 1e-6
    assert p_found > 0.01
