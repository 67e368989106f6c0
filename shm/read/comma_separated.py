"""CSV: `# key: value` lines, the names of the columns, then numbers.

    # hanger: 3
    # time: 2026-05-01T10:00:00Z
    # temperature_c: 12
    # sampling_rate_hz: 512
    # plane: , transverse, longitudinal
    # unit: N, m/s2, m/s2
    # x_m: 1.92, 2.52, 2.52
    force,acc_1,acc_2
    0.12,0.003,-0.001

What belongs to a column may also stand alone: `# acc_1.unit: g`. Columns may be separated by
commas, semicolons (then with decimal commas, if need be) or tabs. A first column `time`, in
seconds, is checked against the sampling rate, or gives it. A first column `frequency` makes it
frequency responses: see `frequency_text`.
"""

from __future__ import annotations

import re
from pathlib import Path

from shm.errors import BadInput, UsageError
from shm.read import assemble, frequency_text
from shm.read.atomic import replace_text
from shm.read.base import Format, Peek, names_in
from shm.read.comma_header import Heading, parse_heading
from shm.read.comma_text import recording_text, response_text
from shm.read.content import is_text, text_of
from shm.read.sidecar import with_sidecar
from shm.read.table import parse_table, rows_in
from shm.read.timebase import REMEDY, evened, rate_of
from shm.values import NAN, FrequencyResponse, Recording

_PLAIN = re.compile(r"[^,;\t\r\n#\"]+")


def _read(path: Path) -> Recording | FrequencyResponse:
    text = text_of(path)
    responses = frequency_text.parse(text, path)
    if responses is not None:
        return frequency_text.read(responses, path)
    heading = parse_heading(text, path)
    table, rate = parse_table(heading, path), NAN
    if heading.has_time:
        table, rate = evened(table[0], table[1:], lambda *fault: _uneven(heading, path, *fault))
    return assemble.recording(with_sidecar(heading.header, path), table, path, rate)


def _peek(path: Path) -> Peek:
    text = text_of(path)
    responses = frequency_text.parse(text, path)
    if responses is not None:
        return frequency_text.peek(responses, FORMAT.name, path)
    heading = parse_heading(text, path)
    rows = rows_in(heading.body)
    header = with_sidecar(heading.header, path)
    return assemble.peeked(
        header, FORMAT.name, rows, lambda: _rate(heading, path), path, heading.remarks
    )


def _rate(heading: Heading, path: Path) -> float:
    """The rate that a column of times tells, NaN without one; raises BadInput where faulty."""
    if not heading.has_time:
        return NAN
    times = parse_table(heading, path)[0]
    return rate_of(times, lambda *fault: _uneven(heading, path, *fault))


def _uneven(heading: Heading, path: Path, row: int, what: str) -> BadInput:
    line, column = heading.body_line + row, heading.columns[0]
    return BadInput(f"{what}.", file=path, channel=column, line=line, remedy=REMEDY)


def _write(described: Recording | FrequencyResponse, path: Path) -> None:
    for name in names_in(described):
        if not _PLAIN.fullmatch(name):
            raise UsageError(
                f"the channel name {name!r} cannot head a column.",
                remedy="Leave out commas, semicolons, quotes, # and line breaks.",
            )
    if isinstance(described, FrequencyResponse):
        replace_text(path, response_text(described))
    else:
        replace_text(path, recording_text(described))


FORMAT = Format(
    name="CSV",
    suffixes=(".csv", ".txt", ".tsv"),
    recognises=is_text,
    peek=_peek,
    read=_read,
    write=_write,
    holds_gaps=True,
    holds_frequency_responses=True,
    needs_sidecar=False,
    may_be_gzipped=True,
)
