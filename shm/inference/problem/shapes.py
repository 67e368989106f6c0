"""Mode shapes as data: what a measured shape is off by, in a mode's own plane.

Each component errs by its identification, with the standard deviation that was stated; each channel
by its gain and each sensor by its place, alike in all modes. The size of a shape is free, so that
only its directions across the measured one count. All standard deviations are a common factor phi
of what is stated, log-normal with a spread of 20 %; and with the share of gross errors phi is as
likely anywhere up to where the shapes say nothing: sensors that were exchanged, a plane that was
turned. A mass that is clamped on changes shapes: those of its tests do not count.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
import scipy

from shm.models import Model
from shm.models.classes.base import Swap
from shm.values import PLANES, FloatArray, Hanger, IntArray, ModalTest, Mode, ShapePoint


@dataclass(frozen=True)
class ShapeOptions:
    """Hold the settings by which shapes count.

    phi has as many usual `nodes` and `gross_nodes`. A search takes shapes for `loose` times less
    certain until the frequencies have led it. From a probability of `rather_gross` on, the answer
    says that the shapes are wrong.
    """

    nodes: int = 5
    gross_nodes: int = 12
    loose: float = 5.0
    rather_gross: float = 0.5


SHAPES = ShapeOptions()


@dataclass(frozen=True, eq=False)
class _Shape:
    """One measured shape: at places `x_m` (points,), of length 1, with standard deviations."""

    plane: int
    order: int
    x_m: FloatArray
    value: FloatArray
    sd: FloatArray


class MeasuredShapes:
    """The shapes of tests, those of one mode at the same places together; their likelihood.

    Predictions are misfits (n, data) in standard deviations, independent of each other: `size` of
    them, one less than a shape has places.
    """

    def __init__(self, tests: Sequence[ModalTest], hanger: Hanger):
        self._hanger = hanger
        shapes = [_mean(each) for each in _same_shapes(tests).values()]
        self._plane = _repeat([each.plane for each in shapes], shapes)
        self._order = _repeat([each.order for each in shapes], shapes)
        self._of: IntArray = _repeat(range(len(shapes)), shapes)
        x_m = np.concatenate([np.zeros(0), *(each.x_m for each in shapes)])
        self.highest_order = int(self._order.max(initial=0))
        self.places_m, self._place = np.unique(x_m, return_inverse=True)
        self._value = np.concatenate([np.zeros(0), *(each.value for each in shapes)])
        sd = np.concatenate([np.zeros(0), *(each.sd for each in shapes)])
        self.size = len(self._value) - len(shapes)
        self._across = self._directions(len(shapes))
        covariance = np.diag(sd**2) + self._sensors()
        factor = np.linalg.cholesky(self._across @ covariance @ self._across.T)
        self._whitening = scipy.linalg.solve_triangular(factor, self._across, lower=True)
        self._log_scale = -float(np.log(np.diag(factor)).sum())
        usual, gross = self._factors(np.sqrt(np.diag(factor @ factor.T)))
        self._log_phi = np.log(np.append(usual[0], gross[0]))
        share = hanger.assumptions.gross_error_share.value
        self._log_weight = np.log(np.append((1 - share) * usual[1], share * gross[1]))
        self._is_gross = np.arange(len(self._log_phi)) >= len(usual[0])

    def renumbered(self, by: int) -> MeasuredShapes:
        """Return the same of modes whose orders are higher `by` so many."""
        found = copy(self)
        found._order, found.highest_order = self._order + by, self.highest_order + by
        return found

    def misfits(self, model: Model, theta: FloatArray) -> FloatArray:
        """Return the misfits (n, size) of parameter sets `theta` (n, parameters)."""
        if not self.size:
            return np.zeros((len(theta), 0))
        return self.misfits_of(model.shapes(theta, self.highest_order, self.places_m))

    def misfits_of(self, deflection: FloatArray) -> FloatArray:
        """Return the misfits (n, size) of shapes (n, 2, modes, places)."""
        if not self.size:
            return np.zeros((len(deflection), 0))
        raw = deflection[:, self._plane, self._order - 1, self._place]
        in_shape = self._of == np.arange(self._of[-1] + 1)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            size = (raw * self._value) @ in_shape.T / (raw**2 @ in_shape.T)
        return np.asarray((size[:, self._of] * raw - self._value) @ self._whitening.T)

    @property
    def factors(self) -> list[tuple[float, float]]:
        """Return each phi and the log of its weight, that of the data's scale included."""
        if not self.size:
            return [(1.0, 0.0)]
        weight = self._log_weight + self._log_scale
        return list(zip(np.exp(self._log_phi).tolist(), weight.tolist(), strict=True))

    def log_likelihood(self, misfits: FloatArray) -> FloatArray:
        """Return the log likelihood (n,) of misfits (n, size), all factors integrated out."""
        if not self.size:
            return np.zeros(len(misfits))
        constant = self._log_scale - self.size * np.log(2 * np.pi) / 2
        return np.asarray(scipy.special.logsumexp(self._joint(misfits), axis=1) + constant)

    def factor(self, misfits: FloatArray) -> float:
        """Return the most probable phi of misfits (1, size)."""
        return float(np.exp(self._log_phi[self._joint(misfits)[0].argmax()])) if self.size else 1.0

    def gross_probability(self, misfits: FloatArray) -> float:
        """Return the probability that the shapes have a gross error; NaN without shapes."""
        if not self.size:
            return float("nan")
        share = scipy.special.softmax(self._joint(misfits), axis=1)
        return float(share[:, self._is_gross].sum(axis=1).mean())

    def _joint(self, misfits: FloatArray) -> FloatArray:
        """Return log likelihoods with the weight of each phi (n, nodes)."""
        square = (misfits**2).sum(axis=1)[:, None]
        likelihood = -0.5 * square * np.exp(-2 * self._log_phi) - self.size * self._log_phi
        return np.asarray(likelihood + self._log_weight)

    def _directions(self, shapes: int) -> FloatArray:
        """Return directions (size, components) across each shape, of length 1."""
        rows = [np.zeros((0, len(self._of)))]
        for shape in range(shapes):
            components = np.flatnonzero(self._of == shape)
            across = scipy.linalg.null_space(self._value[None, components]).T
            row = np.zeros((len(across), len(self._of)))
            row[:, components] = across
            rows.append(row)
        return np.vstack(rows)

    def _sensors(self) -> FloatArray:
        """Return the covariance of the components by gains and places of sensors.

        What a place does follows from the slope of a string's mode, n pi/L times what lies a
        quarter of a wave beside.
        """
        scatter, length_m = self._hanger.scatter, self._hanger.length_m
        same_place = np.equal.outer(self._place, self._place)
        same_channel = same_place & np.equal.outer(self._plane, self._plane)
        wave = self._order * np.pi / length_m
        x_m = self.places_m[self._place]
        sine, slope = np.sin(wave * x_m), wave * np.cos(wave * x_m)
        same_shape = np.equal.outer(self._of, self._of)
        size = (same_shape @ (self._value * sine)) / np.maximum(
            same_shape @ sine**2, np.finfo(float).tiny
        )
        moved = size * slope
        gains = scatter.sensor_gain**2 * np.outer(self._value, self._value) * same_channel
        return gains + scatter.sensor_place_m**2 * np.outer(moved, moved) * same_place

    def _factors(self, sd: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Return values of phi and their weights: usual ones, and those of gross errors.

        The largest makes the most certain component of standard deviation `sd` err by a unit shape.
        """
        spread = self._hanger.assumptions.stated_sd_log_sd.value
        nodes, weights = np.polynomial.hermite_e.hermegauss(SHAPES.nodes)
        top = 1 / sd.min() if len(sd) else 2.0
        gross = np.geomspace(np.exp(spread), max(top, np.exp(2 * spread)), SHAPES.gross_nodes)
        return [
            (np.exp(spread * nodes), weights / weights.sum()),
            (gross, np.full(SHAPES.gross_nodes, 1 / SHAPES.gross_nodes)),
        ]


def swaps_of(model: Model, tests: Sequence[ModalTest]) -> Sequence[Swap]:
    """Return the pairs of end springs that can be exchanged without changing any datum.

    Shapes and a mass that was clamped on tell one end from the other.
    """
    shaped = model.has_shapes and any(True for _ in _shapes(tests))
    laden = any(test.added_mass is not None for test in tests)
    return () if shaped or laden else model.swaps


def _usable(mode: Mode) -> list[ShapePoint]:
    """Return the points with a standard deviation; none where they are too few for a direction."""
    points = [each for each in mode.shape if np.isfinite(each.value) and each.sd > 0]
    return points if len(points) > 1 and any(each.value for each in points) else []


def _same_shapes(tests: Sequence[ModalTest]) -> dict[tuple[object, ...], list[_Shape]]:
    """Return the shapes of each mode and set of places."""
    groups: dict[tuple[object, ...], list[_Shape]] = defaultdict(list)
    for shape in _shapes(tests):
        groups[shape.plane, shape.order, *shape.x_m].append(shape)
    return groups


def _shapes(tests: Sequence[ModalTest]) -> Iterator[_Shape]:
    for test in tests:
        if test.added_mass is not None:
            continue
        for mode in test.regular_modes:
            points = sorted(_usable(mode), key=lambda point: point.x_m)
            if points:
                value = np.array([each.value for each in points])
                length = float(np.linalg.norm(value))
                x_m, sd = (np.array([getattr(p, n) for p in points]) for n in ("x_m", "sd"))
                yield _Shape(PLANES.index(mode.plane), mode.order, x_m, value / length, sd / length)


def _mean(shapes: Sequence[_Shape]) -> _Shape:
    """Return the mean of shapes at the same places, weighted by their certainty."""
    first = shapes[0]
    sign = np.array([1.0 if each.value @ first.value >= 0 else -1.0 for each in shapes])
    weight = np.array([1 / each.sd**2 for each in shapes])
    total = weight.sum(axis=0)
    value = (sign[:, None] * weight * np.array([each.value for each in shapes])).sum(axis=0) / total
    length = float(np.linalg.norm(value))
    return _Shape(first.plane, first.order, first.x_m, value / length, total**-0.5 / length)


def _repeat(values: Sequence[int], shapes: Sequence[_Shape]) -> IntArray:
    """Return one value for each component."""
    return np.repeat(np.array(values, dtype=np.int64), [len(each.x_m) for each in shapes])
