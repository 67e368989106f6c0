"""The single effects that these data could show, each at each place where it may act, and which of
them are worth a full fit: each is tried linearised, on top of a fit without it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from shm.errors import UsageError
from shm.gap.contract import Fit, Hypothesis, Progress
from shm.gap.detectability import HOPELESS_SHARE, Scan, scan, superposed, truncate
from shm.gap.marginal import marginal
from shm.gap.model_probabilities import ScoredHypothesis
from shm.gap.problem import GapProblem
from shm.models.effects import EFFECTS

IN_BASELINE = {
    "beam2": ("rotational_end_flexibility",),
    "solid1": ("rotational_end_flexibility", "translational_end_flexibility"),
    "solid2": ("rotational_end_flexibility",),
}
"""Effects that a baseline class has as parameters of its own."""
# Judgement: what a scan puts 150 times (a coarse one 1100 times) behind is not fitted. A smaller
# reach loses causes, a larger one costs a fit each.
HOPELESS, HOPELESS_IF_COARSE = 5.0, 7.0
NOTHING_SEEN = 1.0


def hypotheses(problem: GapProblem, without: tuple[str, ...] = ()) -> tuple[Hypothesis, ...]:
    """Baseline + one effect, for every variant, in the order of the catalogue.

    Left out are the effects `without`, those that the baseline has itself and those that these
    data cannot show. Raises UsageError for a name that is not in the catalogue.
    """
    unknown = sorted(set(without) - set(EFFECTS))
    if unknown:
        raise UsageError(
            f"No effect is called {', '.join(unknown)}. The catalogue has {', '.join(EFFECTS)}."
        )
    survey = problem.observations.design.survey
    return tuple(
        Hypothesis(((name, variant),))
        for name, effect in EFFECTS.items()
        if name not in without and name not in invisible(problem)
        for variant in effect.variants(problem.hanger, survey)
    )


def invisible(problem: GapProblem) -> dict[str, str]:
    """The effects that cannot be told from the baseline, and why in a sentence each."""
    survey = problem.observations.design.survey
    reasons = {name: each.invisible(problem.hanger, survey) for name, each in EFFECTS.items()}
    for name in IN_BASELINE.get(problem.baseline, ()):
        reasons[name] = f"The baseline {problem.baseline} has it as parameters of its own."
    return {name: reason for name, reason in reasons.items() if reason}


def screened(
    problem: GapProblem, baseline: Fit, singles: Sequence[Hypothesis], progress: Progress
) -> dict[Hypothesis, Scan]:
    """The single effects that these data can show, scanned, their priors cut to visible sizes."""
    scans: dict[Hypothesis, Scan] = {}
    for count, hypothesis in enumerate(singles):
        progress(f"screening {hypothesis.name}", count / len(singles))
        found = scan(problem, baseline, hypothesis)
        if found.smallest < NOTHING_SEEN:
            truncate(problem, found)
            scans[hypothesis] = found
    return scans


def paired(
    problem: GapProblem, leader: Fit, scans: Mapping[Hypothesis, Scan]
) -> dict[Hypothesis, Scan]:
    """The leader with every other effect: what each does alone is added to the leader's fit."""
    first = leader.hypothesis
    pairs = {
        Hypothesis((*first.effects, *single.effects)): found
        for single, found in scans.items()
        if single.name != first.name
    }
    return {pair: superposed(problem, leader, found, pair) for pair, found in pairs.items()}


def tried_by_screening(
    problem: GapProblem, before: Fit, scans: Mapping[Hypothesis, Scan]
) -> tuple[ScoredHypothesis, ...]:
    """What scans on top of a fit say, the best first, as gains on it to stand beside fits."""
    nothing = marginal(problem, Hypothesis(), before, np.zeros((1, len(before.predicted))))
    best = ScoredHypothesis.fitted(before, len(before.z))
    level = float(nothing.log_likelihood[0])
    tried = [
        ScoredHypothesis(
            hypothesis,
            before.log_evidence + found.log_evidence - level,
            best.log_fit + float(found.marginal.log_peak.max()) - level,
        )
        for hypothesis, found in scans.items()
    ]
    return tuple(sorted(tried, key=lambda each: -each.log_evidence))


def hopeful(
    tried: Sequence[ScoredHypothesis],
    priors: Sequence[float],
    coarse: Sequence[bool],
    rival: float,
    gap: float,
    most: int,
) -> tuple[ScoredHypothesis, ...]:
    """Those that may come near the likeliest, the best first, at most `most`.

    `priors` are the logarithms of theirs, `rival` the log of prior times evidence of the best so
    far. A scan of several parameters is `coarse` and may be farther off. The larger the gap (what
    the best gains in log evidence), the more a scan, which takes it as linear, may be wrong.
    """
    weighed = [each.log_evidence + prior for each, prior in zip(tried, priors, strict=True)]
    order = np.argsort(-np.array(weighed), kind="stable")[:most]
    best = max([rival, *weighed])
    own = np.where(coarse, HOPELESS_IF_COARSE, HOPELESS)
    reach = np.maximum(own, HOPELESS_SHARE * gap)
    return tuple(tried[i] for i in order if weighed[i] > best - reach[i])


def varied(
    tried: Sequence[ScoredHypothesis], alike: int, most: int
) -> tuple[ScoredHypothesis, ...]:
    """The best by their evidence, at most `most`, and no more than `alike` of one family."""
    before: Counter[str] = Counter()
    kept = []
    for each in sorted(tried, key=lambda each: -each.log_evidence):
        before[each.hypothesis.name] += 1
        if before[each.hypothesis.name] <= alike:
            kept.append(each)
    return tuple(kept[:most])
