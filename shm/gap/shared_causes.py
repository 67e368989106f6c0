"""A cause that several hangers share, against each having causes of its own.

    P(data | e shared in F) = mean over pi, q, mu, tau of
        product over hangers i of  (1 - pi) own_i(q) + pi there_i(e, mu, tau, q),  two at least
    own_i(q) = q no_gap_i + (1 - q) gap_i
    there_i  = B_i(e) integral L_i(x) N(x | mu, tau) dx / mean L_i + N(x invisible) own_i(q)

pi is the share of the family F that has the effect e, q that of hangers with nothing of their own
(both learnt from all hangers), x the size (`Reach`), which scatters by tau about the family's own,
mu. All are summed over grids. A hanger whose size would be invisible says neither yes nor no.
Hierarchies of this kind: Gelman et al., Bayesian Data Analysis, 2013, chapter 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp, ndtr

from shm.gap.kin import LEAST, Kin
from shm.gap.shared_evidence import Evidence, Patient, Place
from shm.values import FloatArray, IntArray

# Technical: shares of a family, with prior 1 each; a twentieth is finer than 20 hangers can tell.
_SHARES = (np.arange(10) + 0.5) / 10
# Judgement: from bridges on which every hanger has something of its own to those on which one in
# fifty has; 0.25 is what a single diagnosis takes it to be.
_NOTHING_OWN = np.array([0.1, 0.25, 0.5, 0.8, 0.95, 0.98])
# Judgement: parts made alike differ by 7 to 60 % in how much they give, weigh or lack; the steps
# are of a decade, or of the range where it has none, and less scatter is likelier (half normal).
SCATTERS = np.array([0.03, 0.06, 0.12, 0.2])
_LIKELY_SCATTER = 0.1
_STEP = 0.02  # technical: two thirds of the least scatter

_TINY = 1e-300  # technical: what is divided by, and taken the logarithm of


@dataclass(frozen=True, eq=False)
class Own:
    """What speaks for each hanger having causes of its own or none: log (n, q)."""

    log: FloatArray

    @classmethod
    def of(cls, patients: Sequence[Patient]) -> Own:
        none = np.array([[each.no_gap] for each in patients])
        gap = np.array([[each.gap] for each in patients])
        return cls(_log(_NOTHING_OWN * none + (1 - _NOTHING_OWN) * gap))

    @property
    def log_evidence(self) -> float:
        return _log_mean(self.log.sum(axis=0))


@dataclass(frozen=True, eq=False)
class Sizes:
    """What the hangers say to the size of an effect at a place, on the grid of mu and tau.

    The grid's first axis (m) runs over the sizes `x` (m,) with their signs `sign` (m,). `seen`
    (n, m, tau) is the likelihood of a visible size, against own causes; `unseen` (n, m, tau) the
    chance of an invisible one. `normal` (m, m, tau) is the density of a hanger's size, first axis,
    by the family's. `at` says of each hanger's draws where on the grid they lie.
    """

    x: FloatArray
    sign: FloatArray
    seen: FloatArray
    unseen: FloatArray
    normal: FloatArray
    at: tuple[IntArray, ...]

    def draw_weights(self, hanger: int, weight: FloatArray) -> FloatArray:
        """Of a hanger's draws, by weights (m, tau) of the family's size and scatter."""
        at = self.at[hanger]
        mean = self.normal[at].mean(axis=0) if len(at) else np.ones_like(weight)
        return np.asarray((self.normal[at] * (weight / np.maximum(mean, _TINY))).sum(axis=(1, 2)))


def sizes(patients: Sequence[Patient], place: Place) -> Sizes | None:
    """Of an effect at a place; None where fewer than two hangers could show it."""
    found = [each.effects.get(place) for each in patients]
    known = [each for each in found if each is not None]
    if len(known) < LEAST:
        return None
    low = min(each.reach.lower for each in known)
    line = np.arange(low, max(each.reach.upper for each in known) + _STEP, _STEP)
    signs = np.array([1.0, -1.0] if known[0].reach.parameter.signed else [1.0])
    x, sign = np.tile(line, len(signs)), np.repeat(signs, len(line))
    away = (x[:, None, None] - x[:, None]) / SCATTERS
    normal = np.exp(-(away**2) / 2) / (SCATTERS * np.sqrt(2 * np.pi))
    normal *= (sign[:, None] == sign)[..., None]
    seen, unseen, at = [], [], []
    for each in found:
        index = _on_grid(each, low, len(line))
        at.append(index)
        likely, hidden = _said(each, x, normal[index], len(signs))
        seen.append(likely)
        unseen.append(hidden)
    return Sizes(x, sign, np.array(seen), np.array(unseen), normal, tuple(at))


def _on_grid(evidence: Evidence | None, low: float, count: int) -> IntArray:
    """Where the draws of a hanger lie on the grid."""
    if evidence is None:
        return np.empty(0, dtype=np.int64)
    index = np.rint((evidence.x - low) / _STEP).astype(np.int64).clip(0, count - 1)
    return np.asarray(index + count * (evidence.sign < 0))


def _said(
    evidence: Evidence | None, x: FloatArray, density: FloatArray, signs: int
) -> tuple[FloatArray, FloatArray]:
    """The likelihood of a visible size and the chance of an invisible one, (m, tau) both."""
    if evidence is None:
        return np.zeros((len(x), len(SCATTERS))), np.ones((len(x), len(SCATTERS)))
    reach = evidence.reach
    below = ndtr((reach.lower - x[:, None]) / SCATTERS)
    return evidence.bayes_factor * reach.width * signs * density.mean(axis=0), below


@dataclass(frozen=True, eq=False)
class Shared:
    """Something that some of a family share, weighed on the grid of mu, tau, pi and q.

    `log_evidence` is against each hanger having causes of its own. `member` (n,) is the probability
    of each hanger of the family to have it; `weight` (n, m, tau) is that of each size, where the
    hanger shows it; `size` (m, tau) that of the family's own.
    """

    kin: Kin
    log_evidence: float
    member: FloatArray
    weight: FloatArray
    size: FloatArray


def shared(found: Sizes, family: Kin, own: Own) -> Shared:
    """An effect at one place, shared by two hangers of a family at least."""
    rows = list(family.members)
    seen, unseen = found.seen[rows, :, :, None], found.unseen[rows, :, :, None]
    prior = np.exp(-((SCATTERS / _LIKELY_SCATTER) ** 2) / 2)
    log_prior = np.log(prior / prior.sum() / len(found.x))
    own_log = own.log[rows][:, None, None, :]
    others = own.log.sum(axis=0) - own.log[rows].sum(axis=0)
    log_there = _log(seen + unseen * np.exp(own_log))
    log_all, member = [], []
    for part in _SHARES:
        absent = np.log1p(-part) + own_log
        present = np.log(part) + log_there
        log_all.append(_two_at_least(absent, present) + others)
        member.append(1 / (1 + np.exp((absent - present).clip(-_FAR, _FAR))))
    log = np.array(log_all) + log_prior[:, None]
    total = logsumexp(log)
    weight = np.exp(log - total)
    alone = [_two_at_least(np.log1p(-p) * _ones(rows), np.log(p) * _ones(rows)) for p in _SHARES]
    log_evidence = total - np.log(len(_NOTHING_OWN)) - logsumexp(alone) - own.log_evidence
    visible = seen / np.exp(log_there)
    there = np.array([(weight[k] * each) for k, each in enumerate(member)]).sum(axis=0)
    return Shared(
        family,
        float(log_evidence),
        there.sum(axis=(1, 2, 3)),
        (there * visible).sum(axis=3),
        weight.sum(axis=(0, 3)),
    )


_FAR = 500.0


def _two_at_least(absent: FloatArray, present: FloatArray) -> FloatArray:
    """Log of the sum over all choices of two hangers and more (axis 0) of products of either."""
    whole = np.logaddexp(absent, present).sum(axis=0)
    none = absent.sum(axis=0)
    few = none + np.logaddexp(0, logsumexp(present - absent, axis=0))
    return np.asarray(whole + _log(-np.expm1((few - whole).clip(max=0))))


def unknown(patients: Sequence[Patient], family: Kin, own: Own) -> Shared:
    """Something unknown that a family shares; of no size."""
    there = np.array([each.unknown for each in patients])[:, None, None]
    seen = np.repeat(there, len(SCATTERS), axis=2)
    nothing = np.empty((0, 0, 0))
    found = Sizes(np.zeros(1), np.ones(1), seen, np.zeros_like(seen), nothing, ())
    return shared(found, family, own)


def _ones(rows: Sequence[int]) -> FloatArray:
    return np.ones((len(rows), 1))


def _log(value: FloatArray) -> FloatArray:
    return np.asarray(np.log(np.maximum(value, _TINY)))


def _log_mean(log: FloatArray) -> float:
    return float(logsumexp(log) - np.log(len(log)))
