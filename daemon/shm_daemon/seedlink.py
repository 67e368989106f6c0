"""Streams that are asked for: records of a SeedLink server become chunks of full minutes.

A thread for each stream, by the library seedlink-client. Records wait in memory until all channels
have reached the end of a minute; they are read in the sandbox, and the minute is on disk before the
state says from which record on to go on. So a connection, a daemon or a server that ends at any
moment loses nothing that the server still has, and nothing is stored twice.
"""

from __future__ import annotations

import asyncio
import json
import logging
import math
import threading
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from shm.documents import dump, value_of
from shm.errors import BadInput, ShmError, needing
from shm.pipeline import Clock
from shm.pipeline.lineage import read_limits
from shm.read import sidecar_path
from shm.read.atomic import replace_text
from shm.read.chunk_document import BY_TIME, chunk_document
from shm.read.sandbox import read_test
from shm.store import Store, Workspace
from shm.values import Recording
from shm.values.stream import Chunk, SeedLinkFeed, Stream, microseconds, time_of
from shm_daemon.hooks.contract import one_line
from shm_daemon.streams import note_refused, take_chunks

FOLDER = "seedlink"
_MINUTE_US = timedelta(minutes=1) // timedelta(microseconds=1)
_SECOND_US = timedelta(seconds=1) // timedelta(microseconds=1)

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Pace:
    """In s: how soon to connect again, and how long one channel waits for another."""

    retry_s: float = 30.0
    patience_s: float = 600.0


@dataclass(frozen=True)
class Record:
    """A miniSEED record of one of our channels; times in µs since 1970, its end excluded."""

    station: str
    sequence: int
    channel: int
    start_us: int
    end_us: int
    payload: bytes


@dataclass
class Progress:
    """The record of each station from which on not all is on disk: its number and its time.

    `known` are number and time of those after it that are on disk; `done_us` is up to when samples
    are.
    """

    last: dict[str, tuple[int, str]]
    known: dict[str, list[tuple[int, int]]]
    done_us: int = 0

    @classmethod
    def read(cls, path: Path) -> Progress:
        """Read it; empty where there is none, or it is damaged: known samples are known then."""
        with suppress(OSError, ValueError):
            return value_of(cls, json.loads(path.read_text(encoding="utf-8")))
        return cls({}, {})


class StreamAsker:
    """Asks one server for one stream, again and again, until it is ended."""

    def __init__(
        self, workspace: Workspace, stream: Stream, clock: Clock, pace: Pace | None = None
    ):
        assert stream.feed is not None
        self._workspace, self._stream, self._clock = workspace, stream, clock
        self._feed: SeedLinkFeed = stream.feed
        self._pace, self._ended = pace or Pace(), threading.Event()
        self._store: Store | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._task: asyncio.Task[None] | None = None
        self._path = workspace.folder / FOLDER / f"{stream.name}.json"
        self._progress = Progress({}, {})
        self._pending: list[Record] = []
        self._arrived: dict[str, deque[Record]] = {}
        self._channels = {_source_id(*each): n for n, each in enumerate(self._feed.ids)}

    def run(self) -> None:
        """Receive until ended; what fails is noted, and tried again."""
        self._path.parent.mkdir(exist_ok=True)
        with suppress(asyncio.CancelledError):
            asyncio.run(self._serve())

    def end(self) -> None:
        """End it from another thread; what is not on disk is asked for again."""
        self._ended.set()
        if self._loop is not None and self._task is not None:
            with suppress(RuntimeError):  # it has ended
                self._loop.call_soon_threadsafe(self._task.cancel)

    async def _serve(self) -> None:
        self._loop, self._task = asyncio.get_running_loop(), asyncio.current_task()
        known = (ShmError, OSError, _library().SeedLinkError)
        while not self._ended.is_set():
            try:
                with self._workspace.store() as self._store:
                    try:
                        await self._receive()
                    except known[1:] as error:
                        if not self._arrived:
                            self._note_refused(error)
                        raise
            except Exception as error:  # the daemon goes on without this stream
                is_known = isinstance(error, known)
                name = self._stream.name
                log.warning("stream %s waits: %s", name, error, exc_info=not is_known)
            await asyncio.sleep(self._pace.retry_s)

    def _note_refused(self, error: Exception) -> None:
        """Note once an hour why the server sends nothing, or something that cannot be used."""
        refusal = BadInput(
            f"{self._feed.host}:{self._feed.port}: {one_line(str(error))}.",
            remedy="See that the server runs and has these channels; it is asked again.",
        )
        assert self._store is not None
        note_refused(self._store, self._stream.name, refusal, self._clock())

    async def _receive(self) -> None:
        """Take records until the connection ends; go on after the last one that is on disk."""
        library = _library()
        self._progress = Progress.read(self._path)
        self._pending, self._arrived = [], {}
        client = library.AsyncSeedLink(
            self._feed.host,
            self._feed.port,
            timeout=10.0,
            keepalive=30.0,
            idle_timeout=self._pace.patience_s,
            clientname="shm",
        )
        stations: dict[str, list[str]] = {}
        for network, station, location, code in self._feed.ids:
            selector = f"{location or '--'}{code}"
            stations.setdefault(f"{network}_{station}", []).append(selector)
        for name, selectors in stations.items():
            sequence, time = self._progress.last.get(name, (None, None))
            client.add_stream(name, selectors, seqnum=sequence, timestamp=time)
        try:
            await client.connect()
            log.info("stream %s: connected to %s", self._stream.name, client.server_id)
            async for packet in client.collect(reconnect=False):
                self._take(packet)
            raise library.SeedLinkError("the connection ended")
        except library.SeedLinkTimeout:
            self._flush_all()
            raise
        finally:
            await client.close()

    def _take(self, packet: Any) -> None:
        try:
            header = packet.record()
        except _library().SeedLinkError as error:  # asked for again it would be no better
            self._note_refused(error)
            return
        channel = self._channels.get(header.sourceid)
        if channel is None or header.samprate <= 0:
            return  # a server may send more than was selected
        start_us = header.starttime // 1000
        end_us = header.endtime // 1000 + round(_SECOND_US / header.samprate)
        of_packet = packet.station_id, packet.seqnum or 0, channel
        record = Record(*of_packet, start_us, end_us, packet.payload)
        self._arrived.setdefault(record.station, deque()).append(record)
        of_record = record.sequence, record.start_us
        if of_record in self._progress.known.get(record.station, ()):
            return
        if end_us <= self._progress.done_us:  # a clock went back, or a gap is filled
            self._flush_all()
            self._progress.done_us = record.start_us
        self._pending.append(record)
        self._flush(self._complete_us())

    def _complete_us(self) -> int:
        """Return up to when all channels are there, or have been waited for."""
        reached = [0] * len(self._channels)
        for each in self._pending:
            reached[each.channel] = max(reached[each.channel], each.end_us)
        return max(min(reached), max(reached) - round(self._pace.patience_s * _SECOND_US))

    def _flush_all(self) -> None:
        """Store what waits, the beginning of a minute too."""
        newest_us = max((each.end_us for each in self._pending), default=0)
        self._flush(newest_us, unfinished=True)

    def _flush(self, until_us: int, *, unfinished: bool = False) -> None:
        """Store the minutes that end up to a time; then note from which record on to go on."""
        while self._pending:
            begin_us = min(max(each.start_us, self._progress.done_us) for each in self._pending)
            end_us = (begin_us // _MINUTE_US + 1) * _MINUTE_US
            if end_us > until_us:
                if not unfinished:
                    return
                end_us = until_us
            self._store_minute(begin_us, end_us)
            self._progress.done_us = end_us
            self._pending = [each for each in self._pending if each.end_us > end_us]
            self._save()

    def _store_minute(self, begin_us: int, end_us: int) -> None:
        """Put a minute of all channels into the ring; one that cannot be used is noted."""
        path, now = self._path.with_suffix(".mseed"), self._clock()
        found = [r for r in self._pending if r.start_us < end_us and r.end_us > begin_us]
        names = {r.channel: "_".join(filter(None, self._feed.ids[r.channel])) for r in found}
        path.write_bytes(b"".join(each.payload for each in found))
        sidecar = "".join(
            f'[channel.{name}]\nunit = "m/s2"\ncalibration = {self._feed.calibrations[n]!r}\n'
            for n, name in names.items()
        )
        sidecar_path(path).write_text(sidecar, encoding="utf-8")
        assert self._store is not None
        try:
            (recording,) = read_test(path, read_limits(self._workspace.settings))
            assert isinstance(recording, Recording)
            chunk = self._chunk(recording, names, begin_us, end_us)
        except BadInput as error:
            note_refused(self._store, self._stream.name, error, now)
            return
        with suppress(BadInput):  # which is noted
            content = [chunk_document(chunk)]
            take_chunks(self._workspace, self._store, self._stream.name, content, now)

    def _chunk(
        self, recording: Recording, names: dict[int, str], begin_us: int, end_us: int
    ) -> Chunk:
        """Cut a minute out of a recording; a channel without samples is NaN."""
        rate = recording.sampling_rate_hz
        assert recording.time is not None
        start_us = microseconds(recording.time)
        first, last = (
            max(0, math.ceil((at_us - start_us) / _SECOND_US * rate - 1e-2))
            for at_us in (begin_us, end_us)
        )
        by_name = {each.name: each.values for each in recording.channels}
        last = min(last, recording.samples)
        values = np.full((len(self._stream.channels), last - first), np.nan, np.float32)
        for channel, name in names.items():
            values[channel] = by_name[name][first:last]
        start = recording.time + timedelta(seconds=first / rate)
        channels = tuple(each.name for each in self._stream.channels)
        number = BY_TIME + begin_us // _MINUTE_US
        return Chunk(self._stream.name, number, start, rate, channels, values)

    def _save(self) -> None:
        """Note the last record of each station before the first that is needed, and known ones."""
        needed = set(map(id, self._pending))
        for station, arrived in self._arrived.items():
            while arrived and id(arrived[0]) not in needed:
                done = arrived.popleft()
                time = time_of(done.start_us).isoformat()
                self._progress.last[station] = done.sequence, time
            known = [(r.sequence, r.start_us) for r in arrived if id(r) not in needed]
            self._progress.known[station] = known
        replace_text(self._path, dump(vars(self._progress)) + "\n")


def _source_id(network: str, station: str, location: str, code: str) -> str:
    return f"FDSN:{network}_{station}_{location}_{'_'.join(code)}"


def _library() -> Any:
    with needing("seedlink"):
        import seedlink_client
    return seedlink_client


class StreamAskers:
    """A thread for each stream that is asked for, as `bridge.toml` describes them now.

    For the holder of the workspace's lock; nobody is asked before `use`.
    """

    def __init__(self, clock: Clock, pace: Pace | None = None):
        self._clock, self._pace = clock, pace
        self._running: dict[Stream, tuple[StreamAsker, threading.Thread]] = {}

    def use(self, workspace: Workspace) -> None:
        """Begin what is new, end what is gone; raises UsageError without the extra."""
        wanted = {each for each in workspace.bridge.streams if each.feed is not None}
        if wanted:
            _library()
        self._end(self._running.keys() - wanted)
        for stream in wanted - self._running.keys():
            asker = StreamAsker(workspace, stream, self._clock, self._pace)
            thread = threading.Thread(target=asker.run, name=f"seedlink-{stream.name}")
            self._running[stream] = asker, thread
            thread.start()

    def close(self) -> None:
        self._end(set(self._running))

    def _end(self, streams: set[Stream]) -> None:
        ending = [self._running.pop(stream) for stream in streams]
        while any(thread.is_alive() for _, thread in ending):
            for asker, thread in ending:
                asker.end()  # Python 3.11 loses one that comes as a wait ends (wait_for)
                thread.join(0.1)
