"""Which effect causes the gap: evidence for no gap, each effect, pairs, and something unknown; what
is claimed of it, and what stays possible.

Where these data support several causes and cannot tell them apart, what is claimed is their group.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np
import scipy

from shm.gap.contract import Fit, GapOptions
from shm.gap.coordinates import Branch
from shm.gap.damping import with_damping
from shm.gap.law_error import without_minor_cause
from shm.gap.likelihood import Likelihood
from shm.gap.model_probabilities import (
    Family,
    ScoredHypothesis,
    families,
    probabilities,
    undetected_share,
)
from shm.gap.optimiser import Landscape
from shm.gap.problem import GapProblem
from shm.gap.search import SUPPORTED, Search
from shm.inference.mixture import normalised
from shm.inference.options import Progress, silent
from shm.values import Leads
from shm.values.leading import MIN_NO_GAP_PROBABILITY, find_leading_cause

WITHIN_REACH = 7.0
"""Judgement: at log odds of a thousand to one a cause has no chance beside the best one."""
AS_GOOD_A_FIT = 1.0
"""What a cause may fit worse than the best one, in log likelihood, and still fit as well."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """An effect or a pair as an explanation of the gap; of its variants `best` is the likeliest.

    `log_bayes_factor` is that of the evidence averaged over the variants to the baseline's,
    `log_fit` what the best fit gains in log likelihood, `log_occam` what is paid for freedom.
    `group` is an index of `Attribution.groups`, None for none.
    """

    best: ScoredHypothesis
    variants: tuple[ScoredHypothesis, ...]
    probability: float
    log_bayes_factor: float
    log_fit: float
    group: int | None = None

    @property
    def effect(self) -> str:
        return self.best.hypothesis.name

    @property
    def is_pair(self) -> bool:
        return len(self.best.hypothesis.effects) > 1

    @property
    def log_occam(self) -> float:
        return self.log_bayes_factor - self.log_fit


@dataclass(frozen=True, eq=False)
class Attribution:
    """What the evidence says of a gap. All probabilities add to 1.

    `explanations` are the effects that were tried and the pairs that called for it, best first;
    `unexplained` is the likeliest fit with a flexible remainder. `p_value` is the posterior
    predictive p-value of the leading explanation that has no remainder. A part of
    `unexplained_probability` is that of something unknown that passes for an effect of the
    catalogue. `invisible` names the effects that these data cannot show, and why. `search` can be
    gone on with from what it has `tried`.
    """

    baseline: Fit
    no_gap_probability: float
    unexplained_probability: float
    unexplained: Fit
    explanations: tuple[Explanation, ...]
    groups: tuple[tuple[str, ...], ...]
    invisible: tuple[tuple[str, str], ...]
    p_value: float
    search: Search
    tried: tuple[ScoredHypothesis, ...]

    @property
    def leads(self) -> Leads:
        """Return whether a cause leads, no gap, or something unknown."""
        if self.leading is not None:
            return "cause"
        return "no gap" if self.no_gap_probability >= MIN_NO_GAP_PROBABILITY else "unexplained"

    @property
    def leading(self) -> Explanation | None:
        """Return the most probable explanation of the most probable group, as a diagnosis does."""
        return find_leading_cause(
            self.no_gap_probability, self.unexplained_probability, self.explanations
        )

    def with_unknown(self, probability: float) -> Attribution:
        """No gap stands only as far as nothing acts of this `probability` beyond what was tried."""
        moved = probability * self.no_gap_probability
        return replace(
            self,
            no_gap_probability=self.no_gap_probability - moved,
            unexplained_probability=self.unexplained_probability + moved,
        )


def attributed(
    problem: GapProblem, options: GapOptions, rng: np.random.Generator, progress: Progress = silent
) -> Attribution:
    """The causes of the gap between the baseline and the measurements, with probabilities.

    Sizes that these data cannot show are cut from the priors (`problem.smallest`). Raises
    UsageError for an unknown effect in `options.without`.
    """
    search = Search(problem, options, rng, progress)
    tried = search.with_unknown(search.singles())
    if search.calls_for_pairs(tried):
        tried = search.with_pairs(tried)
    return _weighed(search, tried)


def more_thorough(found: Attribution) -> Attribution:
    """The attribution gone on with where something unknown leads, or a pair.

    Every effect and pairs of many are fitted, or other pairs of either effect.
    """
    search, tried = found.search, list(found.tried)
    if found.leads == "unexplained":
        tried = search.with_every_effect(tried)
        if search.calls_for_pairs(tried):
            tried = search.with_many_pairs(tried)
    elif found.leading is None or not found.leading.is_pair:
        return found
    return _weighed(search, search.with_other_pairs(tried))


def _weighed(search: Search, tried: list[ScoredHypothesis]) -> Attribution:
    weighed = families(search.with_laws(search.with_sampled(tried)), search.variants)
    kinds = with_damping(search.problem.observations, weighed)
    search.progress("weighing", 1.0)
    likeliest = _fit([kind for kind in kinds if not kind.flexible])
    p_value = search.p_value(likeliest)
    chances, mimic = probabilities(kinds, p_value)
    chances = without_minor_cause(search.problem, search.baseline, kinds, chances)
    each = [float(chance) for chance in undetected_share(kinds, chances)]
    return _attribution(search, tried, kinds, each, mimic, p_value)


def _attribution(
    search: Search,
    tried: Sequence[ScoredHypothesis],
    kinds: Sequence[Family],
    chances: Sequence[float],
    mimic: float,
    p_value: float,
) -> Attribution:
    """`mimic` is the probability of something unknown that passes for one of the effects."""
    none = next(kind for kind in kinds if not kind.effects and not kind.flexible)
    flexible = [kind for kind in kinds if kind.flexible]
    causes, groups = _with_groups(search.problem, _explanations(kinds, chances, none))
    return Attribution(
        baseline=_fit([none]),
        no_gap_probability=sum(c for k, c in zip(kinds, chances, strict=True) if k is none),
        unexplained_probability=mimic
        + sum(c for k, c in zip(kinds, chances, strict=True) if k.flexible),
        unexplained=_fit(flexible),
        explanations=causes,
        groups=groups,
        invisible=search.invisible,
        p_value=p_value,
        search=search,
        tried=tuple(tried),
    )


def _explanations(
    kinds: Sequence[Family], chances: Sequence[float], none: Family
) -> tuple[Explanation, ...]:
    """Every effect and pair that was tried, the likeliest first."""
    found = [
        Explanation(
            best=kind.best,
            variants=kind.tried,
            probability=chance,
            log_bayes_factor=kind.log_evidence - none.log_evidence,
            # At least what the evidence gains, else a better fit was not found.
            log_fit=max(
                kind.best.log_fit - none.best.log_fit, kind.log_evidence - none.log_evidence
            ),
        )
        for kind, chance in zip(kinds, chances, strict=True)
        if kind.effects and not kind.flexible
    ]
    return tuple(sorted(found, key=lambda each: -each.probability))


def _fit(kinds: Sequence[Family]) -> Fit:
    """The likeliest fit; there always is one without and one with a remainder."""
    return next(kind.best.fit for kind in kinds if kind.best.fit is not None)


def _with_groups(
    problem: GapProblem, causes: tuple[Explanation, ...]
) -> tuple[tuple[Explanation, ...], tuple[tuple[str, ...], ...]]:
    """The causes with the indices of their groups, and the groups' names."""
    best = max(causes, key=lambda each: each.log_bayes_factor, default=None)
    alone = {each.effect: each.log_bayes_factor for each in causes}
    able = [
        (index, each.best.fit, hardly_behind(each, best))
        for index, each in enumerate(causes)
        if best is not None and each.best.fit is not None
        if _reached(each, best) and not _idle(each, alone)
    ]
    found = grouped([faces(problem, fit) for _, fit, _ in able], [near for *_, near in able])
    members = [tuple(able[i][0] for i in group) for group in found]
    names = tuple(tuple(causes[i].effect for i in group) for group in members)
    index = {i: number for number, group in enumerate(members) for i in group}
    return tuple(replace(each, group=index.get(i)) for i, each in enumerate(causes)), names


def hardly_behind(cause: Explanation, best: Explanation) -> bool:
    """Whether the data hardly prefer the best cause: by evidence, or else by the prior alone.

    A cause of many parameters pays for them, but where it fits as well the data do not speak
    against it.
    """
    behind = best.log_bayes_factor - cause.log_bayes_factor
    as_well = cause.log_fit > best.log_fit - AS_GOOD_A_FIT
    return behind < SAME_BELOW or (as_well and behind < WITHIN_REACH)


def _reached(cause: Explanation, best: Explanation) -> bool:
    """Whether these data leave a cause a chance beside the best one."""
    level = cause.log_bayes_factor
    return hardly_behind(cause, best) or level > max(0.0, best.log_bayes_factor - WITHIN_REACH)


def _idle(pair: Explanation, alone: Mapping[str, float]) -> bool:
    """Whether one effect of a pair explains about as much without the other."""
    names = [name for name, _ in pair.best.hypothesis.effects]
    singles = [alone[name] for name in names if len(names) > 1]
    return any(single > pair.log_bayes_factor - SUPPORTED for single in singles)


def answered(attribution: Attribution) -> list[tuple[float, Fit]]:
    """The fits, with their probabilities, of what the diagnosis claims.

    All members of the leading group: which of them it is, the data cannot tell.
    """
    leading = attribution.leading
    if leading is None:
        no_gap = attribution.leads == "no gap"
        return [(1.0, attribution.baseline if no_gap else attribution.unexplained)]
    group = [
        each
        for each in attribution.explanations
        if each is leading or (each.group is not None and each.group == leading.group)
    ]
    found = [(each.probability, each.best.fit) for each in group if each.best.fit is not None]
    # A group may lead by members that screening alone has weighed.
    return found or [(1.0, attribution.unexplained)]


def possible(attribution: Attribution) -> list[tuple[float, Fit]]:
    """The fits of all that may be, with their probabilities: no gap, every cause, the unknown.

    A number that does not hang on the cause, such as the tension, is averaged over them (Hoeting
    et al., Stat. Sci. 14, 1999); over the places too where a cause may act.
    """
    fits = [
        (attribution.no_gap_probability, attribution.baseline),
        (attribution.unexplained_probability, attribution.unexplained),
    ]
    for cause in attribution.explanations:
        found = [(each.log_evidence, each.posterior) for each in cause.variants]
        fitted = [(evidence, fit) for evidence, fit in found if fit is not None]
        if fitted:
            share = normalised(np.array([evidence for evidence, _ in fitted]))
            fits += [
                (cause.probability * s, fit) for s, (_, fit) in zip(share, fitted, strict=True)
            ]
    return fits


SAME_BELOW = 3.0
"""Log Bayes factor, expected or found, under which two causes count as not separable: evidence of
less than twenty to one is not strong (Kass and Raftery, J. Am. Stat. Assoc. 90, 1995).
"""
NOTABLE_WITHIN = 1.6
"""A peak with less than a fifth of the best one's evidence does not speak for its cause."""


def faces(problem: GapProblem, fit: Fit) -> tuple[Fit, ...]:
    """A fit as seen from each of its notable peaks, its best point first.

    A mass that may sit in the middle or at an end looks like a stiff end from one of them only.
    """
    best = max((peak.log_evidence for peak in fit.peaks), default=0.0)
    notable = [peak for peak in fit.peaks if peak.log_evidence > best - NOTABLE_WITHIN]
    if len(notable) < 2:
        return (fit,)
    landscape = Landscape(problem, fit.hypothesis)
    views = landscape.views(np.array([p.w for p in notable]), np.array([p.signs for p in notable]))
    branches = [Branch(peak.signs) for peak in notable]
    others = [
        replace(
            fit,
            z=branch.z(w[None])[0],
            predicted=problem.observations.value - residual,
            slopes=slopes / branch.stretch(w),
        )
        for branch, w, residual, slopes in zip(
            branches, views.w, views.residual, views.slopes, strict=True
        )
    ]
    return (fit, *others)


def grouped(
    causes: Sequence[Sequence[Fit]], near: Sequence[bool] | None = None
) -> tuple[tuple[int, ...], ...]:
    """Indices of `causes` that cannot be told apart, each group of two and more, in their order.

    A cause has one or several faces; one alike is enough. Those that are `near` the best by the
    evidence found are one group, whatever better data would say. Groups are connected: a cause that
    is like two others joins them.
    """
    close = np.array(near if near is not None else [False] * len(causes), dtype=bool)
    links = np.eye(len(causes)) + np.outer(close, close)
    for i, j in combinations(range(len(causes)), 2):
        if links[i, j]:
            continue
        pairs = product(causes[i], causes[j])
        links[i, j] = any(expected_log_bayes_factor(*pair) < SAME_BELOW for pair in pairs)
    count, label = scipy.sparse.csgraph.connected_components(
        scipy.sparse.csr_array(links), directed=False
    )
    members = [tuple(int(i) for i in np.flatnonzero(label == k)) for k in range(count)]
    return tuple(sorted(group for group in members if len(group) > 1))


def expected_log_bayes_factor(one: Fit, other: Fit) -> float:
    """What data like these tell two fitted causes apart, in the direction that tells less.

    If one is true, the other comes as near to its prediction as its parameters allow (linearised);
    half of the squared distance that is left is the log Bayes factor to expect.
    """
    return min(_when_true(one, other), _when_true(other, one))


def _when_true(true: Fit, rival: Fit) -> float:
    """Half of min over z of |predicted - rival(z)|^2 + |z|^2 - |z of the rival's fit|^2."""
    errors = Likelihood.of(rival.noise, rival.model_error)
    apart = true.predicted - rival.predicted
    _, _, square, followed = errors.linear(rival.slopes, apart, rival.z)
    return max(0.0, square - followed) / 2
