"""Points for time-series databases that wait in a file until each is taken: record 0027."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from shm.errors import StoreError

FILE = "points.db"
_TABLES = """
CREATE TABLE IF NOT EXISTS points (
    id INTEGER PRIMARY KEY, target TEXT NOT NULL, key TEXT NOT NULL, line TEXT NOT NULL,
    queued_at TEXT NOT NULL, state TEXT NOT NULL DEFAULT 'waiting', UNIQUE (target, key));
CREATE INDEX IF NOT EXISTS of_state ON points (target, state, id);
CREATE TABLE IF NOT EXISTS targets (
    target TEXT PRIMARY KEY, failed_at TEXT NOT NULL, why TEXT NOT NULL);
"""
_QUEUE = """
INSERT INTO points (target, key, line, queued_at) VALUES (?, ?, ?, ?)
ON CONFLICT (target, key) DO UPDATE
SET line = excluded.line, queued_at = excluded.queued_at, state = 'waiting'
WHERE line <> excluded.line
"""


def key_of(series: str, nanoseconds: int) -> str:
    """Return the key of a point; those of a series are in order of time."""
    return f"{series} {nanoseconds:020d}"


@dataclass(frozen=True)
class WaitingPoint:
    """A point that a database has not taken yet, as a line of the line protocol."""

    id: int
    line: str


@dataclass(frozen=True)
class OutboxState:
    """State of a database that lags behind; `why` is empty while it takes what it is sent."""

    waiting: int
    refused: int
    oldest_at: datetime | None
    why: str

    @property
    def words(self) -> str:
        """Return what is behind and why, for a person; empty where nothing is."""
        since = f" since {self.oldest_at:%Y-%m-%d %H:%M} UTC" if self.oldest_at else ""
        parts = [f"{self.waiting} points wait{since}"] if self.waiting else []
        if self.refused:
            again = "sent again when the daemon begins or bridge.toml changes"
            parts.append(f"{self.refused} points were refused: the log says why; they are {again}")
        return f"{'; '.join(parts)}. {self.why}".strip() if parts else ""


class PointOutbox:
    """The file of one workspace. A point has a key; queued again it waits again if it changed."""

    def __init__(self, folder: Path):
        self._path = folder / FILE

    def queue(self, target: str, lines: Mapping[str, str], at: datetime) -> int:
        """Have the lines wait for a database, by their keys; return how many are new or changed."""
        stamp = at.astimezone(UTC).isoformat()
        with self._connected() as connection:
            before = connection.total_changes
            rows = ((target, key, line, stamp) for key, line in lines.items())
            connection.executemany(_QUEUE, rows)
            return connection.total_changes - before

    def list_waiting(self, target: str, limit: int) -> list[WaitingPoint]:
        """Return the points that wait longest."""
        query = (
            "SELECT id, line FROM points WHERE target = ? AND state = 'waiting' ORDER BY id LIMIT ?"
        )
        with self._connected() as connection:
            return [WaitingPoint(*row) for row in connection.execute(query, (target, limit))]

    def list_keys(self, target: str, prefix: str) -> list[str]:
        """Return the keys that begin so, of points that were taken or wait."""
        query = "SELECT key FROM points WHERE target = ? AND key >= ? AND key < ?"
        with self._connected() as connection:
            found = connection.execute(query, (target, prefix, prefix + "\U0010ffff"))
            return [key for (key,) in found]

    def latest(self, target: str, series: str) -> str:
        """Return the line with the latest time of a series; empty where there is none."""
        query = (
            "SELECT line FROM points WHERE target = ? AND key >= ? AND key < ? "
            "ORDER BY key DESC LIMIT 1"
        )
        with self._connected() as connection:
            found = connection.execute(query, (target, f"{series} ", f"{series} \U0010ffff"))
            (line,) = found.fetchone() or ("",)
        return str(line)

    def mark(self, points: Iterable[WaitingPoint], state: str) -> None:
        """Note that points were `taken` or `refused`; one that changed meanwhile waits."""
        query = "UPDATE points SET state = ? WHERE id = ? AND line = ?"
        with self._connected() as connection:
            connection.executemany(query, ((state, each.id, each.line) for each in points))

    def forget(self, target: str, before_ns: Mapping[str, int]) -> None:
        """Remove points of each series of before a time that were taken and are not made again."""
        query = "DELETE FROM points WHERE target = ? AND key >= ? AND key < ? AND state = 'taken'"
        with self._connected() as connection:
            connection.executemany(
                query, ((target, f"{each} ", key_of(each, ns)) for each, ns in before_ns.items())
            )

    def retry_refused(self, target: str) -> None:
        """Have the points wait again that a database refused."""
        query = "UPDATE points SET state = 'waiting' WHERE target = ? AND state = 'refused'"
        with self._connected() as connection:
            connection.execute(query, (target,))

    def note_failure(self, target: str, why: str, at: datetime) -> None:
        """Note why a database takes nothing; an empty reason says that it does again."""
        query = "INSERT OR REPLACE INTO targets VALUES (?, ?, ?)"
        with self._connected() as connection:
            connection.execute(query, (target, at.astimezone(UTC).isoformat(), why))

    def state(self, target: str) -> OutboxState:
        """Return how far a database is behind; it makes no file where there is none."""
        if not self._path.exists():
            return OutboxState(0, 0, None, "")
        count = "SELECT count(*), min(queued_at) FROM points WHERE target = ? AND state = ?"
        with self._connected() as connection:
            waiting, oldest = connection.execute(count, (target, "waiting")).fetchone()
            refused, _ = connection.execute(count, (target, "refused")).fetchone()
            rows = connection.execute("SELECT why FROM targets WHERE target = ?", (target,))
            (why,) = rows.fetchone() or ("",)
        return OutboxState(
            waiting, refused, datetime.fromisoformat(oldest) if oldest else None, why
        )

    @contextmanager
    def _connected(self) -> Iterator[sqlite3.Connection]:
        """One transaction; raises StoreError."""
        try:
            with closing(sqlite3.connect(self._path)) as connection:
                connection.execute("PRAGMA journal_mode = WAL")
                connection.executescript(_TABLES)
                with connection:
                    yield connection
        except sqlite3.Error as error:
            raise StoreError(
                f"{FILE}: {error}.",
                remedy="Free some space, or let this user write there. If it is damaged, delete "
                "it: all results are then sent again, which doubles nothing.",
                retry_after_s=60.0,
            ) from error
