"""The gap diagnosis of a user's own simulator, whatever it simulates.

The simulator alone, with each effect of its catalogue, and with a remainder that is free in form
compete as in the diagnosis of hangers, by the same prior odds, the same share of what is unknown
that passes for a listed effect, and the same bound under which causes count as one group. Pairs of
a leading effect with another one are tried where one effect alone leaves too much.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import check_count
from shm.gap.causes.groups import SAME_BELOW, group
from shm.gap.causes.probabilities import (
    CALIBRATION,
    SINGLE,
    UNKNOWN,
    ScoredHypothesis,
    families,
    probabilities,
)
from shm.gap.causes.search import SUPPORTED
from shm.gap.hypotheses.contract import Fit, Hypothesis
from shm.gap.simulator.simulator_fit import (
    at_bounds,
    drop_copies,
    errors_of,
    fit_hypothesis,
    in_sds,
    moments,
    p_value,
    refit,
    rms,
    slips,
)
from shm.gap.simulator.simulator_problem import Condition, Reading, Simulator, SimulatorProblem
from shm.models.effects.base import Variant
from shm.values import FloatArray

NO_GAP_BELOW = 0.05
"""As in the diagnosis of hangers: a gap is shown where no gap keeps less."""
LAW_OFF = 0.1
"""An effect with something unknown beside it may be the cause with its law off where it leaves no
more than this part of the gap: 0.98 of effects are off by less (`calibration.toml`)."""
_LEADERS = 2  # technical: of pairs; what is in neither of the two best singles is not reached
_LEAVES_MUCH = 0.1  # judgement: a p-value at which a second cause, a quarter as likely, has no call
_FLEXIBLE = 3  # technical: what leads is tried with something unknown beside; the others lose both
_FOLDS = 5  # at most so many parts are held out in turn
_SUPPORTED = 0.02  # judgement: a cause with less is in no group
_OF_NOTE = 1e-3  # technical: less moves no average, but its spread may not be known
_EVERYWHERE = Variant()
# Of what looks like an effect with its law off: what is unknown passes for one.
_MIMICS = CALIBRATION.mimics_one * UNKNOWN / (CALIBRATION.mimics_one * UNKNOWN + SINGLE)


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
    """Hold where a simulator and its readings differ, and why.

    `causes` come with the likeliest first; their probabilities, `no_gap_probability` and
    `unexplained_probability` add to 1. `groups` are causes that these data cannot tell apart.
    `gaps` are the readings' differences from the simulator alone, in stated deviations (data,).
    `parameters_before` and `parameters_after` hold mean and standard deviation of the simulator's
    own: alone, and averaged over all answers; a deviation is NaN where a parameter lies at its
    bound or nothing fits. `remarks` say what limits the answer.
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
    remarks: tuple[str, ...] = ()

    @property
    def named(self) -> tuple[str, ...]:
        """Return the likeliest cause and its group; empty where no gap or the unknown leads."""
        if self.no_gap_probability >= NO_GAP_BELOW or not self.causes:
            return ()
        first = self.causes[0].name
        group = next((each for each in self.groups if first in each), (first,))
        together = sum(each.probability for each in self.causes if each.name in group)
        return group if together > self.unexplained_probability else ()

    def summary(self) -> str:
        """Return the answer in a few lines."""
        lines = [self._verdict(), *(f"! {each}" for each in self.remarks)]
        for each in self.causes:
            sizes = ", ".join(
                f"{n} = {_format_estimate(m, s, 4)}" for n, (m, s) in each.size.items()
            )
            lines.append(f"{each.probability:5.2f}  {each.name} ({sizes})")
        lines.append(f"{self.no_gap_probability:5.2f}  no gap")
        lines.append(f"{self.unexplained_probability:5.2f}  something not in the catalogue")
        for name, (mean, sd) in self.parameters_after.items():
            alone = _format_estimate(*self.parameters_before[name], 5)
            lines.append(f"{name}: {alone} alone, {_format_estimate(mean, sd, 5)} after")
        lines += [
            f"Next: {each.observable} at {dict(each.condition)}, {each.apart_sds:.1f} sds apart"
            for each in self.next_readings[:1]
        ]
        return "\n".join(lines)

    def to_records(self) -> list[dict[str, object]]:
        """Return one row for each answer, as `pandas.DataFrame` takes them."""
        rows: list[tuple[object, ...]] = [(e.name, e.probability, e.gap_left) for e in self.causes]
        rows.append(("no gap", self.no_gap_probability, self.shrinkage.before))
        rows.append(("unexplained", self.unexplained_probability, float("nan")))
        names = ("answer", "probability", "gap_left_sds")
        return [dict(zip(names, row, strict=True)) for row in rows]

    def _verdict(self) -> str:
        gap = self.shrinkage
        if self.no_gap_probability >= NO_GAP_BELOW:
            return f"No gap is shown: readings lie {gap.before:.1f} sds from the simulator."
        named = " or ".join(self.named) or "something not in the catalogue"
        held = f"held out {gap.held_out_before:.1f} to {gap.held_out_after:.1f}"
        return f"Gap of {gap.before:.1f} sds from {named}; with it {gap.after:.1f} ({held})."


def _format_estimate(mean: float, sd: float, digits: int) -> str:
    return f"{mean:.{digits}g} ± " + ("unknown" if np.isnan(sd) else f"{sd:.2g}")


def diagnose_simulator(
    simulator: Simulator,
    readings: Sequence[Reading],
    *,
    candidates: Sequence[Condition] = (),
    seed: int = 1,
) -> SimulatorDiagnosis:
    """Return why readings differ from a simulator of your own, and which effect of yours causes it.

    `candidates` are conditions that could be measured next.

    >>> prior = shm.Prior("uniform", 1.0, 3.0)
    >>> spring = shm.Simulator(lambda p, at: {"force_n": p["k"] * at["x_m"]}, {"k": prior})
    >>> shm.diagnose_simulator(spring, readings).summary()  # doctest: +SKIP
    """
    check_count("seed", seed, 1, least=0)
    distinct, repeated = drop_copies(readings)
    problem = SimulatorProblem(simulator, distinct)
    rng = np.random.default_rng(seed)
    answers = _answers(problem, rng)
    fits, alone = answers.fits, answers.fits[Hypothesis()]
    causes = sorted(
        (_cause(answers, h) for h in fits if h.effects and not h.flexible),
        key=lambda each: -each.probability,
    )
    no_gap = answers.of(Hypothesis())
    leading = max(fits, key=lambda h: answers.of(h) if not h.flexible else -1.0)
    plain = {h.name: h for h in fits if not h.flexible}
    first = plain[causes[0].name] if causes and leading.effects else Hypothesis()
    return SimulatorDiagnosis(
        causes=tuple(causes),
        no_gap_probability=no_gap,
        unexplained_probability=max(0.0, 1 - no_gap - sum(each.probability for each in causes)),
        groups=_groups(fits, causes, no_gap),
        shrinkage=_shrinkage(problem, alone, fits[first]),
        gaps=tuple(
            (reading, float(gap))
            for reading, gap in zip(problem.readings, in_sds(problem, alone), strict=True)
        ),
        parameters_before=moments(problem, alone, problem.simulator.parameters),
        parameters_after=_averaged(answers),
        next_readings=_planned(answers, candidates),
        remarks=(*repeated, *at_bounds(problem, fits[first]), *slips(problem, alone, fits[first])),
    )


@dataclass(frozen=True, eq=False)
class _Answers:
    """Hold the fits, the probability of each, and of something unknown that passes for one."""

    problem: SimulatorProblem
    fits: Mapping[Hypothesis, Fit]
    chances: Mapping[Hypothesis, float]
    unknown: float

    def of(self, hypothesis: Hypothesis) -> float:
        return self.chances.get(hypothesis, 0.0)


def _answers(problem: SimulatorProblem, rng: np.random.Generator) -> _Answers:
    names = [each.name for each in problem.simulator.effects]
    alone = fit_hypothesis(problem, Hypothesis(), rng)
    singles = [
        fit_hypothesis(problem, Hypothesis(((name, _EVERYWHERE),)), rng, alone.z) for name in names
    ]
    plain = _by_evidence([*singles, *_pairs(problem, alone, _by_evidence(singles), rng)])
    fits = [alone, *plain, fit_hypothesis(problem, Hypothesis(flexible=True), rng, alone.z)]
    for each in plain[:_FLEXIBLE]:
        fits.append(fit_hypothesis(problem, replace(each.hypothesis, flexible=True), rng, each.z))
    scored = [ScoredHypothesis.fitted(fit, len(alone.z)) for fit in fits]
    tried = families(scored, dict.fromkeys(names, 1))
    chances, unknown = probabilities(tried)
    of = {each.best.hypothesis: float(p) for each, p in zip(tried, chances, strict=True)}
    return _Answers(problem, {fit.hypothesis: fit for fit in fits}, of, float(unknown))


def _by_evidence(fits: Sequence[Fit]) -> list[Fit]:
    return sorted(fits, key=lambda each: -each.log_evidence)


def _pairs(
    problem: SimulatorProblem, alone: Fit, singles: Sequence[Fit], rng: np.random.Generator
) -> list[Fit]:
    """Return pairs of the leading singles, where these explain something and leave too much.

    A pair that explains hardly more than one of its effects says nothing of a second one.
    """
    leaders = [e for e in singles[:_LEADERS] if e.log_evidence > alone.log_evidence + SUPPORTED]
    if not leaders or p_value(problem, singles[0]) > _LEAVES_MUCH:
        return []
    found: dict[frozenset[str], Fit] = {}
    for leader in leaders:
        one = problem.effect_priors(leader.hypothesis)
        for other in problem.simulator.effects:
            names = frozenset((leader.hypothesis.name, other.name))
            # Effects with a parameter of one name are forms of one effect.
            if names not in found and not set(one) & set(other.parameters):
                pair = Hypothesis((*leader.hypothesis.effects, (other.name, _EVERYWHERE)))
                found[names] = fit_hypothesis(problem, pair, rng, leader.z[: len(alone.z)])
    alone_of = {each.hypothesis.name: each.log_evidence + SUPPORTED for each in singles}
    return [
        each
        for names, each in found.items()
        if each.log_evidence > max(alone_of[name] for name in names)
    ]


def _cause(answers: _Answers, hypothesis: Hypothesis) -> SimulatorCause:
    problem, fit, alone = answers.problem, answers.fits[hypothesis], answers.fits[Hypothesis()]
    left, before = rms(in_sds(problem, fit)), rms(in_sds(problem, alone))
    flexible = answers.of(replace(hypothesis, flexible=True))
    off = flexible * (1 - _MIMICS) if left < LAW_OFF * before else 0.0
    size = moments(problem, fit, problem.effect_priors(hypothesis))
    return SimulatorCause(hypothesis.name, answers.of(hypothesis) + off, left, size)


def _groups(
    fits: Mapping[Hypothesis, Fit], causes: Sequence[SimulatorCause], no_gap: float
) -> tuple[tuple[str, ...], ...]:
    if no_gap >= NO_GAP_BELOW:
        return ()
    of = {h.name: fit for h, fit in fits.items() if not h.flexible}
    supported = [each.name for each in causes if each.probability > _SUPPORTED]
    members = [of[name] for name in supported]
    best = max((each.log_evidence for each in members), default=0.0)
    near = [each.log_evidence > best - SAME_BELOW for each in members]
    return tuple(
        tuple(supported[i] for i in each) for each in group([(fit,) for fit in members], near)
    )


def _shrinkage(problem: SimulatorProblem, alone: Fit, best: Fit) -> Shrinkage:
    """Return root mean squares in the deviations that belong to the best answer."""
    errors = errors_of(problem, best)
    residuals = [problem.value - fit.predicted for fit in (alone, best)]
    held = [_held_out(problem, fit) for fit in (alone, best)]
    return Shrinkage(*(rms(each / errors) for each in (*residuals, *held)))


def _held_out(problem: SimulatorProblem, fit: Fit) -> FloatArray:
    """Return residuals (data,) of fits that have not seen the condition."""
    conditions = [tuple(sorted(each.condition.items())) for each in problem.readings]
    number = {each: k for k, each in enumerate(dict.fromkeys(conditions))}
    several = len(number) > 1
    fold = np.array([number[e] if several else i for i, e in enumerate(conditions)]) % _FOLDS
    left = np.empty(len(fold))
    for each in np.unique(fold):
        z = refit(problem, fit, fold != each)
        away = problem.value - problem.predict(fit.hypothesis, z[None])[0]
        left[fold == each] = away[fold == each]
    return left


def _averaged(answers: _Answers) -> dict[str, tuple[float, float]]:
    """Return the parameters over all answers by their probabilities (Hoeting et al. 1999)."""
    weight = dict(answers.chances)
    free = Hypothesis(flexible=True)
    weight[free] = weight.get(free, 0.0) + answers.unknown
    problem = answers.problem
    parameters = problem.simulator.parameters
    found = {
        h: moments(problem, answers.fits[h], parameters) for h in weight if weight[h] > _OF_NOTE
    }
    whole = sum(weight[h] for h in found)
    weight = {h: weight[h] / whole for h in found}
    averaged = {}
    for name in parameters:
        mean = sum(weight[h] * found[h][name][0] for h in found)
        square = sum(weight[h] * (found[h][name][1] ** 2 + found[h][name][0] ** 2) for h in found)
        averaged[name] = (mean, float(np.sqrt(max(square - mean**2, 0.0))))
    return averaged


def _planned(answers: _Answers, candidates: Sequence[Condition]) -> tuple[NextReading, ...]:
    """Return readings that separate the two most probable answers, the best first."""
    problem, fits = answers.problem, answers.fits
    plain = sorted((h for h in fits if not h.flexible), key=lambda h: -answers.of(h))[:2]
    if not candidates or len(plain) < 2:
        return ()
    errors = errors_of(problem, fits[plain[0]])
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
