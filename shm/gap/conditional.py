"""The linear parameters of a hypothesis integrated out at given values of the others.

Tension and the bar's deviations move the logarithms of frequencies nearly in proportion, so that
at given other parameters their posterior is normal, whatever shape the others' posterior has
(Rue, Martino and Chopin 2009 integrate nested normal approximations in this way).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from shm.gap.contract import Fit
from shm.gap.landscape import Landscape
from shm.gap.straight import Straight
from shm.values import BoolArray, FloatArray, IntArray

_STEPS = 3
_SETTLED_GAIN = 0.2
_LONGEST_STEP = 2.5
_NEVER = -1e300


@dataclass(frozen=True, eq=False)
class Settled:
    """Points z (n, d) with their linear parameters at the best that the others allow.

    `log_marginal` (n,) is the log likelihood with the linear ones integrated out over their
    priors, `covariance` (n, l, l) their posterior's.
    """

    z: FloatArray
    log_marginal: FloatArray
    covariance: FloatArray

    def take(self, rows: IntArray) -> Settled:
        """Some of the points, by index."""
        return Settled(self.z[rows], self.log_marginal[rows], self.covariance[rows])

    def joined(self, other: Settled) -> Settled:
        """Both sets of points."""
        return Settled(
            np.concatenate([self.z, other.z]),
            np.concatenate([self.log_marginal, other.log_marginal]),
            np.concatenate([self.covariance, other.covariance]),
        )


class Conditional:
    """Settles the linear parameters with the slopes that they have at a fit."""

    def __init__(self, landscape: Landscape, fit: Fit, straight: Straight):
        self._landscape = landscape
        self._linear = landscape.coordinates.linear
        self._fit = fit
        slopes = fit.slopes[:, self._linear]
        self._weighed = landscape.likelihood.weighed(slopes)
        inner = self._weighed.products(slopes.T) + np.eye(len(self._linear))
        rest = landscape.coordinates.other
        self._straight, self._middle = straight, straight.y(fit.z[None, rest])[0]
        bent = straight.slopes(fit.z[rest])
        own = bent @ fit.covariance[np.ix_(rest, rest)] @ bent.T
        shared = bent @ fit.covariance[np.ix_(rest, self._linear)]
        self._pull = np.linalg.solve(own, shared)
        self._covariance: FloatArray = np.linalg.inv(inner).astype(np.float64)
        self._height = landscape.likelihood.log_height - np.linalg.slogdet(inner)[1] / 2

    def settled(self, other: FloatArray) -> Settled:
        """Of the other parameters (n, d - l), in order."""
        z = self._started(other)
        now = self._view(z)
        for _ in range(_STEPS):
            moving = np.flatnonzero(now.gain > _SETTLED_GAIN)
            if not len(moving):
                break
            tried = z[moving]
            tried[:, self._linear] += now.step[moving]
            there = self._view(tried)
            better = there.log_here > now.log_here[moving]
            z[moving[better]] = tried[better]
            now = now.replaced(moving[better], there, better)
            now.gain[moving[~better]] = 0.0
        z[:, self._linear] += now.step
        return Settled(z, now.log_marginal, self._covariance[now.node])

    def _started(self, other: FloatArray) -> FloatArray:
        """Points with the linear parameters where the fit's normal distribution has them."""
        rest = self._landscape.coordinates.other
        z = np.empty((len(other), len(self._fit.z)))
        z[:, rest] = other
        away = (self._straight.y(other) - self._middle) @ self._pull
        z[:, self._linear] = self._fit.z[self._linear] + away.clip(-_LONGEST_STEP, _LONGEST_STEP)
        return z

    def _view(self, z: FloatArray) -> _View:
        residual = self._landscape.residual(z)
        squares = self._landscape.likelihood.by_node(residual).T
        finite = np.asarray(np.isfinite(squares).all(axis=0))
        linear = z[:, self._linear]
        pull = self._weighed.products(np.where(finite[:, None], residual, 0.0)) - linear
        step = pull @ self._covariance
        gain = (pull * step).sum(axis=2) / 2
        volume = self._height - self._landscape.likelihood.log_height
        log = squares + volume[:, None] - (linear**2).sum(axis=1) / 2 + gain
        log = np.where(finite, log, _NEVER)
        node, rows = log.argmax(axis=0), np.arange(len(z))
        chosen = step[node, rows].clip(-_LONGEST_STEP, _LONGEST_STEP)
        return _View(
            np.asarray(logsumexp(log, axis=0)),
            np.where(finite, gain[node, rows], 0.0),
            chosen,
            node,
        )


@dataclass(frozen=True, eq=False)
class _View:
    """Seen from points: the log marginal, the gain of a full step, the step, the likeliest node."""

    log_marginal: FloatArray
    gain: FloatArray
    step: FloatArray
    node: IntArray

    @property
    def log_here(self) -> FloatArray:
        """Log posterior of the linear parameters where they are, but for a constant."""
        return self.log_marginal - self.gain

    def replaced(self, rows: IntArray, other: _View, chosen: BoolArray) -> _View:
        """This view with `rows` taken from the `chosen` points of another."""
        fields = []
        for name in ("log_marginal", "gain", "step", "node"):
            values = getattr(self, name).copy()
            values[rows] = getattr(other, name)[chosen]
            fields.append(values)
        return _View(*fields)
