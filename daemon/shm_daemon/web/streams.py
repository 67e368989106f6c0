"""Chunks of permanent sensors over HTTP: acknowledged once they are on disk."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Path, Request
from pydantic import BaseModel, Field
from starlette.concurrency import run_in_threadpool

from shm.pipeline import utc_now
from shm.read.chunk_document import LARGEST_BYTES, refuse_long_chunk
from shm_daemon.streams import take_chunks
from shm_daemon.web.access import AtSite, Writer
from shm_daemon.web.address import STREAMS
from shm_daemon.web.faults import answers
from shm_daemon.web.recordings import PLAIN_BODY, receive_body

router = APIRouter(prefix=STREAMS, tags=["streams"])


class AcknowledgedChunk(BaseModel):
    """A chunk that is on disk: the logger may forget it."""

    stream: str
    sequence: int
    start: datetime
    end: datetime
    is_new: bool = Field(description="False where the same chunk was there before.")


class _Body:
    """What comes, in memory: a chunk is small."""

    def __init__(self) -> None:
        self.content = bytearray()

    def write(self, piece: bytes | bytearray) -> None:
        refuse_long_chunk(len(self.content) + len(piece))
        self.content += piece


@router.post(
    "/{name}/chunks",
    status_code=202,
    response_model=AcknowledgedChunk,
    responses=answers(400, 401, 403, 408, 409, 413, 415, 422, 503),
    openapi_extra=PLAIN_BODY,
    summary="Send a chunk of a stream",
)
async def chunks(
    request: Request, site: AtSite, _: Writer, name: Annotated[str, Path(max_length=64)]
) -> AcknowledgedChunk:
    """Takes one chunk (`shm.chunk/1`) and answers once it is on disk.

    The same chunk may be sent again after a broken connection: it is kept once. 409 says that its
    number and time are another's, whose samples differ and stay. 503 says to keep it and to send it
    again after `Retry-After`.

    Example: `curl --data-binary @chunk.json -H "Authorization: Bearer $TOKEN"
    http://127.0.0.1:8400/api/streams/h3/chunks`
    """
    body = _Body()
    await receive_body(request, body, LARGEST_BYTES, refuse_long_chunk)
    content = [bytes(body.content)]
    workspace, store = site.workspace, site.store
    (kept,) = await run_in_threadpool(take_chunks, workspace, store, name, content, utc_now())
    return AcknowledgedChunk(**vars(kept))
