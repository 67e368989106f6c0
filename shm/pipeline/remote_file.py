"""A step where it is computed: a recording for a machine that does not see the archive."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ParamSpec, Self, TypeAlias, TypeVar

from shm.errors import StoreError
from shm.read import sidecar_path
from shm.resources import give_back_memory
from shm.store import Archive, ReceivedFile

if TYPE_CHECKING:
    from shm.values import Alert, WatchedTest


@dataclass(frozen=True)
class RemoteFile:
    """The bytes of a file and of its sidecar; None where the archive has none."""

    content: bytes | None = field(repr=False)
    sidecar: bytes | None = field(repr=False)
    damage: str = ""

    @classmethod
    def of(cls, archive: Archive, file: ReceivedFile, most_bytes: int) -> Self:
        """Packs an archived file; one that is larger will be refused, and is not packed."""
        fits = archive.holds(file) and file.size_bytes <= most_bytes
        if fits:
            try:
                archive.refuse_damaged(file)
            except StoreError as error:
                return cls(None, None, str(error))
        content, sidecar = (
            (archive.folder / part).read_bytes() if fits and part is not None else None
            for part in (file.archived_as, file.sidecar_as)
        )
        return cls(content, sidecar)

    @contextmanager
    def opened(self, file: ReceivedFile) -> Iterator[Path]:
        """The file as the archive would show it, in a folder of its own."""
        if self.content is None:
            raise StoreError(
                self.damage or f"{file.file_name} is not in the archive.",
                remedy="" if self.damage else "Drop the file again.",
            )
        with tempfile.TemporaryDirectory(prefix="shm-") as folder:
            path = Path(folder) / Path(file.file_name).name
            path.write_bytes(self.content)
            if self.sidecar is not None:
                sidecar_path(path).write_bytes(self.sidecar)
            yield path


Opens: TypeAlias = "Archive | RemoteFile"
"""What shows a received file under the name it came with."""

WatchResult: TypeAlias = "tuple[WatchedTest, Alert | None, bytes]"
"""What the watch says, the alert that it calls for, and what to keep."""

P = ParamSpec("P")
T = TypeVar("T")


def run_step(step: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
    """Return what a step gives; the process that ran it gives back the memory that it has freed."""
    try:
        return step(*arguments, **named)
    finally:
        give_back_memory()
