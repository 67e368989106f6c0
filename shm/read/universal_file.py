"""UFF: force and accelerations over time, or frequency responses, as data sets of type 58.

Read in ASCII and binary (58b), written in ASCII. Places, planes and hanger stand in the sidecar;
our own files also say them in id lines and nodes.

Time histories of a UFF file and recordings, each made from the other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from shm.errors import BadInput, UsageError
from shm.read import universal_frf
from shm.read.atomic import replace_file
from shm.read.base import Format, PeekChannel, at_once
from shm.read.logger_heading import distinct_names
from shm.read.logger_words import SI, unit_of
from shm.read.sidecar import write_sidecar
from shm.read.table import Column, Table
from shm.read.universal_sets import TIME_RESPONSE, Content, FunctionSet, load, recognises, save
from shm.values import NAN, FloatArray, FrequencyResponse, Quantity, Recording


def open_tables(path: Path) -> tuple[Table, ...]:
    """Return what a file is for: its time histories, or its frequency responses."""
    content = load(path, headers_only=True)

    @cache
    def loaded() -> tuple[FunctionSet, ...]:
        return load(path, headers_only=False).functions

    def values(found: FunctionSet) -> Any:
        return loaded()[content.functions.index(found)].data

    if universal_frf.response_sets(content) and not _holds_histories(content):
        return (universal_frf.table_in(content, values, path),)
    return (_table(content, values, path),)


def _holds_histories(content: Content) -> bool:
    """Return whether time histories are what a file with responses is for: force and response."""
    return len({quantity(found) for found in histories(content)} - {None}) > 1


def _table(content: Content, values: Callable[[FunctionSet], Any], path: Path) -> Table:
    """Return all time histories; none, and why, of a file of modes alone."""
    every = histories(content)
    if not every and content.mode_count:
        refusal = BadInput(
            f"it holds {content.mode_count} modes at {len(content.nodes)} places that another"
            " program identified, no recording.",
            file=path,
            remedy="Give `shm import FILE`: it asks for the hanger and for the planes.",
        )
        return Table(path, (), layout=("UFF",), refusal=refusal)
    columns = tuple(
        _column(name, found, content, partial(_signed, found, values), path)
        for name, found in zip(_names(every, path), every, strict=True)
    )
    sets = [c for c in columns if c.role == "channel"] or columns
    named = (
        f"{c.name} [{c.unit}]"
        for c in columns
        if (c.size, c.rate_hz) == (sets[0].size, sets[0].rate_hz)
    )
    left_out = tuple(_label(found) for found in content.functions if found not in every)
    return Table(path, columns, layout=("UFF", *named), left_out=left_out)


def _column(
    name: str, found: FunctionSet, content: Content, load: Callable[[], FloatArray], path: Path
) -> Column:
    return Column(
        name,
        found.points,
        load,
        found.unit,
        "other" if quantity(found) is None else "channel",
        universal_frf.channel_entries(found, *found.response[1:], content, path),
        universal_frf.entries(found, path),
        1 / found.step if found.step > 0 else NAN,
        label=_label(found),
    )


def _label(found: FunctionSet) -> str:
    return f"{found.title} ({found.label or 'of another kind'})"


def _signed(found: FunctionSet, values: Callable[[FunctionSet], Any]) -> FloatArray:
    signed = universal_frf.sign(found.response[2]) * np.real(np.asarray(values(found)))
    return np.asarray(signed, float)


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


FORMAT = Format(
    "UFF",
    (".uff", ".unv", ".uf"),
    recognises,
    at_once(open_tables),
    write=_write,
    may_be_gzipped=True,
    library="pyuff",
)


# UC-SDRL, Universal File Formats, data set 58, records 7 to 10
_QUANTITIES: dict[int, Quantity] = {9: "force", 12: "acceleration", 13: "force"}
_CODES: dict[Quantity, int] = {"force": 13, "acceleration": 12}
_TIME, _EVEN, _DOUBLE = 17, 1, 4


def histories(content: Content) -> list[FunctionSet]:
    """Return the sets over time, of any quantity."""
    return [found for found in content.functions if found.function == TIME_RESPONSE]


def quantity(found: FunctionSet) -> Quantity | None:
    """Return the quantity of a set by its unit, else by its type; None for any other."""
    unit = unit_of(found.unit)
    return unit.quantity if unit is not None else _QUANTITIES.get(found.quantity)


def sets_of(recording: Recording) -> list[dict[str, Any]]:
    """Return the data sets of a recording for pyuff."""
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


def _names(sets: Sequence[FunctionSet], path: Path) -> list[str]:
    """Return the names of forces and accelerations, and the titles of all else."""
    measured = [found for found in sets if quantity(found) is not None]
    known = iter(_names_of_measured(measured, path))
    return list(
        distinct_names(
            [
                next(known) if quantity(found) is not None else found.lines[0] or found.label
                for found in sets
            ]
        )
    )


def _names_of_measured(sets: Sequence[FunctionSet], path: Path) -> list[str]:
    """Return the names that we wrote; else force, acc_1, acc_2, ... in the order of the file."""
    names = [found.lines[0] for found in sets if universal_frf.facts(found)]
    if len(names) == len(sets):
        _refuse_doubles(names, sets, path)
        return names
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
    """Return what identifies a sensor; loggers give one node to several accelerometers."""
    title = "" if quantity(found) == "force" else found.lines[0]
    return quantity(found), *found.response[1:], title


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
