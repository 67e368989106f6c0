"""Gives found modes their plane and order, and sets aside what is no mode of the hanger.

Modes that stand for one of each plane because the two were not told apart.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from shm.identify.contract import FoundMode, Tone
from shm.identify.mode_ordering.alignment import PlaneModes
from shm.identify.mode_ordering.non_bending_modes import doubts, explained, without_tones
from shm.identify.mode_ordering.order import Expected, Numbering, assign_orders
from shm.identify.mode_ordering.planes import (
    CLOSE,
    is_close,
    planes_of,
    principal_angle,
    sd_in_plane,
    shape_points,
    transverse_share,
)
from shm.values import NAN, PLANES, ForeignMode, Hanger, Mode, Plane, ResponsePoint, ShapePoint

_NOTED_DEGREES = 5.0  # judgement: a sensor clamped on by eye; it sees 0.8 % of the other plane


@dataclass(frozen=True)
class Placement:
    """The hanger's modes plane by plane, what is not one of them, and what was decided."""

    modes: tuple[Mode, ...]
    set_aside: tuple[ForeignMode, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A found mode in the plane where it may have an order."""

    found: FoundMode
    plane: Plane
    shape: tuple[ShapePoint, ...]
    shape_sd: float
    doubt: float


_Ordered: TypeAlias = tuple[_Candidate, int, bool]
"""Candidate, order, and whether that is off the beam of the others."""


def placed(
    found: Sequence[FoundMode],
    points: Sequence[ResponsePoint],
    hanger: Hanger | None,
    tones: Sequence[Tone] = (),
) -> Placement:
    """The modes with plane, order and shape by position; `tones` are known to be there anyway."""
    found, steady = without_tones(found, tones)
    turned_rad = principal_angle(found, points)
    groups = _candidates(found, points, turned_rad)
    known = hanger if hanger and hanger.as_hanger else None
    length_m = known.length_m if known else NAN
    numbering = assign_orders(
        [_plane_modes(group, length_m) for group in groups],
        Expected.of(known) if known else None,
    )
    ordered = [
        (candidate, order, irregular and order == 1)
        for group, orders, irregular in zip(
            groups, numbering.orders, numbering.irregular, strict=True
        )
        for candidate, order in zip(group, orders, strict=True)
        if order is not None
    ]
    kept = [candidate.found for candidate, *_ in ordered]
    pairs = [mode for mode in found if sum(each is mode for each in kept) == len(PLANES)]
    aside = [mode for mode in found if not any(each is mode for each in kept)]
    return Placement(
        modes=tuple(_mode(*each, pairs) for each in ordered),
        set_aside=_by_frequency([*steady, *(explained(mode, found, kept) for mode in aside)]),
        notes=(
            *_plane_notes(points, turned_rad),
            *(pair_note(mode) for mode in pairs),
            *_near_notes(groups, points),
            *_support_notes(hanger),
            *_basis_notes(numbering, known, points),
            *_order_notes(ordered),
            *_irregular_notes(ordered),
        ),
    )


def _candidates(
    found: Sequence[FoundMode], points: Sequence[ResponsePoint], turned_rad: float
) -> list[list[_Candidate]]:
    """Those of each plane; a mode that may be one of each is in both."""
    doubt = {id(mode): value for mode, value in zip(found, doubts(found), strict=True)}
    planes = planes_of(found, points, turned_rad)
    pairs = list(zip(*with_both_planes(found, planes, points, turned_rad), strict=True))
    return [
        [
            _Candidate(
                mode,
                plane,
                shape_points(mode, plane, points),
                sd_in_plane(mode, plane, points),
                float(doubt[id(mode)]),
            )
            for mode, own in pairs
            if own == plane
        ]
        for plane in PLANES
    ]


def _plane_modes(group: Sequence[_Candidate], length_m: float) -> PlaneModes:
    shapes = [candidate.shape for candidate in group]
    position = np.array([point.x_m for point in shapes[0]] if shapes else [])
    values = np.array([[point.value for point in shape] for shape in shapes])
    values = values.reshape(len(group), len(position))
    seen = np.all(np.isfinite(values), axis=0) & bool(np.isfinite(length_m))
    return PlaneModes(
        frequency_hz=np.array([candidate.found.frequency_hz for candidate in group]),
        position=position[seen] / length_m,
        shapes=values[:, seen],
        shape_sd=np.array([candidate.shape_sd for candidate in group]),
        doubt=np.array([candidate.doubt for candidate in group]),
    )


def _mode(candidate: _Candidate, order: int, irregular: bool, pairs: Sequence[FoundMode]) -> Mode:
    found = candidate.found
    if any(found is pair for pair in pairs):
        found = blurred(found)
    return Mode(
        plane=candidate.plane,
        order=order,
        frequency_hz=found.frequency_hz,
        frequency_sd_hz=found.frequency_sd_hz,
        damping_ratio=found.damping_ratio,
        damping_sd=found.damping_sd,
        shape=candidate.shape,
        acceleration_m_s2=found.acceleration_m_s2,
        irregular=irregular,
        amplitude_slope=found.amplitude_slope,
        amplitude_slope_sd=found.amplitude_slope_sd,
    )


def _by_frequency(modes: Sequence[ForeignMode]) -> tuple[ForeignMode, ...]:
    return tuple(sorted(modes, key=lambda mode: mode.frequency_hz))


def _plane_notes(points: Sequence[ResponsePoint], turned_rad: float) -> list[str]:
    if not any(point.plane for point in points):
        return ["no channel states its plane: all modes are taken as transverse"]
    degrees = abs(math.degrees(turned_rad))
    if degrees >= _NOTED_DEGREES:
        return [
            f"the hanger's planes are turned by {degrees:.0f} degrees from the sensors' axes: each "
            "mode has the name of the nearer plane"
        ]
    return []


def _near_notes(
    groups: Sequence[Sequence[_Candidate]], points: Sequence[ResponsePoint]
) -> list[str]:
    if all(any(point.plane == plane for point in points) for plane in PLANES):
        return []
    notes = []
    for plane, group in zip(PLANES, groups, strict=True):
        frequencies = np.array([candidate.found.frequency_hz for candidate in group])
        pairs = int(np.sum(frequencies[1:] / frequencies[:-1] - 1 < CLOSE))
        if pairs:
            notes.append(
                f"{pairs} pairs of {plane} modes are too near for one plane, so one of each is set "
                "aside, which may be the wrong one: measure with a biaxial accelerometer"
            )
    return notes


def _support_notes(hanger: Hanger | None) -> list[str]:
    if hanger is None or hanger.as_hanger:
        return []
    return [
        "the hanger is not clamped at both ends and in tension: its description does not help to "
        "number the modes"
    ]


def _basis_notes(
    numbering: Numbering, hanger: Hanger | None, points: Sequence[ResponsePoint]
) -> list[str]:
    if numbering.basis == "counting":
        return ["the modes fit no tensioned beam: they are counted, so orders may be off"]
    if hanger and numbering.basis == "pattern":
        return [
            "the modes do not fit the hanger's description: they are numbered by the pattern of "
            "their frequencies alone"
        ]
    if hanger and not any(np.isfinite(point.x_m) for point in points):
        return ["no sensor states its position: shapes do not help to number the modes"]
    return []


def _order_notes(ordered: Sequence[_Ordered]) -> list[str]:
    notes = []
    for plane in PLANES:
        numbers = [order for candidate, order, _ in ordered if candidate.plane == plane]
        missing = sorted(set(range(1, max(numbers, default=0))) - set(numbers))
        if missing:
            listed = ", ".join(str(order) for order in missing)
            notes.append(f"{plane} order {listed} was not found; the others keep their numbers")
    return notes


def _irregular_notes(ordered: Sequence[_Ordered]) -> list[str]:
    return [
        f"{candidate.plane} order {order}, {candidate.found.frequency_hz:.2f} Hz, is well off the "
        "beam that the other orders follow, as if the hanger sagged or had lost section: no "
        "tension is inferred from it; ask `shm gap diagnose` for the cause"
        for candidate, order, irregular in ordered
        if irregular
    ]


LEAST_SHARE = 0.15
"""Of the energy that a mode must have in its weaker plane to stand for both."""
BLUR = 0.1
"""Of the bandwidth: what is not resolved over several hits lies nearer than 0.15 of it (measured:
71 pairs in heavy noise, damping 0.1 to 1 %; the errors' root mean square was 0.035)."""


def with_both_planes(
    modes: Sequence[FoundMode],
    planes: Sequence[Plane],
    points: Sequence[ResponsePoint],
    turned_rad: float = 0.0,
) -> tuple[list[FoundMode], list[Plane]]:
    """`modes` and their `planes` with each mode that may be an unresolved pair in either plane.

    Two modes much nearer than their half-power bandwidth may ring down as one, in the direction of
    the hammer. A mode with a near neighbour is no such pair. `turned_rad`: see `transverse_share`.
    """
    both: list[tuple[FoundMode, Plane]] = []
    single = bool(set(PLANES) - {point.plane for point in points})
    for mode, plane in zip(modes, planes, strict=True):
        twice = not single and _stands_for_both(mode, modes, points, turned_rad)
        both += [(mode, each) for each in PLANES] if twice else [(mode, plane)]
    return [mode for mode, _ in both], [plane for _, plane in both]


def _stands_for_both(
    mode: FoundMode, modes: Sequence[FoundMode], points: Sequence[ResponsePoint], turned_rad: float
) -> bool:
    share = transverse_share(mode.shape, points, turned_rad)
    alone = not any(
        is_close(mode.frequency_hz, other.frequency_hz) for other in modes if other is not mode
    )
    return alone and LEAST_SHARE <= share <= 1 - LEAST_SHARE


def blurred(mode: FoundMode) -> FoundMode:
    """An unresolved pair's mode: either of the two has its frequency to a tenth of the bandwidth.

    That part of twice damping ratio times frequency is added to the standard deviation.
    """
    bandwidth = 2 * mode.damping_ratio * mode.frequency_hz
    sd = float(np.hypot(np.nan_to_num(mode.frequency_sd_hz), BLUR * bandwidth))
    return replace(mode, frequency_sd_hz=sd)


def pair_note(mode: FoundMode) -> str:
    """What a reader should know of an unresolved pair."""
    return (
        f"the mode at {mode.frequency_hz:.2f} Hz moves in both planes: it stands for one of each, "
        "uncertain by a tenth of its bandwidth"
    )
