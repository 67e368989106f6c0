"""Hits in several directions at one place, identified together besides one direction at a time.

Two planes' modes of an order are often nearer than their bandwidth. Hit along one plane, the other
rings too faintly to be told apart from it, and the one shape that is found lies along the hammer,
not along the mode. Free decays of all directions have the same poles and shapes; together they
have each mode in full, as decays from several references have (Vold et al. 1982, SAE 820194).
Only where the two frequencies are all but equal noise turns the shapes of both at will; there the
modes of each direction by itself are kept, and their standard deviations say by how much they may
be turned.

Measured on 8 simulated hangers whose axes were turned by 1 to 40 degrees, the planes 0.2 to 3
bandwidths apart: by each direction alone shapes were turned wrongly by up to 7 degrees, those of
the first order by up to 54; together by up to 0.2, and the first by up to 4, as their standard
deviations say.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.identify.contract import Finding, FoundMode, Measurement
from shm.identify.estimation.poles import modal_assurance
from shm.identify.estimation.repeats import LEAST_HITS
from shm.identify.measuring.responses import place_of
from shm.identify.mode_ordering.planes import transverse_share
from shm.identify.setup_merging.join_set_ups import LARGEST_SHIFT, JoinedFinding, matched
from shm.identify.setup_merging.modal_participation import ringing, with_levels
from shm.values import PLANES, FloatArray, ResponsePoint

_MOST_TURN = 0.1
"""Radians: shapes that noise turns by more (as a standard deviation) have no direction."""
_UNKNOWN_TURN = math.pi / 4  # nothing is farther from the nearer of two axes
_SAME_DIRECTION = 0.5  # MAC: less than 45 degrees apart
_OTHER = dict(zip(PLANES, reversed(PLANES), strict=True))


def have_same_sensors(measurements: Sequence[Measurement]) -> bool:
    """Return whether they have the same two-axis sensors, and enough hits in several directions."""
    layouts = {tuple(place_of(point) for point in m.points) for m in measurements}
    hammers = [m.hammer for m in measurements if m.hammer is not None]
    directions = {hammer.plane for hammer in hammers} - {None}
    places = {None if math.isnan(hammer.x_m) else hammer.x_m for hammer in hammers}
    windows = {m.decay_time_constant_s for m in measurements}
    several = len(directions) == len(measurements) > 1
    enough = all(len(m.decays) >= LEAST_HITS for m in measurements)
    biaxial = {point.plane for point in measurements[0].points} == set(PLANES)
    return several and enough and biaxial and len(layouts) == len(places) == len(windows) == 1


def pool_hits(measurements: Sequence[Measurement]) -> Measurement:
    """Return the hits of all as one measurement; what depends on the force is the first one's."""
    return replace(
        measurements[0],
        decays=tuple(decay for m in measurements for decay in m.decays),
        driven=tuple(driven for m in measurements for driven in m.driven),
        hits=tuple(hit for m in measurements for hit in m.hits),
    )


def refine_by_direction(
    measurements: Sequence[Measurement], apart: JoinedFinding, found: Finding
) -> JoinedFinding:
    """Return the modes of all hits, completed by modes found `apart` in one direction.

    Those replace modes whose direction is unknown in all hits together, and add missing ones.
    """
    everything = pool_hits(measurements)
    groups = matched((everything, everything), (found.modes, apart.finding.modes))
    pairs = [{seen.set_up: seen.mode for seen in group} for group in groups]
    modes = [_better(pair[0], pair.get(1), apart.points) for pair in pairs if 0 in pair]
    missed = [pair[1] for pair in pairs if 0 not in pair]
    for mode in missed:
        if not any(_same(mode, other) for other in modes):
            has_neighbour = any(
                _near(mode, other) for other in [*modes, *missed] if other is not mode
            )
            modes.append(_turned(mode, _UNKNOWN_TURN, apart.points) if has_neighbour else mode)
    return _as_joined(measurements, replace(found, modes=_by_frequency(modes)))


def _by_frequency(modes: Sequence[FoundMode]) -> tuple[FoundMode, ...]:
    return tuple(sorted(modes, key=lambda mode: mode.frequency_hz))


def _as_joined(measurements: Sequence[Measurement], found: Finding) -> JoinedFinding:
    """Return a finding over the points of all set-ups, with the levels at which its modes ring."""
    modes = found.modes
    if modes:
        modes = with_levels(
            modes, [ringing(m, modes, _moves_with_hammer(m, modes)) for m in measurements]
        )
    note = f"the hits of {len(measurements)} directions are identified together"
    apart = (modes,) * len(measurements)
    return JoinedFinding(measurements[0].points, replace(found, modes=modes), apart, (note,))


def _better(
    mode: FoundMode, by_itself: FoundMode | None, points: Sequence[ResponsePoint]
) -> FoundMode:
    """Return the mode of all hits where its direction is known, else that of one direction."""
    turn = float(np.linalg.norm(mode.shape_sd) / np.linalg.norm(mode.shape))
    if by_itself is None or turn <= _MOST_TURN:
        return mode
    away = math.acos(min(1.0, math.sqrt(modal_assurance(mode.shape, by_itself.shape))))
    known = math.hypot(turn, away) if math.isfinite(turn) else _UNKNOWN_TURN
    return _turned(by_itself, min(known, _UNKNOWN_TURN), points)


def _turned(mode: FoundMode, turn_rad: float, points: Sequence[ResponsePoint]) -> FoundMode:
    """Return the mode with standard deviations for a possible rotation about the hanger's axis."""
    across = np.abs(_across(mode.shape, points))
    return replace(mode, shape_sd=np.hypot(mode.shape_sd, turn_rad * across))


def _across(shape: FloatArray, points: Sequence[ResponsePoint]) -> FloatArray:
    """Return the shape's value in the other plane at each point's position; 0 where unknown."""
    value = {place_of(p): each for p, each in zip(points, shape.tolist(), strict=True)}
    others = [replace(p, plane=_OTHER[p.plane]) if p.plane else p for p in points]
    return np.array([value.get(place_of(other), 0.0) for other in others])


def _near(mode: FoundMode, other: FoundMode) -> bool:
    return abs(mode.frequency_hz / other.frequency_hz - 1) < LARGEST_SHIFT


def _same(mode: FoundMode, other: FoundMode) -> bool:
    return _near(mode, other) and modal_assurance(mode.shape, other.shape) > _SAME_DIRECTION


def _moves_with_hammer(measurement: Measurement, modes: Sequence[FoundMode]) -> list[bool]:
    """Return which modes move more in the hammer's direction than across it."""
    plane = measurement.hammer.plane if measurement.hammer else None
    share = np.array([transverse_share(mode.shape, measurement.points) for mode in modes])
    return list((share >= 0.5) == (plane == PLANES[0]))
