"""NAME.toml beside NAME.csv or NAME.uff: what the file cannot hold.

hanger = 3
time = 2026-05-01T10:00:00Z
temperature_c = 12.0
sampling_rate_hz = 512.0

[channel.acc_1]
unit = "m/s2"
x_m = 2.52
plane = "transverse"
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from shm.documents import format_time
from shm.errors import BadInput
from shm.read.atomic import replace_text
from shm.read.base import PeekChannel
from shm.read.content import unreadable
from shm.read.header import CHANNEL_KEYS, KEYS, Entry, Header, spread
from shm.values import FrequencyResponse, Recording

_SHAPE = "Write hanger = 3 and the like, and a table [channel.acc_1] for each channel."


def sidecar_path(path: Path) -> Path:
    """Where the sidecar of a file stands, whether it exists or not."""
    return path.with_suffix(".toml")


def with_sidecar(header: Header, path: Path) -> Header:
    """A file's header overridden by its sidecar, if there is one; raises BadInput naming it."""
    sidecar = sidecar_path(path)
    if sidecar == path or not sidecar.is_file():
        return header
    document = _document(sidecar)
    names = list(header.channels)
    entries = {key: Entry(document[key], sidecar) for key in KEYS if key in document}
    channels: dict[str, dict[str, Entry]] = {name: {} for name in names}
    for key in CHANNEL_KEYS:
        if key in document:
            for name, entry in _listed(key, document[key], names, sidecar).items():
                channels[name][key] = entry
    for name, table in _tables(document, names, sidecar).items():
        channels[name].update(
            {key: Entry(table[key], sidecar) for key in CHANNEL_KEYS if key in table}
        )
    return header.overridden_by(Header(sidecar, channels, entries))


def _document(sidecar: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(sidecar.read_text(encoding="utf-8"))
    except OSError as error:
        raise unreadable(sidecar, error) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadInput(
            f"not a readable TOML file: {error}.", file=sidecar, remedy="Correct the sidecar."
        ) from error


def _listed(key: str, value: Any, names: Sequence[str], sidecar: Path) -> dict[str, Entry]:
    whole = Entry(value, sidecar)
    values = value if isinstance(value, list) else [value]
    return spread(key, [Entry(one, sidecar) for one in values], names, whole)


def _tables(document: dict[str, Any], names: Sequence[str], sidecar: Path) -> dict[str, Any]:
    tables = document.get("channel", {})
    if not isinstance(tables, dict) or not all(isinstance(t, dict) for t in tables.values()):
        raise BadInput("`channel` must hold tables.", file=sidecar, remedy=_SHAPE)
    for name in tables:
        if name not in names:
            raise BadInput(
                "describes a channel that the file does not have.",
                file=sidecar,
                channel=name,
                remedy=f"The file has {', '.join(names)}.",
            )
    return tables


def write_sidecar(
    described: Recording | FrequencyResponse,
    channels: Iterable[PeekChannel],
    sampling_rate_hz: float,
    path: Path,
) -> None:
    """Writes the sidecar of `path`, whole or not at all."""
    lines = [
        *_line("hanger", described.hanger),
        *_line("time", described.time),
        *_line("temperature_c", described.temperature_c),
        *_line("sampling_rate_hz", sampling_rate_hz),
    ]
    for channel in channels:
        lines += ["", f"[channel.{json.dumps(channel.name)}]"]
        lines += [*_line("unit", channel.unit), *_line("plane", channel.plane)]
        lines += _line("x_m", channel.x_m)
    text = "\n".join(lines) + "\n"
    replace_text(sidecar_path(path), text)


def _line(key: str, value: object) -> list[str]:
    """A TOML line, or none where the value is unknown."""
    if value is None or value == "" or (isinstance(value, float) and math.isnan(value)):
        return []
    if isinstance(value, datetime):
        return [f"{key} = {format_time(value)}"]
    return [f"{key} = {json.dumps(value) if isinstance(value, str) else repr(value)}"]
