"""The likelihood of one test about a point: its modes, and how they go with the coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.models import Model
from shm.models.base import Conditions
from shm.values import TENSION, BoolArray, FloatArray, IntArray, WatchedQuantity
from shm.watch.quantities import moved, shift_of

_SELDOM = 1e-3
"""Of good tests, by their misfit (judgement): a worse one has larger errors than stated."""
_SLOPE_STEP = 0.1  # technical: of a quantity's step, over which frequencies go nearly straight
# Far above the rounding of a log frequency, far below what a test can tell.
_LEAST_SLOPE_STEP = 1e-7
_PULL_SD_IN_STEPS = 10.0
_MOST_STEPS = 12
_STARTS = 24  # technical: of a tension from a fiftieth to five times the nominal one
# In units of the reading's variance: a last step of a tenth of its standard deviation is taken
# along with the reading, which is linear about the place before it.
_SETTLED = 1e-2
# Information, per step_sd, of which 10,000 tests together say as much as the prior of a change.
_UNSEEN = 1e-4
# How far a search leaves the tables, in log frequency: more than noise, less than a blunder.
_BEYOND = 0.05


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
        """Return some of the modes."""
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
        """Return the cost that is minimised: the misfit and the pull to the baseline."""
        return float(self.residual @ self.residual + self.x @ (self.pull * self.x))

    @property
    def step(self) -> FloatArray:
        """To where the cost is least, were it all linear."""
        downhill = self.slopes.T @ self.residual - self.pull * self.x
        return np.asarray(np.linalg.solve(self.information + np.diag(self.pull), downhill))

    def gain(self, step: FloatArray) -> float:
        """Of a step, in units of the variance."""
        return float(step @ self.information @ step)


def _credible_share(misfit: FloatArray, fitted: int) -> float:
    """Return the share of its stated information that a test deserves, by its misfit over sd (n,).

    1 where the misfit is one that a thousandth of good tests exceed, or less. Where the modes fit
    no state of the hanger, their errors are larger than stated by as much (Birge 1932).
    """
    free = len(misfit) - fitted
    if free < 1:
        return 1.0
    most = float(scipy.special.chdtri(free, _SELDOM))
    return most / max(most, float(misfit @ misfit))


class Likelihood:
    """The likelihood of a test over the coordinates (q,) of a hanger's `quantities`.

    About the parameters `base` of the model, whose first `orders` modes of each plane are asked.
    """

    def __init__(
        self,
        model: Model,
        base: FloatArray,
        quantities: Sequence[WatchedQuantity],
        orders: int,
    ):
        self._model, self._base, self._quantities, self._orders = model, base, quantities, orders
        names = model.parameter_names
        self._columns = [[names.index(name) for name in each.parameters] for each in quantities]
        self._scale: FloatArray = np.array([each.step_sd for each in quantities])
        self.pull: FloatArray = 1 / (_PULL_SD_IN_STEPS * self._scale) ** 2
        self._lowest = np.array([each.coordinates[0] for each in quantities])
        self._highest = np.array([each.coordinates[-1] for each in quantities])

    def inside(self, x: FloatArray) -> FloatArray:
        """Coordinates (q,) no further beyond the tables than a search may go."""
        return np.clip(x, self._lowest - _BEYOND, self._highest + _BEYOND)

    def far_start(self, seen: SeenModes) -> FloatArray:
        """Return where the tension alone fits best: half of the modes may be anywhere."""
        first = np.linspace(self._lowest[0], self._highest[0], _STARTS)
        places = np.zeros((_STARTS, len(self._quantities)))
        places[:, 0] = first
        off = np.abs(seen.log_frequency - self.predicted(places, seen))
        return np.asarray(places[int(np.median(off, axis=1).argmin())])

    def settled(self, seen: SeenModes) -> LinearReading:
        """Return the likelihood about where it is largest, or very nearly.

        Sought from the baseline on; where that fits badly, from where the tension alone fits best,
        too: on the way to a slack hanger a descent may lose itself among stiffnesses.
        """
        near = self._descended(np.zeros(len(self._quantities)), seen)
        misfit = float(near.residual @ near.residual)
        if misfit <= scipy.special.chdtri(len(near.residual), _SELDOM):
            return near
        far = self._descended(self.far_start(seen), seen)
        return far if far.cost < near.cost else near

    def _descended(self, start: FloatArray, seen: SeenModes) -> LinearReading:
        """Return the same from `start` (q,) on; steps that overshoot halve."""
        best = self.linear(start, seen)
        step = best.step
        for _ in range(_MOST_STEPS):
            if best.gain(step) < _SETTLED:
                break
            near = self.inside(best.x + step)
            tried = self.linear(near, seen)
            if tried.cost <= best.cost:
                best, step = tried, tried.step
            else:
                step = step / 2
        return best

    def linear(self, x: FloatArray, seen: SeenModes) -> LinearReading:
        """One call of the model: at `x` and to both sides of it along each coordinate.

        Beyond the end of a table the model stands still, and frequencies go on straight.
        """
        count, inside = len(x), np.clip(x, self._lowest, self._highest)
        half = np.maximum(_SLOPE_STEP * self._scale, _LEAST_SLOPE_STEP)
        low = np.maximum(inside - half, self._lowest)
        high = np.minimum(inside + half, self._highest)
        places = np.vstack([inside, *(_with_diagonal(inside, ends) for ends in (low, high))])
        predicted = self.predicted(places, seen)
        rise = predicted[1 + count :] - predicted[1 : 1 + count]
        slopes = (rise / (high - low)[:, None]).T
        sd = np.sqrt(seen.variance)
        residual = seen.log_frequency - predicted[0] - slopes @ (x - inside)
        return LinearReading(x, residual / sd, slopes / sd[:, None], self.pull)

    def read(self, linear: LinearReading, off: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what moves of the modes `off` (k, n), over sd, make of the coordinates (k, q).

        And the information (q, q) of the likelihood alone, 0 along what is not seen.
        """
        slopes = linear.slopes * self._scale
        shares, axes = np.linalg.eigh(slopes.T @ slopes)
        seen = shares > _UNSEEN
        steps = (off @ slopes @ axes)[:, seen] / shares[seen]
        share = _credible_share(linear.residual, int(seen.sum()))
        chosen = shares[seen] * share > _UNSEEN
        shares, axes = shares[seen][chosen] * share, axes[:, seen][:, chosen]
        information = (axes * shares) @ axes.T / np.outer(self._scale, self._scale)
        return self._scale * (steps[:, chosen] @ axes.T), np.asarray(
            information + information.T
        ) / 2

    def predicted(self, x: FloatArray, seen: SeenModes) -> FloatArray:
        """Log frequencies (n, modes) of the model at coordinates (n, q) within the tables."""
        theta = np.tile(self._base, (len(x), 1))
        for quantity, columns, values in zip(self._quantities, self._columns, x.T, strict=True):
            shift = shift_of(quantity, values)
            if quantity.name == TENSION:
                theta[:, columns] *= 1 + shift[:, None]
            else:
                theta[:, columns] = moved(self._model, self._base, columns, shift)[:, columns]
        found = self._model.frequencies_at(theta, self._orders, seen.conditions)
        return np.asarray(np.log(found[:, seen.plane, seen.order]))


def _with_diagonal(row: FloatArray, diagonal: FloatArray) -> FloatArray:
    """`row` (q,) once for each entry of `diagonal` (q,), which replaces its own: (q, q)."""
    return np.where(np.eye(len(row), dtype=bool), diagonal, row)
