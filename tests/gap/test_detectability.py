"""What of an effect can be seen, and where its prior is cut."""

from __future__ import annotations

import numpy as np
import pytest

from shm.gap.contract import Hypothesis
from shm.gap.detectability import VISIBLE, scan, truncate
from shm.gap.fit import baseline_fit, fitted
from shm.gap.noise import MEAN_MODEL_ERROR, nodes
from shm.models.effects import Variant
from shm.values import FloatArray
from tests.helpers.gap_campaigns import campaign, problem_of

STIFFER = Hypothesis((("bending_stiffness", Variant()),))
HEAVIER = Hypothesis((("distributed_mass", Variant()),))
CLAMP = Hypothesis((("point_mass", Variant()),))


def test_a_shift_counts_only_beyond_what_the_baseline_can_follow() -> None:
    """d' (C + J J')^-1 d, with the baseline's slopes J and priors N(0, I)."""
    problem, rng = problem_of(campaign()), np.random.default_rng(1)
    before = baseline_fit(problem, rng)
    found = scan(problem, before, STIFFER)
    possible = nodes(problem.observations, problem.repeated)
    away = np.abs(np.log([node.model_error / MEAN_MODEL_ERROR for node in possible]))
    usual = [node for node, each in zip(possible, away, strict=True) if each < away.min() + 1e-6]
    visible = [_visible(node.covariance.frequency, before.slopes, found.shift) for node in usual]
    off = [np.abs(found.visible / each - 1).max() for each in visible]
    assert min(off) < 1e-4


def _visible(errors: FloatArray, slopes: FloatArray, shift: FloatArray) -> FloatArray:
    square = np.einsum("gi,ig->g", shift, np.linalg.solve(errors + slopes @ slopes.T, shift.T))
    return np.asarray(np.sqrt(square))


def test_a_cut_prior_begins_where_half_of_the_places_show_the_effect() -> None:
    problem, rng = problem_of(campaign()), np.random.default_rng(1)
    before = baseline_fit(problem, rng)
    found = scan(problem, before, CLAMP)
    truncate(problem, found)
    z = np.zeros((40, 7))
    z[:, :5] = before.z
    z[:, 5], z[:, 6] = -6.0, np.linspace(-1.5, 1.5, 40)
    theta = problem.theta(CLAMP, z)
    shift = problem.predict_at(CLAMP, theta) - before.predicted
    covariance = np.diag(problem.observations.sd**2) + before.slopes @ before.slopes.T
    visible = np.sqrt(np.einsum("gi,ig->g", shift, np.linalg.solve(covariance, shift.T)))
    assert VISIBLE / 2.5 < np.median(visible) < VISIBLE * 2.5


def test_an_effect_that_these_data_cannot_show_says_so() -> None:
    turned = Variant("all sensors")
    problem = problem_of(campaign())
    before = baseline_fit(problem, np.random.default_rng(1))
    found = scan(problem, before, Hypothesis((("sensor_misalignment", turned),)))
    assert found.smallest == 1.0
    assert found.log_evidence == pytest.approx(before.log_evidence, abs=0.3)


@pytest.mark.parametrize(
    ("hypothesis", "values"), [(HEAVIER, [0.06]), (STIFFER, [0.1]), (CLAMP, [5.0, 3.1])]
)
def test_the_scans_evidence_is_near_that_of_the_fit(
    hypothesis: Hypothesis, values: list[float]
) -> None:
    problem, rng = problem_of(campaign(hypothesis.effects, values)), np.random.default_rng(1)
    before = baseline_fit(problem, rng)
    found = scan(problem, before, hypothesis)
    truncate(problem, found)
    fit = fitted(problem, hypothesis, rng)
    gained = fit.log_evidence - before.log_evidence
    assert found.log_evidence - before.log_evidence == pytest.approx(gained, abs=3 + 0.5 * gained)
    assert found.starts(problem.coordinates(hypothesis), 2).shape[1] == len(fit.z)


def test_the_scan_follows_the_bars_length_as_far_as_it_goes() -> None:
    """Linear, a change of the length that the bar's own makes up for seems tens of nats worse."""
    longer = Hypothesis((("effective_length", Variant("arch end", ends=(1,))),))
    problem = problem_of(campaign(longer.effects, [0.35]))
    rng = np.random.default_rng(1)
    before = baseline_fit(problem, rng)
    found = scan(problem, before, longer)
    truncate(problem, found)
    gained = fitted(problem, longer, rng).log_evidence - before.log_evidence
    assert gained > 3
    assert found.log_evidence - before.log_evidence == pytest.approx(gained, abs=1.5)


def test_shapes_show_a_turned_sensor() -> None:
    turned = Variant("all sensors")
    problem = problem_of(campaign(shape_sd=0.01))
    before = baseline_fit(problem, np.random.default_rng(1))
    assert scan(problem, before, Hypothesis((("sensor_misalignment", turned),))).smallest < 0.6
