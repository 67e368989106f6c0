"""Gives found modes their plane and order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.identify.contract import FoundMode
from shm.identify.order import Expected, PlaneModes, assign_orders
from shm.identify.pairs import with_both_planes
from shm.identify.planes import CLOSE, planes_of, shape_points
from shm.values import NAN, PLANES, ForeignMode, Hanger, Mode, Plane, ResponsePoint, ShapePoint


@dataclass(frozen=True)
class Placement:
    """The hanger's modes plane by plane, what is not one of them, and what was decided."""

    modes: tuple[Mode, ...]
    set_aside: tuple[ForeignMode, ...] = ()
    notes: tuple[str, ...] = ()


def placed(
    found: Sequence[FoundMode], points: Sequence[ResponsePoint], hanger: Hanger | None
) -> Placement:
    """The modes with plane, order and shape by position."""
    found, planes, pair_notes = with_both_planes(found, planes_of(found, points), points)
    groups = [
        [mode for mode, own in zip(found, planes, strict=True) if own == plane] for plane in PLANES
    ]
    shapes = [
        [shape_points(mode, plane, points) for mode in group]
        for plane, group in zip(PLANES, groups, strict=True)
    ]
    length_m = hanger.length_m if hanger else NAN
    orders = assign_orders(
        [_plane_modes(*pair, length_m) for pair in zip(groups, shapes, strict=True)],
        Expected.of(hanger) if hanger else None,
    )
    modes = tuple(
        _mode(plane, order, mode, shape)
        for plane, *columns in zip(PLANES, orders, groups, shapes, strict=True)
        for order, mode, shape in zip(*columns, strict=True)
    )
    notes = (*_plane_notes(points), *pair_notes, *_pair_notes(groups), *_order_notes(orders))
    return Placement(modes, notes=notes)


def _plane_modes(
    group: Sequence[FoundMode], shapes: Sequence[tuple[ShapePoint, ...]], length_m: float
) -> PlaneModes:
    position = np.array([point.x_m for point in shapes[0]] if shapes else [])
    values = np.array([[point.value for point in shape] for shape in shapes])
    values = values.reshape(len(group), len(position))
    seen = np.all(np.isfinite(values), axis=0) & bool(np.isfinite(length_m))
    frequency = np.array([mode.frequency_hz for mode in group])
    return PlaneModes(frequency, position[seen] / length_m, values[:, seen])


def _mode(plane: Plane, order: int, found: FoundMode, shape: tuple[ShapePoint, ...]) -> Mode:
    return Mode(
        plane=plane,
        order=order,
        frequency_hz=found.frequency_hz,
        frequency_sd_hz=found.frequency_sd_hz,
        damping_ratio=found.damping_ratio,
        damping_sd=found.damping_sd,
        shape=shape,
        acceleration_m_s2=found.acceleration_m_s2,
    )


def _plane_notes(points: Sequence[ResponsePoint]) -> list[str]:
    if not any(point.plane for point in points):
        return ["no channel states its plane: all modes are taken as transverse"]
    return []


def _pair_notes(groups: Sequence[Sequence[FoundMode]]) -> list[str]:
    notes = []
    for plane, group in zip(PLANES, groups, strict=True):
        frequencies = np.array([mode.frequency_hz for mode in group])
        pairs = int(np.sum(frequencies[1:] / frequencies[:-1] - 1 < CLOSE))
        if pairs:
            notes.append(
                f"{pairs} pairs of {plane} modes are too near for one plane, so orders may be off: "
                "measure with a biaxial accelerometer"
            )
    return notes


def _order_notes(orders: Sequence[Sequence[int]]) -> list[str]:
    notes = []
    for plane, numbers in zip(PLANES, orders, strict=True):
        missing = sorted(set(range(1, max(numbers, default=0))) - set(numbers))
        if missing:
            listed = ", ".join(str(order) for order in missing)
            notes.append(f"{plane} order {listed} was not found; the others keep their numbers")
    return notes
