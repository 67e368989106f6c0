"""A cause that several hangers share, against each having causes of its own.

    P(data | e shared in F) = mean over pi, q, mu, tau of
        product over hangers i of  (1 - pi) own_i(q) + pi there_i(e, mu, tau, q),  two at least
    own_i(q) = q no_gap_i + (1 - q) gap_i
    there_i  = B_i(e) integral L_i(x) N(x | mu, tau) dx / mean L_i           over visible x
             + integral (q no_gap_i L_i(x) / L_i(0) + (1 - q) gap_i) N(x | mu, tau) dx   below

pi is the share of the family F that has the effect e, q that of hangers with nothing of their own
(both learnt from all hangers), x the size (`Reach`), which scatters by tau about the family's own,
mu. All are summed over grids. A size far below what is visible says neither yes nor no.
Hierarchies of this kind: Gelman et al., Bayesian Data Analysis, 2013, chapter 5.

Families are hangers that are alike in something. What a description says is compared as written:
hangers of one delivery, of one section, with ends alike, of about one length, and those measured in
one round of tests.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.shared_evidence import Evidence, Faint, Patient, Place
from shm.values import FloatArray, IntArray

LEAST = 2
"""Members of a family: one alone shares nothing."""

_CLASSES = 2.0
"""Lengths are of one class from one power of the root of this to the next: judgement, ends of
hangers as unlike as that are mostly made otherwise."""


@dataclass(frozen=True)
class Kin:
    """Hangers, by their index, and in words what they have in common."""

    likeness: str
    members: tuple[int, ...]


def kin(patients: Sequence[Patient]) -> tuple[Kin, ...]:
    """All hangers, then the parts of them that are alike in something; each set of hangers once."""
    found = {tuple(range(len(patients))): "all hangers"}
    for likeness, of in _LIKENESSES.items():
        parts: dict[Hashable, list[int]] = {}
        for index, each in enumerate(patients):
            if (key := of(each)) is not None:
                parts.setdefault(key, []).append(index)
        for members in parts.values():
            if len(members) >= LEAST:
                found.setdefault(tuple(members), likeness)
    return tuple(Kin(likeness, members) for members, likeness in found.items())


def _round(each: Patient) -> Hashable | None:
    """The days on which it was tested; None where a test does not say."""
    days = {test.time.date() if test.time else None for test in each.tests}
    return None if None in days else frozenset(days)


_LIKENESSES: dict[str, Callable[[Patient], Hashable | None]] = {
    "hangers of one delivery": lambda each: each.hanger.family or None,
    "hangers of one section": lambda each: (
        each.hanger.area_m2,
        each.hanger.second_moment_m4,
        each.hanger.mass_per_length_kg_m,
        each.hanger.elastic_modulus_pa,
    ),
    "hangers with ends alike": lambda each: (
        each.hanger.plate,
        each.hanger.supports,
        each.hanger.fittings_m,
    ),
    "hangers tested on the same days": _round,
    "hangers of about one length": lambda each: math.floor(
        math.log(each.hanger.length_m) / math.log(_CLASSES) * 2
    ),
}
# Technical: shares of a family, with prior 1 each; a twentieth is finer than 20 hangers can tell.
_SHARES = (np.arange(10) + 0.5) / 10
# Judgement: from bridges on which every hanger has something of its own to those on which one in
# fifty has; 0.25 is what a single diagnosis takes it to be.
_NOTHING_OWN = np.array([0.1, 0.25, 0.5, 0.8, 0.95, 0.98])
# Judgement: parts made alike differ by 7 to 60 % in how much they give, weigh or lack; the steps
# are of a decade, or of the range where it has none, and less scatter is likelier (half normal).
SCATTERS = np.array([0.03, 0.06, 0.12, 0.2])
_LIKELY_SCATTER = 0.1
_BELOW = 0.5
"""Judgement, decades: what one hanger sees by half a standard deviation, ten see by 1.5."""
_ABOUT = 0.15  # technical, decades: as far apart as points of a scan
_STEP = 0.03  # technical: the least scatter; normals so far apart add up evenly to 1e-8

_TINY = 1e-300  # technical: what is divided by, and taken the logarithm of


@dataclass(frozen=True, eq=False)
class Own:
    """What speaks for each hanger having nothing of its own, and something: (n, q) both."""

    nothing: FloatArray
    something: FloatArray

    @classmethod
    def of(cls, patients: Sequence[Patient]) -> Own:
        none = np.array([[each.no_gap] for each in patients])
        gap = np.array([[each.gap] for each in patients])
        return cls(_NOTHING_OWN * none, (1 - _NOTHING_OWN) * gap)

    @property
    def log(self) -> FloatArray:
        """Of either, (n, q)."""
        return _log(self.nothing + self.something)

    @property
    def log_evidence(self) -> float:
        log = self.log.sum(axis=0)
        return float(scipy.special.logsumexp(log) - np.log(len(log)))


@dataclass(frozen=True, eq=False)
class Sizes:
    """What the hangers say to the size of an effect at a place, on the grid of mu and tau.

    The grid's first axis (m) runs over the sizes `x` (m,) with their signs `sign` (m,). `seen`
    (n, m, tau) is the likelihood of a visible size, against own causes; `unseen` (n, m, tau) the
    chance of an invisible one, `faint` (n, m, tau) that times its likelihood over that of no
    effect. `normal` (m, m, tau) is the density of a hanger's size, first axis, by the family's.
    `at` says of each hanger's draws where on the grid they lie, `faint_at` of its faint points.
    """

    x: FloatArray
    sign: FloatArray
    seen: FloatArray
    unseen: FloatArray
    faint: FloatArray
    normal: FloatArray
    at: tuple[IntArray, ...]
    faint_at: tuple[IntArray, ...]

    def draw_weights(self, at: IntArray, weight: FloatArray) -> FloatArray:
        """Of draws `at` places of the grid, by weights (m, tau) of the family's size and scatter;
        they add to that of all."""
        mean = self.normal[at].sum(axis=0) if len(at) else np.ones_like(weight)
        return np.asarray((self.normal[at] * (weight / np.maximum(mean, _TINY))).sum(axis=(1, 2)))


def sizes(patients: Sequence[Patient], place: Place) -> Sizes | None:
    """Of an effect at a place; None where fewer than two hangers could show it."""
    found = [each.effects.get(place) for each in patients]
    known = [each for each in found if each is not None]
    if len(known) < LEAST:
        return None
    low = min(each.reach.lower for each in known) - _BELOW
    line = np.arange(low, max(each.reach.upper for each in known) + _STEP, _STEP)
    signs = np.array([1.0, -1.0] if known[0].reach.parameter.signed else [1.0])
    x, sign = np.tile(line, len(signs)), np.repeat(signs, len(line))
    away = (x[:, None, None] - x[:, None]) / SCATTERS
    normal = np.exp(-(away**2) / 2) / (SCATTERS * np.sqrt(2 * np.pi))
    normal *= (sign[:, None] == sign)[..., None]
    said = [_said(each, x, sign, normal) for each in found]
    seen, unseen, faint = (np.array([each[k] for each in said]) for k in range(3))
    at = tuple(_on_grid(each, low, len(line)) for each in found)
    faint_at = tuple(_on_grid(each and each.faint, low, len(line)) for each in found)
    return Sizes(x, sign, seen, unseen, faint, normal, at, faint_at)


def _on_grid(points: Evidence | Faint | None, low: float, count: int) -> IntArray:
    """Where draws or points of a hanger lie on the grid."""
    if points is None:
        return np.empty(0, dtype=np.int64)
    index = np.rint((points.x - low) / _STEP).astype(np.int64).clip(0, count - 1)
    return np.asarray(index + count * (points.sign < 0))


def _said(
    evidence: Evidence | None, x: FloatArray, sign: FloatArray, normal: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The likelihood of a visible size, the chance of an invisible one, the same weighed by what
    the data say to it; (m, tau) all."""
    every = np.ones((len(x), len(SCATTERS)))
    if evidence is None:
        return 0 * every, every, every
    reach, signs, low = evidence.reach, len(np.unique(sign)), float(x.min())
    count = len(x) // signs
    density = normal[_on_grid(evidence, low, count)].mean(axis=0)
    unseen = scipy.special.ndtr((reach.lower - x[:, None]) / SCATTERS)
    ratio = _smooth(evidence.faint, x, sign)
    below = np.tensordot((ratio - 1) * (x < reach.lower) * _STEP, normal, axes=1)
    seen = evidence.bayes_factor * reach.width * signs * density
    return seen, unseen, np.maximum(unseen + below, 0.0)


def _smooth(faint: Faint, x: FloatArray, sign: FloatArray) -> FloatArray:
    """The likelihood ratio of faint sizes along the grid: the mean of those about each place."""
    if not len(faint.x):
        return np.ones(len(x))
    near = np.exp(-(((faint.x - x[:, None]) / _ABOUT) ** 2) / 2) * (faint.sign == sign[:, None])
    # Far from all points it is that of no effect.
    return np.asarray((near @ faint.ratio + _TINY) / (near.sum(axis=1) + _TINY))


@dataclass(frozen=True, eq=False)
class Shared:
    """Something that some of a family share, weighed on the grid of mu, tau, pi and q.

    `log_evidence` is against each hanger having causes of its own. `member` (n,) is the probability
    of each hanger of the family to have it; `weight` (n, m, tau) is that of each size where the
    hanger shows it, `faint` (n, m, tau) where it does not; `size` (m, tau) that of the common one.
    """

    kin: Kin
    log_evidence: float
    member: FloatArray
    weight: FloatArray
    faint: FloatArray
    size: FloatArray


def shared(found: Sizes, family: Kin, own: Own) -> Shared:
    """An effect at one place, shared by two hangers of a family at least."""
    rows = list(family.members)
    seen = found.seen[rows, :, :, None]
    nothing, something = (each[rows][:, None, None, :] for each in (own.nothing, own.something))
    faint = found.faint[rows, :, :, None] * nothing
    prior = np.exp(-((SCATTERS / _LIKELY_SCATTER) ** 2) / 2)
    log_prior = np.log(prior / prior.sum() / len(found.x))
    own_log = own.log[rows][:, None, None, :]
    others = own.log.sum(axis=0) - own.log[rows].sum(axis=0)
    present = np.maximum(seen + faint + found.unseen[rows, :, :, None] * something, _TINY)
    gain = present / np.exp(own_log)
    log_all, member = [], []
    for part in _SHARES:
        odds = part / (1 - part) * gain
        log_all.append(two_at_least(np.log1p(-part) + own_log, odds) + others)
        member.append(odds / (1 + odds))
    log = np.array(log_all) + log_prior[:, None]
    total = scipy.special.logsumexp(log)
    weight = np.exp(log - total)
    one = np.ones((len(rows), 1))
    alone = [two_at_least(np.log1p(-p) * one, p / (1 - p) * one) for p in _SHARES]
    log_evidence = (
        total - np.log(len(_NOTHING_OWN)) - scipy.special.logsumexp(alone) - own.log_evidence
    )
    there = np.array([(weight[k] * each) for k, each in enumerate(member)]).sum(axis=0)
    there_with = there / present
    return Shared(
        family,
        float(log_evidence),
        there.sum(axis=(1, 2, 3)),
        (there_with * seen).sum(axis=3),
        (there_with * faint).sum(axis=3),
        weight.sum(axis=(0, 3)),
    )


def two_at_least(absent: FloatArray, odds: FloatArray) -> FloatArray:
    """Log of the sum over all choices of two hangers and more (axis 0) of products of either.

    `absent` is the log of one factor of a hanger, `odds` the other over it.
    """
    whole = np.log1p(odds).sum(axis=0)
    few = np.log1p(odds.sum(axis=0))
    return np.asarray(absent.sum(axis=0) + whole + _log(-np.expm1((few - whole).clip(max=0))))


def unknown(patients: Sequence[Patient], family: Kin, own: Own) -> Shared:
    """Something unknown that a family shares; of no size."""
    there = np.array([each.unknown for each in patients])[:, None, None]
    seen = np.repeat(there, len(SCATTERS), axis=2)
    nothing = np.empty((0, 0, 0))
    none = np.zeros_like(seen)
    found = Sizes(np.zeros(1), np.ones(1), seen, none, none, nothing, (), ())
    return shared(found, family, own)


def _log(value: FloatArray) -> FloatArray:
    return np.asarray(np.log(np.maximum(value, _TINY)))
