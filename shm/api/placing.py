"""Planes and places of channels that a caller of `shm.read` knows and the file does not say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias, TypeVar, get_args

from shm.errors import UsageError
from shm.values import Channel, FrequencyResponse, Plane, Recording, ResponsePoint

Planes: TypeAlias = Plane | Mapping[str, Plane] | None
Places: TypeAlias = float | Mapping[str, float] | None
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


def _by_name(
    known: set[str], moved: set[str], planes: Planes, places_m: Places
) -> tuple[dict[str, Plane], dict[str, float]]:
    by_plane = _spread(planes, known, moved, "planes")
    allowed = get_args(Plane)
    wrong = next((each for each in by_plane.values() if each not in allowed), None)
    if wrong is not None:
        raise UsageError(f"{wrong!r} is no plane.", remedy=f"Planes: {', '.join(allowed)}.")
    return by_plane, _spread(places_m, known, moved, "places_m")


def _spread(given: Any, known: set[str], moved: set[str], what: str) -> dict[str, Any]:
    """Return what is given by channel; one value is that of all that move."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        return dict.fromkeys(moved, given)
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
