"""With which conditions the gap grows: a regression of the baseline's residuals on each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from shm.gap.contract import Design, Fit
from shm.gap.problem import GapProblem
from shm.gap.where import identification_sd
from shm.values import NAN, FloatArray, IntArray, Trend


def trends(problem: GapProblem, before: Fit) -> tuple[Trend, ...]:
    """The trends of the frequency residuals, that with the largest share first.

    Conditions that the tests do not vary are absent. The regression is weighted by the
    identification's errors. Tests are compared mode by mode (each plane and order has its own
    mean), so that a test with other modes cannot pass for a trend; orders are compared within a
    test and plane, planes within an order. Standard deviations allow for what the baseline's
    parameters have absorbed. The trend over planes is longitudinal less transverse.
    """
    frequencies = problem.observations.design.frequencies
    residual = 100 * (problem.observations.value - before.predicted)[:frequencies]
    sd = 100 * identification_sd(problem.observations, before)
    covariance = _left_over(100 * before.slopes, sd, frequencies)
    found = [
        _trend(name, values, groups, residual, sd[:frequencies], covariance)
        for name, values, groups in _conditions(problem.observations.design)
        if _varies(values, groups)
    ]
    return tuple(sorted(found, key=lambda trend: -trend.share))


def _conditions(design: Design) -> Iterator[tuple[str, FloatArray, IntArray]]:
    """Each condition's name, its value at each frequency and the groups it is compared within."""
    test, plane, order = design.frequency_test, design.frequency_plane, design.frequency_order
    mode = 2 * order + plane
    each = design.conditions
    masses = [0.0 if c.added_mass is None else c.added_mass.mass_kg for c in each]
    yield "temperature", np.array([c.temperature_shift_k for c in each])[test], mode
    yield "amplitude", np.array([c.amplitude for c in each])[test], mode
    yield "added mass", np.array(masses)[test], mode
    yield "order", order.astype(float), 2 * test + plane
    yield "plane", plane.astype(float), order


def _varies(values: FloatArray, groups: IntArray) -> bool:
    return any(np.ptp(values[groups == group]) > 0 for group in np.unique(groups))


def _trend(
    name: str,
    values: FloatArray,
    groups: IntArray,
    residual: FloatArray,
    sd: FloatArray,
    covariance: FloatArray,
) -> Trend:
    weight = 1 / sd**2
    contrast = _centred(values / np.ptp(values), groups, weight)
    spread = weight @ contrast**2
    estimator = weight * contrast / spread
    slope = float(estimator @ residual)
    misfit = float(weight @ residual**2)
    return Trend(
        condition=name,
        slope_percent=slope,
        slope_sd_percent=float(np.sqrt(max(float(estimator @ covariance @ estimator), 0.0))),
        share=float(slope**2 * spread / misfit) if misfit > 0 else NAN,
    )


def _centred(values: FloatArray, groups: IntArray, weight: FloatArray) -> FloatArray:
    centred = values.copy()
    for group in np.unique(groups):
        rows = groups == group
        centred[rows] -= np.average(values[rows], weights=weight[rows])
    return centred


def _left_over(slopes: FloatArray, sd: FloatArray, rows: int) -> FloatArray:
    """Covariance (rows, rows) of the first residuals of a fit with standard normal priors."""
    weighted = slopes / sd[:, None]
    information = np.eye(slopes.shape[1]) + weighted.T @ weighted
    absorbed = slopes[:rows] @ np.linalg.solve(information, slopes[:rows].T)
    return np.asarray(np.diag(sd[:rows] ** 2) - absorbed)
