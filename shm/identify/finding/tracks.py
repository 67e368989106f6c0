"""Follows poles over rising model orders: a mode stays where it is, noise moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from shm.identify.finding.poles import PoleSet
from shm.values import ComplexArray, FloatArray

FREQUENCY_TOLERANCE = 0.005
SHAPE_TOLERANCE = 0.1
_ORDERS_MISSED_AT_MOST = 8
_FAR = 1e6


@dataclass(frozen=True, eq=False)
class Pole:
    """One pole of one model order; `shape` (channels,) complex, of norm 1."""

    order: int
    frequency_hz: float
    damping_ratio: float
    shape: ComplexArray


Track = tuple[Pole, ...]


def link(sets: Sequence[PoleSet]) -> list[Track]:
    """Tracks of poles that agree from order to order in frequency and shape (0.5 %, MAC 0.9)."""
    closed: list[list[Pole]] = []
    open_tracks: list[list[Pole]] = []
    for poles in sets:
        recent = [t for t in open_tracks if poles.order - t[-1].order <= _ORDERS_MISSED_AT_MOST]
        closed += [t for t in open_tracks if poles.order - t[-1].order > _ORDERS_MISSED_AT_MOST]
        open_tracks = _extended(recent, _as_poles(poles))
    return [tuple(track) for track in closed + open_tracks]


def _as_poles(poles: PoleSet) -> list[Pole]:
    shapes = poles.shapes / np.linalg.norm(poles.shapes, axis=0)
    return [
        Pole(poles.order, float(frequency), float(damping), shape)
        for frequency, damping, shape in zip(
            poles.frequency_hz, poles.damping_ratio, shapes.T, strict=True
        )
    ]


def _extended(tracks: list[list[Pole]], poles: list[Pole]) -> list[list[Pole]]:
    """`tracks`, each with its best pole appended; a pole without a track begins one."""
    if not tracks or not poles:
        return tracks + [[pole] for pole in poles]
    cost = mismatch([track[-1] for track in tracks], poles)
    taken = set()
    for row, column in zip(*linear_sum_assignment(cost), strict=True):
        if cost[row, column] < _FAR:
            tracks[row].append(poles[column])
            taken.add(column)
    return tracks + [[pole] for index, pole in enumerate(poles) if index not in taken]


def mismatch(
    known: Sequence[Pole],
    poles: Sequence[Pole],
    frequency_tolerance: float = FREQUENCY_TOLERANCE,
    shape_tolerance: float = SHAPE_TOLERANCE,
) -> FloatArray:
    """How badly each of `poles` continues each of `known`, (known, poles); 1e6 where it cannot."""
    known_hz = np.array([pole.frequency_hz for pole in known])
    ratio = np.array([pole.frequency_hz for pole in poles]) / known_hz[:, np.newaxis]
    known_shapes = np.array([pole.shape for pole in known])
    likeness = np.abs(known_shapes.conj() @ np.array([pole.shape for pole in poles]).T) ** 2
    frequency_cost = np.abs(ratio - 1) / frequency_tolerance
    shape_cost = (1 - likeness) / shape_tolerance
    near = (frequency_cost < 1) & (shape_cost < 1)
    return np.where(near, frequency_cost + shape_cost, _FAR)


def continued(known: Sequence[Pole], poles: PoleSet) -> list[Pole | None]:
    """For each of `known`, the pole of `poles` that repeats it (1 %, MAC 0.8), or None."""
    candidates = _as_poles(poles)
    if not known or not candidates:
        return [None] * len(known)
    cost = mismatch(known, candidates, 2 * FREQUENCY_TOLERANCE, 2 * SHAPE_TOLERANCE)
    best: list[Pole | None] = [None] * len(known)
    for row, column in zip(*linear_sum_assignment(cost), strict=True):
        if cost[row, column] < _FAR:
            best[row] = candidates[column]
    return best
