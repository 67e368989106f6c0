"""A cause that several hangers share, against each having causes of its own.

    P(data | e shared in F) = mean over pi, q, mu, tau of
        product over hangers i of  (1 - pi) own_i(q) + pi there_i(e, mu, tau, q),  two at least
    own_i(q) = q no_gap_i + (1 - q) gap_i
    there_i  = integral L_i(x) N(x | mu, tau) dx       over visible x
             + own_i(q) integral N(x | mu, tau) dx     below

pi is the share of the group F that has the effect e, q that of hangers with nothing of their own
(both learnt from all hangers), x the size (`Sizes`), which scatters by tau about the group's, mu.
All are summed over grids. L_i is the likelihood of the effect against all that a hanger may have. A
size below what is visible says neither yes nor no. Hierarchies of this kind: Gelman et al.,
Bayesian Data Analysis, 2013, chapter 5.

Groups are all hangers, and those that their owner says to be of one family.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.shared_evidence import EffectEvidence, HangerEvidence, Place
from shm.values import FloatArray, IntArray

LEAST = 2
"""Members of a group: one alone shares nothing."""

# Numerical: shares of a group, with prior 1 each; a twentieth is finer than 20 hangers can tell.
_SHARES = (np.arange(10) + 0.5) / 10
# Judgement: from bridges on which every hanger has something of its own to those on which one in
# fifty has; 0.25 is what a single diagnosis takes it to be.
_NO_INDIVIDUAL_CAUSE = np.array([0.1, 0.25, 0.5, 0.8, 0.95, 0.98])
# Judgement: parts made alike differ by 7 to 60 % in how much they give, weigh or lack; the steps
# are of a decade, or of the range where it has none, and less scatter is likelier (half normal).
SCATTERS = np.array([0.03, 0.06, 0.12, 0.2])
_LIKELY_SCATTER = 0.1
_STEP = 0.03  # numerical, decades: the least scatter of sizes; normals so far apart add up evenly
_BELOW = 0.5  # judgement, decades: how far the sizes of a group may lie below what is visible
_TINY = 1e-300  # numerical: what is divided by, and taken the logarithm of


@dataclass(frozen=True)
class Group:
    """Hangers, by their index, and in words what they have in common."""

    likeness: str
    members: tuple[int, ...]


def find_groups(hangers: Sequence[HangerEvidence]) -> tuple[Group, ...]:
    """Return all hangers, then those of each stated family, each set once."""
    families: dict[str, list[int]] = {}
    for index, each in enumerate(hangers):
        if each.hanger.family:
            families.setdefault(each.hanger.family, []).append(index)
    found = {tuple(range(len(hangers))): "all hangers"}
    for members in families.values():
        if len(members) >= LEAST:
            found.setdefault(tuple(members), "hangers of one delivery")
    return tuple(Group(likeness, members) for members, likeness in found.items())


@dataclass(frozen=True, eq=False)
class OwnCauses:
    """The likelihoods of each hanger having causes of its own, or none: their logs (n, q).

    `log_evidence` is that of all hangers together.
    """

    log: FloatArray
    log_evidence: float

    @classmethod
    def of(cls, hangers: Sequence[HangerEvidence]) -> OwnCauses:
        no_gap, gap = np.array([(each.no_gap, each.gap) for each in hangers]).T[..., None]
        log = _log(_NO_INDIVIDUAL_CAUSE * no_gap + (1 - _NO_INDIVIDUAL_CAUSE) * gap)
        together = scipy.special.logsumexp(log.sum(axis=0)) - np.log(len(_NO_INDIVIDUAL_CAUSE))
        return cls(log, float(together))


@dataclass(frozen=True, eq=False)
class SizeGrid:
    """The evidence of all hangers for an effect at a place, on the grid of mu and tau.

    The grid's first axis (m) runs over the sizes `x` (m,) with their signs `sign` (m,). `visible`
    (n, m, tau) is the likelihood of a visible size, `small` (n, m, tau) the chance of one too small
    to see. `normal` (m, m, tau) is the density of a hanger's size, first axis, by the group's.
    """

    x: FloatArray
    sign: FloatArray
    visible: FloatArray
    small: FloatArray
    normal: FloatArray

    @classmethod
    def of(cls, hangers: Sequence[HangerEvidence], place: Place) -> SizeGrid | None:
        """Return the grid of an effect at a place; None where fewer than two could show it."""
        found = [each.effects.get(place) for each in hangers]
        known = [each.sizes for each in found if each is not None]
        if len(known) < LEAST:
            return None
        lower, upper = np.transpose([each.ends for each in known])
        line = np.arange(lower.min() - _BELOW, upper.max() + _STEP, _STEP)
        signs = known[0].signs
        x, sign = np.tile(line, len(signs)), np.repeat(signs, len(line))
        away = (x[:, None, None] - x[:, None]) / SCATTERS
        normal = np.exp(-(away**2) / 2) / (SCATTERS * np.sqrt(2 * np.pi))
        normal *= (sign[:, None] == sign)[..., None]
        parts = np.array([_likelihoods(each, x, normal) for each in found])
        return cls(x, sign, parts[:, 0], parts[:, 1], normal)


def _likelihoods(
    evidence: EffectEvidence | None, x: FloatArray, normal: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return `visible` and `small` (m, tau) of one hanger; all is small that has no evidence."""
    if evidence is None:
        every = np.ones(normal.shape[1:])
        return 0 * every, every
    at = _on_grid(evidence, x)
    visible = np.tensordot(np.bincount(at, evidence.weight, len(x)), normal, axes=1)
    lower, _ = evidence.sizes.ends
    return visible, scipy.special.ndtr((lower - x[:, None]) / SCATTERS)


def _on_grid(evidence: EffectEvidence, x: FloatArray) -> IntArray:
    """Return the index (n,) on the grid of each point; the negative sizes stand behind."""
    count = len(x) // len(evidence.sizes.signs)
    index = np.rint((evidence.x - x[0]) / _STEP).astype(np.int64).clip(0, count - 1)
    return np.asarray(index + count * (evidence.sign < 0))


@dataclass(frozen=True, eq=False)
class SharedEvidence:
    """The evidence for something that some of a group share, on the grid of mu, tau, pi and q.

    `log_evidence` is against each hanger having causes of its own. `member` (n,) is the probability
    of each hanger of the group to have it; `visible` (n, m, tau) is, over the likelihoods of the
    grid, that of its having it in such a size; `size` (m, tau) those of the group's size.
    """

    group: Group
    log_evidence: float
    member: FloatArray
    visible: FloatArray
    size: FloatArray

    def point_weights(self, grid: SizeGrid, evidence: EffectEvidence, index: int) -> FloatArray:
        """Return the probability (n,) of each point of a hanger's evidence, by its `index`."""
        row, at = self.group.members.index(index), _on_grid(evidence, grid.x)
        return np.asarray(
            evidence.weight * np.tensordot(grid.normal, self.visible[row], axes=2)[at]
        )


def weigh_shared(grid: SizeGrid, group: Group, individual: OwnCauses) -> SharedEvidence:
    """Return the evidence for an effect at one place, shared by two hangers of a group or more."""
    rows = list(group.members)
    own_log = individual.log[rows][:, None, None, :]
    visible, small = (each[rows][..., None] for each in (grid.visible, grid.small))
    prior = np.exp(-((SCATTERS / _LIKELY_SCATTER) ** 2) / 2)
    log_prior = np.log(prior / prior.sum() / len(grid.x))
    others = individual.log.sum(axis=0) - individual.log[rows].sum(axis=0)
    present = np.maximum(visible + small * np.exp(own_log), _TINY)
    gain = present / np.exp(own_log)
    log_all, log_prior_only, member = [], [], []
    for part in _SHARES:
        odds = part / (1 - part)
        absent, one = np.log1p(-part), np.ones((len(rows), 1))
        log_all.append(sum_two_or_more(absent + own_log, odds * gain) + others)
        log_prior_only.append(sum_two_or_more(absent * one, odds * one))
        member.append(odds * gain / (1 + odds * gain))
    log = np.array(log_all) + log_prior[:, None]
    total = scipy.special.logsumexp(log)
    weight = np.exp(log - total)
    there = np.array([weight[k] * each for k, each in enumerate(member)]).sum(axis=0)
    log_two = scipy.special.logsumexp(log_prior_only) + np.log(len(_NO_INDIVIDUAL_CAUSE))
    return SharedEvidence(
        group,
        float(total - log_two - individual.log_evidence),
        there.sum(axis=(1, 2, 3)),
        (there / present).sum(axis=3),
        weight.sum(axis=(0, 3)),
    )


def sum_two_or_more(absent: FloatArray, odds: FloatArray) -> FloatArray:
    """Return the log of the sum over all choices of two hangers or more (axis 0) of products.

    `absent` is the log of the factor of a hanger that is not chosen, `odds` the other over it.
    """
    every = np.log1p(odds).sum(axis=0)
    few = np.log1p(odds.sum(axis=0))
    return np.asarray(absent.sum(axis=0) + every + _log(-np.expm1((few - every).clip(max=0))))


def weigh_unknown(hangers: Sequence[HangerEvidence], group: Group, individual: OwnCauses) -> float:
    """Return the log evidence for something unknown, of no size, that a group shares."""
    there = np.array([each.unknown for each in hangers])[:, None, None]
    visible = np.repeat(there, len(SCATTERS), axis=2)
    none, one = np.zeros_like(visible), np.ones(1)
    return weigh_shared(SizeGrid(one, one, visible, none, none), group, individual).log_evidence


def _log(value: FloatArray) -> FloatArray:
    return np.asarray(np.log(np.maximum(value, _TINY)))
