"""HDF5: datasets in the layout of `array_layout`, with what is said about them as attributes.

    hanger, time, temperature_c, sampling_rate_hz       attributes of the file
    /force     unit="N" x_m=1.92                        datasets, (samples,)
    /acc_1     unit="m/s2" plane="transverse" x_m=2.52

Datasets in groups are read as well, and tables, whose columns are then DATA_1, DATA_2, ...
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py

from shm.read.array_layout import Layout, layout_of
from shm.read.array_reading import peeker, reader
from shm.read.arrays import Arrays
from shm.read.atomic import replace_file
from shm.read.base import Format
from shm.read.hdf5_tree import Node, opened_nodes, variables
from shm.values import FrequencyResponse, Recording

_MAGIC = b"\x89HDF\r\n\x1a\n"


@contextmanager
def _opened(path: Path) -> Iterator[Arrays]:
    with opened_nodes(path) as nodes:
        found = variables(nodes)
        readable = tuple(v for v in found if v.kind in "iufcU")
        others = tuple(v.name for v in found if v.kind not in "iufcU")
        yield Arrays(readable, _general(nodes), others)


def _general(nodes: list[Node]) -> dict[str, object]:
    """Attributes of the groups, those nearest to the root first."""
    groups = sorted((n for n in nodes if n.dataset is None), key=lambda n: -len(n.path))
    return {key: value for group in groups for key, value in group.attributes.items()}


def _write(described: Recording | FrequencyResponse, path: Path) -> None:
    layout = layout_of(described)
    replace_file(path, lambda temporary: _save(temporary, layout))


def _save(path: Path, layout: Layout) -> None:
    with h5py.File(path, "w", track_order=True) as file:
        file.attrs.update(layout.attributes)
        for array in layout.arrays:
            file.create_dataset(array.name, data=array.values).attrs.update(array.attributes)


_NAME = "HDF5"
FORMAT = Format(
    name=_NAME,
    suffixes=(".h5", ".hdf5"),
    recognises=lambda head: head.startswith(_MAGIC),
    peek=peeker(_opened, _NAME),
    read=reader(_opened),
    write=_write,
    holds_gaps=True,
    holds_frequency_responses=True,
    needs_sidecar=False,
)
