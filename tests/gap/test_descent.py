"""The way down to the most probable points, against optimisers and differences of others' making.

The log posterior that is climbed is evaluated here from the predictions alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import minimize

from shm.errors import BadInput
from shm.gap.contract import Hypothesis, Observations
from shm.gap.coordinates import Branch, Coordinates
from shm.gap.fit import fitted
from shm.gap.likelihood import Likelihood
from shm.gap.noise import nodes
from shm.gap.optimiser import Landscape, Optimum, optima
from shm.models.effects import Parameter
from shm.values import FloatArray, Scatter
from tests.gap import linear_toy as toy

BASIC = (
    Parameter("theta_F", "", 0.5, 5.0, np.nan, ""),
    *(Parameter(name, "", -0.1, 0.1, 0.0, "") for name in "sdlm"),
)
SIZE = Parameter("size", "", 0.01, 1.0, 0.0, "")
SIGNED = Parameter("change", "", 0.01, 1.0, 0.0, "", signed=True)
COUNT = toy.design().frequencies
Bend = Callable[[FloatArray], FloatArray]


@dataclass
class Bent:
    """Predicts `slopes` (data, d) @ z, the last z bent before it counts."""

    observations: Observations
    slopes: FloatArray
    bend: Bend
    last: Parameter
    baseline: str = "beam1"

    def predict(self, hypothesis: Hypothesis, z: FloatArray) -> FloatArray:
        bent = np.column_stack([z[:, :-1], self.bend(z[:, -1])])
        return np.asarray(bent @ self.slopes.T)

    def coordinates(self, hypothesis: Hypothesis) -> Coordinates:
        return Coordinates((*BASIC, self.last), 1, Scatter())

    def likelihood(self, hypothesis: Hypothesis) -> Likelihood:
        return Likelihood(nodes(self.observations))


def landscape(bend: Bend, truth: float, last: Parameter = SIZE, size: float = 3e-4) -> Landscape:
    """Of data with the last z at `truth`; one more of it moves the frequencies by `size`, or so."""
    rng = np.random.default_rng(4)
    slopes = np.zeros((toy.design().size, 6))
    slopes[:COUNT] = np.array([2e-3] * 5 + [size]) * rng.standard_normal((COUNT, 6))
    z = np.array([0.5, -0.3, 0.2, 0.4, -0.1, truth])
    made = Bent(toy.observations(np.zeros(len(slopes))), slopes, bend, last)
    value = made.predict(Hypothesis(), z[None])[0] + toy.noise(rng)
    made.observations = toy.observations(value)
    return Landscape(made, Hypothesis())  # type: ignore[arg-type]


def straight(z: FloatArray) -> FloatArray:
    return z


def cubic(z: FloatArray) -> FloatArray:
    return np.asarray(z + 0.3 * z**3)


def mirrored(z: FloatArray) -> FloatArray:
    return np.asarray(z**2)


def height(of: Landscape, branch: Branch, w: FloatArray) -> float:
    """Log of likelihood times prior density by w, the branch's prior included."""
    residual = of.problem.observations.value - of.problem.predict(Hypothesis(), branch.z(w[None]))
    prior = -0.5 * w @ w - 0.5 * len(w) * np.log(2 * np.pi)
    half = np.log(0.5) * np.count_nonzero(branch.signs)
    return float(of.likelihood.log(residual)[0] + prior + half)


def starts(*last: float) -> FloatArray:
    z = np.zeros((len(last), 6))
    z[:, -1] = last
    return z


def highest(of: Landscape, branch: Branch, first: FloatArray) -> float:
    """What an optimiser without slopes climbs to, begun anew where it stopped."""
    w = branch.w(starts(*first))
    found = []
    for each in w:
        for _ in range(3):
            ended = minimize(lambda at: -height(of, branch, at), each, method="Powell")
            each = ended.x
        found.append(-float(ended.fun))
    return max(found)


def hessian(of: Landscape, top: Optimum) -> FloatArray:
    """Of less the log posterior, by central differences."""
    d, step = len(top.w), 0.2 * np.sqrt(np.diag(top.covariance))
    moves = np.diag(step)

    def h(away: FloatArray) -> float:
        return -height(of, top.branch, top.w + away)

    return np.array(
        [
            [
                (h(a + b) - h(a - b) - h(b - a) + h(-a - b)) / (4 * step[i] * step[j])
                for j, b in enumerate(moves)
            ]
            for i, a in enumerate(moves)
        ]
    ).reshape(d, d)


CASES = {
    "straight": (straight, 1.2, SIZE),
    "cubic": (cubic, 1.2, SIZE),
    "mirrored": (mirrored, 1.5, SIZE),
    "of either sign": (straight, -1.4, SIGNED),
    "hardly seen": (straight, 0.2, SIZE),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_the_best_point_is_as_high_as_an_optimiser_of_others_climbs(name: str) -> None:
    bend, truth, last = CASES[name]
    of = landscape(bend, truth, last)
    best = max(optima(of, starts(-1.0, 1.0)), key=lambda each: each.log_posterior)
    branches = of.coordinates.branches
    other = max(
        highest(of, b, np.array([sign]))
        for b in branches
        for sign in ((-1.0, 1.0) if not b.signs.any() else b.signs[-1:])
    )
    assert best.log_posterior == pytest.approx(height(of, best.branch, best.w), abs=1e-6)
    assert best.log_posterior > other - 0.15  # of what a step promises, 0.02, the curvature errs


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("first", [-2.5, -0.5, 0.5, 2.5])
def test_every_point_found_is_a_top_from_whichever_start(name: str, first: float) -> None:
    bend, truth, last = CASES[name]
    of = landscape(bend, truth, last)
    found = optima(of, starts(first))
    assert found
    for top in found:
        values, axes = np.linalg.eigh(top.curvature)
        here = height(of, top.branch, top.w)
        around = [
            height(of, top.branch, top.w + sign * axis / np.sqrt(value))
            for value, axis in zip(values, axes.T, strict=True)
            for sign in (-1, 1)
        ]
        assert max(around) < here


def test_a_far_start_leads_to_the_same_point_as_a_near_one() -> None:
    of = landscape(cubic, 1.2)
    near, far = (optima(of, starts(first))[0] for first in (1.1, -3.0))
    assert far.log_posterior == pytest.approx(near.log_posterior, abs=0.03)
    assert far.log_evidence == pytest.approx(near.log_evidence, abs=0.1)


def test_the_curvature_is_that_of_the_log_posterior_where_predictions_are_straight() -> None:
    of = landscape(straight, 1.2)
    (top,) = optima(of, starts(1.0))
    found, width = hessian(of, top), np.sqrt(np.diag(top.covariance))
    scale = np.outer(width, width)
    most = np.abs(found * scale).max()
    np.testing.assert_allclose(top.curvature * scale, found * scale, atol=0.05 * most)
    np.testing.assert_allclose(top.slopes, of.problem.slopes, atol=1e-8)  # type: ignore[attr-defined]
    exact = len(top.w) * np.log(2 * np.pi) / 2 - np.linalg.slogdet(found)[1] / 2
    assert top.log_evidence == pytest.approx(top.log_posterior + exact, abs=0.1)


def test_mirror_images_are_two_points_alike_and_each_is_told_once() -> None:
    of = landscape(mirrored, 1.5)
    found = optima(of, starts(-2.0, -1.0, -1.2, 1.0, 1.3, 2.0))
    assert sorted(np.sign(each.w[-1]) for each in found) == [-1, 1]
    assert found[0].log_posterior == pytest.approx(found[1].log_posterior, abs=0.05)
    assert [each.log_evidence for each in found] == sorted(
        (each.log_evidence for each in found), reverse=True
    )
    assert len(optima(of, starts(0.9, 1.0, 1.1))) == 1


def test_a_size_of_either_sign_is_sought_on_the_side_of_its_start() -> None:
    of = landscape(straight, -0.1, SIGNED, size=1e-5)
    found = optima(of, starts(-1.0, 1.0))
    assert sorted(each.branch.signs[-1] for each in found) == [-1, 1]
    for each in found:
        assert np.sign(each.branch.z(each.w[None])[0, -1]) == each.branch.signs[-1]
        assert each.branch.signs[:-1].tolist() == [0] * 5


def test_points_that_count_for_nothing_beside_the_best_are_left_out() -> None:
    of = landscape(straight, -1.4, SIGNED)
    (found,) = optima(of, starts(-1.0, 1.0))
    assert found.branch.signs[-1] == -1
    (only,) = optima(of, starts(1.0))
    assert only.branch.signs[-1] == 1
    assert only.log_evidence < found.log_evidence - 7


def test_starts_that_cannot_be_predicted_are_passed_over() -> None:
    def broken(z: FloatArray) -> FloatArray:
        return np.where(z < -1, np.nan, z)

    of = landscape(broken, 1.2)
    assert optima(of, starts(-2.0)) == []
    (both,) = optima(of, starts(-2.0, 1.0))
    (alone,) = optima(of, starts(1.0))
    assert both.log_posterior == alone.log_posterior
    assert np.isfinite(both.residual).all()


def test_where_nothing_can_be_predicted_the_fit_says_so_and_what_to_check() -> None:
    of = landscape(straight, 1.2)
    of.problem.bend = lambda z: np.full_like(z, np.nan)  # type: ignore[attr-defined]
    with pytest.raises(BadInput, match=r"cannot be solved anywhere for beam1.*description"):
        fitted(of.problem, Hypothesis(), np.random.default_rng(1), starts(-1.0, 1.0))
