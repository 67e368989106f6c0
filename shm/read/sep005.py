"""SEP005 of SDyPy: a list of dictionaries, a channel each, that the field's programs exchange.

A dictionary has `data`, `name`, `unit_str`, `fs` (Hz) or `time` (s), and may have `start_timestamp`
(ISO 8601, of the first sample) and `quantity`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from shm.errors import BadInput
from shm.read.assemble import assemble
from shm.read.header import entries_of
from shm.read.logger_text import is_measured, stated_entries
from shm.read.logger_words import name_and_unit
from shm.read.table import Column, Role, Table, describe
from shm.values import NAN, FrequencyResponse, Recording

_SOURCE = Path("SEP005")


def from_sep005(
    channels: Sequence[Mapping[str, Any]] | Mapping[str, Any], *, hanger: int | None = None
) -> Recording:
    """Return the recording that SEP005 channels hold: those in units of force or acceleration.

    Raises BadInput naming the channel where a key is missing or nothing can be read.
    """
    listed = [channels] if isinstance(channels, Mapping) else list(channels)
    columns = [column for each in listed for column in _columns(each)]
    starts = {str(each["start_timestamp"]) for each in listed if each.get("start_timestamp")}
    if len(starts) > 1:
        raise BadInput(
            f"the channels begin at different times ({', '.join(sorted(starts))}).",
            file=_SOURCE,
            remedy="Cut them to one span.",
        )
    entries = entries_of({"hanger": hanger, "time": next(iter(starts), None)}, _SOURCE)
    table = Table(_SOURCE, tuple(columns), entries)
    found = assemble(table, describe(table, with_sidecars=False))
    assert not isinstance(found, FrequencyResponse)
    return replace(found, source="SEP005")


def _columns(channel: Mapping[str, Any]) -> list[Column]:
    name = str(channel.get("name", ""))
    missing = [key for key in ("data", "name", "unit_str") if key not in channel]
    missing += ["fs or time"] if channel.get("fs") is None and channel.get("time") is None else []
    if missing:
        raise BadInput(
            f"it has no {missing[0]}.",
            file=_SOURCE,
            channel=name,
            remedy="Give data, name, unit_str, and fs or time (SDyPy enhancement proposal 5).",
        )
    values, unit = np.asarray(channel["data"], float), name_and_unit(f"x [{channel['unit_str']}]")
    if values.ndim != 1:
        raise BadInput(
            "its data are no single row.", file=_SOURCE, channel=name, remedy="Split its columns."
        )
    role: Role = "channel" if is_measured(name, unit[1], None) else "other"
    known = stated_entries(name, unit[1], None, None, _SOURCE)
    rate = float(channel["fs"]) if channel.get("fs") is not None else NAN
    found = [Column(name, len(values), values.copy, unit[1], role, known, rate_hz=rate, label=name)]
    if channel.get("fs") is None:
        times = np.asarray(channel["time"], float)
        found.append(Column(f"time of {name}", len(times), times.copy, "s", "times"))
    return found
