"""SEP005 of SDyPy: a list of dictionaries, a channel each, that the field's programs exchange.

A dictionary has `data`, `name`, `unit_str`, `fs` (Hz) or `time` (s), and may have `start_timestamp`
(ISO 8601, of the first sample) and `quantity`. As a file it is that list as JSON; what SEP005 does
not know may stand in keys that other programs ignore: those of a sidecar.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from shm.errors import BadInput
from shm.read.base import Format, at_once
from shm.read.header import KEYS, Entry, entries_of, known_values
from shm.read.limits import guarded, refuse_large, refuse_many_samples
from shm.read.logger_words import name_and_unit
from shm.read.table import Column, Table
from shm.values import NAN, FloatArray

NAME = "SEP005"
_BEGINS = re.compile(rb"\s*\[\s*\{\s*\"(data|name|unit_str|fs|time|start_timestamp|quantity)\"\s*:")
_OF_ALL = tuple(key for key in KEYS if key not in ("time", "sampling_rate_hz"))
_OF_CHANNEL = ("plane", "x_m", "full_scale")
_REMEDY = "Give data, name, unit_str, and fs or time (SDyPy enhancement proposal 5)."


def table_of(listed: Sequence[Any], path: Path, hanger: int | None = None) -> Table:
    """Return the channels as columns; raises BadInput naming the one at fault.

    `hanger` goes before what the channels say.
    """
    columns = [column for each in listed for column in _columns(each, path)]
    names = [str(each["name"]) for each in listed]
    for name in names:
        if names.count(name) > 1:
            remedy = "Give each channel a name of its own."
            raise BadInput("two channels have this name.", file=path, channel=name, remedy=remedy)
    _refuse_other_times(columns, path)
    stated = {key: _of_all(key, listed, path) for key in _OF_ALL if key != "hanger"}
    stated["hanger"] = _of_all("hanger", listed, path) if hanger is None else hanger
    stated["time"] = _of_all("start_timestamp", listed, path)
    return Table(path, tuple(columns), entries_of(stated, path), (NAME, *(c.name for c in columns)))


def _refuse_other_times(columns: Sequence[Column], path: Path) -> None:
    """Raise BadInput where times of equally many samples differ by half a step."""
    first: dict[int, FloatArray] = {}
    for column in columns:
        if column.role == "times" and column.size > 1:
            times = column.load()
            known = first.setdefault(column.size, times)
            half_s = abs(known[-1] - known[0]) / (len(known) - 1) / 2
            if np.abs(times - known).max() > half_s:
                raise BadInput(
                    f"the {column.name} differs from that of the others.",
                    file=path,
                    remedy="Export all channels of one recording with one time.",
                )


def _of_all(key: str, listed: Sequence[Any], path: Path) -> object:
    """Return what the channels say of the test; raises BadInput where they differ."""
    values = [value for each in listed for value in known_values({key: each.get(key)}).values()]
    texts = sorted(set(map(str, values)))
    if len(texts) > 1:
        what, remedy = f"say different {key}", "Give all channels of one test the same."
        if key == "start_timestamp":
            what, remedy = "begin at different times", "Cut them to one span."
        raise BadInput(f"the channels {what} ({', '.join(texts)}).", file=path, remedy=remedy)
    return values[0] if values else None


def is_json(head: bytes) -> bool:
    """Return whether the first bytes are of a list or dictionary of JSON, of whatever content."""
    return head.lstrip()[:1] in (b"[", b"{")


def open_tables(path: Path) -> tuple[Table, ...]:
    """Return the channels of a file; raises BadInput where it is damaged or something else."""
    with guarded(path):
        try:
            listed = json.loads(path.read_bytes())
        except json.JSONDecodeError as error:
            raise BadInput(
                f"it is no sound JSON: {error.msg} at column {error.colno}.",
                file=path,
                line=error.lineno,
                remedy="Write it again; a sample that is missing is null.",
            ) from None
    if isinstance(listed, Mapping) and "data" in listed:
        listed = [listed]
    if not isinstance(listed, list) or not listed:
        what, remedy = "JSON, but no list of channels", _REMEDY
        if listed == []:
            what = "an empty list"
        elif isinstance(listed, Mapping) and "schema" in listed:
            what = f"a document of the kind {str(listed['schema'])[:40]}, and no recording"
            if listed["schema"] == "shm.modes/1":
                remedy = "Name it NAME.modes.json."
        raise BadInput(f"it is {what}.", file=path, remedy=remedy)
    table = table_of(listed, path)
    longest = max((column.size for column in table.columns), default=0)
    refuse_many_samples(longest, path)
    refuse_large((longest, len(table.columns)), 8, "", path)
    return (table,)


def _columns(channel: Any, path: Path) -> list[Column]:
    if not isinstance(channel, Mapping):
        raise BadInput("a channel is no dictionary.", file=path, remedy=_REMEDY)
    name = str(channel.get("name", ""))
    missing = [key for key in ("data", "name", "unit_str") if key not in channel]
    missing += ["fs or time"] if channel.get("fs") is None and channel.get("time") is None else []
    if missing:
        raise BadInput(f"it has no {missing[0]}.", file=path, channel=name, remedy=_REMEDY)
    _, unit = name_and_unit(f"x [{channel['unit_str']}]")
    fs, timed = channel.get("fs"), channel.get("time") is not None
    try:
        values = np.asarray(channel["data"], float)
        rate = NAN if fs is None else float(fs)
        times = np.asarray(channel["time"], float) if timed else np.full(len(values), NAN)
    except (TypeError, ValueError):
        raise BadInput(
            "its data, fs or time are no numbers.", file=path, channel=name, remedy=_REMEDY
        ) from None
    if values.ndim != 1 or times.ndim != 1:
        raise BadInput(
            "its data are no single row.", file=path, channel=name, remedy="Split its columns."
        )
    if len(times) != len(values):
        what = f"its data have {len(values)} values, its time {len(times)}."
        raise BadInput(what, file=path, channel=name, remedy="Give one time for each value.")
    facts = entries_of({"sampling_rate_hz": fs}, path)
    column = Column.of_logger(name, unit, values, path, facts=facts, rate_hz=rate, label=name)
    stated = {key: Entry(channel[key], path) for key in _OF_CHANNEL if key in channel}
    found = [replace(column, stated={**column.stated, **stated})]
    if timed:
        found.append(Column(f"time of {name}", len(times), times.copy, "s", "times"))
    return found


FORMAT = Format(
    NAME,
    (".json",),
    lambda head: _BEGINS.match(head) is not None,
    at_once(open_tables),
)
