"""All hypotheses that are tried: single effects, pairs, something unknown.

A scan of each effect's prior, to first order, says what these data could show and where to climb
from. What a scan or a climb leaves far behind the best is tried no further.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from shm.errors import BadInput, UsageError
from shm.gap.contract import Fit, GapOptions, Hypothesis
from shm.gap.law_error import allow_for_laws
from shm.gap.posterior import Target
from shm.gap.probabilities import ScoredHypothesis, log_prior
from shm.gap.problem import GapProblem
from shm.gap.sampling import MOST_ROUNDS, Sampling, approximate
from shm.gap.scan import scan, scan_beside
from shm.inference.linear import Linear
from shm.inference.options import Progress, silent
from shm.inference.posterior import Peak, find_peaks, laplace
from shm.models.effects import EFFECTS
from shm.values import ENOUGH_EFFECTIVE, FloatArray

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
"""Hypotheses with this probability are sampled: the answer rests on them."""
_MOST_SAMPLED = 5  # numerical: with probabilities above a tenth there are seldom more
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
            f"No effect is called {', '.join(unknown)}. The catalogue has {', '.join(EFFECTS)}."
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
        # What sampling finds beyond Laplace's method is nearly common: the hanger's own part.
        self._beyond = self.baseline.log_evidence - self.rough[ALONE]
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
            own = ScoredHypothesis.fitted(fit, common)
            if fit.hypothesis.effects and not fit.hypothesis.flexible:
                laws = allow_for_laws(self.problem, self.baseline, fit, self.rng)
                log = own.log_evidence
                own = replace(
                    own,
                    log_evidence=log + laws.gain,
                    log_mimic=log + laws.mimic,
                    draws=laws.draws,
                )
            tried.append(own)
        # What was not fitted is no better than what is hopeless: a scan may say anything far off.
        most = max(each.log_evidence for each in tried) - HOPELESS
        rest = {h: min(e + self._beyond, most) for h, e in self.rough.items() if h not in self.fits}
        return tried + [ScoredHypothesis(h, log, log) for h, log in rest.items()]

    def _level(self, hypothesis: Hypothesis) -> float:
        """Return the log of prior times rough evidence."""
        return self.rough[hypothesis] + log_prior(hypothesis, self.variants)

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
            hopeless = max(self.rough[h] for h in self.fits) - 2 * HOPELESS
            peaks = find_peaks(target, z, -np.inf if hypothesis.flexible else hopeless)
            if peaks:
                climbed[hypothesis] = peaks
                self.rough[hypothesis] = laplace(peaks)
        best = max(self._level(h) for h in (*self.fits, *climbed))
        for hypothesis, peaks in climbed.items():
            if hypothesis.flexible or self._level(hypothesis) > best - HOPELESS:
                target = Target(self.problem, hypothesis)
                found = approximate(target, peaks, self.draws, self.rng, self._beyond)
                if np.isfinite(found.predicted).all():
                    self.fits[hypothesis] = found

    def sample_probable(self, chance: Callable[[], Mapping[Hypothesis, float]]) -> None:
        """Sample what the answer rests on, by `chance` of each hypothesis, the likeliest first."""
        for _ in range(_MOST_SAMPLED):
            open_ = {
                h: p
                for h, p in chance().items()
                if p > OF_THE_ANSWER and self.fits[h].method == "normal"
            }
            if not open_:
                break
            hypothesis = max(open_, key=lambda h: open_[h])
            self.progress(f"sampling {hypothesis.name or 'something unknown'}", 0.9)
            without = self.baseline if hypothesis.effects else None
            target, peaks = Target(self.problem, hypothesis), self.fits[hypothesis].peaks
            sampling = Sampling(target, peaks, self.rng, without)
            sampling.run(ENOUGH_EFFECTIVE, MOST_ROUNDS)
            self.fits[hypothesis] = sampling.fit(self.draws)

    def _leading(self, most: int, effects: int) -> list[Fit]:
        """Return the likeliest fit of each of the leading effects, or pairs."""
        own = [f for h, f in self.fits.items() if len(h.effects) == effects and not h.flexible]
        own.sort(key=lambda each: -self.rough[each.hypothesis])
        first: dict[str, Fit] = {}
        for fit in own:
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
                    both = scan_beside(self.problem, lead, linear, alone)
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
        problem.alone = sampling.fit(draws)
    return problem.alone


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
