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
from shm.read.assemble import assemble
from shm.read.base import Format, at_once
from shm.read.header import KEYS, Entry, entries_of
from shm.read.limits import guarded, refuse_large, refuse_many_samples
from shm.read.logger_text import is_measured, stated_entries
from shm.read.logger_words import name_and_unit
from shm.read.table import Column, Role, Table, describe
from shm.values import NAN, FrequencyResponse, Recording

_NAME = "SEP005"
_SOURCE = Path(_NAME)
_BEGINS = re.compile(rb"\s*\[\s*\{\s*\"(data|name|unit_str|fs|time|start_timestamp|quantity)\"\s*:")
_OF_ALL = tuple(key for key in KEYS if key not in ("time", "sampling_rate_hz"))
_OF_CHANNEL = ("plane", "x_m", "full_scale")
_REMEDY = "Give data, name, unit_str, and fs or time (SDyPy enhancement proposal 5)."


def from_sep005(
    channels: Sequence[Mapping[str, Any]] | Mapping[str, Any], *, hanger: int | None = None
) -> Recording:
    """Return the recording that SEP005 channels hold: those in units of force or acceleration.

    Raises BadInput naming the channel where a key is missing or nothing can be read.
    """
    listed = [channels] if isinstance(channels, Mapping) else list(channels)
    table = _table(listed, _SOURCE, hanger)
    found = assemble(table, describe(table, with_sidecars=False))
    assert not isinstance(found, FrequencyResponse)
    return replace(found, source=_NAME)


def _table(listed: Sequence[Any], path: Path, hanger: int | None = None) -> Table:
    """Return the channels as columns; raises BadInput naming the one at fault."""
    columns = [column for each in listed for column in _columns(each, path)]
    starts = {str(each["start_timestamp"]) for each in listed if each.get("start_timestamp")}
    if len(starts) > 1:
        raise BadInput(
            f"the channels begin at different times ({', '.join(sorted(starts))}).",
            file=path,
            remedy="Cut them to one span.",
        )
    stated: dict[str, object] = {
        key: each[key] for key in _OF_ALL for each in listed if key in each
    }
    stated |= {"hanger": hanger} if hanger is not None else {}
    stated["time"] = next(iter(starts), None)
    entries = entries_of(stated, path)
    return Table(path, tuple(columns), entries, (_NAME, *(column.name for column in columns)))


def open_tables(path: Path) -> tuple[Table, ...]:
    """Return the channels of a file; raises BadInput where it is damaged."""
    with guarded(path):
        listed = json.loads(path.read_bytes())
    if not isinstance(listed, list):
        raise BadInput("it is no list of channels.", file=path, remedy=_REMEDY)
    table = _table(listed, path)
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
    unit = name_and_unit(f"x [{channel['unit_str']}]")
    try:
        values = np.asarray(channel["data"], float)
        rate = float(channel["fs"]) if channel.get("fs") is not None else NAN
        times = np.asarray(channel["time"], float) if channel.get("fs") is None else np.empty(0)
    except (TypeError, ValueError):
        raise BadInput(
            "its data, fs or time are no numbers.", file=path, channel=name, remedy=_REMEDY
        ) from None
    if values.ndim != 1 or times.ndim != 1:
        raise BadInput(
            "its data are no single row.", file=path, channel=name, remedy="Split its columns."
        )
    role: Role = "channel" if is_measured(name, unit[1]) else "other"
    stated = dict(stated_entries(name, unit[1], path))
    stated |= {key: Entry(channel[key], path) for key in _OF_CHANNEL if key in channel}
    found = [
        Column(name, len(values), values.copy, unit[1], role, stated, rate_hz=rate, label=name)
    ]
    if channel.get("fs") is None:
        found.append(Column(f"time of {name}", len(times), times.copy, "s", "times"))
    return found


FORMAT = Format(
    _NAME,
    (".json",),
    lambda head: _BEGINS.match(head) is not None,
    at_once(open_tables),
    holds_responses=False,
)
