"""The gap diagnosis of a user's own simulator, whatever it simulates.

The simulator alone, with each effect of its catalogue, and with a remainder that is free in form
compete as in the diagnosis of hangers, by the same prior odds, the same share of what is unknown
that passes for a listed effect, and the same bound under which causes count as one group. Pairs of
effects are not tried: two causes at once come out as the larger one with something unknown beside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.contract import Fit, Hypothesis
from shm.gap.groups import SAME_BELOW, grouped
from shm.gap.model_probabilities import (
    ScoredHypothesis,
    families,
    probabilities,
)
from shm.gap.simulator_fit import fitted, refitted
from shm.gap.simulator_problem import Condition, Reading, Simulator, SimulatorProblem
from shm.models.effects.base import Variant
from shm.values import FloatArray

NO_GAP_BELOW = 0.05
"""As in the diagnosis of hangers: a gap is shown where no gap keeps less."""
EXPLAINED = 0.5
"""Judgement: an effect with something unknown beside it counts as the cause where it takes more of
the squared gap than it leaves; else what is unknown is the answer."""
_FLEXIBLE = 3  # technical: what leads is tried with something unknown beside; the others lose both
_FOLDS = 5  # at most so many parts are held out in turn
_SUPPORTED = 0.02  # judgement: a cause with less is in no group
_EVERYWHERE = Variant()


@dataclass(frozen=True)
class SimulatorCause:
    """An effect with its probability and what it leaves of the gap.

    `size` holds mean and standard deviation of its own parameters if it is the cause.
    """

    name: str
    probability: float
    gap_left: float
    size: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Shrinkage:
    """The gap, root mean square of readings less predictions in stated deviations.

    `before` is of the simulator alone, `after` of the likeliest cause; held out are those of
    conditions that the fit did not see.
    """

    before: float
    after: float
    held_out_before: float
    held_out_after: float


@dataclass(frozen=True)
class NextReading:
    """A condition and observable, and by how many deviations the likeliest answers differ."""

    condition: Condition
    observable: str
    apart_sds: float


@dataclass(frozen=True)
class SimulatorDiagnosis:
    """Where a simulator and its readings differ, and why.

    `causes` come with the likeliest first; their probabilities, `no_gap_probability` and
    `unexplained_probability` add to 1. `groups` are causes that these data cannot tell apart.
    `gaps` are the readings' differences from the simulator alone, in stated deviations (data,).
    `parameters_before` and `parameters_after` hold mean and standard deviation of the simulator's
    own: alone, and averaged over all answers.
    """

    causes: tuple[SimulatorCause, ...]
    no_gap_probability: float
    unexplained_probability: float
    groups: tuple[tuple[str, ...], ...]
    shrinkage: Shrinkage
    gaps: tuple[tuple[Reading, float], ...]
    parameters_before: Mapping[str, tuple[float, float]]
    parameters_after: Mapping[str, tuple[float, float]]
    next_readings: tuple[NextReading, ...]

    @property
    def named(self) -> tuple[str, ...]:
        """The likeliest cause, with its group; empty while no gap is shown or the unknown leads."""
        if self.no_gap_probability >= NO_GAP_BELOW or not self.causes:
            return ()
        first = self.causes[0].name
        group = next((each for each in self.groups if first in each), (first,))
        together = sum(each.probability for each in self.causes if each.name in group)
        return group if together > self.unexplained_probability else ()

    def summary(self) -> str:
        """The answer in a few lines."""
        lines = [self._verdict()]
        for each in self.causes:
            sizes = ", ".join(f"{n} = {m:.4g} ± {s:.2g}" for n, (m, s) in each.size.items())
            lines.append(f"{each.probability:5.2f}  {each.name} ({sizes})")
        lines.append(f"{self.no_gap_probability:5.2f}  no gap")
        lines.append(f"{self.unexplained_probability:5.2f}  something not in the catalogue")
        for name, (mean, sd) in self.parameters_after.items():
            was, spread = self.parameters_before[name]
            lines.append(f"{name}: {was:.5g} ± {spread:.2g} alone, {mean:.5g} ± {sd:.2g} after")
        lines += [
            f"Next: {each.observable} at {dict(each.condition)}, {each.apart_sds:.1f} sds apart"
            for each in self.next_readings[:1]
        ]
        return "\n".join(lines)

    def to_records(self) -> list[dict[str, object]]:
        """One row for each answer, as `pandas.DataFrame` takes them."""
        rows: list[dict[str, object]] = [
            {"answer": e.name, "probability": e.probability, "gap_left_sds": e.gap_left}
            for e in self.causes
        ]
        nan = float("nan")
        return [
            *rows,
            {
                "answer": "no gap",
                "probability": self.no_gap_probability,
                "gap_left_sds": self.shrinkage.before,
            },
            {
                "answer": "unexplained",
                "probability": self.unexplained_probability,
                "gap_left_sds": nan,
            },
        ]

    def _verdict(self) -> str:
        gap = self.shrinkage
        if self.no_gap_probability >= NO_GAP_BELOW:
            return f"No gap is shown: readings lie {gap.before:.1f} sds from the simulator."
        named = " or ".join(self.named) or "something not in the catalogue"
        held = f"held out {gap.held_out_before:.1f} to {gap.held_out_after:.1f}"
        return f"Gap of {gap.before:.1f} sds from {named}; with it {gap.after:.1f} ({held})."


def diagnose_simulator(
    simulator: Simulator,
    readings: Sequence[Reading],
    *,
    candidates: Sequence[Condition] = (),
    seed: int = 1,
) -> SimulatorDiagnosis:
    """Why the readings differ from a simulator of your own, and which effect of yours causes it.

    `candidates` are conditions that could be measured next.

    >>> prior = shm.Prior("uniform", 1.0, 3.0)
    >>> spring = shm.Simulator(lambda p, at: {"force_n": p["k"] * at["x_m"]}, {"k": prior})
    >>> shm.diagnose_simulator(spring, readings).summary()  # doctest: +SKIP
    """
    problem = SimulatorProblem(simulator, tuple(readings))
    rng = np.random.default_rng(seed)
    answers = _answers(problem, rng)
    fits = {e.hypothesis: e.fit for e in answers.scored if e.fit is not None}
    alone = fits[Hypothesis()]
    causes = sorted(
        (_cause(problem, h, answers, fits[h], alone) for h in fits if h.effects and not h.flexible),
        key=lambda each: -each.probability,
    )
    no_gap = answers.of(Hypothesis())
    leading = max(fits, key=lambda h: answers.of(h) if not h.flexible else -1.0)
    first = next((_single(e.name) for e in causes), Hypothesis())
    return SimulatorDiagnosis(
        causes=tuple(causes),
        no_gap_probability=no_gap,
        unexplained_probability=max(0.0, 1 - no_gap - sum(each.probability for each in causes)),
        groups=_groups(fits, causes, no_gap),
        shrinkage=_shrinkage(problem, alone, fits[first if leading.effects else Hypothesis()]),
        gaps=tuple(
            (reading, float(gap))
            for reading, gap in zip(problem.readings, _in_sds(problem, alone), strict=True)
        ),
        parameters_before=_moments(problem, alone, problem.simulator.parameters),
        parameters_after=_averaged(problem, answers, fits),
        next_readings=_planned(problem, fits, answers, candidates),
    )


@dataclass(frozen=True, eq=False)
class _Answers:
    """What was tried, the probability of each, and of something unknown that passes for one."""

    scored: tuple[ScoredHypothesis, ...]
    chances: Mapping[Hypothesis, float]
    unknown: float

    def of(self, hypothesis: Hypothesis) -> float:
        return self.chances.get(hypothesis, 0.0)


def _single(name: str, flexible: bool = False) -> Hypothesis:
    return Hypothesis(((name, _EVERYWHERE),), flexible)


def _answers(problem: SimulatorProblem, rng: np.random.Generator) -> _Answers:
    names = [each.name for each in problem.simulator.effects]
    alone = fitted(problem, Hypothesis(), rng)
    fits = [alone, *(fitted(problem, _single(name), rng, alone.z) for name in names)]
    order = sorted(fits[1:], key=lambda each: -each.log_evidence)
    fits.append(fitted(problem, Hypothesis(flexible=True), rng, alone.z))
    for each in order[:_FLEXIBLE]:
        fits.append(fitted(problem, _single(each.hypothesis.name, True), rng, each.z))
    scored = tuple(ScoredHypothesis.fitted(fit, len(alone.z)) for fit in fits)
    tried = families(scored, dict.fromkeys(names, 1))
    plain = max(
        (each for each in tried if not each.flexible),
        key=lambda each: each.log_evidence + each.log_prior,
    )
    chances, unknown = probabilities(tried, _p_value(problem, plain.best.fit or alone))
    of = {each.best.hypothesis: float(p) for each, p in zip(tried, chances, strict=True)}
    return _Answers(scored, of, float(unknown))


def _p_value(problem: SimulatorProblem, fit: Fit) -> float:
    """Of the misfit at the best point, averaged over the unknown size of the errors."""
    residual = problem.value - fit.predicted
    freedom = max(1, len(residual) - len(fit.z))
    nodes = problem.nodes()
    weight = np.exp([each.log_weight for each in nodes])
    squares = [float(np.sum(residual**2 / np.diag(n.covariance.frequency))) for n in nodes]
    return float(weight @ scipy.special.chdtrc(freedom, squares) / weight.sum())


def _cause(
    problem: SimulatorProblem, hypothesis: Hypothesis, answers: _Answers, fit: Fit, alone: Fit
) -> SimulatorCause:
    effect = problem.effect(hypothesis)
    left, before = _rms(_in_sds(problem, fit)), _rms(_in_sds(problem, alone))
    beside = answers.of(_single(hypothesis.name, flexible=True))
    return SimulatorCause(
        hypothesis.name,
        answers.of(hypothesis) + (beside if left**2 < EXPLAINED * before**2 else 0.0),
        left,
        _moments(problem, fit, effect.parameters if effect else {}),
    )


def _groups(
    fits: Mapping[Hypothesis, Fit], causes: Sequence[SimulatorCause], no_gap: float
) -> tuple[tuple[str, ...], ...]:
    if no_gap >= NO_GAP_BELOW:
        return ()
    supported = [each.name for each in causes if each.probability > _SUPPORTED]
    own = [fits[_single(name)] for name in supported]
    best = max((each.log_evidence for each in own), default=0.0)
    near = [each.log_evidence > best - SAME_BELOW for each in own]
    return tuple(
        tuple(supported[i] for i in group) for group in grouped([(fit,) for fit in own], near)
    )


def _errors(problem: SimulatorProblem, fit: Fit) -> FloatArray:
    """Stated deviations, and for unstated ones those that the fit found."""
    found = np.sqrt(np.diag(fit.noise.frequency))
    return np.where(np.isfinite(problem.sd), problem.sd, found)


def _in_sds(problem: SimulatorProblem, fit: Fit) -> FloatArray:
    return np.asarray((problem.value - fit.predicted) / _errors(problem, fit))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _shrinkage(problem: SimulatorProblem, alone: Fit, best: Fit) -> Shrinkage:
    """In the deviations that belong to the best answer, whichever fit is looked at."""
    errors = _errors(problem, best)
    residuals = [problem.value - fit.predicted for fit in (alone, best)]
    held = [_held_out(problem, fit) for fit in (alone, best)]
    return Shrinkage(*(_rms(each / errors) for each in (*residuals, *held)))


def _held_out(problem: SimulatorProblem, fit: Fit) -> FloatArray:
    """Residuals (data,) of fits that have not seen the condition."""
    conditions = [tuple(sorted(each.condition.items())) for each in problem.readings]
    number = {each: k for k, each in enumerate(dict.fromkeys(conditions))}
    several = len(number) > 1
    fold = np.array([number[e] if several else i for i, e in enumerate(conditions)]) % _FOLDS
    left = np.empty(len(fold))
    for each in np.unique(fold):
        z = refitted(problem, fit, fold != each)
        away = problem.value - problem.predicted(fit.hypothesis, z[None])[0]
        left[fold == each] = away[fold == each]
    return left


def _moments(
    problem: SimulatorProblem, fit: Fit, names: Mapping[str, object]
) -> dict[str, tuple[float, float]]:
    priors = problem.priors(fit.hypothesis)
    values = {n: p.value(fit.draws[:, j]) for j, (n, p) in enumerate(priors.items()) if n in names}
    return {name: (float(each.mean()), float(each.std())) for name, each in values.items()}


def _averaged(
    problem: SimulatorProblem, answers: _Answers, fits: Mapping[Hypothesis, Fit]
) -> dict[str, tuple[float, float]]:
    """Over all answers by their probabilities (Hoeting et al. 1999)."""
    weight = dict(answers.chances)
    free = Hypothesis(flexible=True)
    weight[free] = weight.get(free, 0.0) + answers.unknown
    own = problem.simulator.parameters
    found = {h: _moments(problem, fits[h], own) for h in weight}
    averaged = {}
    for name in own:
        mean = sum(weight[h] * found[h][name][0] for h in weight)
        square = sum(weight[h] * (found[h][name][1] ** 2 + found[h][name][0] ** 2) for h in weight)
        averaged[name] = (mean, float(np.sqrt(max(square - mean**2, 0.0))))
    return averaged


def _planned(
    problem: SimulatorProblem,
    fits: Mapping[Hypothesis, Fit],
    answers: _Answers,
    candidates: Sequence[Condition],
) -> tuple[NextReading, ...]:
    """What tells the two likeliest answers apart, the most telling first."""
    plain = sorted((h for h in fits if not h.flexible), key=lambda h: -answers.of(h))[:2]
    if not candidates or len(plain) < 2:
        return ()
    errors = _errors(problem, fits[plain[0]])
    typical: dict[str, float] = {}
    for name in dict.fromkeys(each.observable for each in problem.readings):
        rows = [i for i, each in enumerate(problem.readings) if each.observable == name]
        typical[name] = float(np.median(errors[rows]))
    asked = [Reading(at, name, 0.0, sd) for at in candidates for name, sd in typical.items()]
    one, other = (problem.predicted_of(h, fits[h].draws, asked) for h in plain)
    error = np.array([each.sd for each in asked])
    spread = np.sqrt(error**2 + one.var(axis=0) + other.var(axis=0))
    apart = np.abs(one.mean(axis=0) - other.mean(axis=0)) / spread
    ordered = np.argsort(-apart, kind="stable")
    return tuple(
        NextReading(asked[i].condition, asked[i].observable, float(apart[i])) for i in ordered
    )
