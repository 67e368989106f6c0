"""Effects tried at points of their priors beside a fit without them, to first order.

The other parameters are taken as linear and integrated out. A scan says which sizes of an effect
these data could show, roughly how likely the effect is, and where to climb from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.hypotheses.contract import Fit, Hypothesis
from shm.gap.hypotheses.problem import GapProblem
from shm.inference.sampler.linear import Linear
from shm.values import BoolArray, FloatArray

VISIBLE = 1.5
"""Standard deviations, of all data together, from which on an effect counts as one: a smaller one
is no gap."""

# Numerical: points of a scan by parameters of the effect (powers of 2, as Sobol's are even only
# there), and bins of a size of which each has a median.
_POINTS, _MOST_POINTS, _BINS = {1: 32, 2: 64}, 128, 8
# Numerical: starts of a climb; how far apart; what they may lie behind the best, also as a share of
# the scan's range, since a scan is linear and gaps are not.
_STARTS, _APART, _BEHIND, _BEHIND_SHARE, _FARTHEST = 2, 0.5, 8.0, 0.3, 4.0


@dataclass(frozen=True, eq=False)
class Scan:
    """The last effect of a hypothesis at points of its prior.

    `effect` (g, p) are its parameters, `shift` (g, data) is the change of the prediction,
    `magnitude` (g,) the share that the size has of its range, `visible` (g,) by how many standard
    deviations the data move beyond what the other parameters can follow. `log` (g,) is the log
    marginal likelihood, `step` (g, d) the step of the others to their best.
    """

    hypothesis: Hypothesis
    effect: FloatArray
    shift: FloatArray
    magnitude: FloatArray
    visible: FloatArray
    log: FloatArray
    step: FloatArray

    @property
    def smallest(self) -> float:
        """The share of the size's range that these data cannot show; 1 where they show none.

        That is where half of the places and directions show it.
        """
        order = np.argsort(self.magnitude, kind="stable")
        bins = [each for each in np.array_split(order, _BINS) if len(each)]
        seen = np.array([np.median(self.visible[each]) for each in bins]) + 1e-12
        above = np.flatnonzero(seen >= VISIBLE)
        if not len(above):
            return 1.0
        lowest = int(above[0])
        if lowest == 0 or np.ptp(self.magnitude) == 0:
            return 0.0
        pair = slice(lowest - 1, lowest + 1)
        middle = [np.median(self.magnitude[each]) for each in bins[pair]]
        return float(np.interp(np.log(VISIBLE), np.log(seen[pair]), middle))

    @property
    def seen(self) -> BoolArray:
        """Return which points (g,) are of sizes that these data could show."""
        return np.asarray(self.magnitude >= min(self.smallest, self.magnitude.max()))

    @property
    def log_evidence(self) -> float:
        """Return the rough log evidence of the hypothesis."""
        log = self.log[self.seen]
        return float(scipy.special.logsumexp(log) - np.log(len(log)))

    def starts(self, problem: GapProblem, before: Fit) -> FloatArray:
        """Return the best points z (m, d) that lie apart, and the best seen from the other end."""
        coordinates = problem.coordinates(self.hypothesis)
        moved = (before.z + self.step).clip(-_FARTHEST, _FARTHEST)
        z = np.hstack([moved, coordinates.effect_z(self.effect, len(before.z))])
        log, columns = np.where(self.seen, self.log, -np.inf), slice(len(before.z), None)
        least = log.max() - max(_BEHIND, _BEHIND_SHARE * np.ptp(self.log[self.seen]))
        most = _STARTS + self.effect.shape[1] - 1
        chosen: list[int] = []
        for row in np.argsort(-log, kind="stable").tolist():
            apart = all(np.abs(z[row, columns] - z[k, columns]).max() > _APART for k in chosen)
            if apart and len(chosen) < most and log[row] > least:
                chosen.append(row)
        places = coordinates.places
        mirrored = z[chosen[:1]].copy()
        mirrored[:, places] *= -1
        return np.vstack([z[chosen], mirrored]) if len(places) else z[chosen]


def scan(problem: GapProblem, before: Fit, linear: Linear, hypothesis: Hypothesis) -> Scan:
    """Scan the last effect of `hypothesis`, beside a fit `before` without it.

    `linear` has the slopes of that fit.
    """
    whole, count = problem.coordinates(hypothesis, whole=True), len(before.z)
    parameters = whole.effects[count - whole.baseline :]
    points = _POINTS.get(len(parameters), _MOST_POINTS)
    share = scipy.stats.qmc.Sobol(len(parameters), scramble=False).random(points) + 0.5 / points
    effect = np.stack([p.value(u) for p, u in zip(parameters, share.T, strict=True)], axis=1)
    with np.errstate(all="ignore"):
        predicted = problem.predict_with_effect(hypothesis, before.z, effect)
    return _scanned(problem, before, linear, hypothesis, effect, predicted - before.predicted)


def scan_pair(problem: GapProblem, before: Fit, linear: Linear, alone: Scan) -> Scan:
    """Scan the effect of a scan `alone` beside a fit of another one; what both do is added up."""
    pair = Hypothesis((*before.hypothesis.effects, *alone.hypothesis.effects))
    return _scanned(problem, before, linear, pair, alone.effect, alone.shift)


def _scanned(
    problem: GapProblem,
    before: Fit,
    linear: Linear,
    hypothesis: Hypothesis,
    effect: FloatArray,
    shift: FloatArray,
) -> Scan:
    residual = problem.value - before.predicted - shift
    log, step, _ = linear.marginal(residual, np.tile(before.z, (len(effect), 1)))
    magnitude = problem.coordinates(hypothesis, whole=True).magnitude(effect)
    visible = linear.visible(np.nan_to_num(shift), usual_error(linear))
    return Scan(hypothesis, effect, shift, magnitude, visible, log, step)


def usual_error(linear: Linear) -> int:
    """Return the index of the likeliest errors among those with the least model error."""
    error = np.array([each.model_error for each in linear.likelihood.nodes])
    least = error <= error.min()
    return int(np.where(least, linear.likelihood.log_weight, -np.inf).argmax())
