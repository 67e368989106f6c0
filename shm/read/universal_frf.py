"""Frequency responses of a UFF file and `FrequencyResponse`, each made from the other.

Our own files say more in places that the format leaves free: the first id line holds the channel's
name; id lines that begin with `shm` hold `key=value` pairs. In such files the x axis runs along the
hanger, y is transverse and z longitudinal, and nodes (type 2411) hold the places of sensors. Files
of others say none of this: their sidecar must.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from shm.documents import format_time
from shm.errors import BadInput
from shm.read.header import KEYS, Entry, mass_entries
from shm.read.logger_words import accelerance_si
from shm.read.table import Column, Table
from shm.read.universal_sets import COHERENCE, FREQUENCY_RESPONSE, Content, FunctionSet
from shm.values import (
    ComplexArray,
    FloatArray,
    FrequencyResponse,
    Plane,
    Recording,
)

# UC-SDRL, Universal File Formats, data set 58, records 7 to 10
_ACCELERATION, _EXCITATION, _FREQUENCY, _EVEN = 12, 13, 18, 1
_STEP = "frequency_step_hz"
_SAME_STEP = 1e-4  # judgement: a step printed with six digits errs by 5e-6 at most
_MARK = "shm"
# Data set 2411; x runs along the hanger, so that y and z, 2 and 3, are the planes
_NODES = 2411
_AXES: dict[int, Plane] = {2: "transverse", 3: "longitudinal"}
_DIRECTIONS: dict[Plane | None, int] = {"transverse": 2, "longitudinal": 3, None: 0}
_MONTHS = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"]


def response_sets(content: Content) -> list[FunctionSet]:
    return [found for found in content.functions if found.function == FREQUENCY_RESPONSE]


def table_in(content: Content, values: Callable[[FunctionSet], Any], path: Path) -> Table:
    """Return the accelerances of a file, roving sensor or roving hammer; raises BadInput."""
    sets = response_sets(content)
    points = _points(sets, content, path)
    coherences = {
        (found.response, found.reference): found
        for found in content.functions
        if found.function == COHERENCE and found.points == sets[0].points
    }
    columns = []
    for found, (name, entries_of) in zip(sets, points.items(), strict=True):
        load = partial(_accelerance, found, name, values, path)
        facts_of, title = entries(found, path), found.title
        columns.append(
            Column(name, found.points, load, "", "response", entries_of, facts_of, label=title,
                   is_complex=True)
        )  # fmt: skip
        share = coherences.get((found.response, found.reference))
        if share is not None:
            both, shares = f"{name}_coherence", partial(_real, share, values)
            columns.append(Column(both, share.points, shares, "", "coherence"))
    listed = partial(_frequencies, sets, path)
    columns.append(Column("frequency_hz", sets[0].points, listed, "Hz", "frequencies"))
    return Table(path, tuple(columns), layout=tuple(points))


def _real(found: FunctionSet, values: Callable[[FunctionSet], Any]) -> FloatArray:
    return np.real(np.asarray(values(found))).astype(float)


def sets_of(response: FrequencyResponse) -> list[dict[str, Any]]:
    """Return the data sets of frequency responses, and their coherences, for pyuff."""
    places = [point.x_m for point in response.points]
    nodes = number_nodes(places)
    sets = node_set(places, nodes)
    for index, node in enumerate(nodes):
        facts = _set(response, index, node)
        sets.append({**facts, "func_type": FREQUENCY_RESPONSE, "data": response.accelerance[index]})
        if response.coherence is not None:
            share = {"ordinate_axis_units_lab": "NONE", "ordinate_spec_data_type": 0}
            data = response.coherence[index].copy()
            sets.append({**facts, **share, "func_type": COHERENCE, "data": data})
    return sets


def _set(response: FrequencyResponse, index: int, node: int) -> dict[str, Any]:
    point = response.points[index]
    step = float(response.frequency_hz[1] - response.frequency_hz[0])
    return {
        **id_lines(response, point.name, {_STEP: step}),
        "type": 58,
        "rsp_ent_name": point.name[:10],
        "rsp_node": node,
        "rsp_dir": direction(point.plane),
        "ref_node": 0,
        "ref_dir": 0,
        "abscissa_spacing": _EVEN,
        "abscissa_spec_data_type": _FREQUENCY,
        "abscissa_axis_lab": "Frequency",
        "abscissa_axis_units_lab": "Hz",
        "ordinate_spec_data_type": _ACCELERATION,
        "ordinate_axis_lab": "Acceleration",
        "ordinate_axis_units_lab": "m/s2",
        "orddenom_spec_data_type": _EXCITATION,
        "orddenom_axis_lab": "Force",
        "orddenom_axis_units_lab": "N",
        "x": response.frequency_hz,
    }


def _points(
    sets: Sequence[FunctionSet], content: Content, path: Path
) -> dict[str, dict[str, Entry]]:
    """Return the points: where the response was measured or, where that stays, where was hit."""
    responses, references = (
        {found.response[1:] for found in sets},
        {found.reference[1:] for found in sets},
    )
    if len(responses) > 1 and len(references) > 1:
        raise BadInput(
            f"{len(references)} hammer points and {len(responses)} sensors in one file.",
            file=path,
            remedy="Export the responses to one hammer point, or of one sensor, to one file.",
        )
    roving_hammer = len(references) > 1
    channels = {}
    for number, found in enumerate(sets, start=1):
        name = found.lines[0] if facts(found) else f"point_{number}"
        _, node, direction = found.reference if roving_hammer else found.response
        entries = channel_entries(found, node, direction, content, path)
        channels[name] = {key: entry for key, entry in entries.items() if key != "unit"}
    if len(channels) < len(sets):
        raise BadInput(
            "several frequency responses have one name.",
            file=path,
            remedy="Give each its own first id line.",
        )
    return channels


def _frequencies(sets: Sequence[FunctionSet], path: Path) -> FloatArray:
    """Return the frequencies of all lines, in Hz; raises BadInput where the sets differ."""
    first = sets[0]
    for found in sets:
        if (found.points, found.first, found.step) != (first.points, first.first, first.step):
            raise BadInput(
                f"{found.title} has other frequencies than {first.title}.",
                file=path,
                remedy="Export all responses over the same lines.",
            )
    return first.first + _step(first) * np.arange(first.points, dtype=float)


def _step(found: FunctionSet) -> float:
    """Return the step in Hz, with all its digits where the file is ours."""
    try:
        step = float(facts(found).get(_STEP, math.nan))
    except ValueError:
        return found.step
    return step if abs(step - found.step) < _SAME_STEP * found.step else found.step


def _accelerance(
    found: FunctionSet, name: str, values: Callable[[FunctionSet], Any], path: Path
) -> ComplexArray:
    factor = accelerance_si(found.unit, found.denominator_unit)
    if factor is None or (not found.unit and found.quantity != _ACCELERATION):
        raise BadInput(
            f"{found.title} is {found.label or 'a response'} in {found.unit or 'no unit'} over"
            f" {found.denominator_unit or 'no unit'}, not an acceleration over a force.",
            file=path,
            channel=name,
            remedy="Export accelerances, in m/s2 or g over N, kN or lbf.",
        )
    direction = sign(found.response[2], found.reference[2])
    signed: ComplexArray = np.asarray(values(found), complex) * complex(factor * direction)
    return signed


def facts(found: FunctionSet) -> dict[str, str]:
    """Return the pairs of a set's id lines; empty for files of others."""
    words = [word for line in found.lines if line.startswith(f"{_MARK} ") for word in line.split()]
    return dict(word.split("=", 1) for word in words if "=" in word)


def entries(found: FunctionSet, path: Path) -> dict[str, Entry]:
    """Return hanger, time, temperature and sampling rate, as far as a set gives them."""
    listed = {key: Entry(value, path) for key, value in facts(found).items() if key in KEYS}
    moment = _date(found.lines[2])
    if "time" in listed or moment is None:
        return listed
    return {**listed, "time": Entry(moment.isoformat(), path)}


def channel_entries(
    found: FunctionSet, node: int, direction: int, content: Content, path: Path
) -> dict[str, Entry]:
    """Return the unit, and in our files position and plane, of the set at a node."""
    entries: dict[str, Any] = {"unit": found.unit}
    if facts(found):
        entries["plane"] = _AXES.get(abs(direction), "")
        entries["x_m"] = content.nodes[node][0] if node in content.nodes else ""
    return {key: Entry(value, path) for key, value in entries.items()}


def sign(*directions: int) -> float:
    """Return -1 where an odd number of directions is opposite to its axis, else 1."""
    return float(np.prod([-1.0 if direction < 0 else 1.0 for direction in directions]))


def id_lines(
    described: Recording | FrequencyResponse, name: str, facts: dict[str, float]
) -> dict[str, str]:
    """Return the id lines of a set of ours, none longer than 80 characters."""
    time = described.time
    moment = [f"time={format_time(time)}"] if time else []
    mass = [f"{key}={value:g}" for key, value in mass_entries(described.added_mass).items()]
    size_and_place, radius = mass[:2], mass[2:]
    moment += size_and_place
    known = {"hanger": described.hanger, "temperature_c": described.temperature_c, **facts}
    pairs = [f"{key}={value}" for key, value in known.items() if _is_known(value)]
    return {
        "id1": name,
        "id2": " ".join([_MARK, *radius]) if radius else "hammer test of a hanger",
        "id3": _date_text(time) if time else "NONE",
        "id4": " ".join([_MARK, *moment]) if moment else "NONE",
        "id5": " ".join([_MARK, "format=1", *pairs]),
    }


def _is_known(value: float | None) -> bool:
    return value is not None and not math.isnan(value)


def direction(plane: Plane | None) -> int:
    return _DIRECTIONS[plane]


def number_nodes(places_m: Sequence[float]) -> list[int]:
    """Return a node number for each place, the same for equal places, from 1."""
    numbers: dict[object, int] = {}
    keys = [("unknown", i) if math.isnan(x) else x for i, x in enumerate(places_m)]
    return [numbers.setdefault(key, len(numbers) + 1) for key in keys]


def node_set(places_m: Sequence[float], nodes: Sequence[int]) -> list[dict[str, Any]]:
    """Return the data set of nodes whose place is known; none where no place is."""
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
    """Return a date such as 18-Apr-16 13:49:58, taken as UTC; None for any other text."""
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
