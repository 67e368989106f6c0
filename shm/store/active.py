"""Lock a store for the one process that ingests into it; others stand by.

The lock is the operating system's on a file, or the PostgreSQL server's for as long as a connection
lives: either is let go of when its holder dies, however it dies. Who looks whether it is held takes
no lock, so that nobody who asks for it at that moment is refused.
"""

from __future__ import annotations

import fcntl
import os
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.errors import StoreBusy, StoreError
from shm.store.database import ACTIVE_LOCK, is_server, make_engine, shown, translated

Wait = Callable[[StoreError], bool]
"""Is told why the lock could not be had, waits, and says whether to try again."""


@contextmanager
def active(location: str | Path, lock_file: Path, wait: Wait | None) -> Iterator[ActiveLock]:
    """Holds the lock of a store, once it can be had.

    Raises what kept it from being had where there is no `wait`, where `wait` gives up, or where
    waiting cannot help.
    """
    lock = ServerLock(location) if is_server(location) else FileLock(lock_file)
    try:
        _take(lock, wait)
        yield lock
    finally:
        lock.release()


def holder(location: str | Path, lock_file: Path) -> str | None:
    """Return who ingests into a store now, without locking; None where nobody does.

    Raises StoreError.
    """
    if not is_server(location):
        return FileLock(lock_file).holder()
    lock = ServerLock(location)
    try:
        return lock.holder()
    finally:
        lock.release()


def _take(lock: ActiveLock, wait: Wait | None) -> None:
    while True:
        try:
            return lock.take()
        except StoreError as error:
            if wait is None or error.retry_after_s is None or not wait(error):
                raise


class FileLock:
    """The lock of a store that is a file: a file beside it that holds the process's number."""

    def __init__(self, path: Path):
        self._path = path
        self._file: IO[str] | None = None

    def take(self) -> None:
        """Raises StoreBusy where another process is active, StoreError where none can tell."""
        try:
            file = self._path.open("a+", encoding="utf-8")
        except OSError as error:
            raise StoreError(
                f"{self._path} cannot be written ({error.strerror}).",
                remedy="Give this user write access to its folder.",
            ) from error
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # processes of shm 1.0.0 know only it
            if _HAS_OFD_LOCKS:
                fcntl.fcntl(file, fcntl.F_OFD_SETLK, _pack_lock(fcntl.F_WRLCK))
        except BlockingIOError:
            file.seek(0)
            holder = file.read().strip() or "unknown"
            file.close()
            raise _busy(f"process {holder}", str(self._path.parent)) from None
        try:
            os.ftruncate(file.fileno(), 0)
            os.write(file.fileno(), str(os.getpid()).encode())
        except OSError as error:
            file.close()
            raise StoreError(
                f"{self._path} cannot be written ({error.strerror}).",
                remedy="Free some space on its disk.",
                retry_after_s=60.0,
            ) from error
        self._file = file

    def held(self) -> bool:
        """Return True if it is still ours; who has lost it must stop ingesting at once.

        False too where the file was removed: the next process would lock another one.
        """
        if self._file is None:
            return False
        try:
            return os.path.samestat(os.fstat(self._file.fileno()), self._path.stat())
        except FileNotFoundError:
            return False

    def release(self) -> None:
        """Lets another have it."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def holder(self) -> str | None:
        """Return who has it, without locking; None where nobody has."""
        try:
            with self._path.open(encoding="utf-8") as file:
                return f"process {file.read().strip() or 'unknown'}" if _is_locked(file) else None
        except OSError:
            return None


_HAS_OFD_LOCKS = hasattr(fcntl, "F_OFD_GETLK")  # Linux; elsewhere nobody can look without locking


def _pack_lock(kind: int) -> bytes:
    """Pack the `struct flock` of a lock of some kind on a complete file."""
    return struct.pack("hhqqi0q", kind, os.SEEK_SET, 0, 0, 0)


def _is_locked(file: IO[str]) -> bool:
    """Return True if another open file holds the lock, which is left as it is."""
    if _HAS_OFD_LOCKS:
        found = fcntl.fcntl(file, fcntl.F_OFD_GETLK, _pack_lock(fcntl.F_WRLCK))
        return bool(struct.unpack_from("h", found)[0] != fcntl.F_UNLCK)
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    return False


class ServerLock:
    """The lock of a store in PostgreSQL: an advisory lock of one connection kept for it alone."""

    def __init__(self, location: str | Path):
        # Without a pool: a closed connection is really closed, and its lock with it.
        self._engine = make_engine(location, poolclass=sa.NullPool)
        self._shown = shown(self._engine.url)
        self._connection: Connection | None = None

    def take(self) -> None:
        with translated(self._shown):
            try:
                connection = self._connected()
                if connection.scalar(_TAKE, _KEY):
                    return
                holder = connection.scalar(_HOLDER, _KEY) or "another process"
            except sa.exc.SQLAlchemyError:
                self._drop()
                raise
        raise _busy(holder, self._shown)

    def held(self) -> bool:
        if self._connection is None:
            return False
        try:
            return bool(self._connection.scalar(_HELD, _KEY))
        except sa.exc.SQLAlchemyError:
            self._drop()
            return False

    def release(self) -> None:
        if self._connection is not None:
            with suppress(sa.exc.SQLAlchemyError):  # a dead connection has let go already
                self._connection.execute(_RELEASE)
            self._drop()
        self._engine.dispose()

    def holder(self) -> str | None:
        with translated(self._shown):
            found = self._connected().scalar(_HOLDER, _KEY)
        return None if found is None else str(found)

    def _connected(self) -> Connection:
        if self._connection is None:
            connection = self._engine.connect()
            self._connection = connection.execution_options(
                isolation_level="AUTOCOMMIT", shm_reading=True
            )
            connection.execute(_NAME, {"name": f"process {os.getpid()} on {socket.gethostname()}"})
        return self._connection

    def _drop(self) -> None:
        if self._connection is not None:
            connection, self._connection = self._connection, None
            with suppress(sa.exc.SQLAlchemyError):
                connection.invalidate()
            connection.close()


ActiveLock = FileLock | ServerLock
"""The right to ingest into one store."""

_KEY = {"active": ACTIVE_LOCK}
_TAKE = sa.text("SELECT pg_try_advisory_lock(:active, hashtext(current_schema()))")
_HELD = sa.text(
    "SELECT EXISTS (SELECT FROM pg_locks WHERE locktype = 'advisory' AND classid = :active"
    " AND pid = pg_backend_pid() AND granted)"
)
_HOLDER = sa.text(
    "SELECT application_name FROM pg_locks JOIN pg_stat_activity USING (pid)"
    " WHERE locktype = 'advisory' AND classid = :active"
    " AND objid::bigint = hashtext(current_schema())::bigint & 4294967295"
    " AND database = (SELECT oid FROM pg_database WHERE datname = current_database()) AND granted"
)
_RELEASE = sa.text("SELECT pg_advisory_unlock_all()")
_NAME = sa.text("SELECT set_config('application_name', :name, false)")


def _busy(holder: str, where: str) -> StoreBusy:
    return StoreBusy(
        f"{holder} already ingests into {where}.",
        remedy="Put the files into its spool/ folder, or stop that process.",
        retry_after_s=1.0,
    )
