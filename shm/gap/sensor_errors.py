"""What the shapes of all modes and tests say of the sensors themselves.

A sensor that is turned, sits elsewhere or reads too much does so in every mode and test; that is in
the errors of every explanation (`shm.gap.repeated_errors`), as normal with the owner's or usual
standard deviations. Given what the best explanation leaves, each has a normal posterior.
"""

from __future__ import annotations

import numpy as np

from shm.gap.contract import Fit
from shm.gap.problem import GapProblem
from shm.gap.repeated_errors import SensorError
from shm.values import PLANES, Scatter

_SURE = 3.0  # of its standard deviations: by chance one in 370
_OF_NOTE = 0.7  # of what is usual: a crew cares about a degree, a centimetre and a percent
_MOST = 4  # judgement: more is not read; the largest come first


def sensor_remarks(problem: GapProblem, fit: Fit) -> tuple[str, ...]:
    """What these data are sure that sensors err by, as one remark; none where there is nothing."""
    told = [
        _told(problem, error, mean, sd)
        for error, mean, sd in sorted(_posterior(problem, fit), key=lambda each: -abs(each[1]))
        if abs(mean) > max(_SURE * sd, _OF_NOTE)
    ]
    if not told:
        return ()
    more = f", and {len(told) - _MOST} more" if len(told) > _MOST else ""
    return (
        f"The measurement's own, allowed for in every explanation and no part of the gap: "
        f"{'; '.join(told[:_MOST])}{more}.",
    )


def _posterior(problem: GapProblem, fit: Fit) -> list[tuple[SensorError, float, float]]:
    """Mean and standard deviation of each error, in those that are usual."""
    repeated, count = problem.repeated, problem.design.frequencies
    if not repeated.sensor_errors:
        return []
    left = (problem.observations.value - fit.predicted)[count:]
    # The fit's own parameters follow shapes a little, and so know less of the sensors.
    loads = np.column_stack([repeated.sensors, fit.slopes[count:]])
    weighed = loads / fit.noise.shape[:, None]
    prior = np.eye(loads.shape[1])
    covariance = np.linalg.inv(prior + loads.T @ weighed)
    mean, sd = covariance @ (weighed.T @ left), np.sqrt(np.diag(covariance))
    return list(zip(repeated.sensor_errors, mean.tolist(), sd.tolist(), strict=False))


def _told(problem: GapProblem, error: SensorError, mean: float, sd: float) -> str:
    kind, place, component = error
    usual: Scatter = problem.hanger.scatter
    at = f"the sensor at {problem.design.places_m[place]:.2f} m"
    match kind:
        case "gain":
            percent, own = 100 * usual.sensor_gain * mean, 100 * usual.sensor_gain * sd
            much = "much" if mean > 0 else "little"
            return f"{at} reads {abs(percent):.1f} +- {own:.1f} % too {much} {PLANES[component]}"
        case "place":
            off, own = 100 * usual.sensor_place_m * mean, 100 * usual.sensor_place_m * sd
            end = "arch" if mean > 0 else "deck"
            return f"{at} sits {abs(off):.1f} +- {own:.1f} cm nearer to the {end} end"
        case "turn":
            turned, own = np.degrees(usual.sensor_turn) * mean, np.degrees(usual.sensor_turn) * sd
            return f"{at} is turned by {turned:.1f} +- {own:.1f} degrees"
        case "cross":
            percent, own = 100 * usual.sensor_cross_mean * mean, 100 * usual.sensor_cross_mean * sd
            return f"{at} reads {percent:.1f} +- {own:.1f} % of each axis in the other"
