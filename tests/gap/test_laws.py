"""An allowance for the error of an effect's own law."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from shm.gap.contract import Fit, Hypothesis
from shm.gap.fit import baseline_fit, fitted
from shm.gap.laws import EXACT, by_its_laws
from shm.gap.observations import observed
from shm.gap.problem import GapProblem
from shm.models.effects import EFFECTS
from shm.simulate import CampaignPlan, HangerState, PlantedEffect, campaign
from shm.simulate.reality import Reality
from tests.helpers.hangers import HANGER_3

WORN = PlantedEffect("section_loss", "everywhere", {"loss": 0.3, "x_m": 4.0, "extent_m": 2.0})
TENSION_N = 711e3


@cache
def _gain(effect: str, own_laws: bool) -> tuple[float, Fit, Fit, GapProblem]:
    """What allowing for its law gains a fit of `effect` to worn bars, the fit then and before."""
    plan = CampaignPlan(
        modes=6, temperatures_c=(10.0,), amplitudes=(1.0,), reality=Reality(own_laws=own_laws)
    )
    tests = campaign(HANGER_3, HangerState(TENSION_N), [WORN], plan, np.random.default_rng(3))
    problem = GapProblem(HANGER_3, "beam1", observed(tests, HANGER_3))
    rng = np.random.default_rng(1)
    baseline = baseline_fit(problem, rng)
    (variant, *_) = EFFECTS[effect].variants(HANGER_3, problem.design.survey)
    before = fitted(problem, Hypothesis(((effect, variant),)), rng)
    gain, after = by_its_laws(problem, baseline, before, rng)
    return gain, after, before, problem


def _off(problem: GapProblem, fit: Fit) -> float:
    """How far its loss is off the planted one, in standard deviations."""
    own = problem.names(fit.hypothesis).index("loss")
    loss = problem.theta(fit.hypothesis, fit.draws)[:, own]
    return float(abs(loss.mean() - WORN.values["loss"]) / loss.std())


def test_corrosion_without_edges_is_still_corrosion_and_its_size_is_right() -> None:
    gain, after, before, problem = _gain("section_loss", True)
    assert gain > 20
    assert after.log_fit > before.log_fit + 20
    assert _off(problem, after) < 3 < _off(problem, before)


def test_an_exact_law_pays_little_for_the_allowance() -> None:
    gain, after, before, _ = _gain("section_loss", False)
    assert np.log(EXACT) <= gain < 1.0
    assert after is before


def test_another_effect_is_not_excused_by_its_laws() -> None:
    """A mass in place of the corrosion: what it does not do, no law of it does."""
    _, _, right, _ = _gain("section_loss", True)
    wrong_gain, _, wrong, _ = _gain("point_mass", True)
    right_gain, *_ = _gain("section_loss", True)
    assert wrong.log_evidence + wrong_gain < right.log_evidence + right_gain - 20


def test_a_law_that_shifts_its_action_from_mode_to_mode_is_forgiven() -> None:
    """Modes that the catalogue leaves alone move as much as the others, by a tenth of these."""
    _, _, fit, problem = _gain("section_loss", False)
    rng = np.random.default_rng(1)
    baseline, count = baseline_fit(problem, rng), problem.design.frequencies
    typical = np.sqrt(np.mean((fit.predicted - baseline.predicted)[:count] ** 2))
    gains = []
    for _ in range(5):
        away = problem.observations.value.copy()
        away[:count] += 0.2 * typical * rng.standard_normal(count)
        moved = GapProblem(HANGER_3, "beam1", replace(problem.observations, value=away))
        gains.append(by_its_laws(moved, baseline, fit, rng)[0])
    assert np.median(gains) > 50
