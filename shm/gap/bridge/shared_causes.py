"""A cause that several hangers share, against each having causes of its own.

    P(data | e shared in F) = mean over pi, q, mu, tau of
        product over hangers i of  (1 - pi) own_i(q) + pi there_i(e, mu, tau, q),  two at least
    own_i(q) = q no_gap_i + (1 - q) gap_i
    there_i  = integral L_i(x) N(x | mu, tau) dx                                 over visible x
             + integral (q no_gap_i R_i(x) + (1 - q) gap_i) N(x | mu, tau) dx    below

pi is the share of the group F that has the effect e, q that of hangers with nothing of their own
(both learnt from all hangers), x the size (`Sizes`), which scatters by tau about the group's, mu.
All are summed over grids. L_i is the likelihood of the effect against all that a hanger may have,
R_i that of one too small to see against none. A size far below what is visible says neither yes nor
no. Hierarchies of this kind: Gelman et al., Bayesian Data Analysis, 2013, chapter 5.

Groups are hangers that are similar in something. What a description says is compared as written:
hangers of one delivery, of one section, with similar ends, of about one length, and those measured
on the same days.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.bridge.shared_evidence import SHARING, EffectEvidence, HangerEvidence, Place
from shm.values import FloatArray, IntArray

LEAST = 2
"""Members of a group: one alone shares nothing."""

_CLASSES = 2.0
"""Lengths are of one class from one power of the root of this to the next: judgement, ends of
hangers as unlike as that are mostly made otherwise."""
# Numerical: shares of a group, with prior 1 each; a twentieth is finer than 20 hangers can tell.
_SHARES = (np.arange(10) + 0.5) / 10
# Judgement: from bridges on which every hanger has something of its own to those on which one in
# fifty has; 0.25 is what a single diagnosis takes it to be.
_NO_INDIVIDUAL_CAUSE = np.array([0.1, 0.25, 0.5, 0.8, 0.95, 0.98])
# Judgement: parts made alike differ by 7 to 60 % in how much they give, weigh or lack; the steps
# are of a decade, or of the range where it has none, and less scatter is likelier (half normal).
SCATTERS = np.array([0.03, 0.06, 0.12, 0.2])
_LIKELY_SCATTER = 0.1


@dataclass(frozen=True)
class Group:
    """Hangers, by their index, and in words what they have in common."""

    likeness: str
    members: tuple[int, ...]


def find_groups(hangers: Sequence[HangerEvidence]) -> tuple[Group, ...]:
    """Return all hangers, then the parts of them that are similar in something, each set once."""
    found = {tuple(range(len(hangers))): "all hangers"}
    for likeness, describe in _LIKENESSES.items():
        parts: dict[Hashable, list[int]] = {}
        for index, each in enumerate(hangers):
            if (key := describe(each)) is not None:
                parts.setdefault(key, []).append(index)
        for members in parts.values():
            if len(members) >= LEAST:
                found.setdefault(tuple(members), likeness)
    return tuple(Group(likeness, members) for members, likeness in found.items())


def _days(each: HangerEvidence) -> Hashable | None:
    """Return the days on which it was tested; None where a test does not say."""
    days = {test.time.date() if test.time else None for test in each.tests}
    return None if None in days else frozenset(days)


_LIKENESSES: dict[str, Callable[[HangerEvidence], Hashable | None]] = {
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
    "hangers tested on the same days": _days,
    "hangers of about one length": lambda each: math.floor(
        math.log(each.hanger.length_m) / math.log(_CLASSES) * 2
    ),
}


@dataclass(frozen=True, eq=False)
class OwnCauses:
    """The likelihoods of each hanger having nothing of its own, and something: (n, q) both.

    `log` (n, q) is that of either, `log_evidence` that of all hangers together.
    """

    nothing: FloatArray
    something: FloatArray
    log: FloatArray
    log_evidence: float

    @classmethod
    def of(cls, hangers: Sequence[HangerEvidence]) -> OwnCauses:
        nothing = _NO_INDIVIDUAL_CAUSE * np.array([[each.no_gap] for each in hangers])
        something = (1 - _NO_INDIVIDUAL_CAUSE) * np.array([[each.gap] for each in hangers])
        log = _log(nothing + something)
        together = scipy.special.logsumexp(log.sum(axis=0)) - np.log(len(_NO_INDIVIDUAL_CAUSE))
        return cls(nothing, something, log, float(together))


@dataclass(frozen=True, eq=False)
class SizeGrid:
    """The evidence of all hangers for an effect at a place, on the grid of mu and tau.

    The grid's first axis (m) runs over the sizes `x` (m,) with their signs `sign` (m,). `visible`
    (n, m, tau) is the likelihood of a visible size, `small` (n, m, tau) the chance of one too small
    to see and `ratio` (n, m, tau) that times its likelihood over that of no effect. `normal`
    (m, m, tau) is the density of a hanger's size, first axis, by the group's.
    """

    x: FloatArray
    sign: FloatArray
    visible: FloatArray
    small: FloatArray
    ratio: FloatArray
    normal: FloatArray

    @classmethod
    def of(cls, hangers: Sequence[HangerEvidence], place: Place) -> SizeGrid | None:
        """Return the grid of an effect at a place; None where fewer than two could show it."""
        found = [each.effects.get(place) for each in hangers]
        known = [each.sizes for each in found if each is not None]
        if len(known) < LEAST:
            return None
        lower, upper = np.transpose([each.ends for each in known])
        line = np.arange(lower.min() - SHARING.below, upper.max() + SHARING.step, SHARING.step)
        signs = known[0].signs
        x, sign = np.tile(line, len(signs)), np.repeat(signs, len(line))
        away = (x[:, None, None] - x[:, None]) / SCATTERS
        normal = np.exp(-(away**2) / 2) / (SCATTERS * np.sqrt(2 * np.pi))
        normal *= (sign[:, None] == sign)[..., None]
        parts = np.array([_likelihoods(each, x, normal) for each in found])
        return cls(x, sign, parts[:, 0], parts[:, 1], parts[:, 2], normal)


def _likelihoods(
    evidence: EffectEvidence | None, x: FloatArray, normal: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return `visible`, `small` and `ratio` (m, tau) of one hanger.

    All is small that has no evidence.
    """
    every = np.ones(normal.shape[1:])
    if evidence is None:
        return 0 * every, every, every
    at = _on_grid(evidence, x)
    visible, ratio = (
        np.tensordot(np.bincount(at[rows], evidence.weight[rows], len(x)), normal, axes=1)
        for rows in (evidence.visible, ~evidence.visible)
    )
    lower, _ = evidence.sizes.ends
    lowest = evidence.x[~evidence.visible].min(initial=lower + SHARING.step / 2) - SHARING.step / 2
    small, smaller = (
        scipy.special.ndtr((edge - x[:, None]) / SCATTERS) for edge in (lower, lowest)
    )
    return visible, small, ratio + smaller


def _on_grid(evidence: EffectEvidence, x: FloatArray) -> IntArray:
    """Return the index (n,) on the grid of each point; the negative sizes stand behind."""
    count = len(x) // len(evidence.sizes.signs)
    index = np.rint((evidence.x - x[0]) / SHARING.step).astype(np.int64).clip(0, count - 1)
    return np.asarray(index + count * (evidence.sign < 0))


@dataclass(frozen=True, eq=False)
class SharedEvidence:
    """The evidence for something that some of a group share, on the grid of mu, tau, pi and q.

    `log_evidence` is against each hanger having causes of its own. `member` (n,) is the probability
    of each hanger of the group to have it; `visible` and `small` (n, m, tau) are, over the
    likelihoods of the grid, the probabilities of its having it in such a size; `size` (m, tau)
    those of the group's size.
    """

    group: Group
    log_evidence: float
    member: FloatArray
    visible: FloatArray
    small: FloatArray
    size: FloatArray

    def point_weights(self, grid: SizeGrid, evidence: EffectEvidence, index: int) -> FloatArray:
        """Return the probability (n,) of each point of a hanger's evidence, by its `index`."""
        row, at = self.group.members.index(index), _on_grid(evidence, grid.x)
        visible, small = (
            np.tensordot(grid.normal, each[row], axes=2)[at] for each in (self.visible, self.small)
        )
        return np.asarray(evidence.weight * np.where(evidence.visible, visible, small))


def weigh_shared(grid: SizeGrid, group: Group, individual: OwnCauses) -> SharedEvidence:
    """Return the evidence for an effect at one place, shared by two hangers of a group or more."""
    rows = list(group.members)
    nothing, something = (
        each[rows][:, None, None, :] for each in (individual.nothing, individual.something)
    )
    visible, small, ratio = (
        each[rows][..., None] for each in (grid.visible, grid.small, grid.ratio)
    )
    prior = np.exp(-((SCATTERS / _LIKELY_SCATTER) ** 2) / 2)
    log_prior = np.log(prior / prior.sum() / len(grid.x))
    individual_log = individual.log[rows][:, None, None, :]
    others = individual.log.sum(axis=0) - individual.log[rows].sum(axis=0)
    present = np.maximum(visible + ratio * nothing + small * something, SHARING.tiny)
    gain = present / np.exp(individual_log)
    log_all, log_prior_only, member = [], [], []
    for part in _SHARES:
        odds = part / (1 - part)
        absent, one = np.log1p(-part), np.ones((len(rows), 1))
        log_all.append(sum_two_or_more(absent + individual_log, odds * gain) + others)
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
        (there / present * nothing).sum(axis=3),
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
    return weigh_shared(
        SizeGrid(one, one, visible, none, none, none), group, individual
    ).log_evidence


def _log(value: FloatArray) -> FloatArray:
    return np.asarray(np.log(np.maximum(value, SHARING.tiny)))
