"""Attribute a gap to effects: evidence for no gap, each effect, pairs, and something unknown.

Where these data support several causes and cannot tell them apart, what is claimed is their group.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.gap.contract import Fit, GapOptions, Hypothesis
from shm.gap.groups import SAME_BELOW, group, views_from_peaks
from shm.gap.probabilities import Family, ScoredHypothesis, families, probabilities
from shm.gap.problem import GapProblem
from shm.gap.residuals import predictions, predictive_p_value
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
    """The causes of a gap as the evidence has them. All probabilities add to 1.

    `explanations` are the effects that were tried and the pairs that called for it, best first;
    `unexplained` is the likeliest fit with a flexible remainder. `p_value` is the posterior
    predictive p-value of the leading explanation that has no remainder. A part of
    `unexplained_probability` is that of something unknown that passes for an effect of the
    catalogue. `invisible` names the effects that these data cannot show, and why.
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


def attribute(
    problem: GapProblem, options: GapOptions, rng: np.random.Generator, progress: Progress = silent
) -> Attribution:
    """Return the causes of the gap between the hanger and the measurements, with probabilities.

    Sizes that these data cannot show are cut from the priors (`problem.smallest`). Raises
    UsageError for an unknown effect in `options.without`.
    """
    search = Search(problem, options, rng, progress)
    search.run()
    search.sample_probable(lambda: _chances(search))
    tried = search.scored()
    kinds = families(tried, search.variants)
    likeliest = _fit([kind for kind in kinds if not kind.flexible])
    p_value = predictive_p_value(
        problem.observations, predictions(problem, likeliest), likeliest.noise
    )
    chances, mimic = probabilities(kinds)
    progress("weighing", 1.0)
    none = next(kind for kind in kinds if not kind.effects and not kind.flexible)
    by_kind = list(zip(kinds, chances.tolist(), strict=True))
    causes, groups = _with_groups(search.problem, _explanations(by_kind, none))
    return Attribution(
        baseline=_fit([none]),
        no_gap_probability=sum(chance for kind, chance in by_kind if kind is none),
        unexplained_probability=mimic + sum(chance for kind, chance in by_kind if kind.flexible),
        unexplained=_fit([kind for kind in kinds if kind.flexible]),
        explanations=causes,
        groups=groups,
        invisible=search.invisible,
        p_value=p_value,
        search=search,
        tried=tuple(tried),
    )


def _chances(search: Search) -> dict[Hypothesis, float]:
    """Return the probability of each hypothesis that was fitted."""
    kinds = families(search.scored(), search.variants)
    found: dict[Hypothesis, float] = {}
    for kind, chance in zip(kinds, probabilities(kinds)[0].tolist(), strict=True):
        share = normalised(np.array([each.log_evidence for each in kind.tried]))
        found |= {
            each.hypothesis: chance * float(part)
            for each, part in zip(kind.tried, share, strict=True)
            if each.fit is not None
        }
    return found


def _explanations(by_kind: Sequence[tuple[Family, float]], none: Family) -> tuple[Explanation, ...]:
    """Return every effect and pair that was tried, the likeliest first."""
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
        for kind, chance in by_kind
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
    views = [views_from_peaks(problem, fit) for _, fit, _ in able]
    found = group(views, [near for *_, near in able])
    members = [tuple(able[i][0] for i in each) for each in found]
    names = tuple(tuple(causes[i].effect for i in each) for each in members)
    index = {i: number for number, each in enumerate(members) for i in each}
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
    alike = [
        each
        for each in attribution.explanations
        if each is leading or (each.group is not None and each.group == leading.group)
    ]
    found = [(each.probability, each.best.fit) for each in alike if each.best.fit is not None]
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
