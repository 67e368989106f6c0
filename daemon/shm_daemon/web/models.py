"""Define what addresses and bodies may hold, and the documents that a program sends or waits for.

Documents that are only read are dictionaries of the very values that report and `--json` show; each
route says what is in them. Unknown numbers are null.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from enum import Enum
from typing import Annotated, Any, Literal, Protocol, TypeVar

import numpy as np
from fastapi import Path, Query
from fastapi.responses import JSONResponse
from pydantic import AfterValidator, BaseModel, Field


def _written(text: str) -> str:
    """Return text that a person may have written and any database keeps."""
    if not text.strip() or not all(sign.isprintable() or sign in "\n\t" for sign in text):
        raise ValueError("a text without control characters is expected")
    return text.strip()


MOST_WRITTEN = 2000
"""Technical: characters of a reason or of a list, more than anybody reads."""
MOST_ROWS = 1000
"""Technical: of one answer, which `limit` may ask for; some hundred kilobytes."""
LARGEST_NUMBER = 2**31 - 1
"""Of the store's integers: PostgreSQL refuses larger ones."""

Row = Annotated[int, Path(ge=0, le=LARGEST_NUMBER)]
"""The number of a row of the store, in an address."""
Before = Annotated[int | None, Query(ge=0, le=LARGEST_NUMBER)]
"""The number of the row to go on after."""
HangerNumber = Annotated[
    int, Path(ge=0, le=LARGEST_NUMBER, description="The number of the hanger.")
]
Written = Annotated[str, Field(max_length=MOST_WRITTEN), AfterValidator(_written)]


class Numbered(Protocol):
    """A row by whose number one can go on."""

    @property
    def id(self) -> int: ...


Listed = TypeVar("Listed", bound=Numbered)


def paged(rows: Sequence[Listed], most: int) -> tuple[Sequence[Listed], int | None]:
    """Return the first `most` of `most` + 1 rows, and `before` of the next page."""
    return rows[:most], rows[most - 1].id if len(rows) > most else None


class Uploaded(BaseModel):
    """An upload that is safe: the daemon takes it from the spool."""

    sha256: str
    size_bytes: int
    file_name: str = Field(description="The name in the spool; changed if it was taken.")
    outcome: Literal["new", "duplicate", "reopened", "discarded before"] = Field(
        description="`duplicate`: these bytes are stored already. `reopened`: they were refused "
        "before and are tried again. `discarded before`: a person has discarded them; they stay so."
    )
    status_url: str = Field(description="Progress, once the daemon has taken it.")


class TestLink(BaseModel):
    """A test by its name, and where its page is."""

    name: str
    page: str


class RecordingStatus(BaseModel):
    """A recording and how far it has come."""

    id: int
    sha256: str
    file_name: str
    size_bytes: int
    received_at: datetime
    stage: Literal["received", "identified", "updated", "watched", "done", "refused", "held"]
    hanger: int | None
    tests: list[TestLink] = Field(description="Results so far.")
    reason: dict[str, Any] | None = Field(
        description="Why it was refused or is held; null if neither."
    )


class Recordings(BaseModel):
    """Recordings that were asked for."""

    recordings: list[RecordingStatus]


class Acknowledge(BaseModel):
    """Comment of a person on an alert."""

    why: Written = Field(description="The result, for the record.")
    who: Written | None = Field(
        default=None,
        description="The person behind a token, recorded with it; a user has a name.",
    )
    resolved: bool = Field(
        default=False, description="Its cause is gone or explained; the hooks are notified."
    )


class Health(BaseModel):
    """Health; `reasons` states the problems. Degraded parts work, but not as described."""

    status: Literal["ok", "degraded", "failing"]
    reasons: list[str]
    attention: list[str] = Field(
        default=[], description="What a person should look at though nothing fails."
    )


class FigureDocument(BaseModel):
    """A figure as plotly draws it, with its words."""

    data: list[dict[str, Any]]
    layout: dict[str, Any]
    caption: str
    alt: str = Field(description="Description for screen readers.")


class Underway(BaseModel):
    """It is being worked out: ask again after `Retry-After` seconds."""

    message: str


def document(found: Mapping[str, Any], headers: Mapping[str, str] | None = None) -> JSONResponse:
    """Return a document as the answer of a route."""
    return JSONResponse(plain(found), headers=headers)


def plain(value: Any) -> Any:
    """Convert to JSON values: arrays to lists, times to ISO 8601, NaN and infinity to null."""
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray):
        if value.dtype.kind == "f" and not np.isfinite(value).all():
            return np.where(np.isfinite(value), value, None).tolist()  # type: ignore[call-overload]
        if value.dtype.kind == "M":
            return value.astype(str).tolist()
        return plain(value.tolist()) if value.dtype.kind == "O" else value.tolist()
    if isinstance(value, str | bool) or value is None:
        return value.value if isinstance(value, Enum) else value
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return _single(value)


def _single(value: Any) -> Any:
    if isinstance(value, datetime):
        return value.isoformat().replace("+00:00", "Z")  # as `--json` has it
    if isinstance(value, np.datetime64):
        return str(value)
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
