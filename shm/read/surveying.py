"""Looking into a file: each format's table of columns, and what its headers say of them."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from shm.errors import BadInput
from shm.read import logger_text
from shm.read import logger_words as words
from shm.read.base import (
    Format,
    Layout,
    LoggerColumn,
    LoggerTable,
    Peek,
    PeekChannel,
    Survey,
    SurveyedColumn,
)
from shm.read.bundles import holds_test
from shm.read.registry import format_of

_FINGERPRINT_DIGITS = 16  # technical: of 64 bits; a workspace has a handful of loggers


def survey(path: Path) -> Survey:
    """All that can be found out about a file; raises BadInput where that is nothing."""
    _refuse_archive(path)
    found = format_of(path)
    table = found.table(path) if found.table else None
    look = (
        logger_text.peeked(table, found.name, path)
        if table is not None and table.is_text
        else found.peek(path)
    )
    known = {channel.name: channel for channel in look.channels}
    if table is None:
        listed = look.channels if look.lines else ()
        columns: Sequence[SurveyedColumn] = [_bare(channel) for channel in listed]
    else:
        columns = [_column(column, known.get(column.name)) for column in table.columns]
    return Survey(
        source=str(path),
        format=found.name,
        columns=tuple(columns),
        samples=look.samples or (table.samples if table is not None else 0),
        sampling_rate_hz=look.sampling_rate_hz,
        hanger=look.hanger,
        time=look.time,
        temperature_c=look.temperature_c,
        layout=_layout(found, table, look),
        lines=look.lines,
        remarks=table.remarks if table is not None else (),
        problems=(*look.problems, *_left_out(look, columns)),
    )


def layout_of(path: Path) -> Layout:
    """The layout of a file alone; raises BadInput where nothing can be made out."""
    return survey(path).layout


def _left_out(look: Peek, columns: Sequence[SurveyedColumn]) -> tuple[str, ...]:
    """What a file holds that is not read, where that is all that it holds."""
    if columns or not look.left_out:
        return ()
    return (f"it holds {', '.join(look.left_out)[:200]}, which is not read.",)


def _refuse_archive(path: Path) -> None:
    if holds_test(path):
        raise BadInput(
            "is an archive of several files.",
            file=path,
            remedy="Unpack it and import one of its files; those of the same logger need nothing"
            " then.",
        )


def _column(column: LoggerColumn, known: PeekChannel | None) -> SurveyedColumn:
    meant = words.quantity_meant(column.name)
    plane = words.plane_meant(column.name)
    if known is None:
        return SurveyedColumn(
            column.name, column.unit, column.values, column.overloads, None, meant, plane
        )
    return SurveyedColumn(
        column.name, column.unit, column.values, column.overloads, known.quantity, meant,
        known.plane or (plane if known.quantity == "acceleration" else None),
        known.x_m, known.calibration, known.full_scale, known.unit,
    )  # fmt: skip


def _bare(channel: PeekChannel) -> SurveyedColumn:
    return SurveyedColumn(
        channel.name, channel.unit, None, 0, channel.quantity, channel.quantity, channel.plane,
        channel.x_m, channel.calibration, channel.full_scale, channel.unit,
    )  # fmt: skip


def _layout(found: Format, table: LoggerTable | None, look: Peek) -> Layout:
    said = table.layout if table is not None else tuple(c.name for c in look.channels)
    digest = hashlib.sha256("\n".join((found.name, *said)).encode()).hexdigest()
    columns = (
        tuple(f"{c.name} [{c.unit}]" if c.unit else c.name for c in table.columns)
        if table is not None
        else said
    )
    return Layout(
        digest[:_FINGERPRINT_DIGITS],
        found.name,
        columns,
        table.hanger if table is not None else look.hanger,
        table is not None and (table.said_rate_hz > 0 or table.times_rate_hz > 0),
    )
