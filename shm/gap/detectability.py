"""What effects of all sizes would do to these data, and how far the baseline could follow.

The prediction is taken as linear in the parameters that were there before the effect, and these
are integrated out. What an effect moves the data by beyond that is what can be seen of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.contract import Fit, Hypothesis
from shm.gap.coordinates import DEVIATIONS, Coordinates, is_place
from shm.gap.likelihood import Likelihood
from shm.gap.noise import MEAN_MODEL_ERROR
from shm.gap.problem import GapProblem
from shm.values import BoolArray, FloatArray, IntArray

LARGEST_SCALE = 1.8
"""Up to this factor, up or down, a shift counts as one in proportion to the effect's size.

Judgement: eight decades in 32 points, as scans have, are so far apart; over more a shift bends.
"""

_CELL = 2 * float(np.log(LARGEST_SCALE))  # from the smallest to the largest, of the logarithm
# Technical: rounding of logarithms, and a square that is divided by.
_NEAR, _NOTHING = 1e-9, 1e-30


@dataclass(frozen=True, eq=False)
class Marginal:
    """Of `g` shifts of a prediction, with the linear parameters integrated out.

    `whole` (g,): by how many standard deviations each moves the data, `visible` (g,): by how many
    beyond what the linear parameters can follow. `log_likelihood` (g,) of the shifts as they are;
    `scale` (g,), up to 1.8 up or down, makes them fit best, with the log likelihood `log_peak`
    (g,); `log_mean` (g,) is that of the mean likelihood over all these scales, evenly over their
    logarithm. `step` (g, d) is where the linear parameters go with the scaled shifts, `follow`
    (g, d) with the plain ones.
    """

    whole: FloatArray
    visible: FloatArray
    log_likelihood: FloatArray
    scale: FloatArray
    log_peak: FloatArray
    log_mean: FloatArray
    step: FloatArray
    follow: FloatArray


@dataclass(frozen=True, eq=False)
class _Products:
    """Products of residual and shifts in each node: beyond what the linear parameters follow.

    `cross` of residual and shifts and `shift` of these with themselves, (nodes, g), `whole` the
    latter before anything follows; `height`
    (nodes,) is the log likelihood of the residual. `solved` (nodes, d, 1 + g): where the linear
    parameters go with each.
    """

    cross: FloatArray
    shift: FloatArray
    whole: FloatArray
    height: FloatArray
    solved: FloatArray


def marginal(
    problem: GapProblem, hypothesis: Hypothesis, before: Fit, shift: FloatArray
) -> Marginal:
    """Of shifts (g, data) added to what `before` predicts, by the unknown errors of `hypothesis`.

    The parameters of `before` are those that are linear.
    """
    likelihood = problem.likelihood(hypothesis)
    products = _products(likelihood, before, problem.observations.value - before.predicted, shift)
    nodes = np.arange(len(shift))
    plain = products.height[:, None] + products.cross - products.shift / 2
    own = np.maximum(products.shift, _NOTHING)
    scales = (products.cross / own).clip(1 / LARGEST_SCALE, LARGEST_SCALE)
    peaks = products.height[:, None] + scales * products.cross - scales**2 * own / 2
    best = peaks.argmax(axis=0)
    scale = scales[best, nodes]
    log_peak = np.asarray(scipy.special.logsumexp(peaks, axis=0))
    width = np.sqrt(2 * np.pi / own[best, nodes]) / scale
    residual, shifts = products.solved[best, :, 0], products.solved[best, :, 1 + nodes]
    usual = _nominal(problem, likelihood, peaks.max(axis=1))
    return Marginal(
        whole=np.sqrt(products.whole[usual]),
        visible=np.sqrt(products.shift[usual]),
        log_likelihood=np.asarray(scipy.special.logsumexp(plain, axis=0)),
        scale=scale,
        log_peak=log_peak,
        log_mean=log_peak + np.log(np.minimum(width / _CELL, 1.0)),
        step=residual - scale[:, None] * shifts,
        follow=residual - shifts,
    )


def _products(
    likelihood: Likelihood, before: Fit, residual: FloatArray, shift: FloatArray
) -> _Products:
    d = len(before.z)
    columns = np.column_stack([before.slopes, residual])
    gram = likelihood.weighed(columns).products(np.vstack([columns.T, shift]))
    # The prior is d more data, of value 0 and standard deviation 1.
    inner, outer = gram[:, :d, :d] + np.eye(d), np.swapaxes(gram[:, d:, :d], 1, 2).copy()
    outer[:, :, 0] -= before.z
    solved: FloatArray = np.linalg.solve(inner, outer).astype(np.float64)
    followed = (outer[:, :, :1] * solved).sum(axis=1)
    square = gram[:, d, d] + before.z @ before.z - followed[:, 0]
    own = likelihood.squares(shift).T
    alone = own - (outer[:, :, 1:] * solved[:, :, 1:]).sum(axis=1)
    volume = np.linalg.slogdet(inner)[1]
    return _Products(
        cross=gram[:, d + 1 :, d] - followed[:, 1:],
        shift=np.maximum(alone, 0.0),
        whole=own,
        height=likelihood.log_height - volume / 2 - square / 2,
        solved=solved,
    )


def _nominal(problem: GapProblem, likelihood: Likelihood, height: FloatArray) -> int:
    """The node by which to say what can be seen: the likeliest of those with a usual model error.

    Where no standard deviation is known, the likeliest of all with the shift that fits best.
    """
    error = np.array([node.model_error for node in likelihood.nodes])
    if np.isfinite(problem.observations.sd[: likelihood.frequencies]).any():
        away = np.abs(np.log(error / MEAN_MODEL_ERROR))
        height = np.where(away < away.min() + _NEAR, height, -np.inf)
    return int(height.argmax())


VISIBLE = 1.5
"""Standard deviations, of all data together, from which on an effect counts as one."""

# Judgement, points (powers of 2, as Sobol's are even only there) against time: eight along each of
# two parameters, then 32 in a quarter and a twelfth of the range about the best. In eight bins of a
# size four points and more make a median.
_POINTS = {1: 32, 2: 64}
_MOST_POINTS = 128
_HALVES, _CLOSER_POINTS = (0.12, 0.04), 32
_BINS = 8
# Judgement: log evidence by which a scan may be wrong in any case, so that it needs no closer look.
_ORDINARY = 6.0
# Judgement: starts within 99 % of a prior, no nearer to each other than closer points reach, none
# 3000 times worse than the best, nor by a third of the gap: a scan is linear, gaps are not.
LONGEST_STEP, _FARTHEST, _APART = 2.5, 4.0, _HALVES[0]
_HOPELESS, HOPELESS_SHARE = 8.0, 0.3
# Judgement: curvature is worth two more solutions where the bar's deviations go along for more than
# one standard deviation, not for eight, which the prior forbids, and leave a seventh visible.
_BENT_STEPS, _STRAIGHT, _HOPELESSLY_FAR, _MOSTLY_FOLLOWED = 2, 1.0, 8.0, 0.15


@dataclass(frozen=True, eq=False)
class Scan:
    """Effects tried at `g` points of their prior, on top of a fit without them.

    `effect` (g, p) are the tried effect's parameters, `share` (g, p) their shares of the whole
    ranges, `weight` (g,) is the part of the prior that a point stands for, 0 where others do in its
    place; `magnitude` (g,) is the share that its size has of its range. `shift` (g, data) is what
    it does to the prediction, `marginal` what the data say to that. `theta` (g, d) are all
    parameters, those of the fit moved to where they go best and sizes scaled to what fits best.
    """

    hypothesis: Hypothesis
    effect: FloatArray
    share: FloatArray
    weight: FloatArray
    magnitude: FloatArray
    shift: FloatArray
    marginal: Marginal
    theta: FloatArray

    @property
    def visible(self) -> FloatArray:
        """By how many standard deviations the effect moves the data, (g,)."""
        return self.marginal.visible

    @property
    def smallest(self) -> float:
        """The share of the size's range that cannot be seen; 1 where nothing of it can.

        That is where half of the places and directions show it.
        """
        first = _first_points(self.share.shape[1])
        order = np.argsort(self.magnitude[:first], kind="stable")
        bins = [each for each in np.array_split(order, _BINS) if len(each)]
        middle = np.array([np.median(self.magnitude[each]) for each in bins])
        seen = np.array([np.median(np.log(self.visible[each] + 1e-12)) for each in bins])
        above = np.flatnonzero(seen >= np.log(VISIBLE))
        if not len(above):
            return 1.0
        lowest = int(above[0])
        if lowest == 0 or np.ptp(self.magnitude) == 0:
            return 0.0
        pair = slice(lowest - 1, lowest + 1)
        return float(np.interp(np.log(VISIBLE), seen[pair], middle[pair]))

    @property
    def log_evidence(self) -> float:
        """Of the visible sizes, with shifts taken as linear in the size: rough."""
        weight = np.where(self._counted, self.weight, 0.0)
        return float(scipy.special.logsumexp(self.marginal.log_mean, b=weight / weight.sum()))

    @property
    def _counted(self) -> BoolArray:
        return np.asarray(self.magnitude >= min(self.smallest, self.magnitude.max()))

    def starts(self, coordinates: Coordinates, most: int) -> FloatArray:
        """Up to `most` good and different points z (m, d) for each choice of signs.

        Two more for each further parameter of the effect.
        """
        most += 2 * (self.share.shape[1] - 1)
        z = coordinates.z(self.theta)
        chosen: list[int] = []
        peak = np.where(self._counted, self.marginal.log_peak, -np.inf)
        good = peak > peak.max() - max(_HOPELESS, HOPELESS_SHARE * np.ptp(peak[self._counted]))
        for branch in coordinates.branches:
            rows = np.flatnonzero(branch.holds(z) & good)
            chosen += _different(rows, self.share, self.marginal.log_peak, most)
        return np.vstack([z[chosen], *self._mirrored(z, coordinates)])

    def _mirrored(self, z: FloatArray, coordinates: Coordinates) -> list[FloatArray]:
        """The best point seen from the other end, if the effect has a place."""
        peak = np.where(self._counted, self.marginal.log_peak, -np.inf)
        own = range(z.shape[1] - self.share.shape[1], z.shape[1])
        places = [k for k in own if is_place(coordinates.parameters[k])]
        mirrored = z[[peak.argmax()]]
        mirrored[:, places] *= -1
        return [mirrored] if places else []


def scan(problem: GapProblem, before: Fit, hypothesis: Hypothesis) -> Scan:
    """`hypothesis` has the effects of `before` first and then those that are tried.

    The points spread evenly over the whole prior (Sobol 1967), whatever of it can be seen. Those of
    an effect of several parameters spread again, closer, about the best of them, where that is
    much better than the fit before or much worse, which nothing nested in it need be.
    """
    parameters = problem.coordinates(hypothesis, whole=True).dimension - len(before.z)
    share = _spread(parameters, _first_points(parameters))
    shift = _shift(problem, before, hypothesis, share)
    weight = np.full(len(share), 1 / len(share))
    shift = _bent(problem, before, hypothesis, share, shift)
    found = _scan(problem, before, hypothesis, share, weight, shift)
    for half in _HALVES if parameters > 1 else ():
        peak = found.marginal.log_peak
        if abs(peak.max() - before.log_evidence) < _ORDINARY:
            break
        best = share[peak.argmax()]
        low, high = (best - half).clip(0, 1), (best + half).clip(0, 1)
        closer = low + (high - low) * _spread(parameters, _CLOSER_POINTS)
        volume = float(np.prod(high - low))
        inside = np.asarray(((share >= low) & (share <= high)).all(axis=1))
        kept = np.where(inside, 0.0, weight)
        kept *= (1 - volume) / max(kept.sum(), volume)
        weight = np.append(kept, np.full(len(closer), volume / len(closer)))
        share = np.vstack([share, closer])
        further = _shift(problem, before, hypothesis, closer)
        shift = np.vstack([shift, _bent(problem, before, hypothesis, closer, further)])
        found = _scan(problem, before, hypothesis, share, weight, shift)
    return found


def _shift(
    problem: GapProblem, before: Fit, hypothesis: Hypothesis, share: FloatArray
) -> FloatArray:
    """What effects at shares (g, p) do to the prediction of `before`; NaN where unsolvable."""
    kept = np.repeat(problem.theta(before.hypothesis, before.z[None]), len(share), axis=0)
    theta = np.column_stack([kept, _effect(problem, before, hypothesis, share)])
    return np.asarray(problem.predict_at(hypothesis, theta) - before.predicted)


def _bent(
    problem: GapProblem, before: Fit, hypothesis: Hypothesis, share: FloatArray, shift: FloatArray
) -> FloatArray:
    """The shifts (g, data) with the curvature on the way to where the bar's deviations follow.

    A change of length that the bar's own length all but makes up for is hundreds of standard
    deviations away from what is linear, and a few from what is seen.
    """
    first = problem.coordinates(before.hypothesis).linear[-DEVIATIONS:]
    bent = shift.copy()
    for _ in range(_BENT_STEPS):
        solved = np.asarray(np.isfinite(bent).all(axis=1))
        seen = marginal(problem, hypothesis, before, np.where(solved[:, None], bent, 0.0))
        followed = np.abs(seen.follow[:, first]).max(axis=1)
        far = (followed > _STRAIGHT) & (followed < _HOPELESSLY_FAR)
        rows = np.flatnonzero(solved & far & (seen.visible < _MOSTLY_FOLLOWED * seen.whole))
        if not len(rows):
            break
        moved = before.z + seen.follow[rows]
        theta = problem.theta(before.hypothesis, moved)
        theta = np.column_stack([theta, _effect(problem, before, hypothesis, share[rows])])
        there = problem.predict_at(hypothesis, theta)
        bent[rows] = there - before.predicted - seen.follow[rows] @ before.slopes.T
    return bent


def _effect(
    problem: GapProblem, before: Fit, hypothesis: Hypothesis, share: FloatArray
) -> FloatArray:
    """The tried effects' parameters (g, p) at shares of their whole ranges."""
    tried = problem.coordinates(hypothesis, whole=True).parameters[len(before.z) :]
    return np.stack([each.value(column) for each, column in zip(tried, share.T, strict=True)], 1)


def superposed(problem: GapProblem, before: Fit, tried: Scan, hypothesis: Hypothesis) -> Scan:
    """A scan of a single effect taken over to a fit that has another one, without solving anew.

    The shifts of both are added. `hypothesis` has the effects of `before` first.
    """
    return _scan(problem, before, hypothesis, tried.share, tried.weight, tried.shift)


def _scan(
    problem: GapProblem,
    before: Fit,
    hypothesis: Hypothesis,
    share: FloatArray,
    weight: FloatArray,
    shift: FloatArray,
) -> Scan:
    whole, count = problem.coordinates(hypothesis, whole=True), len(before.z)
    effect = _effect(problem, before, hypothesis, share)
    solved = np.asarray(np.isfinite(shift).all(axis=1))
    seen = marginal(problem, hypothesis, before, np.where(solved[:, None], shift, 0.0))
    moved = before.z + seen.step.clip(-LONGEST_STEP, LONGEST_STEP)
    linear = problem.theta(before.hypothesis, moved.clip(-_FARTHEST, _FARTHEST))
    theta = np.column_stack([linear, effect])
    return Scan(
        hypothesis,
        effect,
        share,
        np.where(solved, weight, 0.0),
        whole.magnitude(theta, count),
        shift,
        seen,
        whole.grown(theta, count, seen.scale),
    )


def truncate(problem: GapProblem, found: Scan) -> None:
    """Cuts the prior of a single effect's size where the effect cannot be seen any more."""
    (effect,) = found.hypothesis.effects
    problem.smallest[effect] = found.smallest


def _first_points(parameters: int) -> int:
    return _POINTS.get(parameters, _MOST_POINTS)


def _spread(parameters: int, count: int) -> FloatArray:
    """Shares (count, parameters) evenly over the unit cube."""
    if parameters == 1:
        return ((np.arange(count) + 0.5) / count)[:, None]
    points = scipy.stats.qmc.Sobol(parameters, scramble=False).random(count)
    return np.asarray(points + 0.5 / count)


def _different(rows: IntArray, share: FloatArray, log_peak: FloatArray, most: int) -> list[int]:
    """The best of `rows`, none near a better one, at most `most`."""
    chosen: list[int] = []
    for row in rows[np.argsort(-log_peak[rows], kind="stable")]:
        away = np.abs(share[chosen] - share[row]).max(axis=1) if chosen else np.ones(1)
        if len(chosen) < most and away.min() > _APART:
            chosen.append(int(row))
    return chosen
