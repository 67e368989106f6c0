"""TDMS of National Instruments: channels in groups, what is said about them as properties.

Loggers write wf_increment (s), wf_start_time and unit_string; hanger, temperature_c, plane, x_m and
full_scale are read as well. A group is only a name.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from shm.errors import BadInput
from shm.read.arrays import Arrays, Variable, attributes_of, unique_names
from shm.read.extras import import_extra
from shm.read.limits import guarded, refuse_large

_MAGIC = b"TDSm"
_MOST_CHANNELS = 2000  # judgement: a hundred times what a recording has


@contextmanager
def opened(path: Path) -> Iterator[Arrays]:
    library = import_extra("nptdms", path)
    log = import_extra("nptdms.log", path)
    log.log_manager.set_level(logging.CRITICAL)  # it writes to stderr what we refuse in words
    # As a stream, so that no index file beside it is opened.
    with path.open("rb") as stream:
        with guarded(path):
            file = library.TdmsFile.open(stream)
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
    if not channels:
        raise BadInput(
            "its bytes are not those of a TDMS file: no channel is found in it.",
            file=path,
            remedy="Export or send it again.",
        )
    if len(channels) > _MOST_CHANNELS:
        raise ValueError("more channels than a recording can have")
    names = unique_names([(channel.group_name, channel.name) for channel in channels])
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
    attributes = attributes_of(channel.properties.items())
    return Variable(
        name, (samples,), dtype.kind, dtype.itemsize, lambda: np.asarray(channel[:]), attributes
    )


def recognises(head: bytes) -> bool:
    return head.startswith(_MAGIC)
