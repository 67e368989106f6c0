"""The page where a person hands recordings in and sees each become a test.

A logger's file over HTTP, the first time: what is understood of it, and what is asked.
"""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import JSONResponse
from starlette.concurrency import run_in_threadpool

from shm.errors import BadInput, UsageError
from shm.pipeline import utc_now
from shm.pipeline.importing import (
    OF_TEST,
    Answers,
    Import,
    Question,
    answer_of_test,
    answer_to,
    import_document,
    keep_profile,
    look_into,
    understand,
)
from shm.report import formatting
from shm.store import Workspace
from shm_daemon.spool import Incoming, Landed, landing_name
from shm_daemon.web.access import AtSite, Reader, Uploader
from shm_daemon.web.address import IMPORTS
from shm_daemon.web.faults import answers
from shm_daemon.web.frame import page
from shm_daemon.web.models import LARGEST_NUMBER, Row, document
from shm_daemon.web.recordings import PLAIN_BODY, receive_body
from shm_daemon.web.site import held_documents

router = APIRouter(tags=["recordings"])


@router.get("/upload", include_in_schema=False)
def upload_page(request: Request, site: AtSite, _: Reader) -> Response:
    """Show the form; files go to `POST /api/recordings` singly, `static/upload.js` follows each."""
    workspace = site.workspace
    return page(
        request,
        "upload.html.j2",
        hangers=[
            (each.id, formatting.hanger_name(each.id, each.name)) for each in workspace.bridge.bars
        ],
        max_mb=workspace.settings.max_file_bytes / 1e6,
        max_bytes=workspace.settings.max_file_bytes,
    )


@router.get("/upload/outcome/{recording}", include_in_schema=False)
def outcome(request: Request, site: AtSite, _: Reader, recording: Row) -> Response:
    """Return, without the frame, why a recording is held, with the form to decide, or refused."""
    stored = site.store.recordings.get(recording)
    held = [each for each in held_documents(site) if each["recording"] == stored.id]
    reason = stored.reason or {"message": "the reason was not noted.", "remedy": ""}
    return page(request, "upload_outcome.html.j2", held=held, reason=reason)


_MOST_ANSWERS = 4000  # technical: of an address, 64 kB at most when each character is escaped


@router.post(
    IMPORTS,
    responses=answers(408, 409, 413, 415, 422),
    openapi_extra=PLAIN_BODY,
    summary="Import the first file of a logger",
)
async def import_file(
    request: Request,
    site: AtSite,
    writer: Uploader,
    name: Annotated[str, Query(min_length=1, max_length=255)],
    said: Annotated[
        str | None,
        Query(
            max_length=_MOST_ANSWERS,
            description='Answers, as JSON: {"hanger": 3, "columns": {"A1": {"plane": "transverse",'
            ' "place": "2.5"}}}; with "each_time": true the hanger is not kept; "time" is an ISO'
            ' 8601 time or day, "operator" who measured. Without answers the file is only looked'
            " into.",
        ),
    ] = None,
) -> JSONResponse:
    """Show what is understood of a file and ask for the rest; store nothing yet.

    With answers to all, they are kept as the profile of its logger, and the file goes to the
    daemon as any other: `sha256` is null until then. `questions` are open, `of_test` may stay so;
    the range of a column is in N or m/s2, its `outline` the largest values in equal parts, 0 to 1.
    """
    landing_name(name)
    workspace = site.workspace
    file = await run_in_threadpool(Incoming, workspace.spool, workspace.settings.max_file_bytes)
    try:
        await receive_body(request, file.write, workspace.settings.max_file_bytes)
        looked = await run_in_threadpool(_looked, file, landing_name(name), workspace, said)
        if looked["sha256"] is not None:
            journal = site.store.acting_as(writer.actor).journal
            await run_in_threadpool(journal.note, utc_now(), "recording uploaded", name)
        return document(looked)
    finally:
        await run_in_threadpool(file.close)


def _looked(file: Incoming, name: str, workspace: Workspace, text: str | None) -> dict[str, Any]:
    if file.size_bytes == 0:
        raise BadInput("the body is empty.", remedy="Send the bytes of the file.")
    with TemporaryDirectory(prefix="shm-import-") as folder:
        path = Path(folder) / name
        shutil.copyfile(file.whole(), path)
        found = look_into(path, workspace, Answers())
    landed: Landed | None = None
    if text is not None:
        answers = _answers(text, found)
        found = understand(found.survey, workspace, answers)
        if found.is_ready:
            keep_profile(found, workspace, each_time=answers.each_time)
            landed = file.land(name, found.described)
    return {**import_document(found), "sha256": landed.sha256 if landed else None}


def _answers(body: str, found: Import) -> Answers:
    """Return the answers of a request; raises BadInput for what is none."""
    try:
        said = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise _misread(str(error)[:100]) from error
    columns = said.get("columns", {}) if isinstance(said, dict) else None
    if not isinstance(columns, dict) or not all(isinstance(t, dict) for t in columns.values()):
        raise _misread("it holds no answers")
    asked = {(q.channel, q.about): q for q in found.questions}
    tables: dict[str, dict[str, object]] = {}
    for name, given in columns.items():
        for about, text in given.items():
            question = asked.get((name, about))
            if question is None:  # of a column that another answer makes a channel
                question = next((q for q in found.questions if q.channel == name), None)
            if question is None:
                raise _misread(f"nothing was asked of {name[:60]!r}")
            tables.setdefault(name, {}).update(_answered(question, about, str(text), found))
    hanger = said.get("hanger")
    if hanger is not None and not (type(hanger) is int and 0 <= hanger <= LARGEST_NUMBER):
        raise _misread("hanger is no number of a hanger")
    answers = Answers(
        hanger,
        _number(said, "sampling_rate_hz", least=0.0),
        None,
        _number(said, "temperature_c", least=-300.0),
        channels=tables,
        each_time=said.get("each_time") is True,
    )
    try:
        for about in (about for about in OF_TEST if about in said):
            answers = answer_of_test(about, str(said[about]), answers)
    except UsageError as error:
        raise BadInput(error.message, remedy=error.remedy) from error
    return answers


def _answered(question: Question, about: str, text: str, found: Import) -> dict[str, object]:
    try:
        return answer_to(replace(question, about=about), text, found)
    except UsageError as error:
        raise BadInput(error.message, remedy=error.remedy) from error


def _number(said: dict[str, Any], key: str, least: float) -> float:
    value = said.get(key)
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float) or not least < value < 1e9:
        raise _misread(f"{key} is no such number")
    return float(value)


def _misread(what: str) -> BadInput:
    return BadInput(
        f"the answers cannot be read: {what}.",
        remedy='Send said={"hanger": 3, "columns": {"A1": {"plane": "transverse"}}}.',
    )
