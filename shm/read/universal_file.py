"""UFF: force and accelerations over time, or frequency responses, as data sets of type 58.

Read in ASCII and binary (58b), written in ASCII. Places and hanger stand in the sidecar. A file of
ours, which its last id lines mark, has the names of its channels in the first ones, directions that
are planes, and its frequency step with all digits.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from datetime import UTC
from functools import cache, partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from shm.errors import BadInput, UsageError
from shm.read.atomic import replace_file
from shm.read.base import Format, PeekChannel, at_once
from shm.read.header import Entry
from shm.read.logger_heading import distinct_names
from shm.read.logger_words import SI, accelerance_si, unit_of
from shm.read.sidecar import write_sidecar
from shm.read.stamps import moment
from shm.read.table import Column, Table
from shm.read.universal_sets import (
    COHERENCE,
    FREQUENCY_RESPONSE,
    TIME_RESPONSE,
    Content,
    FunctionSet,
    load,
    recognises,
    save,
)
from shm.values import (
    NAN,
    Channel,
    ComplexArray,
    FloatArray,
    FrequencyResponse,
    Plane,
    Quantity,
    Recording,
    ResponsePoint,
)

# UC-SDRL, Universal File Formats, data set 58, records 6 to 10, and 2411
_QUANTITIES: dict[int, Quantity] = {9: "force", 12: "acceleration", 13: "force"}
_CODES: dict[Quantity, int] = {"force": 13, "acceleration": 12}
_TIME, _FREQUENCY, _EVEN, _DOUBLE = 17, 18, 1, 4
_NODES = 2411
# x runs along the hanger, so that y and z, 2 and 3, are the planes
_DIRECTIONS: dict[Plane | None, int] = {"transverse": 2, "longitudinal": 3, None: 0}
_MARK = "shm "
_STEP = "frequency_step_hz"
_SAME_STEP = 1e-4  # judgement: a step printed with six digits errs by 5e-6 at most
Values = Callable[[FunctionSet], Any]


def open_tables(path: Path) -> tuple[Table, ...]:
    """Return what a file is for: its time histories, or its frequency responses."""
    content = load(path, headers_only=True)

    @cache
    def loaded() -> tuple[FunctionSet, ...]:
        return load(path, headers_only=False).functions

    def values(found: FunctionSet) -> Any:
        return loaded()[content.functions.index(found)].data

    histories = [found for found in content.functions if found.function == TIME_RESPONSE]
    # Time histories are what a file with responses is for, where they are force and response.
    is_record = len({_quantity(found) for found in histories} - {None}) > 1
    if not is_record and any(f.function == FREQUENCY_RESPONSE for f in content.functions):
        return (_response_table(content, values, path),)
    return (_record_table(histories, content, values, path),)


def _quantity(found: FunctionSet) -> Quantity | None:
    """Return the quantity of a set by its unit, else by its type; None for any other."""
    unit = unit_of(found.unit)
    return unit.quantity if unit is not None else _QUANTITIES.get(found.quantity)


def _sign(*directions: int) -> float:
    """Return -1 where an odd number of directions is opposite to its axis, else 1."""
    return float(np.prod([-1.0 if direction < 0 else 1.0 for direction in directions]))


def _is_ours(found: FunctionSet) -> bool:
    return any(line.startswith(_MARK) for line in found.lines)


def _plane(found: FunctionSet, direction: int, path: Path) -> dict[str, Entry]:
    planes = {number: plane for plane, number in _DIRECTIONS.items()} if _is_ours(found) else {}
    return {"plane": Entry(planes.get(abs(direction)) or "", path)}


def _facts(found: FunctionSet, path: Path) -> dict[str, Entry]:
    """Return the time of the run, which the third id line gives."""
    time = moment("", found.lines[2])
    return {} if time is None else {"time": Entry(time.isoformat(), path)}


# ---------------------------------------------------------------- time histories


def _record_table(
    histories: Sequence[FunctionSet], content: Content, values: Values, path: Path
) -> Table:
    """Return all time histories; none, and why, of a file of modes alone."""
    if not histories and content.mode_count:
        refusal = BadInput(
            f"it holds {content.mode_count} modes at {content.node_count} places that another"
            " program identified, no recording.",
            file=path,
            remedy="Give `shm import FILE`: it asks for the hanger and for the planes.",
        )
        return Table(path, (), layout=("UFF",), refusal=refusal)
    columns = tuple(
        Column(
            name,
            found.points,
            partial(_signed, found, values),
            found.unit,
            "other" if _quantity(found) is None else "channel",
            {"unit": Entry(found.unit, path), **_plane(found, found.response[2], path)},
            _facts(found, path),
            1 / found.step if found.step > 0 else NAN,
            label=_label(found),
        )
        for name, found in zip(_names(histories, path), histories, strict=True)
    )
    usual = next((c for c in columns if c.role == "channel"), columns[0] if columns else None)
    same = [c for c in columns if usual and (c.size, c.rate_hz) == (usual.size, usual.rate_hz)]
    left_out = tuple(_label(found) for found in content.functions if found not in histories)
    layout = ("UFF", *(f"{c.name} [{c.unit}]" for c in same))
    return Table(path, columns, layout=layout, left_out=left_out)


def _label(found: FunctionSet) -> str:
    return f"{found.title} ({found.label or 'of another kind'})"


def _signed(found: FunctionSet, values: Values) -> FloatArray:
    signed = _sign(found.response[2]) * np.real(np.asarray(values(found)))
    return np.asarray(signed, float)


def _names(sets: Sequence[FunctionSet], path: Path) -> tuple[str, ...]:
    """Return the names of forces and accelerations, and the titles of all else."""
    measured = [found for found in sets if _quantity(found) is not None]
    known = iter(_names_of_measured(measured, path))
    return distinct_names(
        [
            next(known) if _quantity(found) is not None else found.lines[0] or found.label
            for found in sets
        ]
    )


def _names_of_measured(sets: Sequence[FunctionSet], path: Path) -> list[str]:
    """Return the names that we wrote; else force, acc_1, acc_2, ... in the order of the file."""
    names = [found.lines[0] for found in sets if _is_ours(found)]
    if len(names) == len(sets):
        _refuse_doubles(names, sets, path)
        return names
    _refuse_doubles([_sensor(found) for found in sets if found.response[1] != 0], sets, path)
    forces, accelerations = count(2), count(1)
    names = []
    for found in sets:
        if _quantity(found) == "acceleration":
            names.append(f"acc_{next(accelerations)}")
        else:
            names.append(f"force_{next(forces)}" if "force" in names else "force")
    return names


def _sensor(found: FunctionSet) -> tuple[object, ...]:
    """Return what identifies a sensor; loggers give one node to several accelerometers."""
    title = "" if _quantity(found) == "force" else found.lines[0]
    return _quantity(found), *found.response[1:], title


def _refuse_doubles(keys: Sequence[object], sets: Sequence[FunctionSet], path: Path) -> None:
    same_grid = (
        len({(found.points, found.step) for found in sets}) == 1
    )  # else it is refused for that
    if same_grid and len(set(keys)) < len(keys):
        raise BadInput(
            f"{len(sets)} time histories, several of one sensor.",
            file=path,
            remedy="Put each recording, with one or many hits, into a file of its own.",
        )


# ---------------------------------------------------------------- frequency responses


def _response_table(content: Content, values: Values, path: Path) -> Table:
    """Return the accelerances of a file, roving sensor or roving hammer; raises BadInput."""
    sets = [found for found in content.functions if found.function == FREQUENCY_RESPONSE]
    n_responses, n_references = (
        len({place[1:] for place in places})
        for places in ([f.response for f in sets], [f.reference for f in sets])
    )
    if n_responses > 1 and n_references > 1:
        raise BadInput(
            f"{n_references} hammer points and {n_responses} sensors in one file.",
            file=path,
            remedy="Export the responses to one hammer point, or of one sensor, to one file.",
        )
    names = [f.lines[0] if _is_ours(f) else f"point_{n}" for n, f in enumerate(sets, start=1)]
    if len(set(names)) < len(names):
        raise BadInput(
            "several frequency responses have one name.",
            file=path,
            remedy="Give each its own first id line.",
        )
    coherences = {
        (found.response, found.reference): found
        for found in content.functions
        if found.function == COHERENCE and found.points == sets[0].points
    }
    columns = []
    for name, found in zip(names, sets, strict=True):
        load = partial(_accelerance, found, name, values, path)
        direction = (found.reference if n_references > 1 else found.response)[2]
        columns.append(
            Column(name, found.points, load, "", "response", _plane(found, direction, path),
                   _facts(found, path), label=found.title, is_complex=True)
        )  # fmt: skip
        share = coherences.get((found.response, found.reference))
        if share is not None:
            both, shares = f"{name}_coherence", partial(_real, share, values)
            columns.append(Column(both, share.points, shares, role="coherence"))
    listed = partial(_frequencies, sets, path)
    columns.append(Column("frequency_hz", sets[0].points, listed, "Hz", "frequencies"))
    return Table(path, tuple(columns), layout=tuple(names))


def _real(found: FunctionSet, values: Values) -> FloatArray:
    return np.real(np.asarray(values(found))).astype(float)


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
    stated = re.search(rf"{_STEP}=(\S+)", found.lines[4])
    try:
        step = float(stated[1]) if stated is not None else NAN
    except ValueError:
        return found.step
    return step if abs(step - found.step) < _SAME_STEP * found.step else found.step


def _accelerance(found: FunctionSet, name: str, values: Values, path: Path) -> ComplexArray:
    factor = accelerance_si(found.unit, found.denominator_unit)
    if factor is None or (not found.unit and found.quantity != _CODES["acceleration"]):
        raise BadInput(
            f"{found.title} is {found.label or 'a response'} in {found.unit or 'no unit'} over"
            f" {found.denominator_unit or 'no unit'}, not an acceleration over a force.",
            file=path,
            channel=name,
            remedy="Export accelerances, in m/s2 or g over N, kN or lbf.",
        )
    direction = _sign(found.response[2], found.reference[2])
    signed: ComplexArray = np.asarray(values(found), complex) * complex(factor * direction)
    return signed


# ---------------------------------------------------------------- writing


def _write(described: Recording | FrequencyResponse, path: Path) -> None:
    if isinstance(described, Recording):
        sets = _sets_of_record(described)
        channels = [
            PeekChannel(c.name, c.quantity, SI[c.quantity], c.plane, c.x_m, NAN, c.full_scale)
            for c in described.channels
        ]
        rate = described.sampling_rate_hz
    else:
        sets = _sets_of_response(described)
        channels = [PeekChannel(p.name, None, "", p.plane, p.x_m) for p in described.points]
        rate = NAN
    for found in sets:
        if "data" in found and np.isnan(found["data"]).any():
            raise UsageError(
                f"UFF files cannot hold the gaps (NaN) of {found['id1']}.",
                remedy="Write a .csv file.",
            )
    write_sidecar(described, channels, rate, path)
    replace_file(path, lambda temporary: save(temporary, sets))


_EACH = {
    "type": 58, "id2": "hammer test of a hanger", "id4": "NONE", "ref_node": 0, "ref_dir": 0,
    "abscissa_spacing": _EVEN,
}  # fmt: skip
_OVER_TIME = {
    "func_type": TIME_RESPONSE, "ord_data_type": _DOUBLE, "abscissa_spec_data_type": _TIME,
    "abscissa_axis_lab": "Time", "abscissa_axis_units_lab": "s", "orddenom_spec_data_type": 0,
}  # fmt: skip
_OVER_FREQUENCY = {
    "func_type": FREQUENCY_RESPONSE, "abscissa_spec_data_type": _FREQUENCY,
    "abscissa_axis_lab": "Frequency", "abscissa_axis_units_lab": "Hz",
    "orddenom_spec_data_type": _CODES["force"], "orddenom_axis_lab": "Force",
    "orddenom_axis_units_lab": SI["force"],
}  # fmt: skip
_SHARE = {
    "func_type": COHERENCE, "ordinate_spec_data_type": 0, "ordinate_axis_units_lab": "NONE",
}  # fmt: skip


def _sets_of_record(recording: Recording) -> list[dict[str, Any]]:
    times = np.arange(recording.samples) / recording.sampling_rate_hz
    channels, common = recording.channels, _common(recording, recording.channels)
    return [
        *_node_set(channels),
        *(
            {**each, **_OVER_TIME, **_measured(c.quantity), "x": times, "data": c.values.copy()}
            for c, each in zip(channels, common, strict=True)
        ),
    ]


def _sets_of_response(response: FrequencyResponse) -> list[dict[str, Any]]:
    sets = _node_set(response.points)
    step = f" {_STEP}={float(response.frequency_hz[1] - response.frequency_hz[0])}"
    over = {**_OVER_FREQUENCY, **_measured("acceleration"), "x": response.frequency_hz}
    for row, each in enumerate(_common(response, response.points, step)):
        sets.append({**each, **over, "data": response.accelerance[row]})
        if response.coherence is not None:
            sets.append({**each, **over, **_SHARE, "data": response.coherence[row].copy()})
    return sets


def _measured(quantity: Quantity) -> dict[str, Any]:
    return {
        "ordinate_spec_data_type": _CODES[quantity],
        "ordinate_axis_lab": quantity.title(),
        "ordinate_axis_units_lab": SI[quantity],
    }


def _common(
    described: Recording | FrequencyResponse,
    points: Sequence[Channel | ResponsePoint],
    more: str = "",
) -> list[dict[str, Any]]:
    """Return what the sets of channels or points begin with."""
    time = described.time
    date = f"{time.astimezone(UTC):%d-%b-%y %H:%M:%S}" if time else "NONE"
    stated = {**_EACH, "id3": date, "id5": f"{_MARK}format=1{more}"}
    return [
        {
            **stated,
            "id1": point.name,
            "rsp_ent_name": point.name[:10],
            "rsp_node": node,
            "rsp_dir": _DIRECTIONS[point.plane],
        }
        for point, node in zip(points, _nodes(points), strict=True)
    ]


def _nodes(points: Sequence[Channel | ResponsePoint]) -> list[int]:
    """Return a node number for each place, the same for equal places, from 1."""
    numbers: dict[object, int] = {}
    keys = [("unknown", i) if math.isnan(p.x_m) else p.x_m for i, p in enumerate(points)]
    return [numbers.setdefault(key, len(numbers) + 1) for key in keys]


def _node_set(points: Sequence[Channel | ResponsePoint]) -> list[dict[str, Any]]:
    """Return the data set of nodes whose place is known; none where no place is."""
    known = {
        node: point.x_m
        for point, node in zip(points, _nodes(points), strict=True)
        if not math.isnan(point.x_m)
    }
    zeros = [0] * len(known)
    nodes = {"type": _NODES, "node_nums": list(known), "x": list(known.values())}
    others = ("def_cs", "disp_cs", "color", "y", "z")
    return [{**nodes, **dict.fromkeys(others, zeros)}] if known else []


FORMAT = Format(
    "UFF",
    (".uff", ".unv", ".uf"),
    recognises,
    at_once(open_tables),
    write=_write,
    may_be_gzipped=True,
    library="pyuff",
)
