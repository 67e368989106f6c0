"""A faint second cause beside a large effect counts as an error of that effect's law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.gap.contract import Fit, Hypothesis
from shm.gap.fit import baseline_fit, fitted
from shm.gap.law_error import without_minor_cause
from shm.gap.model_probabilities import CALIBRATION, ScoredHypothesis, families
from shm.gap.observations import observed
from shm.gap.problem import GapProblem
from shm.models.effects import Variant
from shm.simulate import HangerState, PlantedEffect
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.campaign import CampaignPlan, campaign

PLAN = CampaignPlan(modes=5, amplitudes=(1.0, 2.0))
CLAMP = PlantedEffect("point_mass", "everywhere", {"mass_kg": 60.0, "x_m": 3.4})
SMALL = PlantedEffect("sag", "everywhere, transverse", {"sag_parameter": 0.05})
LARGE = PlantedEffect("sag", "everywhere, transverse", {"sag_parameter": 3.0})
SWING = PlantedEffect("geometric_hardening", "everywhere", {"hardening": 0.0005})


SMALL_VARIANT = Variant("everywhere, transverse", planes=(0,))
Fits = tuple[GapProblem, list[Fit]]


def fits_of(second: PlantedEffect, variant: Variant) -> Fits:
    """The baseline, the clamp, and the clamp with a second cause."""
    tests = campaign(HANGER_3, HangerState(711e3), [CLAMP, second], PLAN, np.random.default_rng(1))
    problem, rng = (
        GapProblem(HANGER_3, "beam1", observed(tests, HANGER_3)),
        np.random.default_rng(1),
    )
    baseline = baseline_fit(problem, rng)
    clamp, other = ("point_mass", Variant()), (second.name, variant)
    fits = [fitted(problem, Hypothesis(effects), rng) for effects in ((clamp,), (clamp, other))]
    return problem, [baseline, *fits]


@pytest.fixture(scope="module")
def faint() -> Fits:
    return fits_of(SMALL, SMALL_VARIANT)


def chances_of(found: Fits, fit_first: bool = True) -> dict[str, float]:
    """Of the clamp, and of the clamp with a second cause, which has 0.9 before."""
    problem, (baseline, *fits) = found
    second = fits[-1].hypothesis.names[1]
    tried = [ScoredHypothesis.fitted(fit, len(baseline.z)) for fit in (baseline, *fits)]
    if not fit_first:
        tried[1] = replace(tried[1], fit=None)
    kinds = families(tried, {"point_mass": 1, second: 1})
    before = np.array([0.9 if kind.effects == 2 else 0.05 for kind in kinds])
    after = without_minor_cause(problem, baseline, kinds, before)
    assert after.sum() == pytest.approx(before.sum())
    return {kind.name: float(chance) for kind, chance in zip(kinds, after, strict=True)}


def test_a_faint_second_cause_is_for_the_most_part_the_law_of_the_first(faint: Fits) -> None:
    found, odds = chances_of(faint), CALIBRATION.minor_law_odds
    assert found["point_mass + sag"] == pytest.approx(0.9 / (1 + odds))
    assert found["point_mass"] == pytest.approx(0.05 + 0.9 * odds / (1 + odds))


def test_an_effect_that_was_not_worth_a_fit_gets_nothing(faint: Fits) -> None:
    found = chances_of(faint, fit_first=False)
    assert found["point_mass + sag"] == pytest.approx(0.9)
    assert found["point_mass"] == pytest.approx(0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("second", "variant"),
    [(LARGE, SMALL_VARIANT), (SWING, Variant())],
)
def test_a_plain_second_cause_and_one_that_differs_from_test_to_test_stay(
    second: PlantedEffect, variant: Variant
) -> None:
    assert chances_of(fits_of(second, variant))[f"point_mass + {second.name}"] == pytest.approx(0.9)
