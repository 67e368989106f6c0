"""The two factors of a product of which only some entries are known."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from shm.values import BoolArray, FloatArray

_MOST_ROUNDS = 200
_TOLERANCE = 1e-9
_TINY = np.finfo(float).tiny


def hang_together(known: BoolArray) -> bool:
    """Whether the known entries (rows, columns) are joined by steps along rows and columns.

    Only then all entries of a factor have one scale.
    """
    rows, columns = known.shape
    places = np.nonzero(known)
    graph = csr_array(
        (np.ones(len(places[0])), (places[0], rows + places[1])), shape=2 * (rows + columns,)
    )
    return bool(connected_components(graph, directed=False)[0] == 1)


def factors(products: FloatArray, known: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Least-squares factors (modes, rows), (modes, columns) of `products` (modes, rows, columns).

    Only the `known` entries (rows, columns) count. By turns each factor is the least-squares
    solution given the other; the second has the norm 1.
    """
    values = np.where(known, products, 0.0)
    column = _first_guess(values)
    row = np.zeros(values.shape[:2])
    for _ in range(_MOST_ROUNDS):
        row = np.einsum("mrc,mc->mr", values, column) / _energy(column, known.T)
        new = np.einsum("mrc,mr->mc", values, row) / _energy(row, known)
        new /= np.maximum(np.linalg.norm(new, axis=1, keepdims=True), _TINY)
        change = np.max(np.abs(new - column), initial=0.0)
        column = new
        if change < _TOLERANCE:
            break
    return row, column


def _first_guess(values: FloatArray) -> FloatArray:
    """The largest row of each mode; columns it does not know are 0 and take no part at first."""
    largest = np.argmax(np.sum(values**2, axis=2), axis=1)
    return np.asarray(values[np.arange(len(values)), largest])


def _energy(factor: FloatArray, known: BoolArray) -> FloatArray:
    return np.asarray(np.maximum(factor**2 @ known, _TINY))
