"""The folder of one bridge: its configuration, store, spool, archive and quarantine."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Self

from shm.bridge import Bridge, load_bridge
from shm.errors import BadInput, ShmError, UsageError
from shm.resources import default_config
from shm.settings import Settings, commented, load_settings
from shm.store.active import ActiveLock, Wait, active, holder
from shm.store.archive import Archive, Quarantine
from shm.store.database import has_password
from shm.store.journal import Actor
from shm.store.store import Store

_DATABASE = "shm.db"
FOLDERS = ("spool", "archive", "quarantine")


@dataclass(frozen=True)
class Workspace:
    """A workspace as its `bridge.toml` describes it; `flags` are settings given for this run.

    The changes of an `actor` are noted as theirs. `newest_change` is the number of the last setting
    changed on a page that was heeded; None where the store could not be asked.
    """

    folder: Path
    bridge: Bridge
    settings: Settings
    flags: Mapping[str, object]
    actor: Actor | None = None
    newest_change: int | None = None

    @classmethod
    def open(cls, folder: str | Path, flags: Mapping[str, object] | None = None) -> Self:
        """An existing workspace; raises BadInput where `bridge.toml` is missing or wrong."""
        workspace = cls.described(folder, flags)
        for name in FOLDERS:
            (workspace.folder / name).mkdir(exist_ok=True)
        return workspace

    @classmethod
    def described(cls, folder: str | Path, flags: Mapping[str, object] | None = None) -> Self:
        """The same, but folders that are missing stay missing: for one who only looks."""
        folder = Path(folder).resolve()
        bridge = load_bridge(folder / "bridge.toml")
        settings = _settings(bridge, flags)
        newest, changed = changed_in(_location(folder, settings))
        if changed:
            bridge, settings = _with_changes(folder / "bridge.toml", changed, flags)
        return cls(folder, bridge, settings, dict(flags or {}), newest_change=newest)

    @classmethod
    def initialise(cls, folder: str | Path, config: Path | None = None) -> Self:
        """Makes a workspace: folders, store, `bridge.toml` (a commented one, or `config` copied).

        Raises UsageError where the folder holds a `bridge.toml` already, BadInput where `config`
        is wrong, StoreError where the store cannot be made.
        """
        folder, described = Path(folder), config or default_config()
        target = folder / "bridge.toml"
        if target.exists():
            raise UsageError(
                f"{folder} is a workspace already.", remedy="Edit its bridge.toml instead."
            )
        settings = _settings(load_bridge(described), None)
        folder.mkdir(parents=True, exist_ok=True)
        Store.create(_location(folder, settings)).close()
        shutil.copyfile(described, target)
        if config is None:  # the template ends with the heading of the settings
            with target.open("a", encoding="utf-8") as file:
                file.write(commented())
        return cls.open(folder)

    def change_setting(
        self,
        store: Store,
        key: str,
        value: float | str | None,
        at: datetime,
        who: str,
        *,
        based_on: int | None = None,
        in_file: str = "not set",
    ) -> None:
        """Has a value hold instead of what `bridge.toml` says; None gives the key back to it.

        Raises BadInput, as for `bridge.toml`, where it cannot hold, and UsageError where another
        change than `based_on` is in force; then nothing is changed.
        """
        current = {name: each.value for name, each in store.settings.list_current().items()}
        wanted = {name: each for name, each in {**current, key: value}.items() if each is not None}
        _settings(load_bridge(self.folder / "bridge.toml", wanted), self.flags)
        store.settings.change(key, value, who, at, based_on=based_on, in_file=in_file)

    def reopened(self) -> Self:
        """The same workspace as its `bridge.toml` describes it now."""
        return type(self).open(self.folder, self.flags)

    def copy_description(self, folder: Path) -> None:
        """Copies what describes bridge and loggers into a folder: no store holds it."""
        from shm.read.profiles import FOLDER  # which opens readers: only a backup waits for them

        shutil.copyfile(self.folder / "bridge.toml", folder / "bridge.toml")
        if (self.folder / FOLDER).is_dir():
            shutil.copytree(self.folder / FOLDER, folder / FOLDER)

    @property
    def database(self) -> Path:
        """The store's file, where the store is one."""
        return self.folder / _DATABASE

    @property
    def location(self) -> str | Path:
        """The store's file or URL; a URL may hold a password."""
        return _location(self.folder, self.settings)

    @property
    def spool(self) -> Path:
        return self.folder / "spool"

    @property
    def archive(self) -> Archive:
        return Archive(self.folder / "archive")

    @property
    def quarantine(self) -> Quarantine:
        return Quarantine(self.folder / "quarantine")

    def store(self, *, or_copy: bool = False) -> Store:
        """Opens the store, as `Store.open`; raises NothingThere, SchemaOutdated or StoreError."""
        opened = Store.open(self.location, or_copy=or_copy)
        return opened.acting_as(self.actor) if self.actor else opened

    @contextmanager
    def lock(self, wait: Wait | None = None) -> Iterator[ActiveLock]:
        """Held by the one process that ingests into this store; others may read and stand by.

        `wait` is told why it cannot be had yet (StoreBusy: another process has it), waits, and says
        whether to try again; without it that is raised at once. It is let go of when the process
        dies, however it dies; where the store is a server it can be lost, so ask `held()`.
        """
        with active(self.location, self._lock_file, wait) as lock:
            yield lock

    def holder(self) -> str | None:
        """Return who holds the lock now; None where nobody does. Raises StoreError."""
        return holder(self.location, self._lock_file)

    @property
    def _lock_file(self) -> Path:
        return self.folder / "shm.lock"


def changed_in(location: str | Path) -> tuple[int | None, Mapping[str, object]]:
    """The number of the newest change of a setting, and what holds instead of `bridge.toml`.

    None where there is no store that says: whoever needs the store is told by the store itself.
    """
    try:
        with Store.open(location, or_copy=True) as store:
            current = store.settings.list_current()
            return store.settings.newest(), {key: each.value for key, each in current.items()}
    except ShmError:
        return None, {}


def _with_changes(
    path: Path, changed: Mapping[str, object], flags: Mapping[str, object] | None
) -> tuple[Bridge, Settings]:
    """Return what holds with what a page has changed.

    Raises BadInput where it no longer fits the file.
    """
    try:
        bridge = load_bridge(path, changed)
        return bridge, _settings(bridge, flags)
    except BadInput as error:
        raise BadInput(
            error.message,
            file=path,
            remedy=f"{error.remedy} A page has changed it: {', '.join(changed)}.",
        ) from error


def _settings(bridge: Bridge, flags: Mapping[str, object] | None) -> Settings:
    in_file = str(bridge.settings_table.get("store", ""))
    if "://" in in_file and has_password(in_file):
        raise BadInput(
            "the store's URL holds a password, which everybody who reads this file would know.",
            file=bridge.source,
            remedy="Put the URL into the environment variable SHM_STORE, or leave the password "
            "to PGPASSWORD or ~/.pgpass.",
        )
    return load_settings(bridge.settings_table, flags, source=bridge.source)


def _location(folder: Path, settings: Settings) -> str | Path:
    return settings.store if "://" in settings.store else folder / (settings.store or _DATABASE)
