"""How often one effect passes for another in given data: so may something that nobody listed.

A remainder that is free to take many forms stands for what is not in the catalogue and resembles
nothing in it. What is not in the catalogue may as well do to these data what an effect of the
catalogue does. How likely that is, the catalogue itself tells: the poorer the data, the more of its
effects others imitate.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shm.gap.contract import Fit, Hypothesis, NoiseNode
from shm.gap.likelihood import Likelihood
from shm.gap.sensitivity import VISIBLE, Scan
from shm.values import FloatArray

IMITATES_WITHIN = 3.0
"""Log Bayes factor to expect under which an effect passes for another."""

_POINTS = 16
_LEAST_SIZE = 4.0


def imitated_share(shifts: Mapping[str, FloatArray], baseline: Fit, likeliest: Fit) -> float:
    """The share of the effects that another effect would be taken for, 0 to 1.

    Each effect's `shifts` (m, data) of what the baseline predicts, whatever their length, are
    scaled to the size of the gap (what the `likeliest` fit gains on the baseline, four standard
    deviations at least) and compared with all shifts of the others, each at the length that comes
    nearest.
    """
    if len(shifts) < 2:
        return 0.0
    effect = np.repeat(np.arange(len(shifts)), [len(each) for each in shifts.values()])
    alike = _correlation(np.vstack(list(shifts.values())), baseline, likeliest) ** 2
    alike[effect[:, None] == effect] = 0.0
    gain = 2 * max(likeliest.log_fit - baseline.log_fit, 0.0)
    left = max(gain, _LEAST_SIZE**2) * (1 - alike.max(axis=1)) / 2
    passes = (left < IMITATES_WITHIN).astype(float)
    return float(np.mean([passes[effect == each].mean() for each in range(len(shifts))]))


def visible_shifts(scans: Mapping[Hypothesis, Scan]) -> dict[str, FloatArray]:
    """By effect some of the shifts (m, data) that its scans found to be visible."""
    found: dict[str, list[FloatArray]] = {}
    for hypothesis, tried in scans.items():
        seen = np.flatnonzero((tried.visible >= VISIBLE) & (tried.weight > 0))
        some = np.linspace(0, len(seen) - 1, min(_POINTS, len(seen))).astype(int)
        if len(seen):
            found.setdefault(hypothesis.name, []).append(tried.shift[seen[some]])
    return {name: np.vstack(rows) for name, rows in found.items()}


def _correlation(shifts: FloatArray, baseline: Fit, likeliest: Fit) -> FloatArray:
    """Of shifts with each other (m, m), beyond what the baseline's parameters can follow."""
    own = beyond(shifts, baseline, NoiseNode(likeliest.noise, 0.0, likeliest.model_error))
    length = np.sqrt(np.maximum(np.diag(own), np.finfo(float).tiny))
    return np.asarray(own / np.outer(length, length))


def beyond(shifts: FloatArray, baseline: Fit, errors: NoiseNode) -> FloatArray:
    """Products (m, m) of shifts (m, data), in standard deviations, beyond what the baseline's
    parameters can follow."""
    columns = np.column_stack([baseline.slopes, shifts.T])[None]
    products = Likelihood([errors]).gram(columns)[0, 0]
    d = len(baseline.z)
    inner, outer = products[:d, :d] + np.eye(d), products[:d, d:]
    return np.asarray(products[d:, d:] - outer.T @ np.linalg.solve(inner, outer))
