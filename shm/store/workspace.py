"""The folder of one bridge: its configuration, store, spool, archive and quarantine."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from shm.bridge import Bridge, load_bridge
from shm.errors import StoreBusy, UsageError
from shm.resources import default_config
from shm.settings import Settings, load_settings
from shm.store.archive import Archive, Quarantine
from shm.store.store import Store

_DATABASE = "shm.db"
_FOLDERS = ("spool", "archive", "quarantine")


@dataclass(frozen=True)
class Workspace:
    """A workspace as its `bridge.toml` describes it; `flags` are settings given for this run."""

    folder: Path
    bridge: Bridge
    settings: Settings
    flags: Mapping[str, object]

    @classmethod
    def open(cls, folder: str | Path, flags: Mapping[str, object] | None = None) -> Self:
        """An existing workspace; raises BadInput where `bridge.toml` is missing or wrong."""
        folder = Path(folder).resolve()
        bridge = load_bridge(folder / "bridge.toml")
        settings = load_settings(bridge.settings_table, flags, source=bridge.source)
        for name in _FOLDERS:
            (folder / name).mkdir(exist_ok=True)
        return cls(folder, bridge, settings, dict(flags or {}))

    @classmethod
    def initialise(cls, folder: str | Path, config: Path | None = None) -> Self:
        """Makes a workspace: folders, store, `bridge.toml` (a commented one, or `config` copied).

        Raises UsageError where the folder holds a `bridge.toml` already, BadInput where `config`
        is wrong.
        """
        folder, config = Path(folder), config or default_config()
        target = folder / "bridge.toml"
        if target.exists():
            raise UsageError(
                f"{folder} is a workspace already.", remedy="Edit its bridge.toml instead."
            )
        load_bridge(config)
        folder.mkdir(parents=True, exist_ok=True)
        Store.create(folder / _DATABASE).close()
        shutil.copyfile(config, target)
        return cls.open(folder)

    def reopened(self) -> Self:
        """The same workspace as its `bridge.toml` describes it now."""
        return type(self).open(self.folder, self.flags)

    @property
    def database(self) -> Path:
        return self.folder / _DATABASE

    @property
    def spool(self) -> Path:
        return self.folder / "spool"

    @property
    def archive(self) -> Archive:
        return Archive(self.folder / "archive")

    @property
    def quarantine(self) -> Quarantine:
        return Quarantine(self.folder / "quarantine")

    def store(self) -> Store:
        """Opens the store; raises NothingThere, SchemaOutdated or StoreError."""
        return Store.open(self.database)

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Held by the one process that ingests here; raises StoreBusy while another holds it.

        The operating system lets go of it when the process dies, however it dies.
        """
        with (self.folder / "shm.lock").open("a+", encoding="utf-8") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                file.seek(0)
                holder = file.read().strip() or "unknown"
                raise StoreBusy(
                    f"process {holder} already ingests into {self.folder}.",
                    remedy="Put the files into its spool/ folder, or stop that process.",
                    retry_after_s=5.0,
                ) from None
            file.truncate(0)
            file.write(str(os.getpid()))
            file.flush()
            yield
