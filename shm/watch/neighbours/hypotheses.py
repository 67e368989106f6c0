"""Everything that may have moved, with its probability: all explanations at all noise scales.

Shifts y (n,) in N are y = x + e, e ~ N(0, D): D holds each hanger's own variance and a small part
common to all. An explanation says x ~ N(0, S) with S = U U' of low rank, so that the marginal
likelihood is N(y; 0, D + U U') by the matrix determinant lemma and Woodbury's identity (Rasmussen
and Williams 2006, appendix A.3); a loss or a gain is the half of it with that sign.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.values import FloatArray, IntArray
from shm.watch.neighbours.pattern_types import ExplanationName, HangerShift, NeighbourOptions

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
    kept = scipy.special.log_ndtr(sign * mean / np.maximum(sd, 1e-300)).sum(axis=1)
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
    moving = scipy.special.logsumexp(by_size, axis=1)
    no, yes = np.log1p(-chance)[:, None, None] + still, np.log(chance)[:, None, None] + moving
    either = np.logaddexp(no, yes)
    weight = np.log(chance_weight)[:, None] + common_weight
    whole, none = weight + either.sum(axis=2), weight + no.sum(axis=2)
    log_whole = float(scipy.special.logsumexp(whole))
    # Were nothing moved counted in here, it would be counted twice.
    log_none = min(float(scipy.special.logsumexp(none)), log_whole - 1e-9)
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
    return np.asarray(weights - scipy.special.logsumexp(weights), np.float64)


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
    return scipy.special.ndtr((mean - least) / width), scipy.special.ndtr((-mean - least) / width)


# Both of two equal losses stand among the likeliest single ones.
_FIRST_OF_TWO = 3
_NOBODY: IntArray = np.empty((0, 0), np.int64)
_SWING_K = 5.0
_SPREAD = 0.2


@dataclass(frozen=True, eq=False)
class Part:
    """Hypotheses of one explanation at one noise scale.

    Log probabilities (h,); `members` (h, m) are the hangers that shed or gained, empty for the
    other explanations; probabilities (h, n) that each hanger gained or lost more than is
    negligible; means and standard deviations (h, n) of its shift in N.
    """

    name: ExplanationName
    log_weight: FloatArray
    members: IntArray
    gained: FloatArray
    lost: FloatArray
    mean_n: FloatArray
    sd_n: FloatArray


def hypotheses(
    shifts: Sequence[HangerShift], causes: Sequence[AlikeCause], options: NeighbourOptions
) -> tuple[Part, ...]:
    """All hypotheses with their posterior probabilities, which add to 1."""
    parts: list[Part] = []
    for scale, prior in zip(options.noise_scales, options.noise_prior, strict=True):
        bridge = Bridge.of(shifts, options, scale)
        for part in _at_one_scale(bridge, causes, options):
            parts.append(replace(part, log_weight=part.log_weight + math.log(prior)))
    total = float(scipy.special.logsumexp(np.concatenate([part.log_weight for part in parts])))
    return tuple(replace(part, log_weight=part.log_weight - total) for part in parts)


def _at_one_scale(
    bridge: Bridge, causes: Sequence[AlikeCause], options: NeighbourOptions
) -> tuple[Part, ...]:
    found = nothing(bridge)
    weight = found.log_evidence + math.log(options.prior["no change"])
    still = _part("no change", weight, _NOBODY, found, bridge, options)
    return (
        still,
        _alike(bridge, causes, options),
        *_moves(bridge, options),
        _by_itself(bridge, options),
    )


def _part(
    name: ExplanationName,
    log_weight: FloatArray,
    members: IntArray,
    found: Weighed,
    bridge: Bridge,
    options: NeighbourOptions,
) -> Part:
    least = options.negligible_fraction * bridge.baseline_n
    gained, lost = beyond(found.mean_n, found.sd_n, least)
    return Part(name, log_weight, members, gained, lost, found.mean_n, found.sd_n)


def _by_itself(bridge: Bridge, options: NeighbourOptions) -> Part:
    found = independent(bridge, options)
    weight = found.log_evidence + math.log(options.prior["independent shifts"])
    unknown = np.full((1, len(bridge.shift_n)), np.nan)
    return Part(
        "independent shifts", np.array([weight]), _NOBODY, found.gained[None], found.lost[None],
        unknown, unknown,
    )  # fmt: skip


def _alike(bridge: Bridge, causes: Sequence[AlikeCause], options: NeighbourOptions) -> Part:
    patterns = np.array([each.fractions * bridge.baseline_n for each in causes])
    found = weighed(bridge, _sized(patterns[:, :, None], options))
    prior = math.log(options.prior["common shift"] / len(found.log_evidence))
    return _part("common shift", found.log_evidence + prior, _NOBODY, found, bridge, options)


def _sized(factors: FloatArray, options: NeighbourOptions) -> FloatArray:
    """Each factor at each size, sizes running slowest."""
    sizes = np.array(options.sizes_fraction)[:, None, None, None]
    return np.asarray((sizes * factors).reshape(-1, *factors.shape[1:]), np.float64)


def _moves(bridge: Bridge, options: NeighbourOptions) -> tuple[Part, Part, Part]:
    """One hanger sheds, one gains, two shed."""
    factors, count = shed_factors(bridge, options), len(bridge.shift_n)
    sizes = len(options.sizes_fraction)
    one, found = (
        np.tile(np.arange(count)[:, None], (sizes, 1)),
        weighed(bridge, _sized(factors, options)),
    )
    two = _pairs(with_sign(found, one, -1), count)
    both = np.concatenate([factors[two[:, 0]], factors[two[:, 1]]], axis=2)
    found_of_two = weighed(bridge, _sized(both, options))
    shed, gained = options.prior["load redistribution"], options.prior["load gain"]
    one_shed = shed * (1 - options.two_hangers) / (count * sizes)
    two_shed = shed * options.two_hangers / (count * (count - 1) / 2 * sizes)
    two = np.tile(two, (sizes, 1))

    def part(
        name: ExplanationName, members: IntArray, of: Weighed, sign: int, prior: float
    ) -> Part:
        weight = with_sign(of, members, sign) + math.log(prior)
        return _part(name, weight, members, of, bridge, options)

    return (
        part("load redistribution", one, found, -1, one_shed),
        part("load gain", one, found, 1, gained / (count * sizes)),
        part("load redistribution", two, found_of_two, -1, two_shed),
    )


def _pairs(logs_of_one: FloatArray, count: int) -> IntArray:
    """Pairs (p, 2) of hangers of which one is among the likeliest to have shed load by itself."""
    of_each = scipy.special.logsumexp(logs_of_one.reshape(-1, count), axis=0)
    first = of_each.argsort()[-_FIRST_OF_TWO:].tolist()
    return np.array([(i, j) for i in first for j in range(count) if i < j or j not in first])


@dataclass(frozen=True, eq=False)
class AlikeCause:
    """A common cause: the fractions (n,) that it moves hangers by, largest about 1; what to do."""

    fractions: FloatArray
    name: str
    remedy: str


def alike_causes(shifts: Sequence[HangerShift]) -> tuple[AlikeCause, ...]:
    """Every common cause that the data could tell from another.

    All by one fraction; each as its temperature went, where those differ. A rate that is off by e
    moves frequencies by e, tensions by 2e.
    """
    return (_common(shifts), *_by_temperature(shifts))


def _common(shifts: Sequence[HangerShift]) -> AlikeCause:
    changes = _changes(shifts)
    everywhere = np.ones(len(shifts))
    clocks = "compare the loggers' clocks and sampling rates"
    if _swing(changes) < _SWING_K:
        return AlikeCause(
            everywhere,
            "a clock or a load on the whole deck",
            f"the temperatures hardly changed; {clocks}, and ask for new surfacing or works",
        )
    if np.isfinite(changes).all() and changes.std() <= _SPREAD * _swing(changes):
        return AlikeCause(
            everywhere,
            "a temperature or a clock",
            f"all tests lie about {changes.mean():+.0f} K from their baselines; "
            f"check the temperature readings, and {clocks}",
        )
    return AlikeCause(
        everywhere, "a temperature or a clock", f"{clocks}, and the temperatures of the tests"
    )


def _by_temperature(shifts: Sequence[HangerShift]) -> tuple[AlikeCause, ...]:
    changes = _changes(shifts)
    swing = _swing(changes)
    if not (swing >= _SWING_K and changes.std() > _SPREAD * swing):
        return ()
    remedy = "the shifts go with the temperatures of the tests; check those readings"
    return (AlikeCause(changes / np.abs(changes).max(), "the temperature", remedy),)


def _changes(shifts: Sequence[HangerShift]) -> FloatArray:
    return np.array([each.temperature_change_k for each in shifts])


def _swing(changes: FloatArray) -> float:
    """Root mean square of the changes in K; NaN where one is unknown."""
    return float(np.sqrt(np.mean(changes**2)))
