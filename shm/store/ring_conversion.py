"""Convert the ring of 1.0.0: HDF5 files of ten minutes, and a file for each chunk not in one yet.

incoming/START-END-SEQUENCE-CHECKSUM.chunk     chunks as they came
20260501/20260501T1210Z-LAYOUT.h5              ten minutes of them
state.json                                     what the next chunks were compared with
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from shm.errors import BadInput
from shm.read.chunk_document import parse_chunk
from shm.store.ring_days import quarantine

if TYPE_CHECKING:
    from shm.store.ring import Ring


def convert_former_files(ring: Ring, folder: Path, most_s: float = 1.0) -> None:
    """Move former files of a stream into its days, the oldest first, for some time."""
    if not (folder / "incoming").is_dir():  # each stream of 1.0.0 has it
        return
    until = time.monotonic() + most_s
    for path in sorted(folder.glob("[0-9]*/[0-9]*.h5")) + sorted(folder.glob("incoming/*.chunk")):
        if time.monotonic() > until:
            return
        try:
            _convert(ring, path)
        except BadInput as error:
            quarantine(path, folder / "aside", error)
    for leftover in folder.glob("incoming/.*.part"):
        leftover.unlink()
    (folder / "state.json").unlink(missing_ok=True)
    for former in (*folder.glob("[0-9]*[0-9]"), folder / "incoming"):
        with suppress(OSError):  # somebody's own file is in it
            former.rmdir()


def _convert(ring: Ring, path: Path) -> None:
    if path.suffix == ".h5":
        from shm.read.ring_segment import read_segment  # it brings h5py

        ring.place(read_segment(path), is_former=True)
    else:
        arrived_us = path.stat().st_mtime_ns // 1000
        ring.place([(parse_chunk(path.read_bytes()), arrived_us)])
    path.unlink()
