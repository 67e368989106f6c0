"""Outliers: frequencies that belong neither to the model nor to any effect.

"A gross error in this frequency" is an explanation like any other: with its prior, with the density
that a wide distribution gives the datum, and beside every other explanation of the same data. So
an effect that moves many data is no outlier, and one wrong frequency no effect.

A frequency comes with a small probability not from the identification's distribution but from a
wide one (Box and Tiao, Biometrika 55, 1968): a wrong mode, a tone of a machine, a slip of the pen.
The price of an ordinary datum is taken from Student's t instead of the normal distribution, since
the standard deviation that a test states is itself an estimate from some twenty hits: 4.5 of them
are rare, but no proof of an error.

It may be no slip: a guide with play, or a crack that a swing opens, acts on a mode only above an
amplitude. In one test at one level that is one frequency off by up to tenths while all others are
right. It is none where another test, hit as hard, shows the mode where it belongs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.assumptions import DEFAULTS
from shm.gap.attribution import Attribution
from shm.gap.contract import Design, Fit, Hypothesis
from shm.gap.detectability import HOPELESS_SHARE
from shm.gap.fit import fitted
from shm.gap.law_error import by_its_laws
from shm.gap.model_probabilities import NO_GAP, UNKNOWN, log_prior
from shm.gap.optimiser import Landscape
from shm.gap.problem import GapProblem
from shm.gap.search import LEADERS
from shm.inference.data_checks import SAME_LEVEL
from shm.values import BoolArray, FloatArray, IntArray

SURE = 0.9
"""A frequency is set aside where it is a gross error with at least this probability.

Judgement: of ten that go, one may be sound, which costs little data and a remark says so.
"""

LARGEST_SHARE = 0.1
"""Never more of the frequencies than this are set aside (one at least may be): the upper end of
what is usual (`gross_error_share` of `shm.assumptions`)."""

_FEWEST_LEFT = 4  # judgement: tension, stiffness, and two that can disagree with them
# Judgement: linear odds of up to 12 to 1 against are worth two fits, more where the gap is large.
_REACH = 2.5
# Judgement: a datum ten standard deviations out has pulled the fit out of where it is linear.
_DRAGGED = 10.0
WIDE_FROM, WIDE_TO = 1e-4, 3.0
"""Sizes of gross errors, of the logarithm of the frequency: log-uniform, up or down."""
FREEDOM = 20.0
"""Degrees of freedom of the stated standard deviations."""


@dataclass(frozen=True, eq=False)
class Believed:
    """A fit with the log of its hypothesis's prior probability."""

    fit: Fit
    log_prior: float

    @property
    def log_weight(self) -> float:
        return self.fit.log_evidence + self.log_prior


@dataclass(frozen=True)
class GrossError:
    """The frequency `row` (an index) that is a gross error with `probability`."""

    row: int
    probability: float


def believed(attribution: Attribution) -> list[Believed]:
    """No gap, something unknown, and every explanation that was fitted, at each place."""
    causes = attribution.explanations
    variants = {each.effect: len(each.variants) for each in causes if not each.is_pair}
    tried = [each for each in attribution.tried if each.hypothesis.effects]
    plain = [each.fit for each in tried if each.fit and not each.hypothesis.flexible]
    fits = [attribution.baseline, attribution.unexplained, *plain]
    return [Believed(fit, log_prior(fit.hypothesis, variants)) for fit in fits]


def gross_errors(
    problem: GapProblem, rows: IntArray, attribution: Attribution, rng: np.random.Generator
) -> list[GrossError]:
    """The frequencies that an attribution of `rows` would rather have set aside, in this order.

    The other frequencies of `problem` have been set aside before. At most one of a test and one of
    a mode, since what moves more together is no slip, and at most a tenth of all. The last one may
    be less than sure.
    """
    found: list[GrossError] = []
    candidates, every = believed(attribution), np.arange(problem.design.frequencies)
    most = max(1, int(LARGEST_SHARE * len(every)))
    while len(every) - len(rows) < most and len(rows) > _FEWEST_LEFT:
        part = problem.part(rows)
        row = _suspect(part, candidates, _open(problem, rows, np.setdiff1d(every, rows)))
        if row is None:
            break
        probability, candidates = _judged(part, candidates, row, rng)
        found.append(GrossError(int(rows[row]), probability))
        if probability < SURE:
            break
        rows = np.delete(rows, row)
    return found


def _open(problem: GapProblem, rows: IntArray, gone: IntArray) -> BoolArray:
    """Which of `rows` are of a test and of a mode that no gross error was found in yet."""
    design = problem.design
    test, mode = design.frequency_test, design.mode
    return np.asarray(~np.isin(test[rows], test[gone]) & ~np.isin(mode[rows], mode[gone]))


def _suspect(
    problem: GapProblem, candidates: Sequence[Believed], possible: BoolArray
) -> int | None:
    """The frequency that most likely is a gross error, if it may be one at all.

    Something unknown counts as a rival only: it could take any single datum for its own.
    """
    rows = np.flatnonzero(possible)
    plain = [each for each in candidates if not each.fit.hypothesis.flexible]
    if not len(rows):
        return None
    seen = [_seen(problem, each.fit, rows) for each in plain]
    gross = np.array([c.log_weight + s.gross for c, s in zip(plain, seen, strict=True)])
    ordinary = np.array([c.log_weight + s.ordinary for c, s in zip(plain, seen, strict=True)])
    unknown = [each.log_weight for each in candidates if each.fit.hypothesis.flexible]
    rivals = scipy.special.logsumexp([*unknown, scipy.special.logsumexp(ordinary, axis=0).max()])
    odds = scipy.special.logsumexp(gross, axis=0) - np.maximum(
        scipy.special.logsumexp(ordinary, axis=0), rivals
    )
    best = int(odds.argmax())
    leader = int(gross[:, best].argmax())
    gain = max(0.0, float(gross[leader, best] - plain[leader].log_weight))
    return int(rows[best]) if odds[best] > -_REACH - HOPELESS_SHARE * gain else None


def _seen(problem: GapProblem, fit: Fit, rows: IntArray) -> LeftOut:
    return left_out(problem, fit.hypothesis, fit.z, fit.predicted, fit.slopes, rows)


def _judged(
    problem: GapProblem, candidates: Sequence[Believed], row: int, rng: np.random.Generator
) -> tuple[float, list[Believed]]:
    """The probability of a gross error, by fits with and without it, and those without it.

    The mode's shape is in neither: of a wrong mode it is wrong as well.
    """
    rest = problem.part(np.delete(np.arange(problem.design.frequencies), row))
    whole = problem.without_shape(row)
    base, base_of_whole = (fitted(each, Hypothesis(), rng) for each in (rest, whole))
    gross, ordinary, kept = [], [], []
    for each in _contenders(problem, candidates, row):
        without = Believed(_without(rest, each.fit, base, rng), each.log_prior)
        seen = at(whole, without.fit, row)
        kept.append(without)
        gain = _gain(rest, base, without.fit, rng)
        gross.append(without.log_weight + gain + seen.gross_given_rest[0])
        tails = without.fit.log_evidence + seen.ordinary_given_rest[0]
        full = (
            each.fit
            if whole is problem
            else fitted(whole, each.fit.hypothesis, rng, each.fit.z[None])
        )
        allowed = full.log_evidence + _gain(whole, base_of_whole, full, rng)
        ordinary.append(each.log_prior + max(_ordinary(whole, full, row, float(tails)), allowed))
    odds = float(scipy.special.logsumexp(gross) - scipy.special.logsumexp(ordinary))
    return float(scipy.special.expit(odds)), kept


def _gain(problem: GapProblem, baseline: Fit, fit: Fit, rng: np.random.Generator) -> float:
    """What a fit gains in log evidence by allowing its effects' laws to be off.

    A law that is off moves one mode more than others, as a gross error does.
    """
    hypothesis = fit.hypothesis
    if hypothesis.flexible or not hypothesis.effects:
        return 0.0
    return by_its_laws(problem, baseline, fit, rng).gain


def _ordinary(whole: GapProblem, fit: Fit, row: int, tails: float) -> float:
    """Log evidence with the frequency as an ordinary datum, from a fit to all data.

    Where it drags the fit along, what is linear about that says little: `tails` do, the evidence by
    the fit without it.
    """
    seen = _seen(whole, fit, np.array([row]))
    away, sd = seen.expected
    return tails if abs(away[0]) > _DRAGGED * sd[0] else fit.log_evidence + seen.ordinary[0]


def _contenders(problem: GapProblem, candidates: Sequence[Believed], row: int) -> list[Believed]:
    """The candidates that lead with or without the frequency, no gap and something unknown."""
    flexible = [each for each in candidates if each.fit.hypothesis.flexible]
    plain = [each for each in candidates if not each.fit.hypothesis.flexible]
    gross = [c.log_weight + float(_seen(problem, c.fit, np.array([row])).gross[0]) for c in plain]
    with_it = np.argsort([-each.log_weight for each in plain], kind="stable")[:LEADERS]
    without = np.argsort(-np.array(gross), kind="stable")[:LEADERS]
    none = [k for k, each in enumerate(plain) if not each.fit.hypothesis.effects]
    chosen = dict.fromkeys([*none, *map(int, with_it), *map(int, without)])
    return [*(plain[k] for k in chosen), *flexible]


def _without(rest: GapProblem, fit: Fit, base: Fit, rng: np.random.Generator) -> Fit:
    """The hypothesis of `fit` on the rest of the data, also from where no gap lies now."""
    if fit.hypothesis == base.hypothesis:
        return base
    starts = np.stack([fit.z, np.append(base.z, fit.z[len(base.z) :])])
    return fitted(rest, fit.hypothesis, rng, starts)


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Frequencies (r) seen from all other data, by each possibility of the unknown errors (nodes).

    `deviation` (nodes, r) is the measured less the expected logarithm, `sd` (nodes, r) its standard
    deviation, `log_all` (nodes,) the log evidence of all data.
    """

    deviation: FloatArray
    sd: FloatArray
    log_all: FloatArray
    gross_share: float = DEFAULTS.gross_error_share.value

    @property
    def log_rest(self) -> FloatArray:
        """Log evidence (nodes, r) of all data but each frequency."""
        return np.asarray(
            self.log_all[:, None] - scipy.stats.norm.logpdf(self.deviation, scale=self.sd)
        )

    @property
    def gross(self) -> FloatArray:
        """Log evidence (r,) relative to that of all data, were each frequency a gross error."""
        return self._relative(log_gross(self.deviation, self.gross_share))

    @property
    def ordinary(self) -> FloatArray:
        """The same (r,) were it an ordinary datum, whose error has the tails of Student's t."""
        return self._relative(log_ordinary(self.deviation, self.sd, self.gross_share))

    @property
    def expected(self) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation (r,) of the deviations, over the possibilities."""
        weight = np.exp(self.log_rest - scipy.special.logsumexp(self.log_rest, axis=0))
        mean = (weight * self.deviation).sum(axis=0)
        square = (weight * (self.sd**2 + self.deviation**2)).sum(axis=0)
        return mean, np.sqrt(square - mean**2)

    @property
    def gross_given_rest(self) -> FloatArray:
        """Return the log density (r,) given all other data, were each a gross error."""
        return self.given_rest(log_gross(self.deviation, self.gross_share))

    @property
    def ordinary_given_rest(self) -> FloatArray:
        """Return the log density (r,) given all other data, were each an ordinary datum."""
        return self.given_rest(log_ordinary(self.deviation, self.sd, self.gross_share))

    def given_rest(self, log_density: FloatArray) -> FloatArray:
        """Log of the mean density (r,), the possibilities weighed by all other data."""
        rest = self.log_rest
        return np.asarray(
            scipy.special.logsumexp(rest + log_density, axis=0)
            - scipy.special.logsumexp(rest, axis=0)
        )

    def _relative(self, log_density: FloatArray) -> FloatArray:
        whole = scipy.special.logsumexp(self.log_all)
        return np.asarray(scipy.special.logsumexp(self.log_rest + log_density, axis=0) - whole)


def log_gross(deviation: FloatArray, share: float) -> FloatArray:
    """Log of prior probability times density of a gross error of this size."""
    size = np.abs(deviation).clip(WIDE_FROM, WIDE_TO)
    return np.asarray(np.log(share) - np.log(2 * size * np.log(WIDE_TO / WIDE_FROM)))


def log_ordinary(deviation: FloatArray, sd: FloatArray, share: float) -> FloatArray:
    """Log of probability times density of an ordinary error."""
    return np.asarray(np.log1p(-share) + scipy.stats.t.logpdf(deviation, FREEDOM, scale=sd))


def left_out(
    problem: GapProblem,
    hypothesis: Hypothesis,
    z: FloatArray,
    predicted: FloatArray,
    slopes: FloatArray,
    rows: IntArray,
) -> LeftOut:
    """Each of the frequencies `rows` (r,) left out in turn, by what is linear about z (d,).

    `predicted` (data,) and `slopes` (data, d) are those at z. The standardised deviations are the
    deleted residuals of regression (Cook and Weisberg 1982, 2.2), with priors.
    """
    residual, d = problem.observations.value - predicted, len(z)
    units = np.zeros((len(residual), len(rows)))
    units[rows, np.arange(len(rows))] = 1.0
    likelihood = problem.likelihood(hypothesis)
    gram = likelihood.gram(np.column_stack([slopes, residual, units])[None])[0]
    # The prior is d more data, of value 0 and standard deviation 1.
    inner, outer = gram[:, :d, :d] + np.eye(d), gram[:, :d, d:]
    outer[:, :, 0] -= z
    solved = np.linalg.solve(inner, outer)
    pull = gram[:, d, d:] - np.einsum("kd,kdc->kc", outer[:, :, 0], solved)
    own = np.einsum("kcc->kc", gram[:, d + 1 :, d + 1 :])
    precision = own - (outer[:, :, 1:] * solved[:, :, 1:]).sum(axis=1)
    height = likelihood.log_height - np.linalg.slogdet(inner)[1] / 2
    return LeftOut(
        deviation=pull[:, 1:] / precision,
        sd=1 / np.sqrt(precision),
        log_all=height - (pull[:, 0] + z @ z) / 2,
        gross_share=problem.hanger.assumptions.gross_error_share.value,
    )


def at(problem: GapProblem, fit: Fit, row: int) -> LeftOut:
    """A frequency of `problem` seen from its other data, to which `fit` was fitted."""
    landscape = Landscape(problem, fit.hypothesis)
    branch = next(each for each in landscape.coordinates.branches if each.holds(fit.z[None])[0])
    w = branch.w(fit.z[None])
    views = landscape.views(w, branch.signs[None])
    predicted = problem.observations.value - views.residual[0]
    return left_out(problem, fit.hypothesis, w[0], predicted, views.slopes[0], np.array([row]))


_SHARE = 3 / 48
"""Of unknown effects in docs/trials/blind_trial.md those, guides with play, that moved one mode."""
_LARGEST = 0.3
"""Judgement: of the logarithm of the frequency. A stiff guide raises a first mode by so much."""


def acts_alone(
    design: Design, kept: Design, row: int, deviation: float, gross_share: float
) -> float:
    """The probability that the frequency `row` of `design`, off by `deviation` of its logarithm,
    is no slip but moved by something unknown that acts on this mode alone.

    `kept` are the frequencies that were not set aside.
    """
    if abs(deviation) > _LARGEST or _right_elsewhere(design, kept, row):
        return 0.0
    modes = len(np.unique(design.mode))
    slip = gross_share / np.log(WIDE_TO / WIDE_FROM)
    acts = UNKNOWN / NO_GAP * _SHARE / modes / np.log(_LARGEST / WIDE_FROM)
    return float(acts / (acts + slip))


def _right_elsewhere(design: Design, kept: Design, row: int) -> bool:
    same = (kept.frequency_plane == design.frequency_plane[row]) & (
        kept.frequency_order == design.frequency_order[row]
    )
    return bool((kept.amplitude[same] * SAME_LEVEL >= design.amplitude[row]).any())
