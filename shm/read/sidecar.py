"""NAME.toml beside NAME.csv, NAME.uff, NAME.h5 or NAME.csv.gz: what the file does not say.

hanger = 3
time = 2026-05-01T10:00:00Z
temperature_c = 12.0
sampling_rate_hz = 512.0

[channel.acc_1]
unit = "m/s2"
x_m = 2.52
plane = "transverse"
calibration = 10.0
full_scale = 50.0

[channel.acc_9]
leave_out = true
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from shm.documents import format_time, key_meant
from shm.errors import BadInput
from shm.read.atomic import replace_text
from shm.read.base import PeekChannel
from shm.read.content import read_toml
from shm.read.header import (
    CHANNEL_KEYS,
    KEYS,
    Entry,
    Header,
    condition_entries,
    known_values,
    spread,
)
from shm.read.limits import refuse_long_header
from shm.values import FrequencyResponse, Recording

SIDECAR_SUFFIX = ".toml"
_NAME_BYTES = 255  # the most that Linux's file systems take
_SHAPE = "Write hanger = 3 and the like, and a table [channel.acc_1] for each channel."


def sidecar_path(path: Path) -> Path:
    """Return the path of a file's sidecar, which need not exist.

    Where the sidecar's name would be too long, the file's name is cut to fit.
    """
    plain = path.with_suffix("") if path.suffix.lower() == ".gz" else path
    name = os.fsencode(plain.with_suffix(SIDECAR_SUFFIX).name)
    if len(name) > _NAME_BYTES:
        name = name[: _NAME_BYTES - len(SIDECAR_SUFFIX)] + SIDECAR_SUFFIX.encode()
    return plain.with_name(os.fsdecode(name))


def with_sidecar(
    header: Header, path: Path, others: Sequence[str] = (), *, of_channels: bool = True
) -> Header:
    """Return a file's header overridden by its sidecar; raises BadInput naming it.

    The sidecar may also describe `others`, which the file holds but which are no channels; what it
    says of channels is left alone where it is not asked for.
    """
    sidecar = sidecar_path(path)
    document = sidecar_document(path)
    if not document:
        return header
    _refuse_misspelt(document, sidecar)
    names = list(header.channels)
    entries = {key: Entry(document[key], sidecar) for key in KEYS if key in document}
    channels: dict[str, dict[str, Entry]] = {name: {} for name in names}
    for key in CHANNEL_KEYS:
        if key in document:
            for name, entry in _listed(key, document[key], names, sidecar).items():
                channels[name][key] = entry
    tables = _tables(document, sidecar)
    if of_channels:
        _refuse_unknown(tables, [*names, *others], sidecar)
    for name in [name for name in names if name in tables]:
        channels[name].update(_entries(tables[name], sidecar))
    return header.merged_with(Header(sidecar, channels, entries))


def _refuse_misspelt(document: Iterable[str], sidecar: Path) -> None:
    for key in document:
        meant = key_meant(key, (*KEYS, *CHANNEL_KEYS, "channel"))
        if meant:
            raise BadInput(
                f"unknown key {key}.", file=sidecar, remedy=f"Write {meant}, or leave it out."
            )


def channels_described(path: Path) -> dict[str, dict[str, Entry]]:
    """Return the tables of single channels in the sidecar of a file; empty without a sidecar."""
    sidecar = sidecar_path(path)
    tables = _tables(sidecar_document(path), sidecar)
    return {name: _entries(table, sidecar) for name, table in tables.items()}


def _entries(table: dict[str, Any], sidecar: Path) -> dict[str, Entry]:
    return {key: Entry(table[key], sidecar) for key in CHANNEL_KEYS if key in table}


def sidecar_document(path: Path) -> dict[str, Any]:
    """Return the content of a file's sidecar; empty without a sidecar."""
    sidecar = sidecar_path(path)
    if sidecar == path or not sidecar.is_file():
        return {}
    _refuse_link_outside(sidecar)
    refuse_long_header(sidecar.stat().st_size, sidecar)
    return read_toml(sidecar, "Correct the sidecar.")


def _refuse_link_outside(sidecar: Path) -> None:
    """Raise BadInput for a link to another folder, whose text a refusal would show."""
    if sidecar.resolve().parent != sidecar.parent.resolve():
        raise BadInput(
            "is a link out of its folder.", file=sidecar, remedy="Lay the sidecar itself there."
        )


def _listed(key: str, value: Any, names: Sequence[str], sidecar: Path) -> dict[str, Entry]:
    whole = Entry(value, sidecar)
    values = value if isinstance(value, list) else [value]
    return spread(key, [Entry(one, sidecar) for one in values], names, whole)


def _tables(document: dict[str, Any], sidecar: Path) -> dict[str, dict[str, Any]]:
    tables = document.get("channel", {})
    if not isinstance(tables, dict) or not all(isinstance(t, dict) for t in tables.values()):
        raise BadInput("`channel` must hold tables.", file=sidecar, remedy=_SHAPE)
    for name, table in tables.items():
        for key in table.keys() - set(CHANNEL_KEYS):
            raise BadInput(
                f"{key!r} is not a key of a channel.",
                file=sidecar,
                channel=name,
                remedy=f"The keys are {', '.join(CHANNEL_KEYS)}.",
            )
    return tables


def _refuse_unknown(tables: Iterable[str], known: Sequence[str], sidecar: Path) -> None:
    for name in tables:
        if name not in known:
            raise BadInput(
                "describes a channel that the file does not have.",
                file=sidecar,
                channel=name,
                remedy=f"The file has {', '.join(known)}.",
            )


def write_sidecar(
    described: Recording | FrequencyResponse,
    channels: Iterable[PeekChannel],
    sampling_rate_hz: float,
    path: Path,
) -> None:
    """Write the sidecar of `path`; an interrupted write leaves the old one."""
    whole = {
        **condition_entries(described),
        "time": described.time,
        "sampling_rate_hz": sampling_rate_hz,
    }
    keys = ("unit", "plane", "x_m", "full_scale")
    tables = {c.name: known_values({key: getattr(c, key) for key in keys}) for c in channels}
    replace_text(sidecar_path(path), sidecar_text({**known_values(whole), "channel": tables}))


Described = Mapping[str, Any]
"""Keys and values of a sidecar; `channel` holds a mapping for each channel by name."""


def sidecar_text(described: Described) -> str:
    """Return the TOML of a sidecar: general keys, then a table for each channel."""
    lines = [f"{key} = {_toml(value)}" for key, value in described.items() if key != "channel"]
    for name, table in described.get("channel", {}).items():
        lines += ["", f"[channel.{_quoted(name)}]"]
        lines += [f"{key} = {_toml(value)}" for key, value in table.items()]
    return "\n".join(lines) + "\n"


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, datetime):
        return str(format_time(value))
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return _quoted(value) if isinstance(value, str) else repr(value)


def _quoted(text: str) -> str:
    """Return a text as TOML takes it: control characters and half pairs as blanks."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    return json.dumps(plain, ensure_ascii=False)
