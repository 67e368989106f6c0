"""From a place of the sampler's space to the best fit near it, for a bar as made."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.optimize import least_squares

from shm.inference.described import DescribedCoordinates
from shm.inference.problem import Problem
from shm.values import FloatArray

_DIFFERENCE = 1e-6
_MOST_ROUNDS = 30


def climbed(
    problem: Problem,
    coordinates: DescribedCoordinates,
    place: FloatArray,
    sigma: float,
    fixed: Mapping[str, float] | None = None,
) -> tuple[FloatArray, float]:
    """The parameters (parameters,) that fit best near `place` (d,), and the square of the deviates
    of the bar that they ask for.

    Flat priors say nothing and normal ones add the squares of the deviates seen, so that the climb
    is a bounded least-squares fit with errors of `sigma` beyond those that are known. `fixed` holds
    parameters of the box where they are given.
    """
    shares, seen = (row[0] for row in coordinates.smooth(place[None]))
    box, held = coordinates.box, dict(fixed or {})
    for name, value in held.items():
        column = box.names.index(name)
        shares[column] = (value - box.lower[column]) / (box.upper[column] - box.lower[column])
    whole = np.append(shares.clip(0, 1), seen)
    count = len(shares)
    free = np.array([name not in held for name in box.names] + [True] * len(seen))
    noise = np.hypot(sigma, problem.likelihood.fit_error)

    def scaled(points: FloatArray) -> FloatArray:
        full = np.repeat(whole[None], len(points), axis=0)
        full[:, free] = points
        theta = coordinates.of_smooth(full[:, :count], full[:, count:])
        return np.hstack([problem.likelihood.misfit(problem.run(theta)) / noise, full[:, count:]])

    def one(point: FloatArray) -> FloatArray:
        return np.asarray(scaled(point[None])[0])

    def slopes(point: FloatArray) -> FloatArray:
        steps = np.where(point < 0.5, _DIFFERENCE, -_DIFFERENCE)
        found = scaled(np.vstack([point, point + np.diag(steps)]))
        return np.asarray(((found[1:] - found[0]) / steps[:, None]).T)

    lower = np.append(np.zeros(count), np.full(len(seen), -np.inf))[free]
    upper = np.append(np.ones(count), np.full(len(seen), np.inf))[free]
    fit = least_squares(one, whole[free], slopes, bounds=(lower, upper), max_nfev=_MOST_ROUNDS)
    whole[free] = fit.x
    theta = coordinates.of_smooth(whole[None, :count], whole[None, count:])[0]
    return np.asarray(theta), float((whole[count:] ** 2).sum())
