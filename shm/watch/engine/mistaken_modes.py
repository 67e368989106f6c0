"""Find mistaken modes of a test: another order, the other plane's, a machine's tone.

Log frequencies lie about a linear function of a few coordinates, which have a normal prior, each
with an error; or, seldom, anywhere. Sets of up to two mistaken modes are compared exhaustively,
since two can hide each other; larger ones grow from the best of these, one mode at a time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np

from shm.values import BoolArray, FloatArray
from shm.watch.engine.limits import LIMITS

MOST_MISTAKEN = 1 / 3  # judgement: where more modes fit no state, it is the test that does not


def _log_good(off: FloatArray, variance: FloatArray | float) -> FloatArray:
    return np.asarray(
        math.log(1 - LIMITS.mistaken) - off**2 / variance / 2 - np.log(2 * np.pi * variance) / 2
    )


@dataclass(frozen=True, eq=False)
class SoundModes:
    """The modes (n,) that are more probably good than mistaken, and the coordinates (q,) by these.

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
    """Find the sound ones of modes `off` (n,) from the origin, with `slopes` (n, q).

    `variance` (n,) is that of their errors, `precision` (q,) that of the coordinates about 0.
    """
    problem = _Problem.of(off, slopes, variance, precision)
    count = len(off)
    sets = _small_sets(count, min(int(MOST_MISTAKEN * count), LIMITS.small_sets))
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
    wide = [_Problem.of(off, slopes, variance + sd**2, precision) for sd in LIMITS.misfit_sds]
    none = np.zeros((1, count), bool)
    misfit = np.array([each.scores(none)[0] for each in wide])
    odds = math.log(LIMITS.misfit / (1 - LIMITS.misfit) / len(wide))
    if mistaken.sum() > MOST_MISTAKEN * count or np.logaddexp.reduce(misfit) + odds > log_evidence:
        # Who goes on from there may find that it fits: mistakes must not pull at it.
        few = np.where(sets.sum(axis=1) <= MOST_MISTAKEN * count, scores, -np.inf)
        x = problem.most_probable(sets[int(few.argmax())])
        return SoundModes(~none[0], x, log_evidence, is_misfit=True)
    return SoundModes(~mistaken, problem.most_probable(sets[best]), log_evidence)


@lru_cache(64)
def _small_sets(count: int, most: int) -> BoolArray:
    """Return all sets of up to `most` of `count` modes (sets, count), the empty one first."""
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
        log = _log_good(off, variance) - math.log(LIMITS.mistaken / LIMITS.mistaken_range)
        return cls(over[:, :, None] * slopes[:, None, :], over * off[:, None], log, precision)

    def scores(self, sets: BoolArray) -> FloatArray:
        """Return the log evidence (sets,) of sets of mistaken modes, less that of all modes."""
        chosen = (~sets).astype(float)
        matrix = np.tensordot(chosen, self.information, 1) + np.diag(self.precision)
        pull = chosen @ self.pull
        lower = np.linalg.cholesky(matrix)
        whitened = np.linalg.solve(lower, pull[:, :, None])[:, :, 0]
        log_det = 2 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
        gain = (whitened**2).sum(axis=1) - log_det + np.log(self.precision).sum()
        return np.asarray(chosen @ self.log + gain / 2)

    def most_probable(self, mistaken: BoolArray) -> FloatArray:
        """Return the coordinates (q,), `mistaken` modes (n,) left out."""
        matrix = self.information[~mistaken].sum(axis=0) + np.diag(self.precision)
        return np.asarray(np.linalg.solve(matrix, self.pull[~mistaken].sum(axis=0)))
