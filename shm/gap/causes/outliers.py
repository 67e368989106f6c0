"""Gross errors: frequencies that belong neither to the hanger nor to any effect.

"A gross error in this frequency" is an explanation like any other: with its prior, with the density
that a wide distribution gives the datum (Box and Tiao, Biometrika 55, 1968), and beside every other
explanation of the same data. So an effect that moves many data is no outlier, and one wrong
frequency no effect. The price of an ordinary datum is taken from Student's t, since the standard
deviation that a test states is itself an estimate from some twenty hits.

It may be no slip: a guide with play, or a crack that a swing opens, acts on a mode only above an
amplitude. It is none where another test, hit as hard, shows the mode where it belongs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.causes.probabilities import NO_GAP, UNKNOWN, ScoredHypothesis, log_prior
from shm.gap.causes.search import Attribution, answered, attribute, find_starts
from shm.gap.hypotheses.contract import Design, Fit, GapOptions, Hypothesis
from shm.gap.hypotheses.problem import GapProblem
from shm.gap.hypotheses.target import Target
from shm.inference.options import Progress, silent
from shm.inference.problem.data_checks import SAME_LEVEL
from shm.inference.sampler.density import find_peaks, laplace
from shm.values import NAN, PLANES, BoolArray, FloatArray, IntArray, Outlier, Residual, effect_label

SURE = 0.9
"""A frequency is set aside where it is a gross error with at least this probability."""
LIKELIER_THAN_NOT = 0.5
LARGEST_SHARE = 0.1
"""Never more of the frequencies than this are set aside (one at least may be)."""

_FEWEST_LEFT = 4  # tension, stiffness, and two that can disagree with them
_WORTH_FITS, _CONTENDERS = -4.0, 3  # linear log odds from which on fits judge, and of how many
WIDE_FROM, WIDE_TO = 1e-4, 3.0
"""Sizes of gross errors, of the logarithm of the frequency: log-uniform, up or down."""
FREEDOM = 20.0
"""Degrees of freedom of the stated standard deviations."""
_BY_AMPLITUDE, _LARGEST = 3 / 48, 0.3
"""Judgement: a part of what is unknown acts on a mode alone, and moves the logarithm of its
frequency by so much at most: a stiff guide raises a first mode by a third."""


@dataclass(frozen=True)
class GrossError:
    """The frequency `row` (an index) that is a gross error with `probability`."""

    row: int
    probability: float


@dataclass(frozen=True, eq=False)
class Cleared:
    """The attribution of those frequencies `rows` (indices) of `whole` that `problem` keeps.

    `excluded` are the others, `doubted` at most one of those kept: more likely than not a gross
    error, but not surely. `first` is the attribution of all frequencies.
    """

    whole: GapProblem
    problem: GapProblem
    rows: IntArray
    attribution: Attribution
    excluded: tuple[GrossError, ...] = ()
    doubted: tuple[GrossError, ...] = ()
    first: Attribution | None = None

    def expected(self, error: GrossError, fit: Fit) -> tuple[float, float]:
        """Return by how much its logarithm lies above what the data kept expect, and the sd."""
        rows = np.union1d(self.rows, [error.row])
        index = int(np.searchsorted(rows, error.row))
        seen = _seen_from(self.whole.part(rows).without_shape(index), fit, index)
        deviation, sd = seen.expected
        return float(deviation[0]), float(sd[0])

    def acts_alone(self, error: GrossError, fit: Fit) -> float:
        """Return how probably what was set aside is no slip, but something on this mode alone."""
        deviation, _ = self.expected(error, fit)
        share = self.problem.hanger.assumptions.gross_error_share.value
        return acts_alone(self.whole.design, self.problem.design, error.row, deviation, share)


def exclude_gross_errors(
    whole: GapProblem, options: GapOptions, rng: np.random.Generator, progress: Progress = silent
) -> Cleared:
    """Attribute the gap, and where that leaves gross errors, attribute it again without them.

    Where the last attribution expects one of them as it was measured, the first one applies.
    """
    every = np.arange(whole.design.frequencies)
    first = found = Cleared(whole, whole, every, attribute(whole, options, rng, progress))
    most = max(1, int(LARGEST_SHARE * len(every)))
    while True:
        error = _find_gross_error(found)
        if error is None or error.probability < LIKELIER_THAN_NOT:
            break
        full = len(found.excluded) == most or len(found.rows) <= _FEWEST_LEFT
        if error.probability < SURE or full:
            found = Cleared(*_fields(found), found.excluded, (error,))
            break
        rows = np.setdiff1d(found.rows, [error.row])
        part = whole.part(rows)
        again = attribute(part, options, rng, lambda label, _: progress(label, 1.0))
        found = Cleared(whole, part, rows, again, (*found.excluded, error))
    confirmed = all(_remains(found, each) for each in found.excluded)
    last = found if confirmed else first
    return Cleared(*_fields(last), last.excluded, last.doubted, first.attribution)


def _fields(found: Cleared) -> tuple[GapProblem, GapProblem, IntArray, Attribution]:
    return found.whole, found.problem, found.rows, found.attribution


def _remains(found: Cleared, error: GrossError) -> bool:
    """Return True where the answer without a frequency still does not expect it."""
    rows = np.union1d(found.rows, [error.row])
    index = int(np.searchsorted(rows, error.row))
    answer = answered(found.attribution)[0][1]
    seen = _seen_from(found.whole.part(rows).without_shape(index), answer, index)
    gross, ordinary = seen.gross_or_ordinary[:, 0]
    return bool(gross > ordinary)


def _find_gross_error(found: Cleared) -> GrossError | None:
    """Return the frequency that most probably is a gross error, None where none may be one."""
    problem, variants = found.problem, found.attribution.search.variants
    tried = [each for each in found.attribution.tried if each.fit is not None]
    log = np.array([each.log_evidence + log_prior(each.hypothesis, variants) for each in tried])
    plain = [k for k, each in enumerate(tried) if not each.hypothesis.flexible]
    rows = np.flatnonzero(_open(found))
    if not len(rows):
        return None
    seen = [_left_out_of(problem, tried[k].fit, rows) for k in plain]
    gross, ordinary = np.swapaxes(
        [log[k] + each.rest + each.gross_or_ordinary for k, each in zip(plain, seen, strict=True)],
        0,
        1,
    )
    odds = scipy.special.logsumexp(gross, axis=0) - scipy.special.logsumexp(ordinary, axis=0)
    best = int(odds.argmax())
    if odds[best] < _WORTH_FITS:
        return None
    # Of a datum that drags the fits along, what is linear about these says too little.
    leaders = [plain[k] for k in np.argsort(-gross[:, best], kind="stable")[:_CONTENDERS]]
    chosen = dict.fromkeys([next(k for k in plain if not tried[k].hypothesis.effects), *leaders])
    row = int(rows[best])
    priors = {k: log_prior(tried[k].hypothesis, variants) for k in chosen}
    fits = np.array([_judge(problem, tried[k], row) + priors[k] for k in chosen])
    whole = problem.without_shape(row)
    unknown = [
        _log_evidence(whole, each) + log_prior(each.hypothesis, variants)
        for each in tried
        if each.hypothesis.flexible
    ]
    final = scipy.special.logsumexp(fits[:, 0]) - scipy.special.logsumexp([*unknown, *fits[:, 1]])
    return GrossError(int(found.rows[row]), float(scipy.special.expit(final)))


def _open(found: Cleared) -> BoolArray:
    """Return which frequencies are of a test and of a mode without a gross error so far.

    What moves more together is no slip.
    """
    design, gone = found.whole.design, [each.row for each in found.excluded]
    test, mode = design.frequency_test, design.mode
    touched = np.isin(test, test[gone]) | np.isin(mode, mode[gone])
    return np.asarray(~touched[found.rows])


def _judge(problem: GapProblem, tried: ScoredHypothesis, row: int) -> FloatArray:
    """Return the log evidence of a hypothesis were a frequency gross, and were it ordinary, (2,).

    By a fit to all other data; the mode's shape is not among them: of a wrong mode it is wrong as
    well.
    """
    assert tried.fit is not None
    fit, hypothesis = tried.fit, tried.hypothesis
    rest = problem.part(np.delete(np.arange(problem.design.frequencies), row))
    # The datum may have dragged the fit far from where the others have it.
    alone = find_starts(rest)
    effects = np.tile(fit.z[alone.shape[1] :], (len(alone), 1))
    peaks = find_peaks(Target(rest, hypothesis), np.vstack([fit.z, np.hstack([alone, effects])]))
    whole, z = problem.without_shape(row), peaks[0].z
    seen = left_out(whole, hypothesis, z, *_around(whole, hypothesis, z), np.array([row]))
    gross, ordinary = laplace(peaks) + seen.gross_or_ordinary[:, 0]
    return np.array([gross, max(ordinary, _log_evidence(whole, tried))])


def _log_evidence(problem: GapProblem, tried: ScoredHypothesis) -> float:
    """Return the log evidence of a hypothesis by some of the data, from a fit to all."""
    assert tried.fit is not None
    return laplace(find_peaks(Target(problem, tried.hypothesis), tried.fit.z[None]))


def _around(
    problem: GapProblem, hypothesis: Hypothesis, z: FloatArray
) -> tuple[FloatArray, FloatArray]:
    residual, slopes = (each[0] for each in Target(problem, hypothesis).look(z[None]))
    return problem.value - residual, slopes


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Frequencies (r) seen from all other data, by each possibility of the unknown errors (nodes).

    `deviation` (nodes, r) is the measured less the expected logarithm, `sd` (nodes, r) its standard
    deviation, `log_all` (nodes,) the log evidence of all data.
    """

    deviation: FloatArray
    sd: FloatArray
    log_all: FloatArray
    gross_share: float

    @property
    def log_rest(self) -> FloatArray:
        """Return the log evidence (nodes, r) of all data but each frequency."""
        return np.asarray(
            self.log_all[:, None] - scipy.stats.norm.logpdf(self.deviation, scale=self.sd)
        )

    @property
    def rest(self) -> FloatArray:
        """Return the log evidence (r,) of all data but each, relative to that of all data."""
        whole = scipy.special.logsumexp(self.log_all)
        return np.asarray(scipy.special.logsumexp(self.log_rest, axis=0) - whole)

    @property
    def gross_or_ordinary(self) -> FloatArray:
        """Return log densities (2, r) given all other data: of a gross error, of an ordinary one.

        An ordinary error has the tails of Student's t.
        """
        rest, share = self.log_rest, self.gross_share
        both = log_gross(self.deviation, share), log_ordinary(self.deviation, self.sd, share)
        together = scipy.special.logsumexp(rest, axis=0)
        return np.array([scipy.special.logsumexp(rest + each, axis=0) - together for each in both])

    @property
    def expected(self) -> tuple[FloatArray, FloatArray]:
        """Return mean and standard deviation (r,) of the deviations, over the possibilities."""
        weight = np.exp(self.log_rest - scipy.special.logsumexp(self.log_rest, axis=0))
        mean = (weight * self.deviation).sum(axis=0)
        square = (weight * (self.sd**2 + self.deviation**2)).sum(axis=0)
        return mean, np.sqrt(square - mean**2)


def log_gross(deviation: FloatArray, share: float) -> FloatArray:
    """Return the log of prior probability times density of a gross error of this size."""
    size = np.abs(deviation).clip(WIDE_FROM, WIDE_TO)
    return np.asarray(np.log(share) - np.log(2 * size * np.log(WIDE_TO / WIDE_FROM)))


def log_ordinary(deviation: FloatArray, sd: FloatArray, share: float) -> FloatArray:
    """Return the log of probability times density of an ordinary error."""
    return np.asarray(np.log1p(-share) + scipy.stats.t.logpdf(deviation, FREEDOM, scale=sd))


def left_out(
    problem: GapProblem,
    hypothesis: Hypothesis,
    z: FloatArray,
    predicted: FloatArray,
    slopes: FloatArray,
    rows: IntArray,
) -> LeftOut:
    """Leave each of the frequencies `rows` (r,) out in turn, by what is linear about z (d,).

    `predicted` (data,) and `slopes` (data, d) are those at z. The standardised deviations are the
    deleted residuals of regression (Cook and Weisberg 1982, 2.2), with priors.
    """
    residual, d = problem.value - predicted, len(z)
    units = np.zeros((len(residual), len(rows)))
    units[rows, np.arange(len(rows))] = 1.0
    likelihood = problem.likelihood(hypothesis)
    gram = likelihood.gram(np.column_stack([slopes, residual, units])[None])[0]
    # The prior is d more data, of value 0 and standard deviation 1.
    inner, outer = gram[:, :d, :d] + np.eye(d), gram[:, :d, d:]
    outer[:, :, 0] -= z
    solved = np.linalg.solve(inner, outer)
    pull = gram[:, d, d:] - np.einsum("kd,kdc->kc", outer[:, :, 0], solved)
    diagonal = np.einsum("kcc->kc", gram[:, d + 1 :, d + 1 :])
    precision = diagonal - (outer[:, :, 1:] * solved[:, :, 1:]).sum(axis=1)
    height = likelihood.log_height - np.linalg.slogdet(inner)[1] / 2
    return LeftOut(
        deviation=pull[:, 1:] / precision,
        sd=1 / np.sqrt(precision),
        log_all=height - (pull[:, 0] + z @ z) / 2,
        gross_share=problem.hanger.assumptions.gross_error_share.value,
    )


def _left_out_of(problem: GapProblem, fit: Fit | None, rows: IntArray) -> LeftOut:
    assert fit is not None
    return left_out(problem, fit.hypothesis, fit.z, fit.predicted, fit.slopes, rows)


def _seen_from(problem: GapProblem, fit: Fit, row: int) -> LeftOut:
    """Return a frequency of `problem` seen from its other data, to which `fit` was fitted."""
    around = _around(problem, fit.hypothesis, fit.z)
    return left_out(problem, fit.hypothesis, fit.z, *around, np.array([row]))


def acts_alone(
    design: Design, remaining: Design, row: int, deviation: float, gross_share: float
) -> float:
    """Return how probably an excluded frequency is no slip, but moved by what acts on it alone.

    It is `row` of `design`, off by `deviation` of its logarithm; `remaining` are the frequencies
    that were kept.
    """
    if abs(deviation) > _LARGEST or _right_elsewhere(design, remaining, row):
        return 0.0
    modes = len(np.unique(design.mode))
    slip = gross_share / np.log(WIDE_TO / WIDE_FROM)
    acts = UNKNOWN / NO_GAP * _BY_AMPLITUDE / modes / np.log(_LARGEST / WIDE_FROM)
    return float(acts / (acts + slip))


def _right_elsewhere(design: Design, remaining: Design, row: int) -> bool:
    same = (remaining.frequency_plane == design.frequency_plane[row]) & (
        remaining.frequency_order == design.frequency_order[row]
    )
    return bool((remaining.amplitude[same] * SAME_LEVEL >= design.amplitude[row]).any())


def describe_outliers(
    found: Cleared, errors: Sequence[GrossError], fit: Fit
) -> tuple[Outlier, ...]:
    """Return gross errors with the frequencies that `fit`, the answer, expects in their place."""
    return tuple(_outlier(found, each, fit) for each in errors)


def _outlier(found: Cleared, error: GrossError, fit: Fit) -> Outlier:
    design, observations = found.whole.design, found.whole.observations
    deviation, sd = found.expected(error, fit)
    measured_hz = float(np.exp(observations.value[error.row]))
    expected_hz = measured_hz * float(np.exp(-deviation))
    stated_sd = float(np.nan_to_num(observations.sd[error.row]))
    return Outlier(
        plane=PLANES[design.frequency_plane[error.row]],
        order=int(design.frequency_order[error.row]),
        test=design.conditions[design.frequency_test[error.row]].test,
        measured_hz=measured_hz,
        expected_hz=expected_hz,
        expected_sd_hz=expected_hz * float(np.sqrt(max(sd**2 - stated_sd**2, 0.0))),
        probability=error.probability,
        acts_alone=found.acts_alone(error, fit) if error in found.excluded else 0.0,
    )


def residuals_with_outliers(
    found: Cleared, residuals: Sequence[Residual], before: Fit, after: Fit | None
) -> tuple[Residual, ...]:
    """Return `residuals` and those of the frequencies set aside, in their order.

    These have no share in the misfit, since it is that of the others.
    """
    rows = dict(zip(found.rows.tolist(), residuals, strict=True))
    rows |= {each.row: _residual(found, each, before, after) for each in found.excluded}
    return tuple(rows[row] for row in sorted(rows))


def _residual(found: Cleared, error: GrossError, before: Fit, after: Fit | None) -> Residual:
    (outlier,) = describe_outliers(found, [error], before)
    deviation, sd = found.expected(error, before)
    left = NAN if after is None else found.expected(error, after)[0]
    percent, after_percent = (100 * float(np.expm1(each)) for each in (deviation, left))
    fields = outlier.plane, outlier.order, outlier.test, outlier.measured_hz, outlier.expected_hz
    return Residual(*fields, percent, deviation / sd, 0.0, after_percent)


def describe_excluded(found: Cleared, outliers: Sequence[Outlier]) -> tuple[str, ...]:
    """Return remarks on frequencies that were done without."""
    otherwise = _led_before(found)
    remarks = tuple(
        f"{_measured(each)}, is excluded as a gross error (probability {_probability(each)}): "
        f"{_expected(each)}. A wrong mode, a tone or a slip; look at the recording again."
        f"{_acts_alone(each)}"
        for each in outliers
    )
    if not remarks or not otherwise:
        return remarks
    right = "it prove right" if len(remarks) == 1 else "they prove right"
    return (*remarks, f"Should {right}, {otherwise} is the most probable cause: repeat the test.")


def describe_doubtful(outliers: Sequence[Outlier]) -> tuple[str, ...]:
    """Return remarks on frequencies that may be gross errors, but were kept."""
    return tuple(
        f"{_measured(each)}, may be a gross error (probability {_probability(each)}): "
        f"{_expected(each)}. It is kept, and the answer may lean on it; look at the recording "
        f"again."
        for each in outliers
    )


def _acts_alone(outlier: Outlier) -> str:
    if not outlier.acts_alone:
        return ""
    return (
        f" Or a part that only this mode's swing reaches, such as a guide with play or a crack "
        f"that opens ({outlier.acts_alone:.2f}): test again with softer and with harder hits."
    )


def _measured(outlier: Outlier) -> str:
    mode = f"{outlier.plane.capitalize()} {outlier.order} of test {outlier.test}"
    return f"{mode}, {outlier.measured_hz:g} Hz"


def _expected(outlier: Outlier) -> str:
    sd_hz = outlier.expected_sd_hz
    digits = max(0, 1 - math.floor(math.log10(sd_hz))) if sd_hz > 0 else 3
    return f"the other data expect {outlier.expected_hz:.{digits}f} +- {sd_hz:.{digits}f} Hz"


def _probability(outlier: Outlier) -> str:
    return f"{outlier.probability:.2f}" if outlier.probability < 0.995 else "over 0.99"


def _led_before(found: Cleared) -> str:
    """Return the effect that led with all frequencies, if it leads no more, and where it acts.

    Pairs are none: among many there always is one that takes a gross error for its own.
    """
    led = found.first.leading if found.first else None
    leads = found.attribution.leading
    if led is None or led.is_pair or (leads and leads.effect == led.effect):
        return ""
    return effect_label(led.effect, led.best.hypothesis.at)
