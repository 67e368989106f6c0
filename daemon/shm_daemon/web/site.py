"""The site of a request: the workspace as described now, and its open store.

Who comes with wrong tokens too often has to wait, and is named in the log.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any

from shm.errors import BadInput, NothingThere, ShmError, StoreError
from shm.store import Store, Workspace
from shm.store.people import same_name
from shm.store.recordings import list_holds
from shm.values import Hanger
from shm_daemon.web.address import Address, network_of

MOST_WRONG, WITHIN_S = 10, 60.0
"""A person mistypes a few; a program with an old token comes again and again."""
_MOST_PASSWORDS = 100  # NIST SP 800-63B-4, 3.2.2, of one name anywhere; of all names at an address
_MAX_COUNTERS = 4096  # technical: below a megabyte of memory


class WrongAttempts:
    """Count the recent wrong passwords and tokens by address and by user; safe for threads.

    Passwords count by user too: behind a proxy that names nobody all people have one address, and
    who mistypes must not keep others out. Those of one user count over all addresses, too: who
    guesses may have thousands. Memory is bounded: the oldest counts are forgotten.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        self._clock, self._lock = clock, threading.Lock()
        self._wrong: OrderedDict[tuple[str, ...], tuple[float, int]] = OrderedDict()

    def wait_s(self, address: str, name: str | None = None) -> float:
        """Return the seconds until a password (or, without a name, a token) is checked again."""
        with self._lock:
            counts = [(self._wrong.get(key), most) for key, most in _counted(address, name)]
            due = [found[0] + WITHIN_S for found, most in counts if found and found[1] >= most]
        return max([0.0, *(at - self._clock() for at in due)])

    def note_wrong(self, address: str, name: str | None = None) -> None:
        """Count a wrong password of this user, or a wrong token."""
        now = self._clock()
        for key, most in _counted(address, name):
            with self._lock:
                began, times = self._wrong.pop(key, (now, 0))
                if now - began >= WITHIN_S:
                    began, times = now, 0
                self._wrong[key] = (began, times + 1)
                while len(self._wrong) > _MAX_COUNTERS:
                    self._wrong.popitem(last=False)
            if times + 1 == most:
                whose = address if key[0] else f"all addresses for the user {name!r}"
                log.warning(
                    "%d wrong tokens or passwords came from %s within %.0f s: it has to wait",
                    most, whose, WITHIN_S,
                )  # fmt: skip
        log.warning("a token or password from %s is wrong or revoked", address)


def _counted(address: str, name: str | None) -> tuple[tuple[tuple[str, ...], int], ...]:
    """Return the counters of a wrong password or token, and the limit of each."""
    network = network_of(address)
    if name is None:
        return (((network, "token"), MOST_WRONG),)
    return (
        ((network, "user", same_name(name)), MOST_WRONG),
        ((network, "users"), _MOST_PASSWORDS),
        (("", "user", same_name(name)), _MOST_PASSWORDS),
    )


log = logging.getLogger(__name__)


class Description:
    """The workspace as `bridge.toml` describes it. May be used from many threads."""

    def __init__(self, workspace: Workspace):
        self._workspace, self._described_at = workspace, modified_ns(workspace)
        self._fault: ShmError | None = None
        self._lock = threading.Lock()

    def forget(self) -> None:
        """Have it read again: a setting was changed."""
        with self._lock:
            self._described_at = -1

    def now(self) -> tuple[Workspace, ShmError | None]:
        """Return the description or, where that has a fault, the last good one; and the fault."""
        with self._lock:
            modified = modified_ns(self._workspace)
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
        self.wrong_attempts = WrongAttempts()
        self._store: Store | None = None
        self._lock = threading.Lock()

    def twin(self) -> Site:
        """Return a copy with separate connections to the store, which need not wait for these."""
        return Site(self._description, self.address)

    @property
    def workspace(self) -> Workspace:
        """As `bridge.toml` describes it now, or as it last did without fault."""
        return self._description.now()[0]

    @property
    def fault(self) -> ShmError | None:
        """Return the error of the present `bridge.toml`, None if there is none."""
        return self._description.now()[1]

    def forget_description(self) -> None:
        """Have the description read again: a setting was changed."""
        self._description.forget()

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
        """Return True if a request with this `Host` is meant for us."""
        names = self.workspace.settings.web_hosts.lower().split(",")
        return self.address.answers_to(host_header, tuple(name.strip() for name in names if name))

    def close(self) -> None:
        with self._lock:
            if self._store is not None:
                self._store.close()
                self._store = None


def modified_ns(workspace: Workspace) -> int:
    """Return when `bridge.toml` was last written (ns); 0 if it cannot be read."""
    try:
        return Path(workspace.bridge.source).stat().st_mtime_ns
    except OSError:
        return 0


def held_documents(site: Site, hanger: int | None = None) -> list[dict[str, Any]]:
    """Return the held recordings, the oldest first; of one hanger if given."""
    return [
        {
            "recording": hold.recording_id,
            "file": hold.file_name,
            "hanger": hold.hanger,
            "held_at": hold.held_at,
            "message": hold.message,
        }
        for hold in list_holds(site.store, hanger)
    ]


def described(workspace: Workspace, hanger_id: int) -> Hanger:
    """Return a hanger of the bridge; raises NothingThere."""
    try:
        return workspace.bridge.hanger(hanger_id)
    except BadInput as error:
        raise NothingThere(error.message, remedy=error.remedy) from error


def quarantined(workspace: Workspace) -> int:
    """Count the refused files in the quarantine."""
    return sum(1 for _ in workspace.quarantine.folder.glob("*.reason.json"))
