"""Likelihood of residuals whose errors have one of several possible covariances.

The frequencies' covariances fall apart into blocks (as a rule one mode in all tests), which are
factored once each. What sensors do to all shapes alike is of low rank and follows by Woodbury's
identity. Possibilities that share a covariance share the work.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.values import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Covariance:
    """Of the data about a prediction: `frequency` (F, F), and of the components of shapes.

    Those err independently with the variances `shape` (S,), and together by k errors: of sensors,
    which repeat in every mode and test, and of the directions of modes. `shape_loads` (S, k) is
    what one standard deviation of each does. So the covariance of shapes is
    diag(shape) + shape_loads shape_loads'.
    """

    frequency: FloatArray
    shape: FloatArray
    shape_loads: FloatArray

    @classmethod
    def of_frequencies(cls, frequency: FloatArray) -> Covariance:
        """Return that of data without shapes."""
        return cls(frequency, np.empty(0), np.empty((0, 0)))

    def part(self, frequencies: IntArray, components: IntArray) -> Covariance:
        """Return that of some frequencies and some components of shapes, by index."""
        frequency = self.frequency[np.ix_(frequencies, frequencies)]
        return Covariance(frequency, self.shape[components], self.shape_loads[components])

    def scaled(self, by: float) -> Covariance:
        """Return that of errors so many times as large."""
        return Covariance(by**2 * self.frequency, by**2 * self.shape, by * self.shape_loads)

    @property
    def whitening(self) -> FloatArray:
        """Return the matrix (data, data) that makes residuals independent, of variance 1."""
        return np.asarray(np.linalg.inv(self.factor), dtype=np.float64)

    @property
    def factor(self) -> FloatArray:
        """Return the Cholesky factor (data, data)."""
        shapes = np.diag(self.shape) + self.shape_loads @ self.shape_loads.T
        root = np.linalg.cholesky(self.frequency)
        return np.asarray(scipy.linalg.block_diag(root, np.linalg.cholesky(shapes)))


@dataclass(frozen=True, eq=False)
class NoiseNode:
    """One possibility of the unknown errors: its covariance and the log of its prior weight.

    The weights of all nodes of a hypothesis add to 1. `model_error` is the fraction it stands for.
    """

    covariance: Covariance
    log_weight: float
    model_error: float


class _Blocks:
    """All blocks of one length: `rows` (blocks, length) of covariances (nodes, F, F)."""

    def __init__(self, rows: IntArray, covariances: FloatArray):
        self._rows = rows
        blocks = covariances[:, rows[:, :, None], rows[:, None, :]]
        factors = np.linalg.cholesky(blocks)
        self.log_volume = np.log(np.einsum("kbii->kbi", factors)).sum(axis=(1, 2))
        self._whitening: FloatArray = np.linalg.inv(factors)

    def squares(self, residual: FloatArray) -> FloatArray:
        """Return squares (n, nodes) of residuals (n, F) of these blocks, whitened."""
        if self._rows.shape[1] == 1:
            return np.asarray(
                residual[:, self._rows[:, 0]] ** 2 @ self._whitening[:, :, 0, 0].T ** 2
            )
        white = self._whitening @ residual.T[self._rows]
        return np.asarray(np.einsum("kbln,kbln->nk", white, white))

    def whitened(self, residual: FloatArray) -> FloatArray:
        """Residuals (n, F) of these blocks, uncorrelated: (nodes, blocks, length, n)."""
        return np.asarray(self._whitening @ residual.T[self._rows])

    def add_weighed(self, columns: FloatArray, total: FloatArray) -> None:
        """Add C^-1 X of columns X (data, c) to `total` (nodes, F, c)."""
        white = self._whitening @ columns[self._rows]
        total[:, self._rows] += np.swapaxes(self._whitening, 2, 3) @ white


class ShapeErrors:
    """Covariances diag(v) + U U' of shapes, K of them, with variances v (S,) and loads U (S, k).

    By Woodbury's identity the inverse is diag(1/v) - T'T with T (k, S) = chol(1 + U'U/v)^-1 U'/v;
    `log_volume` (K,) is half the log determinant.
    """

    def __init__(self, covariances: Sequence[Covariance]):
        variance = np.array([each.shape for each in covariances])
        loads = np.array([each.shape_loads for each in covariances])
        self.precision: FloatArray = 1 / variance
        weighted = np.swapaxes(loads * self.precision[:, :, None], 1, 2)
        inner = np.linalg.cholesky(np.eye(loads.shape[2]) + weighted @ loads)
        self._shared: FloatArray = np.linalg.solve(inner, weighted).astype(np.float64)
        inner_volume = np.log(np.einsum("kii->ki", inner)).sum(axis=1)
        self.log_volume: FloatArray = inner_volume + np.log(variance).sum(axis=1) / 2

    def weighed(self, columns: FloatArray) -> FloatArray:
        """C^-1 X (K, S, c) of columns X (S, c)."""
        shared = np.swapaxes(self._shared, 1, 2) @ (self._shared @ columns)
        return np.asarray(self.precision[:, :, None] * columns - shared)

    def squares(self, residual: FloatArray) -> FloatArray:
        """r' C^-1 r (n, K) of residuals (n, S)."""
        shared = self._shared @ residual.T
        return np.asarray(residual**2 @ self.precision.T - np.einsum("kjn,kjn->nk", shared, shared))

    def gram(self, columns: FloatArray) -> FloatArray:
        """X' C^-1 X (n, K, c, c) of columns X (n, S, c)."""
        weighted = columns[:, None] * self.precision[:, :, None]
        shared = self._shared @ columns[:, None]
        diagonal = np.swapaxes(weighted, 2, 3) @ columns[:, None]
        return np.asarray(diagonal - np.swapaxes(shared, 2, 3) @ shared)


@dataclass(frozen=True, eq=False)
class Weighed:
    """C^-1 X of columns X, by distinct covariance: (distinct, F, c) and (distinct, S, c)."""

    frequency: FloatArray
    shape: FloatArray
    frequency_of: IntArray
    shape_of: IntArray

    def products(self, residual: FloatArray) -> FloatArray:
        """R C^-1 X (nodes, n, c) of residuals R (n, data)."""
        split = self.frequency.shape[1]
        frequency = residual[:, :split] @ self.frequency
        shape = residual[:, split:] @ self.shape
        return np.asarray(frequency[self.frequency_of] + shape[self.shape_of])


class Likelihood:
    """The normal likelihood of residuals (n, data), with the nodes integrated out.

    `log_height` (nodes,) is the log likelihood and log weight of each node at no residual.
    """

    def __init__(self, nodes: Sequence[NoiseNode]):
        self.nodes = tuple(nodes)
        self.log_weight = np.array([node.log_weight for node in nodes])
        covariances = [node.covariance for node in nodes]
        unique, self._frequency_of = _distinct([(each.frequency,) for each in covariances])
        shapes, self._shape_of = _distinct([(c.shape, c.shape_loads) for c in covariances])
        self._covariances: FloatArray = np.array([covariances[k].frequency for k in unique])
        self._shape = ShapeErrors([covariances[k] for k in shapes])
        self.frequencies = self._covariances.shape[1]
        self._blocks = [_Blocks(rows, self._covariances) for rows in _rows(self._covariances)]
        volume = np.sum([each.log_volume for each in self._blocks], axis=0)[self._frequency_of]
        volume = volume + self._shape.log_volume[self._shape_of]
        data = self.frequencies + self._shape.precision.shape[1]
        self.log_height: FloatArray = self.log_weight - volume - data * np.log(2 * np.pi) / 2

    @classmethod
    def of(cls, errors: Covariance, model_error: float) -> Likelihood:
        """Return that of errors of known size."""
        return cls([NoiseNode(errors, 0.0, model_error)])

    def by_node(self, residual: FloatArray) -> FloatArray:
        """Log likelihood and log weight of each node, (n, nodes); -inf where it is not finite."""
        finite = np.asarray(np.isfinite(residual).all(axis=1))
        squares = self.squares(np.where(finite[:, None], residual, 0.0))
        return np.where(finite[:, None], self.log_height - squares / 2, -np.inf)

    def log(self, residual: FloatArray) -> FloatArray:
        """Log likelihood (n,)."""
        return np.asarray(scipy.special.logsumexp(self.by_node(residual), axis=1))

    def gram(self, columns: FloatArray) -> FloatArray:
        """X' C^-1 X (n, nodes, c, c) of columns X (n, data, c)."""
        frequency = self._frequency_gram(columns[:, : self.frequencies])[:, self._frequency_of]
        shape = self._shape.gram(columns[:, self.frequencies :])[:, self._shape_of]
        return np.asarray(frequency + shape)

    def linear(
        self, slopes: FloatArray, residual: FloatArray, z: FloatArray
    ) -> tuple[FloatArray, FloatArray, float, float]:
        """About a point z (d,) with its residual (data,), of errors of known size.

        The curvature (d, d), the best step (d,), the square of the residual and what of it the
        parameters, with standard normal priors, follow in that step.
        """
        gram = self.gram(np.column_stack([slopes, residual])[None])[0, 0]
        inner, pull = gram[:-1, :-1] + np.eye(len(z)), gram[:-1, -1] - z
        step = np.linalg.solve(inner, pull)
        return inner, step, float(gram[-1, -1]), float(pull @ step)

    def weighed(self, columns: FloatArray) -> Weighed:
        """C^-1 X of columns X (data, c), to take products with many residuals."""
        frequency = np.zeros((len(self._covariances), self.frequencies, columns.shape[1]))
        for block in self._blocks:
            block.add_weighed(columns, frequency)
        shape = self._shape.weighed(columns[self.frequencies :])
        return Weighed(frequency, shape, self._frequency_of, self._shape_of)

    def squares(self, residual: FloatArray) -> FloatArray:
        """Squared whitened residuals (n, nodes)."""
        frequency = np.zeros((len(residual), len(self._covariances)))
        for block in self._blocks:
            frequency += block.squares(residual[:, : self.frequencies])
        shape = self._shape.squares(residual[:, self.frequencies :])
        return np.asarray(frequency[:, self._frequency_of] + shape[:, self._shape_of])

    def _frequency_gram(self, columns: FloatArray) -> FloatArray:
        """(n, distinct covariances, c, c) of columns (n, F, c)."""
        n, _, width = columns.shape
        flat = np.swapaxes(columns, 1, 2).reshape(n * width, self.frequencies)
        total = np.zeros((len(self._covariances), n, width, width))
        for block in self._blocks:
            white = block.whitened(flat).reshape(len(total), -1, n, width)
            white = white.transpose(0, 2, 3, 1)
            total += white @ np.swapaxes(white, 2, 3)
        return np.swapaxes(total, 0, 1)


def _rows(covariances: FloatArray) -> list[IntArray]:
    """Rows of the blocks that no covariance connects, those of one length together."""
    linked = scipy.sparse.csr_array((covariances != 0).any(axis=0))
    count, label = scipy.sparse.csgraph.connected_components(linked, directed=False)
    members = [np.flatnonzero(label == k) for k in range(count)]
    lengths = sorted({len(rows) for rows in members})
    return [np.array([m for m in members if len(m) == length]) for length in lengths]


def _distinct(arrays: Sequence[tuple[FloatArray, ...]]) -> tuple[list[int], IntArray]:
    """Return indices of those that differ and, for each of all, which of them it is."""
    found: dict[tuple[bytes, ...], int] = {}
    first: list[int] = []
    index = np.empty(len(arrays), dtype=np.int64)
    for k, each in enumerate(arrays):
        index[k] = found.setdefault(tuple(part.tobytes() for part in each), len(found))
        if index[k] == len(first):
            first.append(k)
    return first, index
