"""Receive recordings over HTTP, streamed to disk, and chunks of permanent sensors.

Both are acknowledged once they are on disk.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Path, Query, Request
from pydantic import BaseModel, Field
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from shm.documents import parse_time
from shm.errors import BadInput, NothingThere
from shm.pipeline import utc_now
from shm.read.chunk_document import LARGEST_BYTES, refuse_long_chunk
from shm.store import Stage, Store, StoredRecording
from shm.store.archive import refuse_oversize
from shm.store.journal import list_former_tests
from shm.store.recordings import find_by_checksum, find_discard
from shm_daemon.spool import Incoming, Landed, landing_name
from shm_daemon.streams import take_chunks
from shm_daemon.web.access import AtSite, Reader, Uploader
from shm_daemon.web.address import STREAMS, UPLOADS, test_page
from shm_daemon.web.faults import Refused, answers
from shm_daemon.web.models import (
    LARGEST_NUMBER,
    MOST_WRITTEN,
    Recordings,
    RecordingStatus,
    Uploaded,
)

_PIECE_BYTES = 1 << 20  # technical: memory of an upload, against a change of threads for each piece
_SILENCE_S = 60.0  # judgement: a mobile connection comes back within that or begins anew
PLAIN_BODY = {
    "requestBody": {
        "required": True,
        "description": "The bytes of the file, as they are: no form.",
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}

_of_uploads = APIRouter(prefix=UPLOADS, tags=["recordings"])

List = Annotated[str | None, Query(max_length=MOST_WRITTEN)]
Number = Annotated[float | None, Query(allow_inf_nan=False)]


def described_by(
    hanger: Annotated[int | None, Query(ge=0, le=LARGEST_NUMBER)] = None,
    time: Annotated[str | None, Query(max_length=40, description="ISO 8601")] = None,
    temperature_c: Number = None,
    added_mass_kg: Number = None,
    added_mass_at_m: Number = None,
    added_mass_radius_m: Number = None,
    sampling_rate_hz: Number = None,
    unit: List = None,
    x_m: List = None,
    plane: List = None,
    calibration: List = None,
    full_scale: List = None,
) -> dict[str, object]:
    """Build the sidecar from a form: it overrides the file.

    The last five are lists in the order of the channels, parted by commas, as in the header of a
    CSV file. More (single channels by name) is said by a sidecar in a .zip with the file.
    """
    values = {
        "hanger": hanger,
        "time": _time(time),
        "temperature_c": temperature_c,
        "added_mass_kg": added_mass_kg,
        "added_mass_at_m": added_mass_at_m,
        "added_mass_radius_m": added_mass_radius_m,
        "sampling_rate_hz": sampling_rate_hz,
        "unit": _listed(unit),
        "plane": _listed(plane),
        "x_m": _numbers("x_m", x_m),
        "calibration": _numbers("calibration", calibration),
        "full_scale": _numbers("full_scale", full_scale),
    }
    return {key: value for key, value in values.items() if value is not None}


@_of_uploads.post(
    "",
    status_code=202,
    response_model=Uploaded,
    responses=answers(408, 413, 415, 422),
    openapi_extra=PLAIN_BODY,
    summary="Upload a recording",
)
async def upload(
    request: Request,
    site: AtSite,
    writer: Uploader,
    described: Annotated[dict[str, object], Depends(described_by)],
    name: Annotated[
        str, Query(min_length=1, max_length=255, description="The name of the file, with suffix.")
    ],
    x_content_sha256: Annotated[
        str | None, Header(pattern="^[0-9a-fA-F]{64}$", description="Checked where it is given.")
    ] = None,
) -> Uploaded:
    """Take the bytes of one file and answer once they are safe on disk.

    The daemon then takes the file from the spool as any other. The same bytes may be sent again
    after a broken connection: they are stored once.

    Example: `curl -X POST -T hanger3.csv -H "Authorization: Bearer $TOKEN"
    "http://127.0.0.1:8400/api/recordings?name=hanger3.csv&hanger=3"`
    """
    landing_name(name)
    workspace = site.workspace
    file = await run_in_threadpool(Incoming, workspace.spool, workspace.settings.max_file_bytes)
    try:
        await receive_body(request, file.write, workspace.settings.max_file_bytes)
        landed = await run_in_threadpool(_land, file, name, described, x_content_sha256)
    finally:
        await run_in_threadpool(file.close)
    store = site.store.acting_as(writer.actor)
    return Uploaded(
        sha256=landed.sha256,
        size_bytes=landed.size_bytes,
        file_name=landed.path.name,
        outcome=await run_in_threadpool(_outcome, store, landed),
        status_url=f"{UPLOADS}/{landed.sha256}",
    )


@_of_uploads.get(
    "/{key}",
    response_model=RecordingStatus,
    responses=answers(404, 422),
    summary="How far a recording has come",
)
def status(
    site: AtSite,
    _: Reader,
    key: Annotated[
        str, Path(pattern="^([0-9]{1,9}|[0-9a-fA-F]{64})$", description="Its number or SHA-256.")
    ],
) -> Any:
    """Return the stage of a recording, and why it was refused where it was."""
    return _row(site.store, _recording(site.store, key))


@_of_uploads.get(
    "", response_model=Recordings, responses=answers(422), summary="The recording of a checksum"
)
def recordings(
    site: AtSite, _: Reader, sha256: Annotated[str, Query(pattern="^[0-9a-fA-F]{64}$")]
) -> Any:
    """One, or none while the file waits in the spool."""
    found = find_by_checksum(site.store, sha256.lower())
    return {"recordings": [_row(site.store, found)] if found else []}


async def receive_body(
    request: Request,
    write: Callable[[bytes | bytearray], object],
    max_bytes: int,
    refuse_large: Callable[[int, int], object] = refuse_oversize,
) -> None:
    """Write the body of a request piece by piece, outside the loop that serves the others.

    `write` raises TooLarge beyond its limit. Refuses a form, and a body whose header is too
    large, before a byte of it is sent, where the sender waits for our response.
    """
    if request.headers.get("content-type", "").strip().lower().startswith("multipart/"):
        raise Refused(
            415, "A form is not taken.", "Send the bytes of the file as the body: `curl -T FILE`."
        )
    refuse_large(int(request.headers.get("content-length", 0)), max_bytes)
    pieces, waiting = request.stream(), bytearray()
    try:
        while True:
            async with asyncio.timeout(_SILENCE_S):
                piece = await anext(pieces, None)
            if piece is None:
                break
            waiting += piece
            if len(waiting) >= _PIECE_BYTES:
                await run_in_threadpool(write, waiting)
                waiting = bytearray()
    except TimeoutError:
        raise Refused(408, f"Nothing came for {_SILENCE_S:.0f} s.", "Send it again.") from None
    except ClientDisconnect:
        raise Refused(400, "The connection broke off.", "Send it again.") from None
    await run_in_threadpool(write, waiting)


def _land(
    file: Incoming, name: str, described: dict[str, object], expected_sha256: str | None
) -> Landed:
    if file.size_bytes == 0:
        raise BadInput("the body is empty.", remedy="Send the bytes of the file.")
    if expected_sha256 is not None and expected_sha256.lower() != file.sha256:
        raise BadInput(
            f"what arrived has the checksum {file.sha256}, not the one that was sent.",
            remedy="Send it again.",
        )
    return file.land(name, described)


def _outcome(store: Store, landed: Landed) -> Any:
    store.journal.note(utc_now(), "recording uploaded", landed.path.name)
    known = find_by_checksum(store, landed.sha256)
    if known is None:
        return "new"
    if known.stage is not Stage.REFUSED:
        return "duplicate"
    return "reopened" if find_discard(store, known.id) is None else "discarded before"


def _recording(store: Store, key: str) -> StoredRecording:
    if len(key) < 64:
        return store.recordings.get(int(key))
    found = find_by_checksum(store, key.lower())
    if found is None:
        raise NothingThere(
            "no recording of this checksum was taken in yet.", remedy="Ask again in some seconds."
        )
    return found


def _tests(store: Store, recording: StoredRecording) -> list[dict[str, str]]:
    """Return the tests in force that came of a recording, but for those that are held."""
    if recording.hanger is None:
        return []
    found = list_former_tests(store, recording.id)
    shown = (each for each in found if each.stage is not Stage.HELD)
    names = [test.name for test in shown if test.superseded_at is None]
    return [{"name": name, "page": test_page(recording.hanger, name)} for name in names]


def _row(store: Store, recording: StoredRecording) -> dict[str, Any]:
    file = recording.file
    return {
        "id": recording.id,
        "sha256": file.sha256,
        "file_name": file.file_name,
        "size_bytes": file.size_bytes,
        "received_at": recording.received_at,
        "stage": recording.stage.value,
        "hanger": recording.hanger,
        "tests": _tests(store, recording),
        "reason": recording.reason,
    }


def _time(text: str | None) -> datetime | None:
    try:
        return None if text is None else parse_time(text)
    except (ValueError, OverflowError):
        raise BadInput(
            f"time = {text!r} is not an ISO 8601 time.", remedy="Write 2026-05-01T10:00:00Z."
        ) from None


def _listed(text: str | None) -> list[str] | None:
    return None if text is None else [part.strip() for part in text.split(",")]


def _numbers(key: str, text: str | None) -> list[object] | None:
    """Return numbers, and empty texts where a channel has none."""
    if text is None:
        return None
    parts = [part.strip() for part in text.split(",")]
    if not all(part == "" or _NUMBER.fullmatch(part) for part in parts):
        raise BadInput(f"{key} = {text!r} is no list of numbers.", remedy="Part them by commas.")
    return [float(part) if part else "" for part in parts]


_NUMBER = re.compile(r"[+-]?\d{1,12}(\.\d{0,12})?([eE][+-]?\d{1,2})?")


_of_streams = APIRouter(prefix=STREAMS, tags=["streams"])


class AcknowledgedChunk(BaseModel):
    """A chunk that is on disk: the logger may forget it."""

    stream: str
    sequence: int
    start: datetime
    end: datetime
    is_new: bool = Field(description="False where the same chunk was there before.")


@_of_streams.post(
    "/{name}/chunks",
    status_code=202,
    response_model=AcknowledgedChunk,
    responses=answers(408, 409, 413, 415, 422),
    openapi_extra=PLAIN_BODY,
    summary="Send a chunk of a stream",
)
async def chunks(
    request: Request, site: AtSite, _: Uploader, name: Annotated[str, Path(max_length=64)]
) -> AcknowledgedChunk:
    """Take one chunk (`shm.chunk/1`) and answer once it is on disk.

    The same chunk may be sent again after a broken connection: it is kept once. 409 says that its
    number and time are another's, whose samples differ and stay. 503 says to keep it and to send it
    again after `Retry-After`.

    Example: `curl --data-binary @chunk.json -H "Authorization: Bearer $TOKEN"
    http://127.0.0.1:8400/api/streams/h3/chunks`
    """
    body = bytearray()  # in memory: a chunk is small

    def write(piece: bytes | bytearray) -> None:
        refuse_long_chunk(len(body) + len(piece))
        body.extend(piece)

    await receive_body(request, write, LARGEST_BYTES, refuse_long_chunk)
    chunk, workspace, store = [bytes(body)], site.workspace, site.store
    (stored,) = await run_in_threadpool(take_chunks, workspace, store, name, chunk, utc_now())
    return AcknowledgedChunk(**vars(stored))


router = APIRouter()
router.include_router(_of_uploads)
router.include_router(_of_streams)
