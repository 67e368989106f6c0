"""How far a law may be off: of effects in general, and of those that go with the level."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from shm.gap import GapOptions, diagnose
from shm.gap.contract import Fit, Hypothesis
from shm.gap.fit import baseline_fit, fitted
from shm.gap.law_error import allowances, exactly
from shm.gap.observations import observed
from shm.gap.problem import GapProblem
from shm.models.effects import EFFECTS
from shm.simulate import HangerState, PlantedEffect
from shm.values import ModalTest
from tests.helpers.effects import all_but
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.campaign import CampaignPlan, campaign
from tests.worlds.simulated.reality import Reality

SWUNG = PlantedEffect("geometric_hardening", "everywhere", {"hardening": 0.006})


@cache
def _tests() -> list[ModalTest]:
    plan = CampaignPlan(modes=8, mass_share=0.0, reality=Reality())
    return campaign(HANGER_3, HangerState(711e3), [SWUNG], plan, np.random.default_rng(3))


@cache
def _fits(*effects: str) -> tuple[GapProblem, Fit, Fit]:
    problem = GapProblem(HANGER_3, "beam1", observed(_tests(), HANGER_3))
    rng = np.random.default_rng(1)
    survey = problem.design.survey
    variants = ((each, EFFECTS[each].variants(HANGER_3, survey)[0]) for each in effects)
    return problem, baseline_fit(problem, rng), fitted(problem, Hypothesis(tuple(variants)), rng)


@pytest.mark.parametrize("effect", ["section_loss", "geometric_hardening"])
def test_shares_add_to_one(effect: str) -> None:
    problem, baseline, fit = _fits(effect)
    off = [each.share for each in allowances(problem, baseline, fit)]
    for shares in zip(exactly(fit.hypothesis), *off, strict=True):
        assert sum(shares) == pytest.approx(1.0)


def test_what_passes_for_an_effect_may_be_off_wherever_the_effect_may() -> None:
    """Or an effect that is off by the level would be beyond doubt."""
    for effect in ("section_loss", "geometric_hardening"):
        problem, baseline, fit = _fits(effect)
        found = allowances(problem, baseline, fit)
        assert found
        for allowed in found:
            assert allowed.share.unknown >= allowed.share.own / 2


def test_beside_another_effect_only_the_one_that_goes_with_the_level_is_roughly_known() -> None:
    problem, baseline, fit = _fits("geometric_hardening", "timebase")
    alone = problem.predict_at(
        Hypothesis(fit.hypothesis.effects[1:]),
        np.delete(
            problem.theta(fit.hypothesis, fit.z[None]),
            problem.names(fit.hypothesis).index("hardening"),
            axis=1,
        ),
    )[0]
    rough = allowances(problem, baseline, fit)[-1]
    assert rough.off == pytest.approx(0.4 * (fit.predicted - alone))


def test_a_tension_that_rises_with_the_level_is_told_though_each_mode_sees_its_own_share() -> None:
    """As simulated, the wide swing dies away while the other modes still ring."""
    plan = CampaignPlan(modes=6, mass_share=0.0, shapes=False, reality=Reality())
    tests = campaign(HANGER_3, HangerState(711e3), [SWUNG], plan, np.random.default_rng(3))
    few = GapOptions(without=all_but("geometric_hardening", "timebase"))
    found = diagnose(tests, HANGER_3, few)
    assert found.causes[0].effect == "geometric_hardening"
    assert found.causes[0].probability > 0.6
