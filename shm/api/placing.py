"""Planes and places of channels that a caller of `shm.read` knows and the file does not say."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from numbers import Real
from typing import Any, TypeAlias, TypeVar, get_args

from shm.errors import UsageError
from shm.values import Channel, FrequencyResponse, Plane, Recording, ResponsePoint

Planes: TypeAlias = Plane | Mapping[str, Plane] | None
Places: TypeAlias = float | Mapping[str, float] | None
Units: TypeAlias = Mapping[str, str] | None
"""By the names of channels, or one for all accelerations."""
Placed = TypeVar("Placed", Channel, ResponsePoint)


def with_places(
    record: Recording | FrequencyResponse, planes: Planes, places_m: Places
) -> Recording | FrequencyResponse:
    """Return a record with planes and places in m from the deck end; raises UsageError."""
    if isinstance(record, Recording):
        known = {each.name for each in record.channels}
        moved = {each.name for each in record.accelerations}
        given = _by_name(known, moved, planes, places_m)
        return replace(record, channels=_placed(record.channels, *given))
    names = {each.name for each in record.points}
    given = _by_name(names, names, planes, places_m)
    return replace(record, points=_placed(record.points, *given))


def check_units(units: object) -> None:
    """Raise UsageError for units that are not given by the names of channels."""
    if units is not None and not isinstance(units, Mapping):
        raise UsageError(
            f"units is {units!r}, which does not say what belongs to which channel.",
            remedy='Give them by the names of the channels: units={"force": "kN", "acc_1": "g"}.',
        )


def _by_name(
    known: set[str], moved: set[str], planes: Planes, places_m: Places
) -> tuple[dict[str, Plane], dict[str, float]]:
    by_plane = _spread(planes, known, moved, "planes")
    allowed = get_args(Plane)
    wrong = next((each for each in by_plane.values() if each not in allowed), None)
    if wrong is not None:
        raise UsageError(f"{wrong!r} is no plane.", remedy=f"Planes: {', '.join(allowed)}.")
    by_place = _spread(places_m, known, moved, "places_m")
    for name, place_m in by_place.items():
        if not isinstance(place_m, Real) or place_m < 0 or math.isinf(place_m):
            raise UsageError(
                f"places_m puts {name} at {place_m!r}, which is no distance from the deck end.",
                remedy=f'Give metres from the deck end: places_m={{"{name}": 2.5}}.',
            )
    return by_plane, by_place


def _spread(given: Any, known: set[str], moved: set[str], what: str) -> dict[str, Any]:
    """Return what is given by channel; one value is that of all that move."""
    if given is None:
        return {}
    if isinstance(given, Sequence | Set) and not isinstance(given, str):
        name, value = min(moved or known), "2.5" if what == "places_m" else '"transverse"'
        raise UsageError(
            f"{what} is a list, which does not say what belongs to which channel.",
            remedy=f'Give it by the names of the channels, {what}={{"{name}": {value}, ...}}, '
            f"or one value for all accelerations. The channels are {', '.join(sorted(known))}.",
        )
    if not isinstance(given, Mapping):
        return dict.fromkeys(sorted(moved), given)
    if unknown := sorted(set(given) - known):
        raise UsageError(
            f"{what} names the channel {unknown[0]!r}, which the file does not have.",
            remedy=f"Its channels are {', '.join(sorted(known))}.",
        )
    return dict(given)


def _placed(
    points: Sequence[Placed], planes: Mapping[str, Plane], places_m: Mapping[str, float]
) -> tuple[Placed, ...]:
    return tuple(
        replace(
            each,
            plane=planes.get(each.name, each.plane),
            x_m=float(places_m.get(each.name, each.x_m)),
        )
        for each in points
    )
