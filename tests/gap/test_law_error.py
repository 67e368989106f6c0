"""An allowance for the error of an effect's own law."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shm.gap.contract import Fit, Hypothesis
from shm.gap.probabilities import CALIBRATION, ByLaws, allow_for_laws
from shm.gap.problem import GapProblem
from shm.gap.search import fit_alone
from shm.models.effects import EFFECTS
from shm.simulate import PlantedEffect
from tests.helpers.gap_campaigns import HANGER, fit_of, problem_of, simulated
from tests.worlds.simulated.reality import Reality

WORN = PlantedEffect("section_loss", "everywhere", {"loss": 0.3, "x_m": 4.0, "extent_m": 2.0})
CASES = [("section_loss", True), ("section_loss", False), ("point_mass", True)]


@cache
def _by_laws(effect: str, own_laws: bool) -> tuple[ByLaws, Fit, GapProblem]:
    """Fit `effect` to a worn hanger."""
    tests = simulated(WORN, seed=3, mass_share=0.02, reality=Reality(own_laws=own_laws))
    problem, rng = problem_of(tests), np.random.default_rng(1)
    variants = EFFECTS[effect].variants(HANGER, problem.design.survey)
    (variant,) = [each for each in variants if each.at == WORN.at]
    fit = fit_of(problem, Hypothesis(((effect, variant),)))
    return allow_for_laws(problem, fit_alone(problem, rng), fit, rng), fit, problem


def test_allow_for_laws_no_shift_no_gain() -> None:
    """Of an effect that does nothing all laws are one: their weights add to 1."""
    _, fit, problem = _by_laws("section_loss", False)
    found = allow_for_laws(problem, fit, fit, np.random.default_rng(1))
    assert (found.gain, found.mimic) == (pytest.approx(0.0, abs=1e-9), pytest.approx(0.0, abs=1e-9))


@pytest.mark.parametrize(("effect", "own_laws"), CASES)
def test_laws_gain_at_least_log_exact(effect: str, own_laws: bool) -> None:
    """And the tension is as wide as by the exact one at least."""
    found, fit, problem = _by_laws(effect, own_laws)
    assert found.gain >= np.log(CALIBRATION.exact.known)
    assert found.mimic >= np.log(CALIBRATION.exact.unknown)
    after, before = (problem.tension_n(fit.hypothesis, d).std() for d in (found.draws, fit.draws))
    assert after > 0.85 * before


@pytest.mark.slow
def test_worn_without_edges_its_size_right() -> None:
    found, fit, problem = _by_laws("section_loss", True)
    loss = problem.coordinates(fit.hypothesis).effect_values(found.draws)[:, 0]
    assert abs(loss.mean() - WORN.values["loss"]) < 3 * loss.std()


def test_mimic_exceeds_gain_far_off() -> None:
    """What is exactly an effect hardly is something unknown that passes for it, and pays little."""
    exact, *_ = _by_laws("section_loss", False)
    wrong, *_ = _by_laws("point_mass", True)
    assert exact.gain < 1.0
    assert exact.mimic < exact.gain - 0.5
    assert wrong.mimic > wrong.gain + 0.5


def test_another_effect_not_excused() -> None:
    """A mass in place of the corrosion: what it does not do, no law of it does."""
    right, corrosion, _ = _by_laws("section_loss", True)
    wrong, mass, _ = _by_laws("point_mass", True)
    assert mass.log_evidence + wrong.gain < corrosion.log_evidence + right.gain - 10


@pytest.mark.slow
def test_a_law_off_from_mode_to_mode_forgiven() -> None:
    """Modes that the catalogue leaves alone move as much as the others, by a tenth of these."""
    _, fit, problem = _by_laws("section_loss", False)
    rng = np.random.default_rng(1)
    baseline, count = fit_alone(problem, rng), problem.design.frequencies
    typical = np.sqrt(np.mean((fit.predicted - baseline.predicted)[:count] ** 2))
    away = problem.observations.value.copy()
    away[:count] += 0.2 * typical * rng.standard_normal(count)
    observations = replace(problem.observations, value=away)
    moved = GapProblem(problem.model, problem.tests, observations, problem.described)
    assert allow_for_laws(moved, baseline, fit, rng).gain > 50
