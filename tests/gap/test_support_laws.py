"""A support with more than one mode is still a support that swings along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.assumptions import DEFAULTS
from shm.gap.contract import Fit, Hypothesis
from shm.gap.fit import baseline_fit, fitted
from shm.gap.law_error import ByLaws, by_its_laws
from shm.gap.model_probabilities import CALIBRATION
from shm.gap.observations import observed
from shm.gap.problem import GapProblem
from shm.models.effects import EFFECTS
from shm.simulate import HangerState, PlantedEffect
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.campaign import CampaignPlan, campaign
from tests.worlds.simulated.reality import Reality

# The campaign's two tests are of one tension.
HANGER = replace(HANGER_3, assumptions=DEFAULTS.with_numbers(tension_between_tests=1e-6))
AT = "deck end, transverse"
DECK = PlantedEffect(
    "support_motion", AT, {"support_mass_kg": 2000.0, "support_frequency_hz": 16.0}
)
TENSION_N = 711e3


def _by_laws(own_laws: bool) -> tuple[ByLaws, Fit]:
    """A fit of the support by its laws, and before."""
    plan = CampaignPlan(
        modes=6, temperatures_c=(10.0,), amplitudes=(1.0,), reality=Reality(own_laws=own_laws)
    )
    tests = campaign(HANGER, HangerState(TENSION_N), [DECK], plan, np.random.default_rng(3))
    problem = problem_of(tests, hanger=HANGER)
    rng = np.random.default_rng(1)
    effect = EFFECTS["support_motion"]
    (at,) = [e for e in effect.variants(HANGER, problem.design.survey) if e.at == AT]
    baseline = fit_alone(problem, rng)
    before = fitted(problem, Hypothesis((("support_motion", at),)), rng)
    return by_its_laws(problem, baseline, before, rng), before


def test_a_deck_with_a_second_mode_is_forgiven_and_fitted() -> None:
    found, before = _by_laws(own_laws=True)
    assert found.gain > 10
    assert found.fit.log_fit > before.log_fit + 10


def test_a_deck_with_one_mode_pays_little_for_the_allowance() -> None:
    found, before = _by_laws(own_laws=False)
    assert np.log(CALIBRATION.exact.own) <= found.gain < 1.0
    assert found.fit is before
