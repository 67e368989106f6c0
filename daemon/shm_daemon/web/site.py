"""What every request works with: the workspace as it is described now, and its open store."""

from __future__ import annotations

import logging
import threading
from pathlib import Path

from shm.errors import NothingThere, ShmError, StoreError
from shm.store import Store, Workspace
from shm_daemon.web.address import Address

log = logging.getLogger(__name__)


class Site:
    """One workspace served at one address. May be used from many threads."""

    def __init__(self, workspace: Workspace, address: Address):
        self.address = address
        self._workspace, self._described_at = workspace, _modified_ns(workspace)
        self._store: Store | None = None
        self._lock = threading.Lock()

    @property
    def workspace(self) -> Workspace:
        """As `bridge.toml` describes it now, or as it last did without fault."""
        with self._lock:
            modified = _modified_ns(self._workspace)
            if modified != self._described_at:
                self._described_at = modified
                try:
                    self._workspace = self._workspace.reopened()
                except ShmError as error:
                    log.error("bridge.toml is not taken over: %s", error)
            return self._workspace

    @property
    def store(self) -> Store:
        """Opened at the first use, so that the interface can say that there is none yet."""
        with self._lock:
            if self._store is None:
                try:
                    self._store = self._workspace.store()
                except NothingThere as error:
                    raise StoreError(error.message, remedy=error.remedy) from error
            return self._store

    def answers_to(self, host_header: str) -> bool:
        """Whether a request with this `Host` is meant for us."""
        names = self.workspace.settings.web_hosts.lower().split(",")
        return self.address.answers_to(host_header, tuple(name.strip() for name in names if name))

    def close(self) -> None:
        with self._lock:
            if self._store is not None:
                self._store.close()
                self._store = None


def _modified_ns(workspace: Workspace) -> int:
    try:
        return Path(workspace.bridge.source).stat().st_mtime_ns
    except OSError:
        return 0
