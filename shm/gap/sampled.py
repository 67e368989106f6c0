"""The posterior of a fit by importance sampling, where a normal distribution is too plain.

Only what is not nearly linear is drawn, from t distributions put on the fit's peaks and refitted
to their own weighted draws (Cappe et al. 2008, population Monte Carlo), with a share of the prior
so that no weight is unbounded (Hesterberg 1995). Tension and the bar's deviations are integrated
out at each draw. The evidence rests on fresh draws from the last mixture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from shm.gap.branched import Points, Proposal
from shm.gap.conditional import Conditional, Settled
from shm.gap.contract import Fit
from shm.gap.coordinates import Branch
from shm.gap.fit import fitted
from shm.gap.landscape import Landscape, log_normal
from shm.gap.problem import GapProblem
from shm.inference.tmcmc import normalised, systematic
from shm.values import FloatArray

_TRIAL, _MOST_TRIALS = 100, 4
_FINAL, _MOST_FINALS = 200, 4
_ENOUGH = 120.0
_GOOD_SHARE = 0.3
_UNSEEN = 1.25
_MUCH_BETTER = 2.0


@dataclass(frozen=True, eq=False)
class _Draws:
    """Draws with their linear parameters settled and log weights (n,)."""

    points: Points
    settled: Settled
    log_weight: FloatArray

    @property
    def effective(self) -> float:
        """Kish's effective number of draws."""
        return float(1 / np.sum(normalised(self.log_weight) ** 2))

    def joined(self, other: _Draws) -> _Draws:
        return _Draws(
            self.points.joined(other.points),
            self.settled.joined(other.settled),
            np.append(self.log_weight, other.log_weight),
        )


def sampled(problem: GapProblem, fit: Fit, rng: np.random.Generator, draws: int) -> Fit:
    """The same fit with `draws` equal draws and an evidence with its standard error, by sampling.

    Where a draw is much more probable than the fit's `z`, the fit is made anew from there.
    """
    sampler = _Sampler(problem, fit)
    final = sampler.run(rng)
    best = int((final.settled.log_marginal + log_normal(final.points.w)).argmax())
    if final.settled.log_marginal[best] > sampler.log_marginal_of_fit + _MUCH_BETTER:
        fit = fitted(problem, fit.hypothesis, rng, np.stack([final.settled.z[best], fit.z]))
    rows = systematic(normalised(final.log_weight), draws, rng)
    share = 1 / final.effective - 1 / len(final.log_weight)
    return replace(
        fit,
        draws=rng.permutation(sampler.scattered(final.settled.take(rows), rng)),
        log_evidence=float(logsumexp(final.log_weight) - np.log(len(final.log_weight))),
        log_evidence_sd=float(_UNSEEN * np.sqrt(max(share, 0.0))),
        method="sampled",
    )


class _Sampler:
    """Draws of what is not linear, on all choices of signs."""

    def __init__(self, problem: GapProblem, fit: Fit):
        self._landscape = Landscape(problem, fit.hypothesis)
        coordinates = self._landscape.coordinates
        self._linear, self._other = coordinates.linear, coordinates.other
        self._branches: Sequence[Branch] = [
            branch.part(self._other) for branch in coordinates.branches
        ]
        self._conditional = Conditional(self._landscape, fit)
        self._fit = fit

    @property
    def log_marginal_of_fit(self) -> float:
        """The log likelihood at the fit's other parameters, the linear ones integrated out."""
        return float(self._conditional.settled(self._fit.z[None, self._other]).log_marginal[0])

    def run(self, rng: np.random.Generator) -> _Draws:
        """Trials that the proposal is refitted to, then the draws that count."""
        proposal = Proposal.about(self._fit.peaks, self._branches, self._other)
        for _ in range(_MOST_TRIALS):
            trial = self._drawn(proposal, _TRIAL, rng)
            if trial.effective >= _GOOD_SHARE * _TRIAL:
                break
            proposal = proposal.refitted(trial.points, trial.log_weight)
        final = self._drawn(proposal, _FINAL, rng)
        for _ in range(_MOST_FINALS):
            if final.effective >= _ENOUGH:
                break
            final = final.joined(self._drawn(proposal, _FINAL, rng))
        return final

    def scattered(self, settled: Settled, rng: np.random.Generator) -> FloatArray:
        """Draws z (n, d) with the linear parameters drawn from their own posterior."""
        z = settled.z.copy()
        factor = np.linalg.cholesky(settled.covariance)
        noise = rng.standard_normal((len(z), len(self._linear), 1))
        z[:, self._linear] += (factor @ noise)[..., 0]
        return z

    def _drawn(self, proposal: Proposal, count: int, rng: np.random.Generator) -> _Draws:
        points = proposal.draw(count, rng)
        z = np.empty_like(points.w)
        for k, branch in enumerate(self._branches):
            z[points.branch == k] = branch.z(points.w[points.branch == k])
        settled = self._conditional.settled(z)
        prior = log_normal(points.w) + self._branches[0].log_prior
        return _Draws(points, settled, settled.log_marginal + prior - proposal.log_density(points))
