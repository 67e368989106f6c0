"""What every request works with: the workspace as it is described now, and its open store."""

from __future__ import annotations

import logging
import threading
from pathlib import Path

from shm.errors import NothingThere, ShmError, StoreError
from shm.store import Store, Workspace
from shm_daemon.web.address import Address
from shm_daemon.web.throttle import WrongTokens

log = logging.getLogger(__name__)


class Description:
    """The workspace as `bridge.toml` describes it. May be used from many threads."""

    def __init__(self, workspace: Workspace):
        self._workspace, self._described_at = workspace, _modified_ns(workspace)
        self._fault: ShmError | None = None
        self._lock = threading.Lock()

    def now(self) -> tuple[Workspace, ShmError | None]:
        """As it is described now or, where that has a fault, as it last was; and the fault."""
        with self._lock:
            modified = _modified_ns(self._workspace)
            if modified != self._described_at:
                self._described_at = modified
                try:
                    self._workspace, self._fault = self._workspace.reopened(), None
                except (ShmError, OSError) as error:
                    self._fault = error if isinstance(error, ShmError) else ShmError(f"{error}.")
                    log.error("bridge.toml is not taken over: %s", error)
            return self._workspace, self._fault


class Site:
    """One workspace served at one address. May be used from many threads."""

    def __init__(self, description: Description, address: Address):
        self.address = address
        self._description = description
        self.wrong_tokens = WrongTokens()
        self._store: Store | None = None
        self._lock = threading.Lock()

    def twin(self) -> Site:
        """The same with connections of its own to the store: it need not wait for this one's."""
        return Site(self._description, self.address)

    @property
    def workspace(self) -> Workspace:
        """As `bridge.toml` describes it now, or as it last did without fault."""
        return self._description.now()[0]

    @property
    def fault(self) -> ShmError | None:
        """What is wrong with `bridge.toml` as it is now."""
        return self._description.now()[1]

    @property
    def store(self) -> Store:
        """Opened at the first use, so that the interface can say that there is none yet."""
        with self._lock:
            if self._store is None:
                try:
                    self._store = self.workspace.store()
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
