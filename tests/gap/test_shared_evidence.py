"""The evidence of one hanger for effects that it may share, read back from its diagnosis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.contract import GapOptions
from shm.gap.probabilities import NO_GAP, SINGLE, UNKNOWN
from shm.gap.scan import VISIBLE
from shm.gap.search import Attribution, attribute
from shm.gap.shared_evidence import SHARING, HangerEvidence, weigh_hanger
from shm.simulate import HangerState, PlantedEffect
from tests.helpers.diagnoses import a_diagnosis
from tests.helpers.effects import all_but
from tests.helpers.gap_campaigns import problem_of
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.campaign import CampaignPlan, campaign

ROD = replace(HANGER_3, plate=None)
PLAN = CampaignPlan(
    modes=5, temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0, shapes=False, as_made=False
)
PLACE = ("distributed_mass", "everywhere")


def weigh(*planted: PlantedEffect) -> tuple[Attribution, HangerEvidence]:
    """Weigh a hanger by a catalogue of one effect."""
    tests = campaign(ROD, HangerState(711e3), planted, PLAN, np.random.default_rng(1))
    options = GapOptions(without=all_but(PLACE[0]), draws=200)
    found = attribute(problem_of(tests, hanger=ROD), options, np.random.default_rng(1))
    return found, weigh_hanger(ROD, tests, a_diagnosis(), found, np.random.default_rng(1))


@pytest.fixture(scope="module")
def sound() -> tuple[Attribution, HangerEvidence]:
    return weigh()


@pytest.fixture(scope="module")
def heavier() -> tuple[Attribution, HangerEvidence]:
    return weigh(PlantedEffect(*PLACE, {"mass_change": 0.12}))


def test_the_likelihoods_give_the_probabilities_back(
    heavier: tuple[Attribution, HangerEvidence],
) -> None:
    found, evidence = heavier
    effect = evidence.effects[PLACE]
    chance = SINGLE * effect.weight[effect.visible].sum() / np.ptp(effect.sizes.ends)
    assert chance == pytest.approx(found.explanations[0].probability, rel=1e-6)
    assert NO_GAP * evidence.no_gap == pytest.approx(found.no_gap_probability)
    assert UNKNOWN * evidence.unknown == pytest.approx(found.unexplained_probability)


def test_visible_points_are_draws_of_the_size(
    heavier: tuple[Attribution, HangerEvidence],
) -> None:
    effect = heavier[1].effects[PLACE]
    low, high = effect.sizes.ends
    assert low <= effect.x[effect.visible].min() <= effect.x[effect.visible].max() <= high
    size = effect.sizes.value(effect.x[effect.visible])
    assert np.quantile(size, 0.02) < 0.12 < np.quantile(size, 0.98)


def test_a_smaller_size_is_less_told_from_none(
    sound: tuple[Attribution, HangerEvidence],
) -> None:
    effect = sound[1].effects[PLACE]
    small = ~effect.visible
    order = np.argsort(effect.x[small])
    told = np.abs(np.log(effect.weight[small] / SHARING.step)[order])
    assert told[0] < 0.5 * told[-1]
    assert told.max() < VISIBLE**2


def test_the_tension_follows_the_size(heavier: tuple[Attribution, HangerEvidence]) -> None:
    effect = heavier[1].effects[PLACE]
    visible = effect.visible
    assert np.corrcoef(effect.x[visible], effect.tension_n[visible])[0, 1] > 0.5
    assert effect.tension_n[visible].mean() > effect.tension_n[~visible].mean()
