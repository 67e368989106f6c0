"""Parameters in which the data are linear, integrated out in closed form.

With standard normal priors and normal errors both the evidence and the best values of such
parameters follow from two products of matrices, for each possible size of the errors.
"""

from __future__ import annotations

import numpy as np
import scipy

from shm.inference.sampler.likelihood import Likelihood
from shm.values import FloatArray, IntArray

_LONGEST = 2.5  # numerical: standard deviations of a prior; over more no slope holds


class Linear:
    """Parameters with fixed slopes (data, l) of the prediction and standard normal priors."""

    def __init__(self, likelihood: Likelihood, slopes: FloatArray):
        self.likelihood = likelihood
        self._slopes, self._weighed = slopes, likelihood.weighed(slopes)
        inner = self._weighed.products(slopes.T) + np.eye(slopes.shape[1])
        self.covariance: FloatArray = np.asarray(np.linalg.inv(inner), dtype=np.float64)
        self._height = likelihood.log_height - np.linalg.slogdet(inner)[1] / 2

    def marginal(
        self, residual: FloatArray, z: FloatArray
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        """Return the log marginal likelihood (n,) of residuals (n, data) at z (n, l).

        With it the step (n, l) to the best z, and the index (n,) of the likeliest error.
        """
        known = np.asarray(np.isfinite(residual).all(axis=1))
        residual = np.where(known[:, None], residual, 0.0)
        pull = self._weighed.products(residual) - z  # (nodes, n, l)
        step = pull @ self.covariance
        square = self.likelihood.squares(residual).T + (z**2).sum(axis=1)
        square = square - (pull * step).sum(axis=2)
        log = np.where(known, self._height[:, None] - square / 2, -np.inf)
        node, rows = log.argmax(axis=0), np.arange(len(z))
        found = step[node, rows]
        # Digits that cancelled, as where slopes are those of a cliff, never raise the likelihood.
        left = self.likelihood.squares(residual - found @ self._slopes.T)[rows, node]
        lost = left + ((z + found) ** 2).sum(axis=1) - square[node, rows]
        log_marginal = scipy.special.logsumexp(log, axis=0) - np.maximum(lost, 0.0) / 2
        found = np.where(known[:, None], found.clip(-_LONGEST, _LONGEST), 0.0)
        return np.where(known, log_marginal, -np.inf), found, node

    def visible(self, shift: FloatArray, node: int) -> FloatArray:
        """Return by how many standard deviations shifts (n, data) go beyond what z can follow.

        By the errors of one `node`; shape (n,).
        """
        pull = self._weighed.products(shift)[node]
        followed = ((pull @ self.covariance[node]) * pull).sum(axis=1)
        beyond = self.likelihood.squares(shift)[:, node] - followed
        return np.asarray(np.sqrt(np.maximum(beyond, 0.0)))
