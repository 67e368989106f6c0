"""Causes that these data cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np
import scipy

from shm.gap.hypotheses.contract import Fit
from shm.gap.hypotheses.target import Problem, Target
from shm.inference.sampler.likelihood import Likelihood

SAME_BELOW = 3.0
"""Log Bayes factor, expected or found, under which two causes count as not separable: evidence of
less than twenty to one is not strong (Kass and Raftery, J. Am. Stat. Assoc. 90, 1995).
"""
_NOTABLE_WITHIN = 1.6  # a peak with less than a fifth of the best one's evidence speaks for nothing


def views_from_peaks(problem: Problem, fit: Fit) -> tuple[Fit, ...]:
    """Return a fit as seen from each of its notable peaks, its best point first.

    A mass that may sit in the middle or at an end looks like a stiff end from one of them only.
    """
    best = max((peak.log_evidence for peak in fit.peaks), default=0.0)
    target, found = Target(problem, fit.hypothesis), [fit]
    for peak in fit.peaks[1:]:
        if peak.log_evidence > best - _NOTABLE_WITHIN:
            residual, slopes = (each[0] for each in target.look(peak.z[None]))
            predicted = problem.value - residual
            found.append(replace(fit, z=peak.z, predicted=predicted, slopes=slopes))
    return tuple(found)


def group(causes: Sequence[Sequence[Fit]], near: Sequence[bool]) -> tuple[tuple[int, ...], ...]:
    """Return indices of `causes` that cannot be told apart, each group of two and more.

    A cause has one or several views; one alike is enough. Those that are `near` the best by the
    evidence found are one group, whatever better data would say. Groups are connected: a cause that
    is like two others joins them.
    """
    close = np.array(near, dtype=bool)
    links = np.eye(len(causes)) + np.outer(close, close)
    for i, j in combinations(range(len(causes)), 2):
        if not links[i, j]:
            pairs = product(causes[i], causes[j])
            links[i, j] = any(expected_log_bayes_factor(*pair) < SAME_BELOW for pair in pairs)
    count, label = scipy.sparse.csgraph.connected_components(
        scipy.sparse.csr_array(links), directed=False
    )
    members = [tuple(int(i) for i in np.flatnonzero(label == k)) for k in range(count)]
    return tuple(sorted(each for each in members if len(each) > 1))


def expected_log_bayes_factor(one: Fit, other: Fit) -> float:
    """Return what data like these tell two fitted causes apart, in the direction that tells less.

    If one is true, the other comes as near to its prediction as its parameters allow (linearised);
    half of the squared distance that is left is the log Bayes factor to expect.
    """
    return min(_when_true(one, other), _when_true(other, one))


def _when_true(true: Fit, rival: Fit) -> float:
    """Half of min over z of |predicted - rival(z)|^2 + |z|^2 - |z of the rival's fit|^2."""
    errors = Likelihood.of(rival.noise, rival.model_error)
    apart = true.predicted - rival.predicted
    _, _, square, followed = errors.linear(rival.slopes, apart, rival.z)
    return max(0.0, square - followed) / 2
