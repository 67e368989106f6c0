"""What our own UFF files say in places that the format leaves free, and node numbers.

The first id line holds the channel's name; id lines that begin with `shm` hold `key=value` pairs.
In such files the x axis runs along the hanger, y is transverse and z longitudinal, and nodes
(type 2411) hold the places of sensors. Files of others say none of this: their sidecar must.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from shm.documents import format_time
from shm.read.header import KEYS, Entry, mass_entries
from shm.read.universal_sets import Content, FunctionSet
from shm.values import FrequencyResponse, Plane, Recording

_MARK = "shm"
_NODES = 2411
_AXES: dict[int, Plane] = {2: "transverse", 3: "longitudinal"}
_DIRECTIONS: dict[Plane | None, int] = {"transverse": 2, "longitudinal": 3, None: 0}
_MONTHS = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"]


def facts(found: FunctionSet) -> dict[str, str]:
    """The pairs of a set's id lines; empty for files of others."""
    words = [word for line in found.lines if line.startswith(f"{_MARK} ") for word in line.split()]
    return dict(word.split("=", 1) for word in words if "=" in word)


def entries(found: FunctionSet, path: Path) -> dict[str, Entry]:
    """Hanger, time, temperature and sampling rate, as far as a set says them."""
    own = {key: Entry(value, path) for key, value in facts(found).items() if key in KEYS}
    moment = _date(found.lines[2])
    if "time" in own or moment is None:
        return own
    return {**own, "time": Entry(moment.isoformat(), path)}


def channel_entries(
    found: FunctionSet, node: int, direction: int, content: Content, path: Path
) -> dict[str, Entry]:
    """Unit, and in our own files place and plane, of the set at a node."""
    said: dict[str, Any] = {"unit": found.unit}
    if facts(found):
        said["plane"] = _AXES.get(abs(direction), "")
        said["x_m"] = content.nodes[node][0] if node in content.nodes else ""
    return {key: Entry(value, path) for key, value in said.items()}


def sign(*directions: int) -> float:
    """-1 where an odd number of directions runs against its axis."""
    return float(np.prod([-1.0 if direction < 0 else 1.0 for direction in directions]))


def id_lines(
    described: Recording | FrequencyResponse, name: str, own: dict[str, float]
) -> dict[str, str]:
    """The id lines of a set of ours."""
    time = described.time
    moment = [f"time={format_time(time)}"] if time else []
    moment += [f"{key}={value:g}" for key, value in mass_entries(described.added_mass).items()]
    known = {"hanger": described.hanger, "temperature_c": described.temperature_c, **own}
    pairs = [f"{key}={value}" for key, value in known.items() if _is_known(value)]
    return {
        "id1": name,
        "id2": "hammer test of a hanger",
        "id3": _date_text(time) if time else "NONE",
        "id4": " ".join([_MARK, *moment]) if moment else "NONE",
        "id5": " ".join([_MARK, "format=1", *pairs]),
    }


def _is_known(value: float | None) -> bool:
    return value is not None and not math.isnan(value)


def direction(plane: Plane | None) -> int:
    return _DIRECTIONS[plane]


def number_nodes(places_m: Sequence[float]) -> list[int]:
    """A node number for each place, the same for equal places, from 1."""
    numbers: dict[object, int] = {}
    keys = [("unknown", i) if math.isnan(x) else x for i, x in enumerate(places_m)]
    return [numbers.setdefault(key, len(numbers) + 1) for key in keys]


def node_set(places_m: Sequence[float], nodes: Sequence[int]) -> list[dict[str, Any]]:
    """The data set of nodes whose place is known; none where no place is."""
    known = {node: x for node, x in zip(nodes, places_m, strict=True) if not math.isnan(x)}
    if not known:
        return []
    zeros = [0] * len(known)
    return [
        {
            "type": _NODES,
            "node_nums": list(known),
            "def_cs": zeros,
            "disp_cs": zeros,
            "color": zeros,
            "x": list(known.values()),
            "y": zeros,
            "z": zeros,
        }
    ]


def _date(text: str) -> datetime | None:
    """A date such as 18-Apr-16 13:49:58, taken as UTC; None for any other text."""
    day, _, clock = text.partition(" ")
    parts = day.split("-")
    if len(parts) != 3 or parts[1].title() not in _MONTHS:
        return None
    month = _MONTHS.index(parts[1].title()) + 1
    try:
        year = int(parts[2]) + (2000 if len(parts[2]) == 2 else 0)
        hour, minute, second = (int(part) for part in clock.strip().split(":"))
        return datetime(year, month, int(parts[0]), hour, minute, second, tzinfo=UTC)
    except (ValueError, OverflowError):
        return None


def _date_text(time: datetime) -> str:
    utc = time.astimezone(UTC)
    return f"{utc:%d}-{_MONTHS[utc.month - 1]}-{utc:%y %H:%M:%S}"
