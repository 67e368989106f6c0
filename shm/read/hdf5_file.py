"""HDF5: datasets in the layout of `arrays`, with what is said about them as attributes.

    hanger, time, temperature_c, sampling_rate_hz       attributes of the file
    /force     unit="N" x_m=1.92                        datasets, (samples,)
    /acc_1     unit="m/s2" plane="transverse" x_m=2.52

Datasets in groups are read as well, and tables, whose columns are then DATA_1, DATA_2, ...

This is the door to h5py: a file is walked without following it out of the file. External and soft
links, external storage and virtual datasets can make a reader open any file of the system; they are
refused by the link or the creation properties, before a dataset is opened or its extent asked for.
Sizes are checked before anything is allocated.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5g, h5l, h5o
from numpy.typing import NDArray

from shm.errors import BadInput
from shm.read.arrays import Arrays, Variable, attributes_of, natural_sort_key, unique_names
from shm.read.limits import guarded, refuse_large

_MAGIC = b"\x89HDF\r\n\x1a\n"
# judgement: a recording has some tens of objects, two or three groups deep
_DEEPEST, _MOST_OBJECTS = 8, 2000
_LARGEST_ATTRIBUTE = 1 << 16  # 64 KB, HDF5's own limit of one in an object's header
_FILTERS = {
    h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32,
    h5py.h5z.FILTER_SZIP, h5py.h5z.FILTER_NBIT, h5py.h5z.FILTER_SCALEOFFSET,
    h5py.h5z.FILTER_LZF,
}  # fmt: skip
_COMPLEX = ("real", "imag")
_PLAIN = "Store plain datasets in the file itself."


def recognises(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of HDF5."""
    return head.startswith(_MAGIC)


@contextmanager
def opened(path: Path) -> Iterator[Arrays]:
    with opened_nodes(path) as nodes:
        found = variables(nodes)
        readable = tuple(v for v in found if v.kind in "iufcU")
        others = tuple(v.name for v in found if v.kind not in "iufcU")
        yield Arrays(readable, _general(nodes), others)


def _general(nodes: list[Node]) -> dict[str, object]:
    """Return the attributes of the groups; those closest to the root take precedence."""
    groups = sorted((n for n in nodes if n.dataset is None), key=lambda n: -len(n.path))
    return {key: value for group in groups for key, value in group.attributes.items()}


@dataclass(frozen=True, eq=False)
class Node:
    """A group or a dataset: its path in the file, its attributes; `dataset` is None of a group."""

    path: tuple[str, ...]
    attributes: dict[str, object]
    dataset: h5py.Dataset | None


@contextmanager
def opened_nodes(path: Path) -> Iterator[list[Node]]:
    """Yield all groups and datasets of a file; raises BadInput for links and external storage."""
    with guarded(path, "the HDF5 file"):
        file = h5py.File(path, "r", locking=False)
    with file:
        with guarded(path, "the HDF5 file"):
            nodes = list(_walk(file.id, (), path, [0]))
        yield nodes


def variables(nodes: list[Node]) -> tuple[Variable, ...]:
    """Return the datasets of nodes, named by their last part where that is unique."""
    found = [node for node in nodes if node.dataset is not None]
    names = unique_names([node.path for node in found])
    return tuple(_variable(name, node) for name, node in zip(names, found, strict=True))


def _walk(
    group: h5g.GroupID, place: tuple[str, ...], path: Path, count: list[int]
) -> Iterator[Node]:
    count[0] += 1
    if count[0] > _MOST_OBJECTS or len(place) > _DEEPEST:
        raise _refusal(place, "holds more objects than a recording can have", path)
    yield Node(place, _attributes(group), None)
    for name in _ordered(group):
        here = (*place, name.decode("utf-8", errors="replace"))
        if group.links.get_info(name).type != h5l.TYPE_HARD:
            raise _refusal(here, "is a soft or an external link", path)
        found = h5o.open(group, name)
        if isinstance(found, h5g.GroupID):
            yield from _walk(found, here, path, count)
        elif isinstance(found, h5d.DatasetID):
            _refuse_storage(found, here, path)
            yield Node(here, _attributes(found), h5py.Dataset(found))


def _ordered(group: h5g.GroupID) -> list[bytes]:
    """Return the names in a group: as created where the file knows, else acc_2 before acc_10."""
    names = list(group)
    links = {name: group.links.get_info(name) for name in names}
    if names and all(link.corder_valid for link in links.values()):
        return sorted(names, key=lambda name: links[name].corder)
    return sorted(names, key=lambda name: natural_sort_key(name.decode("utf-8", errors="replace")))


def _refuse_storage(dataset: h5d.DatasetID, place: tuple[str, ...], path: Path) -> None:
    """Raise BadInput for data in other files, foreign filters, and impossible sizes."""
    made = dataset.get_create_plist()
    if made.get_layout() == h5d.VIRTUAL or made.get_external_count():
        raise _refusal(place, "takes its data from other files", path)
    if not {made.get_filter(i)[0] for i in range(made.get_nfilters())} <= _FILTERS:
        raise _refusal(place, "is compressed in a way that is not read", path)
    name, item_bytes = "/".join(place), dataset.dtype.itemsize
    if made.get_layout() == h5d.CHUNKED:
        refuse_large(made.get_chunk(), item_bytes, name, path)
    refuse_large(dataset.shape or (), item_bytes, name, path)


def _attributes(owner: h5g.GroupID | h5d.DatasetID) -> dict[str, object]:
    """Return the small attributes that are numbers or texts."""
    manager = h5py.AttributeManager(h5py.Group(owner) if isinstance(owner, h5g.GroupID)
                                    else h5py.Dataset(owner))  # fmt: skip
    return attributes_of((name, manager[name]) for name in manager if _is_small(manager, name))


def _is_small(manager: h5py.AttributeManager, name: str) -> bool:
    found = manager.get_id(name)
    readable = found.dtype.kind in "iufSU" or h5py.check_string_dtype(found.dtype) is not None
    size = int(np.prod(found.shape or (), dtype=object)) * found.dtype.itemsize
    return readable and 0 <= size <= _LARGEST_ATTRIBUTE


def _variable(name: str, node: Node) -> Variable:
    dataset = node.dataset
    assert dataset is not None
    kind, dtype = dataset.dtype.kind, dataset.dtype
    if h5py.check_string_dtype(dtype) is not None:
        kind = "U"
    elif dtype.names == _COMPLEX:
        kind = "c"
    shape = dataset.shape if dataset.shape is not None else (0,)
    return Variable(
        name, shape, kind, dtype.itemsize, lambda: _values(dataset, kind), node.attributes
    )


def _values(dataset: h5py.Dataset, kind: str) -> NDArray[Any]:
    if kind == "U":
        return np.asarray(dataset.asstr(errors="replace")[()])
    values = np.asarray(dataset[()])
    return values["real"] + 1j * values["imag"] if values.dtype.names == _COMPLEX else values


def _refusal(place: tuple[str, ...], what: str, path: Path) -> BadInput:
    return BadInput(f"{'/'.join(place) or '/'} {what}.", file=path, remedy=_PLAIN)
