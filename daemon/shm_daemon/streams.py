"""Keeps the ring while the daemon serves: rolling files in, ten minutes sealed, what is old out.

In a thread of its own, so that neither holds up the other: a recording that takes long, and samples
that come every few seconds. What was under way when it ends is done the next time.

Rolling files of loggers in `spool/streams/NAME/`: read in the sandbox, cut into chunks, removed.

A file is taken once it has not changed for `spool_stable_seconds`; the newest of a folder, which a
logger may still write, once it has not for 30 times as long. Chunks are cut at full minutes, which
number them: a file that is read again after a crash gives the same chunks, and those are known.
What no file says stands in a sidecar, or for all of a folder in its `stream.toml`.

Chunks of streams, by whatever way they come: kept in the ring, or refused with a reason.
"""

from __future__ import annotations

import logging
import math
import re
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from shm.errors import BadInput, DoubledChunk, ShmError, retry_pause_s
from shm.pipeline.faults import move_to_quarantine
from shm.pipeline.lineage import read_limits
from shm.pipeline.stream_health import sweep_ring
from shm.read import sidecar_path
from shm.read.chunk_document import BY_TIME, chunk_document
from shm.read.sandbox import read_test
from shm.store import Store, Workspace
from shm.store.archive import checksum, refuse_oversize
from shm.store.ring import StoredChunk, ring_of
from shm.store.streams import list_stream_events
from shm.values import Channel, FloatArray, Recording
from shm.values.stream import Chunk, Stream, StreamEvent
from shm_daemon.background import Background
from shm_daemon.spool import STREAMS, FileStabilityTracker, scan

log = logging.getLogger(__name__)


def take_chunks(
    workspace: Workspace, store: Store, stream: str, contents: Sequence[bytes], now: datetime
) -> list[StoredChunk]:
    """Keeps chunks of a stream: they are on disk when this returns.

    Raises BadInput where one cannot be used, which is noted, and ShmError with `retry_after_s`
    where it is to be sent again later.
    """
    try:
        return ring_of(workspace, lambda: now).append_all(contents, stream)
    except DoubledChunk as error:
        log.warning("stream %s: refused: %s", stream, error)
        store.streams.save_event(StreamEvent(stream, "doubled", now, now, error.message))
        raise
    except BadInput as error:
        note_refused(store, stream, error, now)
        raise


def note_refused(store: Store, stream: str, error: BadInput, now: datetime) -> None:
    """Once an hour: a logger that is set up wrong sends as wrong a chunk every few seconds."""
    log.warning("stream %s: refused: %s", stream, error)
    hour = now.replace(minute=0, second=0, microsecond=0)
    known = list_stream_events(store, stream, hour)
    if all(event.kind != "refused" or event.start < hour for event in known):
        store.streams.save_event(StreamEvent(stream[:64], "refused", now, now, str(error)[:500]))


_PATIENCE_WITH_NEWEST = 30.0  # judgement: a minute by default; loggers write at least that often
_RETRY_FILE_S = 60.0  # technical: how soon a file that could not be read or kept is tried again
_STAMP = re.compile(r"(20\d\d)-?(\d\d)-?(\d\d)[T_ -]?(\d\d)[-_.]?(\d\d)[-_.]?(\d\d)(?!\d)")
_MINUTE_S = 60


class RollingFiles:
    """Files in the folders of the streams, of which the whole ones are taken."""

    def __init__(self, stable_s: float, clock: Callable[[], datetime]):
        self._clock = clock
        self._older = FileStabilityTracker(stable_s, time.monotonic)
        self._newest = FileStabilityTracker(_PATIENCE_WITH_NEWEST * stable_s, time.monotonic)

    def take(self, workspace: Workspace, store: Store) -> int:
        """Takes what is whole; how many files are left to be taken."""
        looks = scan(workspace.spool / STREAMS)
        newest = {max((look, path) for path, look in looks.items() if path.parent == folder)[1]
                  for folder in {path.parent for path in looks}}  # fmt: skip
        left = len(looks)
        for tracker, is_newest in ((self._older, False), (self._newest, True)):
            some = {path: look for path, look in looks.items() if (path in newest) == is_newest}
            for path in tracker.whole(some):
                try:
                    self._take(workspace, store, path)
                    left -= 1
                    if path.exists():  # it was refused, and cannot be moved away
                        tracker.leave(path)
                except (ShmError, OSError) as error:
                    log.warning("%s is left for now: %s", path.name, error)
                    tracker.put_off(path, retry_pause_s(error, _RETRY_FILE_S))
        return left

    def _take(self, workspace: Workspace, store: Store, path: Path) -> None:
        name, now = path.parent.name, self._clock()
        try:
            refuse_oversize(path.stat().st_size, workspace.settings.max_file_bytes)
            stream = workspace.bridge.stream(name)
            contents = [chunk_document(chunk) for chunk in _chunks(workspace, stream, path)]
            take_chunks(workspace, store, name, contents, now)
        except BadInput as error:
            if not isinstance(error, DoubledChunk):  # which is noted
                note_refused(store, name, error, now)
            move_to_quarantine(workspace, path, path.name, error, now, checksum(path))
        else:
            path.unlink()
            sidecar_path(path).unlink(missing_ok=True)


def _chunks(workspace: Workspace, stream: Stream, path: Path) -> Iterator[Chunk]:
    common, sidecar = path.with_name("stream.toml"), sidecar_path(path)
    if (
        common.is_file() and not sidecar.exists()
    ):  # what all files of a folder do not say stands there
        shutil.copyfile(common, sidecar)
    recording, *others = read_test(path, read_limits(workspace.settings))
    if others or not isinstance(recording, Recording):
        raise _refusal("holds no samples, or those of several records", path)
    start, rate = recording.time or _stamp_of(path), recording.sampling_rate_hz
    values = np.array([each.values for each in _channels(recording, stream, path)])
    weather = recording.temperature_c
    names = tuple(channel.name for channel in stream.channels)
    for number, first, last in _minutes(start.timestamp(), rate, values):
        at = start + timedelta(seconds=first / rate)
        part = values[:, first:last].astype(np.float32)
        yield Chunk(stream.name, number, at, rate, names, part, weather)


def _channels(recording: Recording, stream: Stream, path: Path) -> list[Channel]:
    """By their names or, where the file has others, in order."""
    found, names = recording.accelerations, [channel.name for channel in stream.channels]
    by_name = {channel.name: channel for channel in found}
    if set(names) <= by_name.keys():
        return [by_name[name] for name in names]
    if len(found) != len(names):
        names_found = ", ".join(by_name) or "none"
        raise _refusal(
            f"has the channels {names_found}, where bridge.toml has {', '.join(names)}", path
        )
    return list(found)


def _minutes(start_s: float, rate: float, values: FloatArray) -> Iterator[tuple[int, int, int]]:
    """The number of each minute, and its first and its last sample but one."""
    samples, number = values.shape[1], int(start_s // _MINUTE_S)
    first = 0
    while first < samples:
        last = min(math.ceil(((number + 1) * _MINUTE_S - start_s) * rate - 1e-6), samples)
        if last > first:
            yield BY_TIME + number, first, last
        first, number = last, number + 1


def _stamp_of(path: Path) -> datetime:
    """The time in a file's name, in UTC; raises BadInput where there is none."""
    found = _STAMP.search(path.name)
    try:
        if found is not None:
            return datetime(*map(int, found.groups()), tzinfo=UTC)  # type: ignore[misc, arg-type]
    except ValueError as error:
        log.info("%s: %s", path.name, error)
    raise _refusal("says no time, nor does its name", path)


def _refusal(what: str, path: Path) -> BadInput:
    return BadInput(
        f"{what}.",
        file=path,
        remedy="See docs/permanent_sensors.md; a name may give the time: h3_20260501_101000.csv.",
    )


_LOOK_S = 2.0  # technical: chunks are sealed within seconds, of ten minutes
_SWEEP_S = 3600.0  # technical: a thirtieth of a day of samples is no matter
_RETRY_S = 60.0  # technical: a full disk is not mended sooner

Sealed = Callable[[Sequence[tuple[str, datetime]]], object]
"""Is told each stream and beginning of ten minutes that has new samples."""


class StreamKeeper(Background):
    """One turn after the other, in a thread or by whoever calls `turn`."""

    name = "streams"

    def __init__(
        self, workspace: Workspace, clock: Callable[[], datetime], sealed: Sealed = lambda _: None
    ):
        super().__init__(workspace, clock, pause_s=_LOOK_S, retry_s=_RETRY_S)
        self._sealed, self._sweep_at = sealed, 0.0
        self._files = RollingFiles(workspace.settings.spool_stable_seconds, clock)

    def turn(self) -> int:
        """Files in, ten minutes sealed and, once an hour, what is old out; how many files are left.

        Nothing where nobody has thought of streams.
        """
        workspace = self._workspace
        if not workspace.bridge.streams and not (workspace.spool / STREAMS).is_dir():
            return 0
        left, now = self._files.take(workspace, self._store), self._clock()
        ring = ring_of(workspace, self._clock, self._store.streams.save_event)
        if sealed := ring.seal(now):
            self._sealed(sealed)
        if time.monotonic() >= self._sweep_at:
            self._sweep_at = time.monotonic() + _SWEEP_S
            sweep_ring(workspace, ring, self._store, now)
            self._store.streams.sweep(now, workspace.settings.window_days)
        return left

    def break_off(self) -> None:
        """Let the turn end by itself: it waits for nothing outside."""

    def drain(self) -> None:
        """Take turns until no file is left."""
        while self.turn():
            time.sleep(_LOOK_S / 10)
