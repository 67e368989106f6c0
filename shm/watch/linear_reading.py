"""The modes of a test that its baseline has too, and their likelihood about one place."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.models.base import Conditions
from shm.values import BoolArray, FloatArray, IntArray

SELDOM = 1e-3
"""Of good tests, by their misfit (judgement): a worse one has larger errors than stated."""


@dataclass(frozen=True, eq=False)
class SeenModes:
    """The modes (n,) of a test that the baseline has too: what is measured less its own residual.

    `plane` and `order` index the model's frequencies, `own` the reader's modes; `log_frequency`
    and its `variance` are (n,).
    """

    conditions: Conditions
    plane: IntArray
    order: IntArray
    own: IntArray
    log_frequency: FloatArray
    variance: FloatArray

    def taken(self, rows: BoolArray) -> SeenModes:
        """Some of the modes."""
        arrays = ("plane", "order", "own", "log_frequency", "variance")
        return replace(self, **{name: getattr(self, name)[rows] for name in arrays})


@dataclass(frozen=True, eq=False)
class LinearReading:
    """The likelihood about coordinates `x` (q,): residuals (n,) and slopes (n, q), both over sd."""

    x: FloatArray
    residual: FloatArray
    slopes: FloatArray
    pull: FloatArray

    @property
    def information(self) -> FloatArray:
        return self.slopes.T @ self.slopes

    @property
    def cost(self) -> float:
        """What is made small: the misfit and the pull to the baseline."""
        return float(self.residual @ self.residual + self.x @ (self.pull * self.x))

    @property
    def step(self) -> FloatArray:
        """To where the cost is least, were it all linear."""
        downhill = self.slopes.T @ self.residual - self.pull * self.x
        return np.asarray(np.linalg.solve(self.information + np.diag(self.pull), downhill))

    def gain(self, step: FloatArray) -> float:
        """Of a step, in units of the variance."""
        return float(step @ self.information @ step)


def credible_share(misfit: FloatArray, fitted: int) -> float:
    """The share of its stated information that a test deserves, by its misfit over sd (n,).

    1 where the misfit is one that a thousandth of good tests exceed, or less. Where the modes fit
    no state of the hanger, their errors are larger than stated by as much (Birge 1932).
    """
    free = len(misfit) - fitted
    if free < 1:
        return 1.0
    most = float(scipy.special.chdtri(free, SELDOM))
    return most / max(most, float(misfit @ misfit))
