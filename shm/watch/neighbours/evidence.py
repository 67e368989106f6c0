"""Marginal likelihoods of what may have moved, in closed form or by quadrature in one dimension.

Shifts y (n,) in N are y = x + e, e ~ N(0, D): D holds each hanger's own variance and a small part
common to all. An explanation says x ~ N(0, S) with S = U U' of low rank, so that the marginal
likelihood is N(y; 0, D + U U') by the matrix determinant lemma and Woodbury's identity (Rasmussen
and Williams 2006, appendix A.3); a loss or a gain is the half of it with that sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, logsumexp, ndtr

from shm.values import FloatArray, IntArray
from shm.watch.neighbours.pattern_types import HangerShift, NeighbourOptions

# Technical: at a sixteenth of an sd the trapezoid rule is exact to rounding for a normal law, and
# Gauss's of 16 nodes for polynomials of degree 31.
_COMMON_NODES = np.linspace(-5, 5, 161)
_FRACTION_NODES, _FRACTION_WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True, eq=False)
class Bridge:
    """Shifts, their noise and the tensions they started from, each (n,); `places` (n,) along it."""

    places: IntArray
    shift_n: FloatArray
    sd_n: FloatArray
    baseline_n: FloatArray
    common_sd_n: FloatArray

    @classmethod
    def of(
        cls, shifts: Sequence[HangerShift], options: NeighbourOptions, noise_scale: float = 1.0
    ) -> Bridge:
        """The compared hangers with the scatter that their own standard deviations leave out."""
        baseline = np.array([each.baseline_n for each in shifts])
        own = noise_scale * np.array([each.shift_sd_n for each in shifts])
        return cls(
            places=np.array([each.place for each in shifts], np.int64),
            shift_n=np.array([each.shift_n for each in shifts]),
            sd_n=np.hypot(own, options.scatter_fraction * baseline),
            baseline_n=baseline,
            common_sd_n=options.common_scatter_fraction * baseline,
        )

    @property
    def noise(self) -> FloatArray:
        """Covariance D (n, n) of the shifts where nothing moved, in N^2."""
        return np.diag(self.sd_n**2) + np.outer(self.common_sd_n, self.common_sd_n)


@dataclass(frozen=True, eq=False)
class Weighed:
    """Evidence of h hypotheses and what x is under each: log evidences (h,), means, sds (h, n)."""

    log_evidence: FloatArray
    mean_n: FloatArray
    sd_n: FloatArray


def nothing(bridge: Bridge) -> Weighed:
    """N(y; 0, D): x is 0."""
    none = np.zeros((1, len(bridge.shift_n)))
    return Weighed(np.array([_log_normal(bridge)]), none, none)


def weighed(bridge: Bridge, factors: FloatArray) -> Weighed:
    """Hypotheses x ~ N(0, U U') with `factors` U (h, n, r) in N."""
    whiten = np.linalg.inv(np.linalg.cholesky(bridge.noise))
    white = whiten @ factors
    pull = (whiten @ bridge.shift_n) @ white
    precision = np.eye(factors.shape[2]) + np.swapaxes(white, 1, 2) @ white
    covariance = np.linalg.inv(precision)
    latent = np.einsum("hrs,hs->hr", covariance, pull)
    log_size = np.linalg.slogdet(precision)[1]
    gain = 0.5 * (np.einsum("hr,hr->h", pull, latent) - log_size)
    variance = np.einsum("hnr,hrs,hns->hn", factors, covariance, factors)
    return Weighed(
        _log_normal(bridge) + gain,
        np.einsum("hnr,hr->hn", factors, latent),
        np.sqrt(np.maximum(variance, 0)),
    )


def _log_normal(bridge: Bridge) -> float:
    lower = np.linalg.cholesky(bridge.noise)
    white = np.linalg.solve(lower, bridge.shift_n)
    size = 2 * np.log(np.diag(lower)).sum() + len(white) * np.log(2 * np.pi)
    return float(-0.5 * (white @ white + size))


def with_sign(found: Weighed, members: IntArray, sign: int) -> FloatArray:
    """Log evidences (h,) of the same hypotheses with x of `members` (h, m) of that sign.

    For two members the signs are taken as independent, which matters only where they are in doubt.
    """
    rows = np.arange(len(members))[:, None]
    mean, sd = found.mean_n[rows, members], found.sd_n[rows, members]
    kept = log_ndtr(sign * mean / np.maximum(sd, 1e-300)).sum(axis=1)
    return np.asarray(found.log_evidence + kept + members.shape[1] * np.log(2), np.float64)


def shed_factors(bridge: Bridge, options: NeighbourOptions) -> FloatArray:
    """U (n, n, 5) for a loss of one hanger each, of one times its tension, taken up around it.

    The pattern is -1 at the hanger and Dirichlet shares at the places within two of it; U U' is its
    second moment. Shares of a hanger without a test, or beyond the bridge's end, go unseen.
    """
    mean = np.array(
        [options.next_share, options.nearest_share, options.nearest_share, options.next_share]
    )
    mean = mean / mean.sum()
    spread = np.diag(np.sqrt(mean)) - np.outer(mean, np.sqrt(mean))
    shares = np.column_stack([mean, spread / np.sqrt(options.share_concentration + 1)])
    away = bridge.places[None, :] - bridge.places[:, None]
    factors = np.zeros((*away.shape, 5))
    for row, distance in zip(shares, (-2, -1, 1, 2), strict=True):
        factors[away == distance] = row
    factors[away == 0, 0] = -1
    return np.asarray(factors * bridge.baseline_n[:, None, None], np.float64)


@dataclass(frozen=True, eq=False)
class Independent:
    """Each hanger by itself: the evidence, and for each hanger (n,) whether and how it moved."""

    log_evidence: float
    moved: FloatArray
    gained: FloatArray
    lost: FloatArray


def independent(bridge: Bridge, options: NeighbourOptions) -> Independent:
    """At least one hanger moved, each with the same chance, by N(0, (size x tension)^2).

    The chance is uniform between 0 and 1, so that any number of hangers is as likely as another.
    Given it and the common part of the noise the hangers are independent: two quadratures.
    """
    common, common_weight = _COMMON_NODES, _normal_weights()
    left = bridge.shift_n - common[:, None] * bridge.common_sd_n
    still = _log_density(left, bridge.sd_n**2)
    spread = (np.array(options.sizes_fraction)[:, None] * bridge.baseline_n) ** 2
    by_size = _log_density(left[:, None], spread + bridge.sd_n**2) - np.log(len(spread))
    chance, chance_weight = (1 + _FRACTION_NODES) / 2, _FRACTION_WEIGHTS / 2
    moving = logsumexp(by_size, axis=1)
    no, yes = np.log1p(-chance)[:, None, None] + still, np.log(chance)[:, None, None] + moving
    either = np.logaddexp(no, yes)
    weight = np.log(chance_weight)[:, None] + common_weight
    whole, none = weight + either.sum(axis=2), weight + no.sum(axis=2)
    log_whole = float(logsumexp(whole))
    # Were nothing moved counted in here, it would be counted twice.
    log_none = min(float(logsumexp(none)), log_whole - 1e-9)
    some = log_whole + np.log(-np.expm1(log_none - log_whole))
    kept = np.exp(whole - some)
    by_node = np.einsum("qc,qcn->cn", kept, np.exp(yes - either))
    of_size = by_node[:, None] * np.exp(by_size - moving[:, None])
    gained, lost = _signs(bridge, options, left, spread)
    count = len(bridge.shift_n)
    return Independent(
        some - float(np.log(count / (count + 1))),
        np.minimum(by_node.sum(axis=0), 1),
        np.einsum("csn,csn->n", of_size, gained),
        np.einsum("csn,csn->n", of_size, lost),
    )


def _normal_weights() -> FloatArray:
    weights = -0.5 * _COMMON_NODES**2
    return np.asarray(weights - logsumexp(weights), np.float64)


def _log_density(left: FloatArray, variance: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * (left**2 / variance + np.log(2 * np.pi * variance)), np.float64)


def _signs(
    bridge: Bridge, options: NeighbourOptions, left: FloatArray, spread: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Probabilities (nodes, sizes, n) of more than a negligible gain and loss, if it moved."""
    pull = spread / (spread + bridge.sd_n**2)
    mean, sd = left[:, None] * pull, np.sqrt(pull) * bridge.sd_n
    return beyond(mean, sd, options.negligible_fraction * bridge.baseline_n)


def beyond(mean: FloatArray, sd: FloatArray, least: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Probabilities that a normal variable lies above `least`, and below minus `least`."""
    width = np.maximum(sd, 1e-300)
    return ndtr((mean - least) / width), ndtr((-mean - least) / width)
