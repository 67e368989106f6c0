"""Which modes of several set-ups are the same mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from shm.identify.contract import FoundMode, Measurement
from shm.identify.finding.poles import modal_assurance
from shm.identify.measuring.points import Place, place_of
from shm.identify.placing.planes import transverse_share
from shm.values import PLANES, FloatArray

LARGEST_SHIFT = 0.002
"""A mode's frequency differs by less than this fraction from set-up to set-up."""
LEAST_LIKENESS = 0.25
_SEEN = 0.01
"""Share of a shape's energy that points must hold to say anything of it."""
_NEVER = 1e6


@dataclass(frozen=True, eq=False)
class Seen:
    """A mode as one set-up sees it."""

    set_up: int
    mode: FoundMode
    shape: dict[Place, float]
    transverse: float

    @staticmethod
    def of(set_up: int, mode: FoundMode, measurement: Measurement) -> Seen:
        places = [place_of(point) for point in measurement.points]
        both = not set(PLANES) - {point.plane for point in measurement.points}
        share = transverse_share(mode.shape, measurement.points) if both else np.nan
        shape = dict(zip(places, mode.shape.tolist(), strict=True))
        return Seen(set_up, mode, shape, share)


def matched(
    measurements: Sequence[Measurement], found: Sequence[Sequence[FoundMode]]
) -> list[list[Seen]]:
    """The modes of all set-ups in groups that are one mode each, by rising frequency.

    Set-ups are taken from the one with most modes on; each of its modes joins the nearest group,
    one to one, if its frequency and its shape on common points (else its direction) allow.
    """
    seen = [
        [Seen.of(index, mode, measurement) for mode in modes]
        for index, (measurement, modes) in enumerate(zip(measurements, found, strict=True))
    ]
    groups: list[list[Seen]] = []
    for modes in sorted(seen, key=len, reverse=True):
        _take_in(groups, modes)
    return sorted(groups, key=_frequency)


def _take_in(groups: list[list[Seen]], modes: Sequence[Seen]) -> None:
    cost = np.array([[_cost(group, mode) for group in groups] for mode in modes])
    cost = cost.reshape(len(modes), len(groups))
    joined = {
        int(row): int(column)
        for row, column in zip(*linear_sum_assignment(cost), strict=True)
        if cost[row, column] < _NEVER
    }
    for row, mode in enumerate(modes):
        if row in joined:
            groups[joined[row]].append(mode)
        else:
            groups.append([mode])


def _frequency(group: Sequence[Seen]) -> float:
    return float(np.mean([seen.mode.frequency_hz for seen in group]))


def _cost(group: Sequence[Seen], mode: Seen) -> float:
    shift = abs(mode.mode.frequency_hz / _frequency(group) - 1)
    likeness = float(np.mean([_likeness(member, mode) for member in group]))
    if shift > LARGEST_SHIFT or likeness < LEAST_LIKENESS:
        return _NEVER
    return shift / LARGEST_SHIFT + 1 - likeness


def _likeness(one: Seen, other: Seen) -> float:
    """MAC on common points; without, of the directions; 1 where nothing is common."""
    common = sorted(one.shape.keys() & other.shape.keys(), key=str)
    shapes = [np.array([seen.shape[place] for place in common]) for seen in (one, other)]
    if all(_tells(part, seen.shape) for part, seen in zip(shapes, (one, other), strict=True)):
        return modal_assurance(*shapes)
    if np.isnan(one.transverse) or np.isnan(other.transverse):
        return 1.0
    directions = [
        np.sqrt(np.array([seen.transverse, 1 - seen.transverse])) for seen in (one, other)
    ]
    return modal_assurance(*directions)


def _tells(part: FloatArray, shape: dict[Place, float]) -> bool:
    return float(part @ part) > _SEEN * sum(value**2 for value in shape.values())
