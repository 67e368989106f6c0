"""A hypothesis of a user's simulator fitted, and what a fit leaves of the readings.

Newton steps lead to the peaks from several starts. The evidence comes from importance sampling
about the peaks (t distributions refitted to their own draws, with a share of the prior so that no
weight is unbounded; Cappe et al. 2008, Hesterberg 1995): Laplace's method only says where to draw.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.contract import Fit, Hypothesis, NoiseNode
from shm.gap.likelihood import Likelihood
from shm.gap.simulator_problem import Prior, Reading, SimulatorProblem
from shm.inference.coordinates import log_normal
from shm.inference.mixture import (
    Normal,
    Pool,
    Rows,
    TMixture,
    effective,
    normalised,
    systematic,
    tempered,
)
from shm.values import FloatArray, IntArray

# Technical: effective draws against calls of the simulator. Weights correct whatever is drawn from.
_SCOUTS, _STARTS, _STEPS = 150, 3, 20
_ROUND, _ROUNDS, _ENOUGH, _KEPT = 150, 10, 200, 400
_FROM_PRIOR, _FROM_FIRST = 0.05, 0.2
_TO_FIT, _COOLING, _LEAST_POWER = 4, 0.7, 1e-3
_WIDTHS = (1.0, 2.0)  # a posterior with a bound on one side has longer tails than its curvature
_DIFFERENCE = 1e-4  # of a prior's standard deviation: between rounding and curvature
_GAIN = 0.01  # of log posterior: less is no step
_FARTHEST = 4.5  # standard deviations of a prior: one in 150 000 lies beyond
_LEAST_CURVATURE, _MOST_DAMPING = 1e-9, 1e4


class _Target:
    """The log posterior of z, but for the evidence."""

    def __init__(self, problem: SimulatorProblem, hypothesis: Hypothesis, rows: FloatArray):
        self.problem, self.hypothesis = problem, hypothesis
        nodes = problem.flexible_nodes() if hypothesis.flexible else problem.nodes()
        self.rows = np.flatnonzero(rows)
        self.likelihood = Likelihood([_part(node, self.rows) for node in nodes])
        self.nodes = nodes
        self.dimension = len(problem.priors(hypothesis))

    def residual(self, z: FloatArray) -> FloatArray:
        """Readings less predictions (n, kept data)."""
        away = self.problem.value - self.problem.predicted(self.hypothesis, z)
        return np.asarray(away[:, self.rows])

    def log(self, z: FloatArray) -> FloatArray:
        """(n,)"""
        return np.asarray(self.likelihood.log(self.residual(z)) + log_normal(z))

    def slopes(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residual (data,) at z (d,) and the derivatives (data, d) of the prediction."""
        step = np.where(z > 0, -_DIFFERENCE, _DIFFERENCE)
        points = np.vstack([z, z + np.diag(step)])
        residual = self.residual(points)
        return residual[0], np.asarray((residual[0] - residual[1:]).T / step)

    def curvature(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Gauss and Newton's Hessian (d, d) and the gradient (d,) of the log posterior."""
        residual, slopes = self.slopes(z)
        share = scipy.special.softmax(self.likelihood.by_node(residual[None])[0])
        products = self.likelihood.gram(np.column_stack([slopes, residual])[None])[0]
        mean = np.einsum("k,kij->ij", share, products)
        return mean[:-1, :-1] + np.eye(len(z)), mean[:-1, -1] - z


def _part(node: NoiseNode, rows: IntArray) -> NoiseNode:
    return NoiseNode(node.covariance.part(rows, np.empty(0, dtype=np.int64)), node.log_weight, 0.0)


def fitted(
    problem: SimulatorProblem,
    hypothesis: Hypothesis,
    rng: np.random.Generator,
    start: FloatArray | None = None,
) -> Fit:
    """The posterior and evidence of a hypothesis; `start` (d0,) is a fit of the simulator alone."""
    target = _Target(problem, hypothesis, np.ones(len(problem.value)))
    peaks = [_climbed(target, z) for z in _starts(target, rng, start)]
    best = max(peaks, key=lambda each: each.log)
    pool = _sampled(target, peaks, rng)
    weights = normalised(pool.log_weights)
    count = effective(weights)
    residual, slopes = target.slopes(best.z)
    node = target.nodes[int(target.likelihood.by_node(residual[None])[0].argmax())]
    return Fit(
        hypothesis, best.z, best.covariance, problem.value - residual, slopes, node.covariance, 0.0,
        draws=pool.batch.z[systematic(weights, _KEPT, rng)],
        log_fit=float(target.likelihood.log(residual[None])[0]),
        log_evidence=pool.log_evidence,
        log_evidence_sd=float(np.sqrt(max(1 / count - 1 / pool.draws, 0.0))),
        method="sampled", effective=count,
    )  # fmt: skip


def refitted(problem: SimulatorProblem, fit: Fit, rows: FloatArray) -> FloatArray:
    """The most probable z by the readings of `rows` (data,) alone, from a fit to all."""
    return _climbed(_Target(problem, fit.hypothesis, rows), fit.z).z


@dataclass(frozen=True, eq=False)
class _Summit:
    z: FloatArray
    log: float
    covariance: FloatArray


def _starts(
    target: _Target, rng: np.random.Generator, start: FloatArray | None
) -> Sequence[FloatArray]:
    """The likeliest of points drawn from the priors, half of them near `start`."""
    z = rng.standard_normal((_SCOUTS, target.dimension))
    if start is not None:
        z[::2, : len(start)] = start
    log = target.log(z)
    return [z[i] for i in np.argsort(-np.where(np.isnan(log), -np.inf, log))[:_STARTS]]


def _climbed(target: _Target, z: FloatArray) -> _Summit:
    """Levenberg and Marquardt's steps to the next summit."""
    here, damping = float(target.log(z[None])[0]), 1e-2
    hessian, gradient = target.curvature(z)
    for _ in range(_STEPS):
        scale = np.diag(np.diag(hessian))
        tried = np.clip(
            z + np.linalg.solve(hessian + damping * scale, gradient), -_FARTHEST, _FARTHEST
        )
        there = float(target.log(tried[None])[0])
        if there > here:
            gained, z, here = there - here, tried, there
            hessian, gradient = target.curvature(z)
            damping /= 5
            if gained < _GAIN:
                break
        elif (damping := damping * 6) > _MOST_DAMPING:
            break
    covariance = np.linalg.inv(hessian + _LEAST_CURVATURE * np.eye(len(z)))
    return _Summit(z, here, np.asarray(covariance, dtype=np.float64))


@dataclass(frozen=True, eq=False)
class _Points(Rows):
    z: FloatArray


def _log_density(proposal: TMixture, batch: _Points) -> FloatArray:
    own = np.log1p(-_FROM_PRIOR) + proposal.log_density(batch.z)
    return np.asarray(np.logaddexp(own, np.log(_FROM_PRIOR) + log_normal(batch.z)))


def _sampled(
    target: _Target, peaks: Sequence[_Summit], rng: np.random.Generator
) -> Pool[TMixture, _Points]:
    """Draws about the peaks, until enough are effective; the last proposals fit their own draws."""
    parts = [Normal(each.z, wide**2 * each.covariance) for each in peaks for wide in _WIDTHS]
    log = np.array([each.log for each in peaks for _ in _WIDTHS])
    first = proposal = TMixture(parts, np.maximum(scipy.special.softmax(log), 0.02))
    pool: Pool[TMixture, _Points] = Pool(_log_density)
    for _ in range(_ROUNDS):
        z = proposal.draw(_ROUND, rng)
        prior = rng.random(_ROUND) < _FROM_PRIOR
        z[prior] = rng.standard_normal((int(prior.sum()), z.shape[1]))
        log_target = target.log(z)
        log_target = np.where(np.isnan(log_target), -np.inf, log_target)
        pool.add(proposal, _ROUND, _Points(z), log_target)
        if pool.effective > _ENOUGH:
            break
        fewest = _TO_FIT * z.shape[1]
        weights = tempered(pool.log_weights, fewest, _COOLING, _LEAST_POWER)
        proposal = proposal.refitted(pool.batch.z, weights).mixed(first, _FROM_FIRST)
    return pool


# Judgement, in a prior's standard deviations: nearer to a bound than a hundredth of the range; so
# far out that one in 150 000 lies beyond.
_AT_BOUND, _FAR_OUT = 2.33, 4.5
_FEWEST_EFFECTIVE = 20  # judgement: fewer draws tell a spread to no better than a sixth
# Judgement: what does not fit, but for one of its three worst readings, holds a slip.
_BAD, _GOOD, _SUSPECTS = 0.01, 0.05, 3


def without_copies(readings: Sequence[Reading]) -> tuple[tuple[Reading, ...], tuple[str, ...]]:
    """The readings, those alike to the last digit once, and a remark on them."""
    kept = {
        (tuple(sorted(e.condition.items())), e.observable, e.value, repr(e.sd)): e for e in readings
    }
    copies = len(readings) - len(kept)
    if not copies:
        return tuple(readings), ()
    return tuple(kept.values()), (
        f"{copies} of {len(readings)} readings repeat another one to the last digit and count once:"
        " a copy, or a step of the instrument that hides its scatter, adds nothing.",
    )


def errors_of(problem: SimulatorProblem, fit: Fit) -> FloatArray:
    """Stated deviations, and for unstated ones those that the fit found."""
    found = np.sqrt(np.diag(fit.noise.frequency))
    return np.where(np.isfinite(problem.sd), problem.sd, found)


def in_sds(problem: SimulatorProblem, fit: Fit) -> FloatArray:
    """What a fit leaves of each reading (data,)."""
    return np.asarray((problem.value - fit.predicted) / errors_of(problem, fit))


def rms(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def p_value(problem: SimulatorProblem, fit: Fit, residual: FloatArray | None = None) -> float:
    """Of the misfit at the best point, averaged over the unknown size of the errors.

    A `residual` (data,) may be another than the fit's, NaN for readings that do not count.
    """
    away = problem.value - fit.predicted if residual is None else residual
    freedom = max(1, int(np.isfinite(away).sum()) - len(fit.z))
    nodes = problem.nodes()
    weight = np.exp([each.log_weight for each in nodes])
    squares = [float(np.nansum(away**2 / np.diag(n.covariance.frequency))) for n in nodes]
    return float(weight @ scipy.special.chdtrc(freedom, squares) / weight.sum())


def moments(
    problem: SimulatorProblem, fit: Fit, names: Mapping[str, object]
) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation of parameters; NaN for a deviation that draws do not show."""
    found = {}
    for j, (name, prior) in enumerate(problem.priors(fit.hypothesis).items()):
        if name in names:
            value = prior.value(fit.draws[:, j])
            shown = fit.effective >= _FEWEST_EFFECTIVE and not _at_bound(prior, fit.draws[:, j])
            found[name] = float(value.mean()), float(value.std()) if shown else float("nan")
    return found


def _at_bound(prior: Prior, z: FloatArray) -> bool:
    return prior.spread in ("uniform", "logarithmic") and bool(abs(z.mean()) > _AT_BOUND)


def at_bounds(problem: SimulatorProblem, fit: Fit) -> tuple[str, ...]:
    """A remark on each parameter that lies at the bound of its prior, or far out of it."""
    said = []
    for j, (name, prior) in enumerate(problem.priors(fit.hypothesis).items()):
        z = fit.draws[:, j]
        bound = _at_bound(prior, z)
        if bound or abs(z.mean()) > _FAR_OUT:
            where = "at its bound" if bound else "far out of its prior"
            said.append(
                f"{name} lies {where}, {float(prior.value(z).mean()):.4g}: widen its prior if it "
                "may lie there."
            )
    return tuple(said)


def slips(problem: SimulatorProblem, *fits: Fit) -> tuple[str, ...]:
    """A remark on the reading with which alone the last of these does not fit, if any does not."""
    return tuple(said for fit in fits if (said := _slip(problem, fit)))[-1:]


def _slip(problem: SimulatorProblem, fit: Fit) -> str:
    """On the reading without which a bad fit is a good one; empty where there is none."""
    if len(problem.value) < len(fit.z) + 3 or p_value(problem, fit) > _BAD:
        return ""
    best, said = _GOOD, ""
    for row in np.argsort(-np.abs(in_sds(problem, fit)))[:_SUSPECTS]:
        z = refitted(problem, fit, np.arange(len(problem.value)) != row)
        away = problem.value - problem.predicted(fit.hypothesis, z[None])[0]
        off = abs(away[row]) / errors_of(problem, fit)[row]
        away[row] = np.nan
        if (p := p_value(problem, fit, away)) > best:
            best, said = p, _on_slip(problem.readings[row], off, fit.hypothesis.name)
    return said


def _on_slip(reading: Reading, off: float, effect: str) -> str:
    return (
        f"{reading.observable} = {reading.value:.6g} at {dict(reading.condition)} lies "
        f"{off:.0f} sds from what all other readings say with {effect or 'the simulator alone'}: "
        "look whether it is a slip, and diagnose again without it."
    )
