"""What of an effect can be seen, where its prior is cut, and where to climb from."""

from __future__ import annotations

import numpy as np
import pytest

from shm.gap.contract import Hypothesis
from shm.gap.scan import VISIBLE, Scan, scan, scan_pair
from shm.gap.search import fit_alone
from shm.inference.linear import Linear
from shm.models.effects import Variant
from shm.values import FloatArray
from tests.helpers.gap_campaigns import campaign, fit_of, problem_of, scan_of

STIFFER = Hypothesis((("bending_stiffness", Variant()),))
HEAVIER = Hypothesis((("distributed_mass", Variant()),))
CLAMP = Hypothesis((("point_mass", Variant()),))
TURNED = Hypothesis((("sensor_misalignment", Variant("all sensors")),))


def made(visible: FloatArray, magnitude: FloatArray) -> Scan:
    """Make a scan by what it saw at each size."""
    none = np.zeros((len(visible), 1))
    return Scan(STIFFER, none, none, magnitude, visible, np.zeros(len(visible)), none)


def test_smallest_log_linear() -> None:
    """What grows a thousandfold over the prior is seen from the size where it is VISIBLE on."""
    magnitude = np.random.default_rng(1).permutation(np.linspace(0, 1, 801))
    visible = 0.05 * 1000**magnitude
    exact = np.log(VISIBLE / 0.05) / np.log(1000)
    assert made(visible, magnitude).smallest == pytest.approx(exact, abs=1e-3)


@pytest.mark.parametrize(("visible", "smallest"), [(0.1, 1.0), (9.0, 0.0)])
def test_smallest_none_or_all_visible(visible: float, smallest: float) -> None:
    found = made(np.full(64, visible), np.linspace(0, 1, 64))
    assert found.smallest == smallest
    assert found.seen.any()


def test_scan_visible_beyond_baseline() -> None:
    """d' (C + J J')^-1 d, with the baseline's slopes J and priors N(0, I)."""
    problem, rng = problem_of(campaign()), np.random.default_rng(1)
    before, found = fit_alone(problem, rng), scan_of(problem, STIFFER)
    nodes = problem.likelihood(Hypothesis()).nodes
    error = np.array([node.model_error for node in nodes])
    off = []
    for node in (n for n, each in zip(nodes, error, strict=True) if each <= error.min()):
        covariance = node.covariance.frequency + before.slopes @ before.slopes.T
        square = np.einsum("gi,ig->g", found.shift, np.linalg.solve(covariance, found.shift.T))
        off.append(np.abs(found.visible / np.sqrt(square) - 1).max())
    assert min(off) < 1e-4


def test_cut_prior_begins_visible() -> None:
    """At the least size left half of the places show the mass."""
    problem = problem_of(campaign())
    before, found = fit_alone(problem, np.random.default_rng(1)), scan_of(problem, CLAMP)
    assert 0 < found.smallest < 1
    z = np.tile(np.append(before.z, [-6.0, 0.0]), (40, 1))
    z[:, -1] = np.linspace(-1.5, 1.5, 40)
    shift = problem.predict(CLAMP, z) - before.predicted
    linear = Linear(problem.likelihood(Hypothesis()), before.slopes)
    visible = np.max([linear.visible(shift, k) for k in range(len(linear.covariance))], axis=0)
    assert VISIBLE / 2.5 < np.median(visible) < VISIBLE * 2.5


def test_scan_without_shapes_sees_no_turn() -> None:
    problem = problem_of(campaign())
    found = scan_of(problem, TURNED)
    assert found.smallest == 1.0
    alone = fit_alone(problem, np.random.default_rng(1)).log_evidence
    assert found.log_evidence == pytest.approx(alone, abs=0.3)
    assert scan_of(problem_of(campaign(shape_sd=0.01)), TURNED).smallest < 0.6


@pytest.mark.parametrize(
    ("hypothesis", "values"), [(HEAVIER, [0.06]), (STIFFER, [0.1]), (CLAMP, [5.0, 3.1])]
)
def test_scan_evidence_near_fit(hypothesis: Hypothesis, values: list[float]) -> None:
    problem = problem_of(campaign(hypothesis.effects, values))
    before, found = fit_alone(problem, np.random.default_rng(1)), scan_of(problem, hypothesis)
    fit = fit_of(problem, hypothesis)
    gained = fit.log_evidence - before.log_evidence
    assert found.log_evidence - before.log_evidence == pytest.approx(gained, abs=3 + 0.5 * gained)
    starts = found.starts(problem, before)
    assert starts.shape[1] == len(fit.z)
    own = slice(len(before.z), None)
    assert np.abs(starts[:, own] - fit.z[own]).max(axis=1).min() < 1.0


def test_starts_mirrored_place() -> None:
    """The best place is started from as seen from the other end, too."""
    problem = problem_of(campaign(CLAMP.effects, [5.0, 3.1]))
    starts = scan_of(problem, CLAMP).starts(problem, fit_alone(problem, np.random.default_rng(1)))
    assert starts[-1, -1] == pytest.approx(-starts[0, -1])


def test_scan_beside_adds_shifts() -> None:
    pair = Hypothesis((*CLAMP.effects, *STIFFER.effects))
    problem = problem_of(campaign(pair.effects, [12.0, 3.1, 0.2]))
    before = fit_alone(problem, np.random.default_rng(1))
    likelihood = problem.likelihood(Hypothesis())
    alone = scan(problem, before, Linear(likelihood, before.slopes), STIFFER)
    leader = fit_of(problem, CLAMP)
    found = scan_pair(problem, leader, Linear(likelihood, leader.slopes), alone)
    assert found.hypothesis == pair
    np.testing.assert_array_equal(found.shift, alone.shift)
    assert found.log_evidence > leader.log_evidence + 3
    best = found.effect[found.log.argmax(), 0]
    assert best == pytest.approx(0.2, abs=0.1)
