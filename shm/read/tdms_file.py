"""TDMS of National Instruments: channels in groups, what is said about them as properties.

Loggers write wf_increment (s), wf_start_time and unit_string; we write these and hanger,
temperature_c, plane, x_m, full_scale. A group is only a name: "test" in ours.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsFile, TdmsWriter
from nptdms.log import log_manager

from shm.errors import BadInput
from shm.read.array_reading import peeker, reader
from shm.read.arrays import (
    Arrays,
    Layout,
    NamedArray,
    Variable,
    attributes_of,
    layout_of,
    named_apart,
)
from shm.read.atomic import replace_file
from shm.read.base import Format
from shm.read.limits import guarded, refuse_large
from shm.values import FrequencyResponse, Recording

log_manager.set_level(logging.CRITICAL)  # it writes to stderr what we refuse in words
_MAGIC = b"TDSm"
_GROUP = "test"
_MOST_CHANNELS = 2000


@contextmanager
def _opened(path: Path) -> Iterator[Arrays]:
    # As a stream, so that no index file beside it is opened.
    with path.open("rb") as stream:
        with guarded(path):
            file = TdmsFile.open(stream)
            _refuse_cut_off(file, path)
            arrays = _arrays(file, path)
        yield arrays


def _refuse_cut_off(file: Any, path: Path) -> None:
    status = file.file_status
    if status.incomplete_final_segment or status.channel_statuses is not None:
        raise BadInput(
            "the file ends within its data.",
            file=path,
            remedy="Let the logger close the file, or send it again.",
        )


def _arrays(file: Any, path: Path) -> Arrays:
    channels = [channel for group in file.groups() for channel in group.channels()]
    if len(channels) > _MOST_CHANNELS:
        raise ValueError("more channels than a recording can have")
    names = named_apart([(channel.group_name, channel.name) for channel in channels])
    found = [_variable(n, channel, path) for n, channel in zip(names, channels, strict=True)]
    general = {k: v for g in file.groups() for k, v in attributes_of(g.properties.items()).items()}
    return Arrays(
        tuple(v for v in found if v.kind in "iufc"),
        {**general, **attributes_of(file.properties.items())},
        tuple(v.name for v in found if v.kind not in "iufc"),
    )


def _variable(name: str, channel: Any, path: Path) -> Variable:
    samples, dtype = len(channel), np.dtype(channel.dtype)
    if samples > path.stat().st_size:
        raise BadInput(
            f"claims {samples} values, more than the file has bytes.",
            file=path,
            channel=name,
            remedy="The file is damaged: export or send it again.",
        )
    refuse_large((samples,), dtype.itemsize, name, path)
    said = attributes_of(channel.properties.items())
    return Variable(
        name, (samples,), dtype.kind, dtype.itemsize, lambda: np.asarray(channel[:]), said
    )


def _write(described: Recording | FrequencyResponse, path: Path) -> None:
    layout = layout_of(described)
    replace_file(path, lambda temporary: _save(temporary, layout))


def _save(path: Path, layout: Layout) -> None:
    channels = [
        ChannelObject(_GROUP, array.name, array.values, _properties(array, layout))
        for array in layout.arrays
    ]
    with path.open("wb") as stream, TdmsWriter(stream) as writer:
        writer.write_segment([RootObject(layout.attributes), GroupObject(_GROUP), *channels])


def _properties(array: NamedArray, layout: Layout) -> dict[str, object]:
    """What belongs to a channel, in the words of National Instruments where they have some."""
    said: dict[str, object] = {k: v for k, v in array.attributes.items() if k != "unit"}
    if "unit" in array.attributes:
        said["unit_string"] = array.attributes["unit"]
    rate = layout.attributes.get("sampling_rate_hz")
    if isinstance(rate, float):
        said |= {"sampling_rate_hz": rate, "wf_increment": 1 / rate, "wf_start_offset": 0.0}
    return said


_NAME = "TDMS"
FORMAT = Format(
    name=_NAME,
    suffixes=(".tdms",),
    recognises=lambda head: head.startswith(_MAGIC),
    peek=peeker(_opened, _NAME),
    read=reader(_opened),
    write=_write,
    holds_gaps=True,
    holds_frequency_responses=True,
    needs_sidecar=False,
)
