"""Chunks of streams, by whatever way they come: kept in the ring, or refused with a reason."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from datetime import datetime

from shm.errors import BadInput, DoubledChunk
from shm.store import Store, Workspace
from shm.store.ring import Kept, ring_of
from shm.values.stream import StreamEvent

log = logging.getLogger(__name__)


def take_chunks(
    workspace: Workspace, store: Store, stream: str, contents: Sequence[bytes], now: datetime
) -> list[Kept]:
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
    known = store.streams.list_events(stream, hour)
    if all(event.kind != "refused" or event.start < hour for event in known):
        store.streams.save_event(StreamEvent(stream[:64], "refused", now, now, str(error)[:500]))
