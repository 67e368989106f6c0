"""The search through hypotheses: single effects, something unknown, pairs where they are needed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy

from shm.gap.contract import Fit, GapOptions, Hypothesis
from shm.gap.detectability import HOPELESS_SHARE, Scan, scan, superposed, truncate
from shm.gap.fit import (
    STARTS,
    baseline_fit,
    fitted,
    hypotheses,
    invisible,
    tried_by_screening,
    varied,
    with_remainder,
)
from shm.gap.importance_sampling import sampled
from shm.gap.law_error import by_its_laws, mixed, otherwise
from shm.gap.model_probabilities import Family, ScoredHypothesis, families, log_prior
from shm.gap.problem import GapProblem
from shm.gap.residuals import predictions, predictive_p_value
from shm.inference.mixture import normalised
from shm.inference.options import Progress
from shm.values import FloatArray

# Judgement, time against the chance to miss a cause. Sampled is what Laplace's method puts within
# 55 to one of the likeliest, five at most.
MOST_FITS = 30
SAMPLED_WITHIN, MOST_SAMPLED = 4.0, 5
BENT_WITHIN, MOST_BENT = 8.0, 6
"""The same of a baseline with end springs, whose posterior no normal distribution follows: all
that Laplace's method puts within so much, and the baseline itself, are sampled."""

THOROUGH_WITHIN = 3.0
"""Of the likeliest, by Laplace's method: the samplers of others stop after their first attempt. An
evidence that is off by 0.6 changes a probability of 0.05 by 0.03."""

# Judgement, too: each leader costs a scan of all its pairs, each pair a fit.
LEADERS, LEADING_PAIRS, MOST_PAIRS, MOST_ROUNDS = 3, 2, 8, 3
MANY_LEADERS, MANY_PAIRS, ALIKE = 6, 30, 2

# Judgement: seven to one, where evidence is positive (Kass and Raftery 1995 say from 1.1 on): below
# it a second effect has nothing to stand on.
SUPPORTED = 2.0
# Judgement: of a large effect the error of its law may cost a fifth of what it explains, hundreds
# in a gap of many standard deviations; less reach would judge a cause by the letter of its law.
LAWS_WITHIN, LAWS_WITHIN_SHARE = 500.0, 0.2
# Judgement: what a scan puts 150 times (a coarse one 1100 times) behind is not fitted. A smaller
# reach loses causes, a larger one costs a fit each.
HOPELESS, HOPELESS_IF_COARSE = 5.0, 7.0
NOTHING_SEEN = 1.0
DROWNED = "Even at its largest it would drown in the errors of these data."


class Search:
    """Goes through the hypotheses; what it tries grows from step to step."""

    def __init__(
        self, problem: GapProblem, options: GapOptions, rng: np.random.Generator, progress: Progress
    ):
        self.problem, self.options, self.rng, self.progress = problem, options, rng, progress
        progress("baseline", 0.0)
        self.baseline = baseline_fit(problem, rng)
        self.hypotheses = hypotheses(problem, options.without)
        self.variants: dict[str, int] = {}
        self.scans: dict[Hypothesis, Scan] = {}
        self._reached = 0.0
        self._samples: dict[Hypothesis, tuple[Fit, Fit, bool]] = {}

    def singles(self) -> list[ScoredHypothesis]:
        """No gap and every single effect, those that stand a chance fitted."""
        for count, hypothesis in enumerate(self.hypotheses):
            self._tell(f"screening {hypothesis.name}", 0.4 * count / len(self.hypotheses))
            found = scan(self.problem, self.baseline, hypothesis)
            if found.smallest < NOTHING_SEEN:
                truncate(self.problem, found)
                self.scans[hypothesis] = found
        self.variants = dict(Counter(each.name for each in self.scans))
        rival = self.baseline.log_evidence + log_prior(Hypothesis(), self.variants)
        rough = tried_by_screening(self.problem, self.baseline, self.scans)
        nothing = self.baseline.log_evidence
        chosen = self._hopeful(self.scans, rough, nothing, rival, MOST_FITS)
        fits = self._fitted(self.scans, chosen, 0.4, 0.6)
        rest = [each for each in rough if each.hypothesis not in fits]
        return [self._tried(self.baseline), *map(self._tried, fits.values()), *rest]

    def with_unknown(self, tried: list[ScoredHypothesis]) -> list[ScoredHypothesis]:
        """Adds the remainder of something unknown to no gap and to the leading effects."""
        fits = [self.baseline, *self._leading_fits(tried, LEADERS)]
        return [*tried, *map(self._flexible, fits)]

    def calls_for_pairs(self, tried: Sequence[ScoredHypothesis]) -> bool:
        """Whether the best single effect explains something, so that a second may explain more."""
        fits = [leader.best.fit for leader in self.leaders(tried)[:1]]
        level = self.baseline.log_evidence + SUPPORTED
        return any(fit is not None and fit.log_evidence > level for fit in fits)

    def with_pairs(self, tried: list[ScoredHypothesis]) -> list[ScoredHypothesis]:
        """Adds the pairs of a leading effect with another one that may be as likely, fitted."""
        return self._with_pairs_of(self._leading_fits(tried, LEADERS), tried)

    def with_other_pairs(self, tried: list[ScoredHypothesis]) -> list[ScoredHypothesis]:
        """Adds pairs of either effect of the likeliest pair, which need not lead alone, fitted.

        Among them are those of its own kind at other places. Goes on while another pair leads.
        """
        seen: set[Hypothesis] = set()
        best = self._likeliest(tried)
        while len(best.effects) > 1 and best not in seen and len(seen) < MOST_ROUNDS:
            seen.add(best)
            tried = self._with_pairs_of(self._parts(best, tried), tried, best.names)
            best = self._likeliest(tried)
        return tried

    def _likeliest(self, tried: Sequence[ScoredHypothesis]) -> Hypothesis:
        """Of the effects and pairs."""
        kinds = families(tried, self.variants)
        return next(f.best.hypothesis for f in kinds if f.effects and not f.flexible)

    def _parts(self, pair: Hypothesis, tried: Sequence[ScoredHypothesis]) -> list[Fit]:
        """The fits of a pair's effects, each alone."""
        parts = [Hypothesis((effect,)) for effect in pair.effects]
        alone = [each for each in tried if each.hypothesis in parts]
        new = self._fitted(self.scans, [each for each in alone if each.fit is None], 0.7, 0.7)
        return [*(each.fit for each in alone if each.fit is not None), *new.values()]

    def _with_pairs_of(
        self, fits: Sequence[Fit], tried: list[ScoredHypothesis], kind: tuple[str, ...] = ()
    ) -> list[ScoredHypothesis]:
        """Adds the pairs of fitted effects that stand a chance, and all of a `kind`, fitted."""
        best = families(tried, self.variants)[0]
        rival = best.log_evidence + best.log_prior
        single = max(each.log_evidence for each in tried if not each.hypothesis.flexible)
        scans, rough = self._pairs(fits, tried)
        hopeful = self._hopeful(scans, rough, single, rival, MOST_PAIRS)
        of_kind = [each for each in rough if sorted(each.hypothesis.names) == sorted(kind)]
        chosen = tuple(dict.fromkeys([*hopeful, *of_kind]))
        return self._with_fitted_pairs(tried, scans, chosen)

    def with_every_effect(self, tried: list[ScoredHypothesis]) -> list[ScoredHypothesis]:
        """Adds fits of the effects and places that screening had given up.

        Of an effect so large that the baseline goes along far, the linear scan says too little.
        """
        given_up = [each for each in tried if each.fit is None]
        fits = self._fitted(self.scans, given_up, 0.6, 0.7)
        return [each for each in tried if each.hypothesis not in fits] + [
            self._tried(fit) for fit in fits.values()
        ]

    def with_many_pairs(self, tried: list[ScoredHypothesis]) -> list[ScoredHypothesis]:
        """Adds pairs of all kinds, fitted.

        Where the gap is large, the scans, which add up what each effect does alone, say little.
        """
        scans, rough = self._pairs(self._leading_fits(tried, MANY_LEADERS), tried)
        return self._with_fitted_pairs(tried, scans, varied(rough, ALIKE, MANY_PAIRS))

    def _pairs(
        self, fits: Sequence[Fit], tried: Sequence[ScoredHypothesis]
    ) -> tuple[dict[Hypothesis, Scan], list[ScoredHypothesis]]:
        """Pairs of fitted effects that are not tried yet, scanned, and what the scans say."""
        known = {each.hypothesis for each in tried}
        scans: dict[Hypothesis, Scan] = {}
        rough: list[ScoredHypothesis] = []
        for fit in fits:
            found, own = {}, fit.hypothesis
            for single, alone in self.scans.items():
                pair = Hypothesis((*own.effects, *single.effects))
                either_way = {pair, Hypothesis(pair.effects[::-1])}
                if single.name != own.name and not either_way & {*known, *scans}:
                    found[pair] = superposed(self.problem, fit, alone, pair)
            rough += tried_by_screening(self.problem, fit, found)
            scans |= found
        return scans, rough

    def _with_fitted_pairs(
        self,
        tried: list[ScoredHypothesis],
        scans: Mapping[Hypothesis, Scan],
        chosen: Sequence[ScoredHypothesis],
    ) -> list[ScoredHypothesis]:
        fits = list(self._fitted(scans, chosen, 0.7, 0.85, tried).values())
        first = sorted(fits, key=lambda fit: -fit.log_evidence)[:1]
        return [*tried, *map(self._tried, fits), *map(self._flexible, first)]

    def with_sampled(self, tried: list[ScoredHypothesis]) -> list[ScoredHypothesis]:
        """The likeliest explanations, by variant, sampled instead of taken as normal."""
        able = {e.hypothesis: e for e in tried if e.fit is not None and not e.hypothesis.flexible}
        weight = {h: e.log_evidence + log_prior(h, self.variants) for h, e in able.items()}
        first = max(weight.values())
        bent = len(self.problem.coordinates(Hypothesis()).other) > 0
        within, most = (BENT_WITHIN, MOST_BENT) if bent else (SAMPLED_WITHIN, MOST_SAMPLED)
        near = [h for h in weight if weight[h] > first - within]
        chosen = sorted(near, key=lambda h: -weight[h])[:most]
        if bent and Hypothesis() not in chosen:
            chosen.append(Hypothesis())
        near = [h for h in chosen if weight[h] > first - THOROUGH_WITHIN or not h.effects]
        thorough = near if bent else chosen
        return [
            self._sampled(each, each.hypothesis in thorough) if each.hypothesis in chosen else each
            for each in tried
        ]

    def with_laws(self, tried: list[ScoredHypothesis]) -> list[ScoredHypothesis]:
        """Allows for the error of the effects' own laws, where it may decide something."""
        first = max(each.log_evidence for each in tried)
        gap = first - self.baseline.log_evidence
        least = first - max(LAWS_WITHIN, LAWS_WITHIN_SHARE * gap)
        foremost = {family.best.hypothesis for family in self._foremost(tried)}
        return [
            self._by_its_laws(each, each.hypothesis in foremost)
            if each.log_evidence > least
            else each
            for each in tried
        ]

    @property
    def invisible(self) -> tuple[tuple[str, str], ...]:
        """The effects that these data cannot show, and why."""
        seen = {hypothesis.name for hypothesis in self.scans}
        drowned = {each.name: DROWNED for each in self.hypotheses if each.name not in seen}
        return tuple((invisible(self.problem) | drowned).items())

    def p_value(self, fit: Fit) -> float:
        """Of the absolute fit, with the errors as they are expected to be."""
        return predictive_p_value(
            self.problem.observations, predictions(self.problem, fit), fit.noise
        )

    def leaders(self, tried: Sequence[ScoredHypothesis], most: int = LEADERS) -> list[Family]:
        """The likeliest families of one effect."""
        singles = [f for f in families(tried, self.variants) if f.effects == 1 and not f.flexible]
        return singles[:most]

    def _leading_fits(self, tried: Sequence[ScoredHypothesis], most: int) -> list[Fit]:
        leaders = (family.best.fit for family in self.leaders(tried, most))
        return [fit for fit in leaders if fit is not None]

    def _hopeful(
        self,
        scans: Mapping[Hypothesis, Scan],
        rough: Sequence[ScoredHypothesis],
        without: float,
        rival: float,
        most: int,
    ) -> tuple[ScoredHypothesis, ...]:
        """What may come near the likeliest, the best first, at most `most`.

        `without` is the log evidence without what was scanned, `rival` the log of prior times
        evidence of the best so far. A scan of several parameters is coarse and may be farther off.
        The larger the gap (what the best gains in log evidence), the more a scan, which takes it as
        linear, may be wrong.
        """
        if not rough:
            return ()
        weighed = [e.log_evidence + log_prior(e.hypothesis, self.variants) for e in rough]
        coarse = [scans[each.hypothesis].share.shape[1] > 1 for each in rough]
        gap = max(each.log_evidence for each in rough) - without
        reach = np.where(coarse, HOPELESS_IF_COARSE, HOPELESS)
        least = max([rival, *weighed]) - np.maximum(reach, HOPELESS_SHARE * gap)
        order = np.argsort(-np.array(weighed), kind="stable")[:most]
        return tuple(rough[i] for i in order if weighed[i] > least[i])

    def _fitted(
        self,
        scans: Mapping[Hypothesis, Scan],
        chosen: Sequence[ScoredHypothesis],
        begin: float,
        end: float,
        tried: Sequence[ScoredHypothesis] = (),
    ) -> dict[Hypothesis, Fit]:
        """Fits of what was chosen, from the scans' best points.

        A pair also from where each of its effects, if it was `tried`, lies alone.
        """
        found: dict[Hypothesis, Fit] = {}
        alone = {e.hypothesis: e.fit for e in tried if e.fit and len(e.hypothesis.effects) == 1}
        for hypothesis in (each.hypothesis for each in chosen):
            fraction = begin + (end - begin) * len(found) / len(chosen)
            self._tell(f"fitting {hypothesis.name}", fraction)
            starts = scans[hypothesis].starts(self.problem.coordinates(hypothesis), STARTS)
            starts = np.vstack([starts, *self._joined(hypothesis, alone)])
            found[hypothesis] = fitted(self.problem, hypothesis, self.rng, starts)
        return found

    def _joined(self, pair: Hypothesis, alone: Mapping[Hypothesis, Fit]) -> list[FloatArray]:
        """Points z (d,) of a pair from the fits of its effects, each alone."""
        fits = [alone.get(Hypothesis((effect,))) for effect in pair.effects]
        known = [fit.z for fit in fits if fit is not None]
        if len(known) < 2:
            return []
        common = len(self.baseline.z)
        effects = [z[common:] for z in known]
        return [np.concatenate([z[:common], *effects]) for z in known]

    def _tell(self, label: str, fraction: float) -> None:
        """Progress never goes back."""
        self._reached = max(self._reached, fraction)
        self.progress(label, self._reached)

    def _flexible(self, base: Fit) -> ScoredHypothesis:
        self._tell("something unknown", 0.65)
        return self._tried(with_remainder(self.problem, base, self.rng))

    def _foremost(self, tried: Sequence[ScoredHypothesis]) -> list[Family]:
        """The likeliest families of one effect and of two."""
        pairs = [f for f in families(tried, self.variants) if f.effects > 1 and not f.flexible]
        return [*self.leaders(tried), *pairs[:LEADING_PAIRS]]

    def _by_its_laws(self, tried: ScoredHypothesis, anew: bool) -> ScoredHypothesis:
        """With the error of its laws; fitted `anew` by each other law, as likely as by its own.

        A large effect by another law may be far from the point that fits best by its own.
        """
        if tried.fit is None or tried.hypothesis.flexible or not tried.hypothesis.effects:
            return tried
        fits = [tried.fit, *(self._by_other_laws(tried.fit) if anew else ())]
        share = np.array([1.0, *(1 / len(fits[1:]) for _ in fits[1:])])
        found = [by_its_laws(self.problem, self.baseline, fit, self.rng) for fit in fits]
        plain = np.log(share / share.sum()) + [fit.log_evidence for fit in fits]
        log = plain + [each.gain for each in found]
        return replace(
            self._tried(found[int(log.argmax())].fit),
            log_evidence=float(scipy.special.logsumexp(log)),
            log_mimic=float(scipy.special.logsumexp(plain + [each.mimic for each in found])),
            draws=mixed([each.draws for each in found], normalised(log), self.rng),
        )

    def _by_other_laws(self, fit: Fit) -> list[Fit]:
        self._tell(f"other laws of {fit.hypothesis.name}", 0.95)
        return [fitted(self.problem, h, self.rng, fit.z[None]) for h in otherwise(fit.hypothesis)]

    def _tried(self, fit: Fit) -> ScoredHypothesis:
        return ScoredHypothesis.fitted(fit, len(self.baseline.z))

    def _sampled(self, tried: ScoredHypothesis, thorough: bool) -> ScoredHypothesis:
        fit = tried.fit
        if fit is None:
            return tried
        known = self._samples.get(tried.hypothesis)
        if known is None or known[0] is not fit or (thorough and not known[2]):
            self._tell(f"sampling {tried.hypothesis.name}", 0.9)
            found = sampled(self.problem, fit, self.rng, self.options.draws, thorough)
            known = self._samples[tried.hypothesis] = fit, found, thorough
        return self._tried(known[1])
