"""UFF: force and accelerations over time, or frequency responses, as data sets of type 58.

Read in ASCII and binary (58b), written in ASCII. Places, planes and hanger stand in the sidecar;
our own files also say them in id lines and nodes.

Time histories of a UFF file and recordings, each made from the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from shm.errors import BadInput, UsageError
from shm.read import assemble, universal_frf
from shm.read.atomic import replace_file
from shm.read.base import Format, LoggerColumn, LoggerTable, Peek, PeekChannel
from shm.read.header import Header
from shm.read.logger_heading import unlike
from shm.read.logger_words import SI, unit_of
from shm.read.sidecar import channels_described, with_sidecar, write_sidecar
from shm.read.universal_sets import TIME_RESPONSE, Content, FunctionSet, load, recognises, save
from shm.values import NAN, FloatArray, FrequencyResponse, Quantity, Recording


def _read(path: Path) -> Recording | FrequencyResponse:
    content = load(path, headers_only=False)
    if _holds_responses(content):
        return universal_frf.frequency_response(content, path)
    return recording(content, path)


def _peek(path: Path) -> Peek:
    content = load(path, headers_only=True)
    if _holds_responses(content):
        return universal_frf.peek(content, FORMAT.name, path)
    return peek(content, FORMAT.name, path)


def _holds_responses(content: Content) -> bool:
    """Whether frequency responses are what the file is for: time histories go first if whole."""
    measured = {quantity(found) for found in time_sets(content)}
    return bool(universal_frf.response_sets(content)) and len(measured) < 2


def _write(described: Recording | FrequencyResponse, path: Path) -> None:
    if isinstance(described, Recording):
        sets = sets_of(described)
        channels = [
            PeekChannel(c.name, c.quantity, SI[c.quantity], c.plane, c.x_m, NAN, c.full_scale)
            for c in described.channels
        ]
        rate = described.sampling_rate_hz
    else:
        sets = universal_frf.sets_of(described)
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


def _table(path: Path) -> LoggerTable | None:
    """The time histories, with those that are neither a force nor an acceleration."""
    content = load(path, headers_only=False)
    every, sets = histories(content), time_sets(content) or histories(content)
    if _holds_responses(content) or not sets:
        return None
    _refuse_different(sets, path)
    columns = tuple(
        LoggerColumn(name, found.unit, _real(found))
        for name, found in zip(_names(every, path), every, strict=True)
        if (found.points, found.step) == (sets[0].points, sets[0].step)
    )
    layout = ("UFF", *(f"{c.name} [{c.unit}]" for c in columns))
    rate, header = _rate(sets), _header(_used(content, path), content, path)
    return LoggerTable(columns, rate, NAN, header.hanger, None, NAN, 0, layout, (), False)


FORMAT = Format(
    name="UFF",
    library="pyuff",
    suffixes=(".uff", ".unv", ".uf"),
    recognises=recognises,
    peek=_peek,
    read=_read,
    write=_write,
    may_be_gzipped=True,
    table=_table,
)


# UC-SDRL, Universal File Formats, data set 58, records 7 to 10
_QUANTITIES: dict[int, Quantity] = {9: "force", 12: "acceleration", 13: "force"}
_CODES: dict[Quantity, int] = {"force": 13, "acceleration": 12}
_TIME, _EVEN, _DOUBLE = 17, 1, 4


def histories(content: Content) -> list[FunctionSet]:
    """The sets over time, whatever they hold."""
    return [found for found in content.functions if found.function == TIME_RESPONSE]


def time_sets(content: Content) -> list[FunctionSet]:
    """The sets that hold a force or an acceleration over time."""
    return [found for found in histories(content) if quantity(found) is not None]


def _used(content: Content, path: Path) -> dict[str, FunctionSet]:
    """Those, and what the sidecar says to be one, by name."""
    described, sets = channels_described(path), histories(content)
    named = zip(_names(sets, path), sets, strict=True)
    return {n: found for n, found in named if quantity(found) is not None or n in described}


def quantity(found: FunctionSet) -> Quantity | None:
    """What a set measures, by its unit or else by its type; None for anything else."""
    unit = unit_of(found.unit)
    return unit.quantity if unit is not None else _QUANTITIES.get(found.quantity)


def recording(content: Content, path: Path) -> Recording:
    _refuse_different(time_sets(content), path)
    used = _used(content, path)
    sets = list(used.values())
    if not sets:
        _refuse_modes(content, path)
        assemble.refuse_quantities([], path)
    _refuse_different(sets, path)
    values = np.array([universal_frf.sign(found.response[2]) * _real(found) for found in sets])
    header = _header(used, content, path)
    return assemble.recording(header, values, path, _rate(sets))


def _refuse_modes(content: Content, path: Path) -> None:
    """Raises BadInput for a file of modes alone, which a person must say more of."""
    if content.has_modes:
        raise BadInput(
            "it holds modes that another program identified, no recording.",
            file=path,
            remedy="Give `shm import FILE`: it asks for the hanger and for the planes.",
        )


def peek(content: Content, file_format: str, path: Path) -> Peek:
    used = _used(content, path)
    sets = list(used.values())
    left_out = [found for found in content.functions if found not in sets]
    named = [f"{found.title} ({found.label or 'of another kind'})" for found in left_out]
    timed = sets or histories(content)
    samples = timed[0].points if timed else 0
    header = _header(used, content, path)
    return assemble.peeked(header, file_format, samples, lambda: _rate(timed), path, left_out=named)


def sets_of(recording: Recording) -> list[dict[str, Any]]:
    """The data sets of a recording for pyuff."""
    places = [channel.x_m for channel in recording.channels]
    nodes = universal_frf.number_nodes(places)
    rate = recording.sampling_rate_hz
    sets = universal_frf.node_set(places, nodes)
    for channel, node in zip(recording.channels, nodes, strict=True):
        lines = universal_frf.id_lines(recording, channel.name, {"sampling_rate_hz": rate})
        sets.append(
            {
                **lines,
                "type": 58,
                "func_type": TIME_RESPONSE,
                "rsp_ent_name": channel.name[:10],
                "rsp_node": node,
                "rsp_dir": universal_frf.direction(channel.plane),
                "ref_node": 0,
                "ref_dir": 0,
                "ord_data_type": _DOUBLE,
                "abscissa_spacing": _EVEN,
                "abscissa_spec_data_type": _TIME,
                "abscissa_axis_lab": "Time",
                "abscissa_axis_units_lab": "s",
                "ordinate_spec_data_type": _CODES[channel.quantity],
                "ordinate_axis_lab": channel.quantity.title(),
                "ordinate_axis_units_lab": SI[channel.quantity],
                "orddenom_spec_data_type": 0,
                "x": np.arange(len(channel.values)) / rate,
                "data": channel.values.copy(),
            }
        )
    return sets


def _header(used: Mapping[str, FunctionSet], content: Content, path: Path) -> Header:
    others = [name for name in _names(histories(content), path) if name not in used]
    if not used:
        return with_sidecar(Header(path, {}), path, others)
    channels = {
        name: universal_frf.channel_entries(found, *found.response[1:], content, path)
        for name, found in used.items()
    }
    first = next(iter(used.values()))
    return with_sidecar(Header(path, channels, universal_frf.entries(first, path)), path, others)


def _names(sets: Sequence[FunctionSet], path: Path) -> list[str]:
    """The names of forces and accelerations, and the titles of all else."""
    measured = [found for found in sets if quantity(found) is not None]
    known = iter(_names_of_measured(measured, path))
    return list(
        unlike(
            [
                next(known) if quantity(found) is not None else found.lines[0] or found.label
                for found in sets
            ]
        )
    )


def _names_of_measured(sets: Sequence[FunctionSet], path: Path) -> list[str]:
    """The names that we wrote; else force, acc_1, acc_2, ... in the order of the file."""
    own = [found.lines[0] for found in sets if universal_frf.facts(found)]
    if len(own) == len(sets):
        _refuse_doubles(own, sets, path)
        return own
    _refuse_doubles([_sensor(found) for found in sets if found.response[1] != 0], sets, path)
    forces, accelerations = count(2), count(1)
    names = []
    for found in sets:
        if quantity(found) == "acceleration":
            names.append(f"acc_{next(accelerations)}")
        else:
            names.append(f"force_{next(forces)}" if "force" in names else "force")
    return names


def _sensor(found: FunctionSet) -> tuple[object, ...]:
    """What tells one sensor from another; loggers give one node to several accelerometers."""
    title = "" if quantity(found) == "force" else found.lines[0]
    return quantity(found), *found.response[1:], title


def _refuse_doubles(keys: Sequence[object], sets: Sequence[FunctionSet], path: Path) -> None:
    if len(set(keys)) < len(keys):
        raise BadInput(
            f"{len(sets)} time histories, several of one sensor.",
            file=path,
            remedy="Put each recording, with one or many hits, into a file of its own.",
        )


def _refuse_different(sets: Sequence[FunctionSet], path: Path) -> None:
    for found in sets[1:]:
        first = sets[0]
        if (found.points, found.step) != (first.points, first.step):
            raise BadInput(
                f"{found.title} has {found.points} samples every {found.step:g} s, {first.title}"
                f" {first.points} every {first.step:g} s.",
                file=path,
                remedy="Export all channels of one recording with one length and rate.",
            )


def _real(found: FunctionSet) -> FloatArray:
    return np.real(np.asarray(found.data)).astype(float)


def _rate(sets: Sequence[FunctionSet]) -> float:
    return 1 / sets[0].step if sets and sets[0].step > 0 else NAN
