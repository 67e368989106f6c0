"""The first drift decision: shifts, their probabilities, and when they become an alert."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from shm.values import FloatArray, Posterior
from shm.watch import assess, decide, end_stiffness
from tests.helpers.hangers import HANGER_3

NOMINAL_N = 700e3
WHEN = datetime(2026, 5, 1, tzinfo=UTC)
THRESHOLDS = HANGER_3.thresholds


def posterior(
    tension: float, sd: float = 0.005, log10_k: float | None = 7.0, seed: int = 1
) -> Posterior:
    """A posterior of a given tension ratio; with springs unless `log10_k` is None."""
    rng = np.random.default_rng(seed)
    columns: dict[str, FloatArray] = {
        "theta_F": tension * (1 + sd * rng.standard_normal(1000)),
        "theta_L": np.ones(1000),
    }
    if log10_k is not None:
        for name in ("log10_k1", "log10_k2", "log10_k3", "log10_k4"):
            columns[name] = log10_k + 0.05 * rng.standard_normal(1000)
    samples = np.column_stack(list(columns.values()))
    return Posterior(
        model="beam2" if log10_k is not None else "beam1",
        hanger=3,
        names=tuple(columns),
        samples=samples,
        log_likelihood=np.zeros(1000),
        most_probable=samples[0],
        nominal_tension_n=NOMINAL_N,
        log_evidence=0.0,
        log_evidence_sd=0.01,
        effective_sample_size=1000,
        r_hat=1.0,
        evaluations=1,
        predicted=(),
        tests=("t",),
        seed=seed,
        seconds=0.0,
    )


def compare(before: Posterior, after: Posterior):
    return assess(before, after, HANGER_3, test="t2", time=WHEN)


def test_a_loss_beyond_the_threshold_is_an_alert_that_says_how_much() -> None:
    drifts = compare(posterior(1.0), posterior(0.92, seed=2))
    tension = drifts[0]
    assert tension.quantity == "tension"
    assert tension.shift_mean == pytest.approx(-0.08, abs=0.002)
    assert tension.shift_sd == pytest.approx(0.0066, rel=0.1)
    assert tension.probability > 0.99
    alert = decide(drifts, THRESHOLDS)
    assert alert is not None
    assert alert.key == "hanger-3:tension-down"
    assert re.search(r"from (699|700)\.\d to 64[34]\.\d kN, -[78]\.\d%", alert.message)
    assert [drift.quantity for drift in alert.drifts] == ["tension"]


@pytest.mark.parametrize("ratio", [1.0, 0.96, 1.04])
def test_a_shift_within_the_threshold_is_no_alert(ratio: float) -> None:
    assert decide(compare(posterior(1.0), posterior(ratio, seed=2)), THRESHOLDS) is None


def test_a_gain_is_told_from_a_loss() -> None:
    alert = decide(compare(posterior(1.0), posterior(1.1, seed=2)), THRESHOLDS)
    assert alert is not None
    assert alert.key == "hanger-3:tension-up"


def test_an_uncertain_loss_is_no_alert() -> None:
    drifts = compare(posterior(1.0, sd=0.05), posterior(0.92, sd=0.05, seed=2))
    assert 0.5 < drifts[0].probability < 0.9
    assert decide(drifts, THRESHOLDS) is None


def test_softer_ends_are_told_without_blaming_the_tension() -> None:
    alert = decide(compare(posterior(1.0), posterior(1.0, log10_k=6.2, seed=2)), THRESHOLDS)
    assert alert is not None
    moved = [drift.quantity for drift in alert.drifts]
    assert moved == ["transverse_end_stiffness", "longitudinal_end_stiffness"]
    assert alert.drifts[0].shift_mean == pytest.approx(-0.8, abs=0.02)


def test_exchanging_the_ends_is_no_shift() -> None:
    before, after = posterior(1.0), posterior(1.0, seed=2)
    one, other = (before.names.index(name) for name in ("log10_k1", "log10_k3"))
    before.samples[:, one] += 1.0
    after.samples[:, other] += 1.0
    stiffness = compare(before, after)[1]
    assert stiffness.probability < 0.01
    assert stiffness.shift_mean == pytest.approx(0, abs=0.02)


def test_a_clamped_class_has_no_stiffness_to_watch() -> None:
    drifts = compare(posterior(1.0, log10_k=None), posterior(1.0, log10_k=None, seed=2))
    assert [drift.quantity for drift in drifts] == ["tension"]


def test_a_solid_class_is_watched_by_the_rotational_stiffness_of_its_faces() -> None:
    beam = posterior(1.0)
    solid = replace(
        beam,
        model="solid2",
        names=("theta_F", "log10_k1", "log10_k2", "log10_k3", "log10_k4"),
        samples=np.column_stack([beam.samples[:, :1], np.full((1000, 4), 8.0)]),
    )
    found = end_stiffness(solid, HANGER_3)
    spacing, thickness, width = 0.0425, 0.040, 1.0644
    thin = 2e8 / spacing * (width * thickness**2 / 4 + thickness**3 / 12)
    wide = 2e8 / spacing * (width**3 / 12 + thickness * width**2 / 4)
    expected = np.log10(2 / (1 / thin + 1 / wide))
    assert list(found) == ["transverse_end_stiffness", "longitudinal_end_stiffness"]
    np.testing.assert_allclose(list(found.values()), expected)


def test_the_same_posteriors_give_the_same_decision() -> None:
    first, second = (compare(posterior(1.0), posterior(0.93, seed=2)) for _ in range(2))
    assert first == second
