"""The posterior of one hypothesis about a hanger or a user's simulator."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from shm.gap.hypotheses.contract import Hypothesis
from shm.inference.sampler.density import Density
from shm.inference.sampler.likelihood import Likelihood
from shm.values import FloatArray, IntArray

SETTLED = 0.3
"""Numerical: of a prior's standard deviation; over less the slopes of linear parameters hold."""


class Problem(Protocol):
    """Predictions of hypotheses for one set of data."""

    @property
    def value(self) -> FloatArray:
        """Return the data (data,)."""

    def linear(self, hypothesis: Hypothesis) -> IntArray:
        """Return the columns in which predictions are nearly linear."""

    def dimension(self, hypothesis: Hypothesis) -> int:
        """Return how many parameters there are."""

    def predict(self, hypothesis: Hypothesis, z: FloatArray) -> FloatArray:
        """Return the data (n, data) that z (n, d) predict; NaN where they cannot."""

    def likelihood(self, hypothesis: Hypothesis) -> Likelihood:
        """Return the likelihood of residuals."""


class Target(Density):
    """The posterior of a hypothesis in coordinates z (d,) with standard normal priors."""

    def __init__(
        self, problem: Problem, hypothesis: Hypothesis, likelihood: Likelihood | None = None
    ):
        self.problem, self.hypothesis = problem, hypothesis
        self.value = problem.value
        self._likelihood = likelihood or problem.likelihood(hypothesis)
        self.dimension = problem.dimension(hypothesis)
        self.linear = problem.linear(hypothesis)
        self.other: IntArray = np.setdiff1d(np.arange(self.dimension), self.linear)

    @property
    def likelihood(self) -> Likelihood:
        return self._likelihood

    def predict(self, z: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            return self.problem.predict(self.hypothesis, z)

    def follow(self, z: FloatArray, before: FloatArray, slopes: FloatArray) -> FloatArray:
        near = (np.abs(z - before)[:, self.linear] <= SETTLED).all(axis=1)
        found = slopes.copy()
        if not near.all():
            found[~near] = self.slopes(z[~near])
        rows = np.flatnonzero(near)
        if len(rows) and len(self.other):
            ways = np.eye(self.dimension)[:, self.other]
            found[np.ix_(rows, np.arange(found.shape[1]), self.other)] = self.slopes(z[rows], ways)
        return found
