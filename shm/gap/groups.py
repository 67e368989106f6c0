"""Causes that these data support and cannot tell apart: what is claimed is then their group."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np
import scipy

from shm.gap.contract import Fit, NoiseNode
from shm.gap.coordinates import Branch
from shm.gap.likelihood import Likelihood
from shm.gap.objective import Landscape
from shm.gap.problem import GapProblem

SAME_BELOW = 3.0
"""Log Bayes factor, expected or found, under which two causes count as not separable: evidence of
less than twenty to one is not strong (Kass and Raftery, J. Am. Stat. Assoc. 90, 1995).
"""


NOTABLE_WITHIN = 1.6
"""A peak with less than a fifth of the best one's evidence does not speak for its cause."""


def faces(problem: GapProblem, fit: Fit) -> tuple[Fit, ...]:
    """A fit as seen from each of its notable peaks, its best point first.

    A mass that may sit in the middle or at an end looks like a stiff end from one of them only.
    """
    best = max((peak.log_evidence for peak in fit.peaks), default=0.0)
    notable = [peak for peak in fit.peaks if peak.log_evidence > best - NOTABLE_WITHIN]
    if len(notable) < 2:
        return (fit,)
    landscape = Landscape(problem, fit.hypothesis)
    views = landscape.views(np.array([p.w for p in notable]), np.array([p.signs for p in notable]))
    branches = [Branch(peak.signs) for peak in notable]
    others = [
        replace(
            fit,
            z=branch.z(w[None])[0],
            predicted=problem.observations.value - residual,
            slopes=slopes / branch.stretch(w),
        )
        for branch, w, residual, slopes in zip(
            branches, views.w, views.residual, views.slopes, strict=True
        )
    ]
    return (fit, *others)


def grouped(
    causes: Sequence[Sequence[Fit]], near: Sequence[bool] | None = None
) -> tuple[tuple[int, ...], ...]:
    """Indices of `causes` that cannot be told apart, each group of two and more, in their order.

    A cause has one or several faces; one alike is enough. Those that are `near` the best by the
    evidence found are one group, whatever better data would say. Groups are connected: a cause that
    is like two others joins them.
    """
    close = np.array(near if near is not None else [False] * len(causes), dtype=bool)
    links = np.eye(len(causes)) + np.outer(close, close)
    for i, j in combinations(range(len(causes)), 2):
        if links[i, j]:
            continue
        pairs = product(causes[i], causes[j])
        links[i, j] = any(expected_log_bayes_factor(*pair) < SAME_BELOW for pair in pairs)
    count, label = scipy.sparse.csgraph.connected_components(
        scipy.sparse.csr_array(links), directed=False
    )
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
