"""Causes that these data support and cannot tell apart: what is claimed is then their group."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from shm.gap.contract import Fit, NoiseNode
from shm.gap.likelihood import Likelihood

SAME_BELOW = 3.0
"""Expected log Bayes factor under which two causes count as not separable."""


def grouped(fits: Sequence[Fit]) -> tuple[tuple[int, ...], ...]:
    """Indices of `fits` that cannot be told apart, each group of two and more, in their order.

    Groups are connected: a cause that is like two others joins them.
    """
    links = np.eye(len(fits))
    for i, j in combinations(range(len(fits)), 2):
        links[i, j] = expected_log_bayes_factor(fits[i], fits[j]) < SAME_BELOW
    count, label = connected_components(csr_array(links), directed=False)
    members = [tuple(int(i) for i in np.flatnonzero(label == k)) for k in range(count)]
    return tuple(sorted(group for group in members if len(group) > 1))


def expected_log_bayes_factor(one: Fit, other: Fit) -> float:
    """What data like these tell two fitted causes apart, in the direction that tells less.

    If one is true, the other comes as near to its prediction as its parameters allow (linearised);
    half of the squared distance that is left is the log Bayes factor to expect.
    """
    return min(_when_true(one, other), _when_true(other, one))


def _when_true(true: Fit, rival: Fit) -> float:
    """Half of min over z of |predicted - rival(z)|^2 + |z|^2 - |z of the rival's fit|^2."""
    errors = Likelihood([NoiseNode(rival.noise, 0.0, rival.model_error)])
    apart = true.predicted - rival.predicted
    products = errors.gram(np.column_stack([rival.slopes, apart])[None])[0, 0]
    inner, outer, square = products[:-1, :-1], products[:-1, -1], products[-1, -1]
    pull = outer - rival.z
    curvature = inner + np.eye(len(rival.z))
    return float(max(0.0, square - pull @ np.linalg.solve(curvature, pull)) / 2)
