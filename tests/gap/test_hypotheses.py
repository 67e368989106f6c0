"""The single effects that data could show."""

from __future__ import annotations

import numpy as np
import pytest

from shm.errors import UsageError
from shm.gap.fit import hypotheses, invisible
from shm.gap.observations import observed
from shm.gap.problem import GapProblem
from shm.models.effects import EFFECTS
from shm.simulate import HangerState
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.campaign import CampaignPlan, campaign

SIMULATED = set(EFFECTS) - {"load_scale"}  # no simulated campaign reads a tension


def _problem(baseline: str = "beam1", **plan: object) -> GapProblem:
    tests = campaign(
        HANGER_3, HangerState(711e3), (), CampaignPlan(**plan), np.random.default_rng(1)
    )
    return problem_of(tests, baseline)


def test_a_full_campaign_calls_for_the_whole_catalogue() -> None:
    assert {each.name for each in hypotheses(_problem())} == SIMULATED


def test_every_hypothesis_is_one_effect_without_a_remainder() -> None:
    assert all(len(h.effects) == 1 and not h.flexible for h in hypotheses(_problem()))


def test_an_effect_may_be_taken_out() -> None:
    names = {each.name for each in hypotheses(_problem(), ("point_mass", "sag"))}
    assert names == SIMULATED - {"point_mass", "sag"}


def test_an_effect_that_is_not_in_the_catalogue_cannot_be_taken_out() -> None:
    with pytest.raises(UsageError, match="moonlight"):
        hypotheses(_problem(), ("moonlight",))


def test_end_springs_that_the_baseline_has_are_no_effect() -> None:
    problem = _problem("beam2")
    assert "rotational_end_flexibility" not in {each.name for each in hypotheses(problem)}
    assert "beam2" in invisible(problem)["rotational_end_flexibility"]


def test_effects_that_tests_alike_cannot_show_are_left_out_with_the_reason() -> None:
    problem = _problem(temperatures_c=(10.0,), amplitudes=(1.0,), shapes=False, mass_share=0.0)
    hidden = invisible(problem)
    assert {"temperature_tension", "geometric_hardening", "sensor_misalignment"} <= set(hidden)
    assert not set(hidden) & {each.name for each in hypotheses(problem)}
