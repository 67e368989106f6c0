"""Which modes of a test are mistaken: another order, the other plane's, a machine's tone.

Log frequencies lie about a linear function of a few coordinates, which have a normal prior, each
with an error; or, seldom, anywhere. For a given set of mistaken modes all is normal, and its
evidence has a closed form. Sets of up to two are compared exhaustively, since two can hide each
other; larger ones grow from the best of these, one mode at a time.

Of modes that tests keep having wrong there is a notice. One slip of a test is left out and
forgotten. The same mode wrong in three tests in a row is numbered wrongly each time, or the hanger
has changed in a way that its model class does not know. Where more modes are off the baseline than
can be misnamed, it is the tests that do not fit it. A misnamed mode is one of a few: where many are
off, the tests do not fit the baseline.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations

import numpy as np

from shm.values import (
    BoolArray,
    FloatArray,
    Reading,
    RepeatedMistake,
)
from shm.values.drift import ENOUGH_FITS
from shm.watch.quantities import MeasuredMode

# Of routine modes so many are mistaken: judgement, of hammer tests that were checked by hand.
MISTAKEN = 0.04
# What a mistaken one may be off by, in log frequency: two neighbouring orders of a low mode.
MISTAKEN_RANGE = 0.7
MOST_MISTAKEN = 1 / 3  # judgement: where more modes fit no state, it is the test that does not
_SMALL_SETS = 2
# Of tests so many are of a bar that its class does not describe, all of whose modes lie off by a
# little: judgement, a joint or a fitting that is new. By how much, from a percent on: technical.
_MISFIT, _MISFIT_SDS = 0.001, (0.01, 0.02, 0.04)


def log_mixture(off: FloatArray, variance: FloatArray | float) -> FloatArray:
    """Log density of modes that are `off` by so much, of which a few are mistaken; NaN where a mode
    was not measured."""
    with np.errstate(invalid="ignore"):
        mixed = np.logaddexp(_log_good(off, variance), math.log(MISTAKEN / MISTAKEN_RANGE))
    return np.asarray(mixed)


def _log_good(off: FloatArray, variance: FloatArray | float) -> FloatArray:
    return np.asarray(
        math.log(1 - MISTAKEN) - off**2 / variance / 2 - np.log(2 * np.pi * variance) / 2
    )


@dataclass(frozen=True, eq=False)
class SoundModes:
    """Which modes (n,) are likelier good than mistaken, and the coordinates (q,) by these.

    `log_evidence` is that of the whole test over all sets that were compared. Where the test
    `is_misfit`, it is likelier that its modes fit no coordinates, all of them, than that some are
    mistaken; none is.
    """

    sound: BoolArray
    x: FloatArray
    log_evidence: float
    is_misfit: bool = False


def sound_modes(
    off: FloatArray, slopes: FloatArray, variance: FloatArray, precision: FloatArray
) -> SoundModes:
    """Of modes `off` (n,) from the origin, with `slopes` (n, q) and error `variance` (n,).

    `precision` (q,) is that of the prior of the coordinates about 0.
    """
    problem = _Problem.of(off, slopes, variance, precision)
    count = len(off)
    sets = _small_sets(count, min(int(MOST_MISTAKEN * count), _SMALL_SETS))
    scores = problem.scores(sets)
    best, size = int(scores.argmax()), int(sets[int(scores.argmax())].sum())
    # On beyond what callers believe: stopped there, a test of another state would seem to have just
    # as many mistakes as they do.
    while size == sets.sum(axis=1).max() and size < count:
        grown = sets[best] | np.eye(count, dtype=bool)[~sets[best]]
        sets, scores = np.vstack([sets, grown]), np.append(scores, problem.scores(grown))
        best, size = int(scores.argmax()), int(sets[int(scores.argmax())].sum())
    weight = np.exp(scores - scores[best])
    log_evidence = float(scores[best] + np.log(weight.sum()))
    mistaken = weight @ sets / weight.sum() >= 0.5
    wide = [_Problem.of(off, slopes, variance + sd**2, precision) for sd in _MISFIT_SDS]
    none = np.zeros((1, count), bool)
    misfit = np.array([each.scores(none)[0] for each in wide])
    odds = math.log(_MISFIT / (1 - _MISFIT) / len(wide))
    if mistaken.sum() > MOST_MISTAKEN * count or np.logaddexp.reduce(misfit) + odds > log_evidence:
        # Who goes on from there may find that it fits: mistakes must not pull at it.
        few = np.where(sets.sum(axis=1) <= MOST_MISTAKEN * count, scores, -np.inf)
        x = problem.most_probable(sets[int(few.argmax())])
        return SoundModes(~none[0], x, log_evidence, is_misfit=True)
    return SoundModes(~mistaken, problem.most_probable(sets[best]), log_evidence)


@lru_cache(64)
def _small_sets(count: int, most: int) -> BoolArray:
    """All sets of up to `most` of `count` modes (sets, count), the empty one first."""
    chosen = [each for size in range(most + 1) for each in combinations(range(count), size)]
    sets = np.zeros((len(chosen), count), bool)
    for row, each in zip(sets, chosen, strict=True):
        row[list(each)] = True
    return sets


@dataclass(frozen=True, eq=False)
class _Problem:
    """The normal equations, one part a mode: `information` (n, q, q), `pull` (n, q), `log` (n,)."""

    information: FloatArray
    pull: FloatArray
    log: FloatArray
    precision: FloatArray

    @classmethod
    def of(
        cls, off: FloatArray, slopes: FloatArray, variance: FloatArray, precision: FloatArray
    ) -> _Problem:
        over = slopes / variance[:, None]
        log = _log_good(off, variance) - math.log(MISTAKEN / MISTAKEN_RANGE)
        return cls(over[:, :, None] * slopes[:, None, :], over * off[:, None], log, precision)

    def scores(self, sets: BoolArray) -> FloatArray:
        """Log evidence (sets,) of each set of mistaken modes, less that of all being mistaken."""
        kept = (~sets).astype(float)
        matrix = np.tensordot(kept, self.information, 1) + np.diag(self.precision)
        pull = kept @ self.pull
        lower = np.linalg.cholesky(matrix)
        whitened = np.linalg.solve(lower, pull[:, :, None])[:, :, 0]
        log_det = 2 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
        gain = (whitened**2).sum(axis=1) - log_det + np.log(self.precision).sum()
        return np.asarray(kept @ self.log + gain / 2)

    def most_probable(self, mistaken: BoolArray) -> FloatArray:
        """The coordinates (q,), `mistaken` modes (n,) left out."""
        matrix = self.information[~mistaken].sum(axis=0) + np.diag(self.precision)
        return np.asarray(np.linalg.solve(matrix, self.pull[~mistaken].sum(axis=0)))


# Of a log frequency: more than sensors, joints and traffic do to a mode by itself (judgement).
_OFF = 0.01


def repeated_mistakes(
    before: Sequence[RepeatedMistake], reading: Reading, modes: Sequence[MeasuredMode]
) -> tuple[RepeatedMistake, ...]:
    """The modes that are wrong by a reading, or were of late.

    `modes` are those of the baseline, in the order of the reading's; `before` is the same by the
    test before.
    """
    if reading.modes is None:
        return tuple(before)
    known = {(each.plane, each.order): each for each in before}
    misfit = off_the_baseline(reading)
    is_wrong = reading.modes.mistaken | misfit
    found = []
    for key, wrong, off, variance in zip(
        modes, is_wrong.tolist(), misfit.tolist(), reading.modes.variances, strict=True
    ):
        run = known.get(key)
        if wrong:
            since, tests = (run.since, run.tests) if run else (reading.time, 0)
            found.append(RepeatedMistake(*key, since, tests + 1, is_misfit=off))
        elif run and math.isinf(variance):  # this test does not have the mode
            found.append(run)
        elif run and run.is_notable and run.fits + 1 < ENOUGH_FITS:
            found.append(replace(run, fits=run.fits + 1))
    return tuple(found)


def off_the_baseline(reading: Reading) -> BoolArray:
    """Which of the baseline's modes (modes,) lie off the state that a reading fits best, where
    these are too many to be misnamed; else none.
    """
    modes = reading.modes
    if modes is None:
        return np.zeros(0, bool)
    measured = np.isfinite(modes.variances)
    off = measured & (np.abs(modes.values - modes.slopes @ reading.mean) > _OFF)
    can_tell = measured.sum() > len(reading.mean) + 1
    are_too_many = can_tell and off.sum() > MOST_MISTAKEN * measured.sum()
    return off if are_too_many else np.zeros(len(off), bool)
