"""The causes of a gap: no gap, single effects, pairs, and something unknown, with probabilities.

A scan of each effect's prior, to first order, says what these data could show and where to climb
from. What a scan or a climb leaves far behind the best is tried no further. Where these data
support several causes and cannot tell them apart, what is claimed is their group.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import BadInput, UsageError
from shm.gap.causes.groups import SAME_BELOW, group, views_from_peaks
from shm.gap.causes.probabilities import (
    Family,
    ScoredHypothesis,
    allow_for_laws,
    families,
    log_prior,
    probabilities,
)
from shm.gap.causes.residuals import predictions, predictive_p_values
from shm.gap.causes.scan import scan, scan_pair
from shm.gap.hypotheses.contract import Fit, GapOptions, Hypothesis
from shm.gap.hypotheses.problem import GapProblem
from shm.gap.hypotheses.sampling import MOST_ROUNDS, Sampling, approximate
from shm.gap.hypotheses.target import Target
from shm.inference.options import Progress, silent
from shm.inference.sampler.coordinates import log_normal
from shm.inference.sampler.density import Peak, find_peaks, laplace
from shm.inference.sampler.linear import Linear
from shm.inference.sampler.mixture import effective, normalised, systematic
from shm.inference.sampler.sampling import weigh_along
from shm.models.effects import EFFECTS
from shm.values import ENOUGH_EFFECTIVE, FloatArray, Leads
from shm.values.leading import MIN_NO_GAP_PROBABILITY, find_leading_cause

ALONE = Hypothesis()

HOPELESS, HOPELESS_SHARE = 4.0, 0.4
"""Log of prior times evidence behind the best, or a share of the gap, from which on nothing is
tried further: a scan is linear, large gaps are not."""
LEADERS = 3
"""Effects that are tried in pairs, and with something unknown beside."""
SUPPORTED = 2.0
"""Log evidence that an effect gains where it explains something, so that pairs are tried."""
DROWNED = "Even at its largest it would drown in the errors of these data."
_MOST_SCANNED, _MOST_PAIRS = 12, 8
OF_THE_ANSWER = 0.1
"""Probability that may rest on hypotheses which were not sampled."""
_MOST_SAMPLED = 5  # numerical: places of one cause are seldom more
_ROUGHLY = 40, 8  # numerical: effective draws and rounds that tell the classes' evidence apart


def hypotheses(problem: GapProblem, without: tuple[str, ...] = ()) -> tuple[Hypothesis, ...]:
    """Return the hanger with one effect, for every variant, in the order of the catalogue.

    Left out are the effects `without`, those that the hanger has itself and those that these data
    cannot show. Raises UsageError for a name that is not in the catalogue.
    """
    check_effects(without)
    survey, reasons = problem.design.survey, invisible(problem)
    return tuple(
        Hypothesis(((name, variant),))
        for name, effect in EFFECTS.items()
        if name not in without and name not in reasons
        for variant in effect.variants(problem.hanger, survey)
    )


def check_effects(names: Sequence[str]) -> None:
    """Raise UsageError for a name that is not in the catalogue."""
    unknown = sorted(set(names) - set(EFFECTS))
    if unknown:
        raise UsageError(
            f"no effect is called {', '.join(unknown)}.",
            remedy=f"Name effects of the catalogue: {', '.join(EFFECTS)}.",
        )


def invisible(problem: GapProblem) -> dict[str, str]:
    """Return the effects that cannot be told from the hanger alone, and why in a sentence each."""
    survey = problem.design.survey
    reasons = {name: each.invisible(problem.hanger, survey) for name, each in EFFECTS.items()}
    for name in problem.has_itself:
        reasons[name] = f"The baseline {problem.model.name} has it as parameters of its own."
    return {name: reason for name, reason in reasons.items() if reason}


class Search:
    """Everything tried of a problem: scans, peaks and fits, each by its hypothesis.

    `rough` are log evidences by scans, or by Laplace's method where one was climbed to.
    """

    def __init__(
        self,
        problem: GapProblem,
        options: GapOptions,
        rng: np.random.Generator,
        progress: Progress = silent,
    ):
        self.problem, self.rng, self.draws, self.progress = problem, rng, options.draws, progress
        progress("baseline", 0.0)
        self.baseline = fit_alone(problem, rng, options.draws)
        self.fits: dict[Hypothesis, Fit] = {ALONE: self.baseline}
        self.rough: dict[Hypothesis, float] = {ALONE: laplace(self.baseline.peaks)}
        linear = Linear(problem.likelihood(ALONE), self.baseline.slopes)
        every = hypotheses(problem, options.without)
        scans = {h: scan(problem, self.baseline, linear, h) for h in every}
        self.scans = {h: each for h, each in scans.items() if each.smallest < 1}
        problem.smallest |= {h.effects[0]: each.smallest for h, each in self.scans.items()}
        self.rough |= {h: each.log_evidence for h, each in self.scans.items()}
        self.variants = dict(Counter(h.name for h in self.scans))
        drowned = {h.name: DROWNED for h in every if h.name not in self.variants}
        self.invisible = tuple((invisible(problem) | drowned).items())

    def run(self) -> None:
        """Try single effects, pairs where one effect explains something, and the unknown."""
        self.progress("single effects", 0.1)
        self._fit({h: self.scans[h].starts(self.problem, self.baseline) for h in self._hopeful()})
        leaders = self._leading(LEADERS, effects=1)
        explains = [h for h in self.fits if self.rough[h] > self.rough[ALONE] + SUPPORTED]
        if explains:
            self.progress("pairs", 0.5)
            self._fit(self._pairs(leaders))
        self.progress("something unknown", 0.8)
        bases = [self.baseline, *leaders[:1], *self._leading(1, effects=2)]
        self._fit({replace(each.hypothesis, flexible=True): each.z[None] for each in bases})

    def scored(self) -> list[ScoredHypothesis]:
        """Return every hypothesis with its evidence, by laws that may be off."""
        common, tried = len(self.baseline.z), []
        for fit in self.fits.values():
            score = ScoredHypothesis.fitted(fit, common)
            if fit.hypothesis.effects and not fit.hypothesis.flexible:
                laws = allow_for_laws(self.problem, self.baseline, fit, self.rng)
                log = score.log_evidence
                score = replace(
                    score,
                    log_evidence=log + laws.gain,
                    log_mimic=log + laws.mimic,
                    draws=laws.draws,
                )
            tried.append(score)
        # What was not fitted is no better than what is hopeless: a scan may say anything far off.
        most = max(each.log_evidence for each in tried) - HOPELESS
        rest = {h: min(e, most) for h, e in self.rough.items() if h not in self.fits}
        return tried + [ScoredHypothesis(h, log, log) for h, log in rest.items()]

    def _level(self, hypothesis: Hypothesis) -> float:
        """Return the log of prior times rough evidence."""
        return self.rough[hypothesis] + log_prior(hypothesis, self.variants)

    def _needed(self, target: Target, level: float) -> float:
        """Return the log posterior at the peak that a level needs at least.

        Parameters of the hanger are as uncertain as without effects, those of effects as before.
        """
        alone = self.baseline.peaks[0]
        added = target.dimension - len(alone.z)
        volume = alone.log_evidence - alone.log + added * np.log(2 * np.pi) / 2
        return float(level - log_prior(target.hypothesis, self.variants) - volume)

    def _hopeful(self) -> list[Hypothesis]:
        """Return the scanned hypotheses near the best; each effect once where there is a gap.

        Of a narrow peak a coarse scan sees little.
        """
        ranked = sorted(self.scans, key=lambda h: -self._level(h))
        if not ranked:
            return []
        gap = max(self.rough[h] for h in ranked) - self.rough[ALONE]
        best = max(self._level(ranked[0]), self._level(ALONE))
        reach = max(HOPELESS, HOPELESS_SHARE * gap)
        near = [h for h in ranked[:_MOST_SCANNED] if self._level(h) > best - reach]
        each_once = {h.name: h for h in reversed(ranked)} if gap > SUPPORTED else {}
        return list(dict.fromkeys([*near, *each_once.values()]))

    def _fit(self, starts: Mapping[Hypothesis, FloatArray]) -> None:
        """Climb from the starts of each hypothesis; approximate those that come near the best."""
        climbed: dict[Hypothesis, list[Peak]] = {}
        for hypothesis, z in starts.items():
            target = Target(self.problem, hypothesis)
            best = max(self._level(h) for h in (*self.fits, *climbed))
            hopeless = -np.inf if hypothesis.flexible else self._needed(target, best - 2 * HOPELESS)
            peaks = find_peaks(target, z, hopeless)
            if peaks and self.problem.settle_temperatures(hypothesis, peaks[0].z):
                again = np.array([peak.z for peak in peaks])
                peaks = find_peaks(Target(self.problem, hypothesis), again)
            if peaks:
                climbed[hypothesis] = peaks
                self.rough[hypothesis] = laplace(peaks)
        best = max(self._level(h) for h in (*self.fits, *climbed))
        for hypothesis, peaks in climbed.items():
            if hypothesis.flexible or self._level(hypothesis) > best - HOPELESS:
                target = Target(self.problem, hypothesis)
                peaks = self._with_mirrored(target, peaks)
                self.rough[hypothesis] = laplace(peaks)
                found = approximate(target, peaks, self.draws, self.rng)
                # Where two modes change places a prediction is one thing in a batch, another alone.
                if found.log_fit + log_normal(found.z[None])[0] > peaks[0].log - AS_GOOD_A_FIT:
                    self.fits[hypothesis] = found

    def _with_mirrored(self, target: Target, peaks: list[Peak]) -> list[Peak]:
        """Return the peaks with those at the places mirrored at mid-length, the highest first.

        Frequencies hardly tell the one from the other, so that both belong to the posterior.
        """
        places = self.problem.coordinates(target.hypothesis).places
        if not len(places):
            return peaks
        z = np.array([peak.z for peak in peaks])
        mirrored = z.copy()
        mirrored[:, places] *= -1
        return find_peaks(target, np.vstack([z, mirrored])) or peaks

    def sample_probable(self, chance: Callable[[], Mapping[Hypothesis, float]]) -> None:
        """Sample what the answer rests on, by `chance` of each hypothesis, the likeliest first."""
        for _ in range(_MOST_SAMPLED):
            rest = {h: p for h, p in chance().items() if self.fits[h].method == "normal"}
            if sum(rest.values()) < OF_THE_ANSWER:
                break
            hypothesis = max(rest, key=lambda h: rest[h])
            self.progress(f"sampling {hypothesis.name or 'something unknown'}", 0.9)
            without = self.baseline if hypothesis.effects else None
            target, peaks = Target(self.problem, hypothesis), self.fits[hypothesis].peaks
            sampling = Sampling(target, peaks, self.rng, without)
            sampling.run(ENOUGH_EFFECTIVE, MOST_ROUNDS)
            self.fits[hypothesis] = sampling.fit(self.draws)

    def _leading(self, most: int, effects: int) -> list[Fit]:
        """Return the likeliest fit of each of the leading effects, or pairs."""
        fits = [f for h, f in self.fits.items() if len(h.effects) == effects and not h.flexible]
        fits.sort(key=lambda each: -self.rough[each.hypothesis])
        first: dict[str, Fit] = {}
        for fit in fits:
            first.setdefault(fit.hypothesis.name, fit)
        return list(first.values())[:most]

    def _pairs(self, leaders: Sequence[Fit]) -> dict[Hypothesis, FloatArray]:
        """Return starts of the pairs of a leading effect with another that promise most."""
        found: dict[Hypothesis, tuple[float, FloatArray]] = {}
        for lead in leaders:
            linear = Linear(self.problem.likelihood(ALONE), lead.slopes)
            for single, alone in self.scans.items():
                pair = Hypothesis((*lead.hypothesis.effects, *single.effects))
                other_way = Hypothesis(pair.effects[::-1])
                if single.name != lead.hypothesis.name and other_way not in found:
                    both = scan_pair(self.problem, lead, linear, alone)
                    self.rough[pair] = both.log_evidence
                    found[pair] = both.log_evidence, both.starts(self.problem, lead)
        best = sorted(found, key=lambda h: -found[h][0])[:_MOST_PAIRS]
        return {h: found[h][1] for h in best}


# Numerical: the tension over nearly all of its prior, and ends from loose to fast.
_TENSIONS, _ENDS = np.linspace(-2.5, 2.5, 21), (-1.5, -0.5, 0.5, 1.5)


def fit_alone(problem: GapProblem, rng: np.random.Generator, draws: int = 1000) -> Fit:
    """Return the fit of the hanger without effects, which the problem keeps.

    Raises BadInput where the model cannot be solved near the data.
    """
    if problem.alone is None:
        sampling = sample_alone(problem, rng)
        sampling.run(ENOUGH_EFFECTIVE, MOST_ROUNDS)
        problem.alone = _with_draws_of_update(problem, sampling.fit(draws), rng)
    return problem.alone


def _with_draws_of_update(problem: GapProblem, fit: Fit, rng: np.random.Generator) -> Fit:
    """Return the fit of the hanger alone with the draws that an update has of it.

    They follow valleys that sampling about the peaks does not; what differs between both densities
    weights them. The fit stays where too few count, and where the hanger alone misses by more than
    models do: there an update widens, and a diagnosis looks for the cause.
    """
    update = problem.as_update()
    if update is None:
        return fit
    update.settle(fit.z)
    error = update.measured.most_likely_sigma(update.predict(fit.z[None]))
    if error[0] > problem.hanger.assumptions.model_error.upper:
        return fit
    starts = update.fold(np.array([peak.z for peak in fit.peaks]))
    samples = 3 * len(fit.draws) // 2
    found = weigh_along(update, find_peaks(update.rough, starts), samples, rng)[0]
    points = found.resampled(samples, rng)
    z = problem.described.places(update.coordinates.finished(points.z, rng))
    log = Target(problem, ALONE).log(z) - update.log_posterior(points)
    weights = normalised(np.where(np.isfinite(log), log, -np.inf))
    count = found.effective_sample_size * effective(weights) / len(weights)
    if not count >= ENOUGH_EFFECTIVE:
        return fit
    rows = systematic(weights, len(fit.draws), rng)
    return replace(fit, draws=z[rng.permutation(rows)], effective=count)


def sample_alone(problem: GapProblem, rng: np.random.Generator) -> Sampling:
    """Return the sampling of the hanger without effects, which the problem keeps.

    It has come as far as the evidence takes.
    """
    if problem.sampling is not None:
        return problem.sampling
    peaks = find_peaks(Target(problem, ALONE), find_starts(problem))
    problem.settle(peaks[0])
    problem.sampling = Sampling(Target(problem, ALONE), peaks, rng)
    problem.sampling.run(*_ROUGHLY)
    return problem.sampling


def find_starts(problem: GapProblem) -> FloatArray:
    """Return points z (m, d) of the hanger alone from which to climb.

    For each level of the ends the tension that fits best: they trade with each other. Raises
    BadInput where the model cannot be solved near the data.
    """
    target = Target(problem, ALONE)
    z = np.zeros((len(_ENDS), len(_TENSIONS), target.dimension))
    z[:, :, 0] = _TENSIONS
    z[:, :, problem.end_columns] = np.array(_ENDS)[:, None, None]
    log = target.log(z.reshape(-1, target.dimension)).reshape(z.shape[:2])
    if not np.isfinite(log).any():
        raise BadInput(
            f"the model cannot be solved anywhere for {problem.model.name}.",
            remedy="Check the description of the hanger.",
        )
    best = np.where(np.isnan(log), -np.inf, log).argmax(axis=1)
    return np.unique(z[np.arange(len(best)), best], axis=0)


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
    `unexplained` is the likeliest fit with a flexible remainder. `p_values` are the posterior
    predictive p-values, of frequencies and of shapes, of the leading explanation that has no
    remainder. A part of
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
    p_values: tuple[float, float]
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
    most_probable = _fit([kind for kind in kinds if not kind.flexible])
    p_values = predictive_p_values(
        problem.observations, predictions(problem, most_probable), most_probable.noise
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
        p_values=p_values,
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
    """Return True where evidence hardly prefers the best cause, or the prior alone does.

    A cause of many parameters pays for them, but where it fits as well the data do not speak
    against it.
    """
    behind = best.log_bayes_factor - cause.log_bayes_factor
    as_well = cause.log_fit > best.log_fit - AS_GOOD_A_FIT
    return behind < SAME_BELOW or (as_well and behind < WITHIN_REACH)


def _reached(cause: Explanation, best: Explanation) -> bool:
    """Return True where these data leave a cause a chance beside the best one."""
    level = cause.log_bayes_factor
    return hardly_behind(cause, best) or level > max(0.0, best.log_bayes_factor - WITHIN_REACH)


def _idle(pair: Explanation, alone: Mapping[str, float]) -> bool:
    """Return True where one effect of a pair explains about as much without the other."""
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
    members = [
        each
        for each in attribution.explanations
        if each is leading or (each.group is not None and each.group == leading.group)
    ]
    found = [(each.probability, each.best.fit) for each in members if each.best.fit is not None]
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
