"""Power cuts, simulated: what a disk holds of all that a process wrote up to some moment.

A process at work is recorded (`file_recorder.c`); then, for any moment, the folder is laid out anew
as a disk might hold it: all that was forced to it (fsync of the file; of a name: fsync of its
folder) and, of the rest, whatever chance left, sector by sector. That is more than journalling file
systems lose.
"""

from __future__ import annotations

import ctypes
import os
import random
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parents[2]
_SOURCE = Path(__file__).with_name("file_recorder.c")
_SECTOR = 512
_HEAD = struct.Struct("<cQQII")


@dataclass(frozen=True)
class Operation:
    """One thing that was done: its kind (see `file_recorder.c`), to which file, with what."""

    kind: str
    inode: int
    number: int
    first: bytes
    second: bytes

    @property
    def path(self) -> str:
        return self.first.decode()

    @property
    def target(self) -> str:
        return self.second.decode()


def compiler() -> str | None:
    """The C compiler that makes the recorder; None where there is none."""
    return shutil.which("gcc") or shutil.which("cc")


def recorded(folder: Path, script: str, *arguments: str, where: Path) -> list[Operation]:
    """Runs a module in a process of its own; what it did to `folder`, in order."""
    log = where / "operations"
    watched(folder, script, *arguments, where=where, log=log)
    return list(_read(log.read_bytes()))


def watched(folder: Path, script: str, *arguments: str, where: Path, log: Path) -> None:
    """Runs a module in a process of its own whose calls go through the recorder."""
    library = where / "recorder.so"
    build = [str(compiler()), "-shared", "-fPIC", "-O1", "-o", str(library), str(_SOURCE), "-ldl"]
    subprocess.run([*build, "-lpthread"], check=True)
    environment = {
        **os.environ,
        "LD_PRELOAD": str(library),
        "RECORD_ROOT": str(folder.resolve()),
        "RECORD_LOG": str(log),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    command = [sys.executable, "-m", script, str(folder), *arguments]
    subprocess.run(command, check=True, cwd=ROOT, env=environment)


def mark(text: str) -> None:
    """Notes, in a recorded process, what has been promised up to here."""
    ctypes.CDLL(None).record_mark(text.encode())


def _read(content: bytes) -> Iterator[Operation]:
    at = 0
    while at < len(content):
        kind, inode, number, first, second = _HEAD.unpack_from(content, at)
        at += _HEAD.size
        yield Operation(
            kind.decode(),
            inode,
            number,
            content[at : at + first],
            content[at + first : at + first + second],
        )
        at += first + second


@dataclass
class _File:
    """What the disk holds of a file, and what was written to it since it was last forced there."""

    content: bytearray = field(default_factory=bytearray)
    pending: list[Operation] = field(default_factory=list)

    def sync(self) -> None:
        for each in self.pending:
            _apply(self.content, each, range(len(each.first)))
        self.pending.clear()

    def after(self, rng: random.Random) -> bytearray:
        """The content after a cut: each sector that was not forced to disk may be there or not."""
        content, share = bytearray(self.content), rng.choice((0.0, 0.5, 1.0))
        for each in self.pending:
            if each.kind == "T":
                if rng.random() < share:
                    _apply(content, each, range(0))
                continue
            for begin, end in _sectors(each.number, len(each.first)):
                if rng.random() < share:
                    _apply(content, each, range(begin, end))
        return content


def _sectors(offset: int, size: int) -> Iterator[tuple[int, int]]:
    """Pieces of a write, from its beginning, that lie in one sector each."""
    begin = 0
    while begin < size:
        end = min(size, begin + _SECTOR - (offset + begin) % _SECTOR)
        yield begin, end
        begin = end


def _apply(content: bytearray, each: Operation, part: range) -> None:
    if each.kind == "T":
        del content[each.number :]
        content.extend(bytes(each.number - len(content)))
        return
    begin = each.number + part.start
    content.extend(bytes(max(0, begin - len(content))))
    content[begin : begin + len(part)] = each.first[part.start : part.stop]


@dataclass
class _Naming:
    """A change of names that may not be on the disk yet, and the files that it is about."""

    operation: Operation
    file: _File | None = None


class Disk:
    """A folder as the disk holds it, while a recorded process goes on."""

    def __init__(self, folder: Path):
        self.folder = str(folder.resolve())
        self._files: dict[int, _File] = {}
        self._now: dict[str, _File | None] = {}  # names as the process sees them; None: a folder
        self._kept: dict[str, _File | None] = {}
        self._pending: list[_Naming] = []
        self.promises: list[str] = []
        for path in sorted(folder.rglob("*")):
            file = None if path.is_dir() else _File(bytearray(path.read_bytes()))
            self._now[str(path)] = self._kept[str(path)] = file
            if file is not None:
                self._files[path.stat().st_ino] = file

    def do(self, each: Operation) -> None:
        """One more operation of the process."""
        if each.kind == "K":
            self.promises.append(each.path)
        elif each.kind in "WT":
            self._files[each.inode].pending.append(each)
        elif each.kind == "S":
            self._sync(each)
        elif each.kind == "C" and not each.number:  # emptied
            empty = Operation("T", each.inode, 0, b"", b"")
            self._files[each.inode].pending.append(empty)
        else:
            self._name(each)

    def _sync(self, each: Operation) -> None:
        if each.inode in self._files:
            self._files[each.inode].sync()
        self._settle(each.path)

    def _name(self, each: Operation) -> None:
        file = self._now.get(each.path)
        if each.kind == "C":
            file = self._files[each.inode] = _File()
        naming = _Naming(each, file)
        self._pending.append(naming)
        _rename(self._now, naming)

    def _settle(self, folder: str) -> None:
        """Names in a folder are forced to disk, with those changes that they stand on."""
        names: set[str] = set()
        chosen = []
        for naming in reversed(self._pending):
            touched = {naming.operation.path, naming.operation.target} - {""}
            if touched & names or any(_parent(name) == folder for name in touched):
                names |= touched
                chosen.append(naming)
        for naming in reversed(chosen):
            _rename(self._kept, naming)
        self._pending = [naming for naming in self._pending if naming not in chosen]

    def lay_out(self, target: Path, rng: random.Random) -> None:
        """Puts what a cut now might leave into an empty folder."""
        names = dict(self._kept)
        share, prefix = rng.choice((0.0, 0.5, 1.0)), rng.random() < 0.5
        count = int(share * len(self._pending))
        for number, naming in enumerate(self._pending):
            if number < count if prefix else rng.random() < share:
                _rename(names, naming)
        for name, file in sorted(names.items()):
            path = target / PurePosixPath(name).relative_to(self.folder)
            if not path.parent.is_dir() or name.endswith("-shm"):
                continue  # what lies in a folder that is not there is lost with it
            if file is None:
                path.mkdir(exist_ok=True)
            else:
                path.write_bytes(file.after(rng))


def _parent(name: str) -> str:
    return str(PurePosixPath(name).parent)


def _rename(names: dict[str, _File | None], naming: _Naming) -> None:
    each = naming.operation
    if each.kind == "C":
        names[each.path] = naming.file
    elif each.kind == "M":
        names[each.path] = None
    elif each.kind in "UD":
        names.pop(each.path, None)
    elif each.kind in "RL":
        if each.kind == "R":
            names.pop(each.path, None)
        names[each.target] = naming.file
