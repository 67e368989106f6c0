"""Days of a stream: each an SQLite file `YYYYMMDD.db` with a row for each chunk that begins in it.

A chunk is stored as it came. `excluded` is the reason why none of it counts, empty where it counts;
`is_sealed` is 0 until its ten minutes are over and its events are noted. What SQLite cannot read
moves to `aside/` with its reason, and the other days go on.
"""

from __future__ import annotations

import atexit
import logging
import os
import sqlite3
import threading
import zlib
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shm.documents import dump
from shm.errors import ShmError, StoreDamaged
from shm.read.atomic import replace_text
from shm.read.chunk_document import LONGEST
from shm.store.archive import sync
from shm.store.database import BUSY_SECONDS, translated
from shm.values import NAN
from shm.values.stream import PERIOD, Chunk, microseconds, time_of

log = logging.getLogger(__name__)

PERIOD_US, _LONGEST_US = (microseconds(time_of(0) + each) for each in (PERIOD, LONGEST))
_MOST_OPEN = 200  # technical: today's files of as many streams; each is three of 1024 open files
_ALL_SEALED = 1  # `user_version` of a day in which no chunk waits to be sealed
_LEVEL = 1  # of zlib: 4 saves 1 % more of noise at twice the time
_TABLES = """
PRAGMA journal_mode = WAL;
CREATE TABLE chunks (
    id INTEGER PRIMARY KEY,
    start_us INTEGER NOT NULL, end_us INTEGER NOT NULL,  -- since 1970, by the logger's clock
    sequence INTEGER NOT NULL,
    arrived_us INTEGER NOT NULL,                         -- by our clock
    sampling_rate_hz REAL NOT NULL, channels TEXT NOT NULL,
    temperature_c REAL, wind_m_s REAL, event TEXT NOT NULL,
    samples INTEGER NOT NULL,
    valid INTEGER NOT NULL,                              -- samples that any channel has
    missing TEXT NOT NULL,                               -- counts without a value, by channel
    covered INTEGER NOT NULL,                            -- samples that were there already
    excluded TEXT NOT NULL,
    is_sealed INTEGER NOT NULL
);
CREATE UNIQUE INDEX counted ON chunks (start_us, sequence) WHERE excluded = '';
CREATE INDEX by_start ON chunks (start_us);
CREATE INDEX by_arrival ON chunks (arrived_us);
CREATE INDEX unsealed ON chunks (start_us) WHERE NOT is_sealed;
CREATE TABLE contents (id INTEGER PRIMARY KEY, samples BLOB NOT NULL);  -- packed, of the same id
"""


class Row(NamedTuple):
    """A chunk of a day without its samples: the columns of the table, and the file."""

    id: int | None
    start_us: int
    end_us: int
    sequence: int
    arrived_us: int
    sampling_rate_hz: float
    channels: str
    temperature_c: float | None
    wind_m_s: float | None
    event: str
    samples: int
    valid: int
    missing: str
    covered: int = 0
    excluded: str = ""
    is_sealed: int = 0
    day: Path = Path()

    @property
    def period_us(self) -> int:
        """Return when the ten minutes began that it begins in."""
        return self.start_us // PERIOD_US * PERIOD_US


def row_of(chunk: Chunk, arrived_us: int) -> Row:
    """Return the row of a chunk that counts in full, as far as is known before the others."""
    missing = np.isnan(chunk.values)
    counts = missing.sum(axis=1).tolist() if missing.any() else []
    return Row(
        None,
        start_us=microseconds(chunk.start),
        end_us=microseconds(chunk.end),
        sequence=chunk.sequence,
        arrived_us=arrived_us,
        sampling_rate_hz=chunk.sampling_rate_hz,
        channels=" ".join(chunk.channels),
        temperature_c=chunk.temperature_c,
        wind_m_s=chunk.wind_m_s,
        event=chunk.event,
        samples=chunk.values.shape[1],
        valid=int((~missing.all(axis=0)).sum()),
        missing=" ".join(map(str, counts)),
    )


class StreamDays:
    """All days of one stream."""

    def __init__(self, folder: Path):
        self.folder = folder

    def path(self, start_us: int) -> Path:
        """Return the file for a chunk by when it begins."""
        return self.folder / f"{time_of(start_us):%Y%m%d}.db"

    def paths(self, since_us: int | None = None, until_us: int | None = None) -> list[Path]:
        """Return the files there are, by time, of chunks that begin within a time."""
        least = "" if since_us is None else self.path(since_us).name
        most = "9" if until_us is None else self.path(until_us).name
        return sorted(p for p in self.folder.glob("[0-9]*.db") if least <= p.name <= most)

    def make(self) -> None:
        """Make the folder, to outlast a power cut."""
        if not self.folder.is_dir():
            self.folder.mkdir(parents=True, exist_ok=True)
            for folder in (self.folder.parent, self.folder.parent.parent):
                sync(folder)

    def rows(self, paths: Iterable[Path], where: str, *values: object) -> list[Row]:
        """Return the rows of some days where a condition holds, by time."""
        sql = f"SELECT * FROM chunks WHERE {where} ORDER BY start_us, sequence"  # noqa: S608 - ours
        return [Row._make((*each, path)) for path in paths for each in query(path, sql, *values)]

    def between(self, start_us: int, end_us: int) -> list[Row]:
        """Return the rows of chunks that have samples within a time, whether they count or not."""
        since_us = start_us - _LONGEST_US
        where = "start_us >= ? AND start_us < ? AND end_us > ?"
        return self.rows(self.paths(since_us, end_us), where, since_us, end_us, start_us)

    def unsealed(self) -> list[Row]:
        """Return the rows that are not sealed."""
        paths = [path for path in self.paths() if not _is_all_sealed(path)]
        return self.rows(paths, "NOT is_sealed")

    def load(self, row: Row) -> Chunk | None:
        """Return a chunk with its samples; None where they are damaged, which excludes it."""
        channels = tuple(row.channels.split())
        found = query(row.day, "SELECT samples FROM contents WHERE id = ?", row.id)
        try:
            values = _unpacked(found[0][0], len(channels), row.samples)
        except (IndexError, ValueError, zlib.error) as error:
            log.error("a chunk of %s is damaged: %s", row.day, error)
            self.exclude([row], f"its samples are damaged: {error}")
            return None
        stated = row.temperature_c, row.wind_m_s
        temperature_c, wind_m_s = (NAN if each is None else each for each in stated)
        start, rate = time_of(row.start_us), row.sampling_rate_hz
        name = self.folder.name
        weather = temperature_c, wind_m_s, row.event
        return Chunk(name, row.sequence, start, rate, channels, values, *weather)

    def add(self, row: Row, chunk: Chunk) -> None:
        """Add a chunk; one of the same number and beginning that counts makes room for it."""
        with writing([self.path(row.start_us)]) as (connection,):
            if not row.excluded:
                old = "SELECT id FROM chunks WHERE start_us = ? AND sequence = ? AND excluded = ''"
                for each in connection.execute(old, (row.start_us, row.sequence)).fetchall():
                    connection.execute("DELETE FROM chunks WHERE id = ?", each)
                    connection.execute("DELETE FROM contents WHERE id = ?", each)
            marks = ", ".join("?" * len(row[:-1]))
            sql = f"INSERT INTO chunks VALUES ({marks})"  # noqa: S608 - question marks alone
            added = connection.execute(sql, row[:-1]).lastrowid
            connection.execute("INSERT INTO contents VALUES (?, ?)", (added, _packed(chunk)))
            _note_sealed(connection)

    def exclude(self, rows: Iterable[Row], reason: str) -> None:
        """Let chunks count no more, for a reason; their ten minutes are to be sealed once more."""
        self._change(rows, "UPDATE chunks SET excluded = ?, is_sealed = 0 WHERE id = ?", reason)

    def seal(self, rows: Iterable[Row]) -> None:
        """Mark chunks whose events are noted."""
        self._change(rows, "UPDATE chunks SET is_sealed = 1 WHERE id = ?")

    def _change(self, rows: Iterable[Row], sql: str, *values: object) -> None:
        for path, of_day in groupby(sorted(rows, key=_day), _day):
            with writing([path]) as (connection,):
                connection.executemany(sql, [(*values, row.id) for row in of_day])
                _note_sealed(connection)

    def thin(self, path: Path, retained_us: Sequence[tuple[int, int]], *, may_go: bool) -> None:
        """Remove what a day has outside of some times, and the day if that is all and it may go.

        A day that still takes chunks must stay: another process may have it open.
        """
        inside = " OR ".join(["0", *("start_us < ? AND end_us > ?" for _ in retained_us)])
        edges = [edge for start_us, end_us in retained_us for edge in (end_us, start_us)]
        with writing([path]) as (connection,):
            sql = f"DELETE FROM chunks WHERE NOT ({inside})"  # noqa: S608 - question marks alone
            gone = connection.execute(sql, edges).rowcount
            connection.execute("DELETE FROM contents WHERE id NOT IN (SELECT id FROM chunks)")
            (left,) = connection.execute("SELECT COUNT(*) FROM chunks").fetchone()
        if may_go and not left:
            with _LOCK:
                _forget(path)
                for each in _files(path):
                    each.unlink(missing_ok=True)
        elif gone:
            with _LOCK, translated(str(path), sqlite3.Error):
                connection.execute("VACUUM")
                connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def _note_sealed(connection: sqlite3.Connection) -> None:
    """Note in the head of a day whether all of it is sealed."""
    (waits,) = connection.execute(
        "SELECT EXISTS (SELECT 1 FROM chunks WHERE NOT is_sealed)"
    ).fetchone()
    (noted,) = connection.execute("PRAGMA user_version").fetchone()
    if (wanted := 0 if waits else _ALL_SEALED) != noted:
        connection.execute(f"PRAGMA user_version = {wanted}")


def _day(row: Row) -> Path:
    return row.day


def _packed(chunk: Chunk) -> bytes:
    """Return samples channel by channel, the first bytes of all numbers first, compressed."""
    values = np.ascontiguousarray(chunk.values, dtype="<f4")
    return zlib.compress(values.view(np.uint8).reshape(-1, 4).T.tobytes(), _LEVEL)


def _unpacked(content: bytes, channels: int, samples: int) -> NDArray[np.float32]:
    planes = np.frombuffer(zlib.decompress(content), np.uint8).reshape(4, -1)
    return np.ascontiguousarray(planes.T).view("<f4").reshape(channels, samples)


def _is_all_sealed(path: Path) -> bool:
    """Return True if a day says so that no process has open: opening it takes ten times as long."""
    if path.with_name(f"{path.name}-wal").exists():
        return False
    try:
        with path.open("rb") as file:
            head = file.read(64)
    except FileNotFoundError:
        return True
    return int.from_bytes(head[60:64]) == _ALL_SEALED  # where SQLite keeps `user_version`


def size_of(path: Path) -> int:
    """Return the size of a day with what SQLite has not written into it yet."""
    return sum(each.stat().st_size for each in _files(path))


def _files(path: Path) -> list[Path]:
    candidates = (path.with_name(f"{path.name}{suffix}") for suffix in ("", "-wal", "-shm"))
    return [each for each in candidates if each.exists()]


def query(path: Path, sql: str, *values: object) -> list[Any]:
    """Return what SQLite selects from a day: nothing where it is damaged or gone."""
    try:
        with translated(str(path), sqlite3.Error), _reading(path) as connection:
            return connection.execute(sql, values).fetchall() if connection else []
    except StoreDamaged as error:
        quarantine(path, path.parent / "aside", error)
        return []


@contextmanager
def writing(paths: Iterable[Path]) -> Iterator[list[sqlite3.Connection]]:
    """Write into days, which are made where they are not there; on disk once the block has ended.

    Within another such block on a day it is a part of that. Raises StoreError.
    """
    begun: list[sqlite3.Connection] = []
    wanted = sorted(set(paths))
    try:
        with _LOCK, translated(str(wanted[0].parent), sqlite3.Error):
            try:
                connections = [_writable(path) for path in wanted]
                for connection in connections:
                    if not connection.in_transaction:
                        connection.execute("BEGIN IMMEDIATE")
                        begun.append(connection)
                yield connections
                for connection in begun:
                    connection.execute("COMMIT")
            except BaseException:
                for connection in begun:
                    if connection.in_transaction:
                        connection.execute("ROLLBACK")
                raise
    except StoreDamaged as error:
        for path in wanted:
            if path.exists() and query(path, "PRAGMA quick_check(1)") != [("ok",)]:
                quarantine(path, path.parent / "aside", error)
        raise


def quarantine(path: Path, folder: Path, error: ShmError) -> None:
    """Move a damaged file into a folder that nobody reads, with the reason."""
    if not path.exists():
        return
    folder.mkdir(exist_ok=True)
    log.error("%s is set aside: %s", path, error.message)
    replace_text(folder / f"{path.name}.reason.json", dump({"message": error.message}) + "\n")
    with _LOCK:
        _forget(path)
        for each in _files(path):
            each.replace(folder / each.name)


# Closing the last connection to a file writes all that waits into it, which takes as long as two
# more chunks: so those that were written stay open.
_LOCK = threading.RLock()
_OPEN: OrderedDict[Path, tuple[int, sqlite3.Connection]] = OrderedDict()


def _known(path: Path) -> sqlite3.Connection | None:
    """Return the open connection to a day, unless another file has its name by now."""
    if path in _OPEN:
        file_number, connection = _OPEN[path]
        if path.exists() and path.stat().st_ino == file_number:
            _OPEN.move_to_end(path)
            return connection
        _forget(path)
    return None


def _forget(path: Path) -> None:
    if path in _OPEN:
        _OPEN.pop(path)[1].close()


def _writable(path: Path) -> sqlite3.Connection:
    connection = _known(path)
    if connection is None:
        if not path.exists():
            _make(path)
        connection = _connect(path)
        _OPEN[path] = path.stat().st_ino, connection
        while len(_OPEN) > _MOST_OPEN:
            _forget(next(iter(_OPEN)))
    return connection


@contextmanager
def _reading(path: Path) -> Iterator[sqlite3.Connection | None]:
    """Yield a connection to a day; None where there is no such day."""
    with _LOCK:
        if (known := _known(path)) is not None:
            yield known
            return
    if not path.exists():
        yield None
        return
    connection = _connect(path)
    try:
        yield connection
    finally:
        connection.close()


def _connect(path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(
        f"{path.absolute().as_uri()}?mode=rw",
        uri=True,
        timeout=BUSY_SECONDS,
        isolation_level=None,
        check_same_thread=False,
    )
    connection.execute("PRAGMA synchronous = FULL")  # a chunk is acknowledged once it is on disk
    return connection


def _make(path: Path) -> None:
    """Make a day that appears with its tables, to outlast a power cut."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    temporary.unlink(missing_ok=True)
    try:
        connection = sqlite3.connect(temporary, isolation_level=None)
        try:
            connection.executescript(_TABLES)
        finally:
            connection.close()
        with suppress(FileExistsError):  # another process was quicker
            os.link(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    sync(path.parent)


@atexit.register
def close_days() -> None:
    """Close the days that this process has written; the next use opens them again."""
    with _LOCK:
        for path in list(_OPEN):
            _forget(path)
