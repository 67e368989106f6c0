"""One document for every kind of report: `as_text`, `as_html` and `as_pdf` render it alike.

A kind of report is a function that builds a `Paper`; the renderers know none of the kinds.
A report is made without a logo that cannot be read.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from itertools import zip_longest
from pathlib import Path
from string import ascii_uppercase
from typing import TYPE_CHECKING

from shm.bridge.description import NO_LETTERHEAD, Letterhead
from shm.report import formatting

if TYPE_CHECKING:
    from shm.report.figures.specification import Illustration

_KINDS = {"PNG": "image/png", "JPEG": "image/jpeg"}


@dataclass(frozen=True)
class Logo:
    """The bytes of an image, its kind and its size; without bytes `fault` says why."""

    content: bytes = b""
    kind: str = ""
    width: int = 0
    height: int = 0
    fault: str = ""

    @property
    def as_address(self) -> str:
        """For a page that fetches nothing."""
        return f"data:{self.kind};base64,{base64.b64encode(self.content).decode()}"


def read_logo(path: Path | None) -> Logo:
    """Return the logo in a file; with a `fault` that names it where there is none to be read."""
    if path is None:
        return Logo()
    # Loaded here: a report on a terminal shows no image.
    from PIL import Image

    try:
        content = path.read_bytes()
        with Image.open(io.BytesIO(content), formats=tuple(_KINDS)) as image:
            image.load()
            return Logo(content, _KINDS[str(image.format)], *image.size)
    except OSError as error:
        why = error.strerror or "it is no PNG or JPEG image"
        return Logo(fault=f"Without the logo {path.name}, which cannot be read: {why}")
    except (ValueError, SyntaxError, Image.DecompressionBombError):
        return Logo(fault=f"Without the logo {path.name}, which is no PNG or JPEG image")


Fact = tuple[str, str, str]
"""Return what, value, and what belongs to it."""
CREDIBLE = "Intervals are central 90 % credible intervals, ± is half of one"


@dataclass(frozen=True)
class Table:
    """One table; every cell is a text with its unit in the cell or in the heading.

    `marks` names a style for each row; empty: none has one. A terminal shows the rows whose
    indices are in `terminal_rows`, all where it is None; `hidden_note` says in place of `{}` how
    many more there are, and a table without either is left out there. One that `may_break` goes on
    over a page's end, where others begin a new page; paper shows the two halves of one that
    `is_folded` next to each other.
    """

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    marks: tuple[str, ...] = ()
    terminal_rows: tuple[int, ...] | None = None
    hidden_note: str = "... and {} more rows (in HTML and JSON)."
    may_break: bool = False
    is_folded: bool = False

    def shortened(self, most: int, last: int = 0) -> Table:
        """Return the table with `most` rows in a terminal, `last` of them from the end.

        One more may stay.
        """
        count = len(self.rows)
        if count <= most + 1:
            return self
        return replace(self, terminal_rows=(*range(most - last), *range(count - last, count)))

    def folded(self) -> Table:
        """Return the table with its second half to the right of its first."""
        half = (len(self.rows) + 1) // 2
        empty = ("",) * len(self.headings)
        pairs = zip_longest(self.rows[:half], self.rows[half:], fillvalue=empty)
        rows = tuple((*left, *right) for left, right in pairs)
        return replace(self, headings=self.headings * 2, rows=rows, is_folded=False)

    def with_units_in_headings(self) -> Table:
        """Return the table with a unit that all numbers of a column share in its heading."""
        headings, columns = [], []
        for heading, cells in zip(self.headings, zip(*self.rows, strict=True), strict=True):
            numbers = [cell for cell in cells if any(map(str.isdecimal, cell))]
            units = {cell.rpartition(" ")[2] for cell in numbers}
            unit = units.pop() if len(units) == 1 else ""
            is_shared = bool(unit) and not any(map(str.isdecimal, unit))
            headings.append(f"{heading}, {unit}" if is_shared else heading)
            columns.append([c.removesuffix(f" {unit}") for c in cells] if is_shared else cells)
        return replace(self, headings=tuple(headings), rows=tuple(zip(*columns, strict=True)))

    def not_in_terminal(self) -> Table:
        """Return the table, left out in a terminal."""
        return replace(self, terminal_rows=(), hidden_note="")


LEAST_PROBABILITY = 0.01
"""Rows of less are folded into one: a reader does nothing with them."""


def fold_improbable(
    rows: Sequence[tuple[str, ...]], probabilities: Sequence[float], what: str, column: int = 1
) -> tuple[tuple[str, ...], ...]:
    """Return the rows, those of a probability below 0.01 as one with their number.

    `probabilities` belong to the rows, and stand in a `column`; `what` names a row.
    """
    pairs = list(zip(rows, probabilities, strict=True))
    retained = [row for row, probability in pairs if not probability < LEAST_PROBABILITY]
    left = len(pairs) - len(retained)
    if left < 2:
        return tuple(rows)
    cells = [""] * len(rows[0])
    cells[0] = f"{left} further {what}"
    cells[column] = f"< {LEAST_PROBABILITY} each"
    return (*retained, tuple(cells))


def filled(*tables: Table) -> tuple[Table, ...]:
    """Return the tables that have rows."""
    return tuple(table for table in tables if table.rows)


@dataclass(frozen=True, eq=False)
class Section:
    """A headed part; what it has stands in the order of its fields.

    `lead` begins the summary and is stressed; `details` is the paragraph after it. `figures` are
    drawn where a renderer asks for them: a terminal does not, and loads nothing that draws.
    `status` and `style` are those of an answer of its own, as the paper's are of the whole; without
    a `style` it has the paper's. An appendix is on a screen and in a complete text, not in a PDF.
    `brief` are tables that stand alone in a brief text.
    """

    title: str
    paragraphs: Sequence[str] = ()
    lead: str = ""
    summary: str = ""
    details: str = ""
    facts: Sequence[Fact] = ()
    remarks: Sequence[str] = ()
    figures: Callable[[], Sequence[Illustration]] = tuple
    tables: Sequence[Table] = ()
    status: str = ""
    style: str = ""
    remarks_title: str = "What to mind about these data"
    is_appendix: bool = False
    brief: Sequence[Table] = ()

    @property
    def headline(self) -> str:
        """`Gap diagnosis: Explained`."""
        return ": ".join(word for word in (self.title, self.status) if word)

    @property
    def full_summary(self) -> str:
        """The summary with its lead."""
        return " ".join(word for word in (self.lead, self.summary) if word)


def appendices(*parts: Section) -> tuple[Section, ...]:
    """Return the parts as `Appendix A: ...`, `Appendix B: ...`."""
    lettered = zip(ascii_uppercase, parts, strict=False)
    return tuple(
        replace(part, title=f"Appendix {letter}: {part.title}", is_appendix=True)
        for letter, part in lettered
    )


@dataclass(frozen=True, eq=False)
class Paper:
    """One document: `status` is the state in a word, `style` its name among the page's styles.

    The first part says all in short. `bridge` and `period` are empty where the title says them or
    there is none; an engineer puts a name to one that `is_signed`. `generated_at` is None and
    `version` empty where nobody says. `closing` ends it: what holds throughout. `revision` is that
    of the report as a file, and `more` says in a brief text how to see everything.
    """

    title: str
    status: str
    style: str
    parts: Sequence[Section]
    closing: str
    bridge: str = ""
    period: str = ""
    generated_at: datetime | None = None
    version: str = ""
    is_signed: bool = False
    letterhead: Letterhead = NO_LETTERHEAD
    revision: str = ""
    more: str = ""

    @property
    def above(self) -> str:
        """`Arch bridge, period 2026-03-01 to 2026-05-25`: what stands above the title."""
        period = f"period {self.period}" if self.period else ""
        revision = f"revision {self.revision}" if self.revision else ""
        words = (self.letterhead.organisation, self.bridge, period, revision)
        return ", ".join(word for word in words if word)

    @cached_property
    def logo(self) -> Logo:
        """Of the head, with what is wrong with it."""
        return read_logo(self.letterhead.logo)

    @property
    def signatures(self) -> tuple[tuple[str, str], ...]:
        """Return who answers for it: the words, and the name as far as it is given."""
        by = self.letterhead
        return (
            ("Prepared by", by.prepared_by),
            ("Checked by", by.checked_by),
            ("Date", ""),
            ("Signature", ""),
        )

    @property
    def revision_line(self) -> str:
        """Return the revision, as it stands above the signatures."""
        return f"Revision: {self.revision or 'not stated'}"

    @property
    def name(self) -> str:
        """`Hanger 3, Arch bridge`: for a list of files, and the properties of one."""
        return ", ".join(word for word in (self.title, self.bridge, self.period) if word)

    @property
    def headline(self) -> str:
        """`Hanger 3, Arch bridge: Alert`."""
        return ": ".join(word for word in (self.name, self.status) if word)

    @property
    def made(self) -> str:
        """`Made 2026-05-01 10:00 UTC by shm 0.1.0`; empty where nobody says."""
        when = f"Made {formatting.moment(self.generated_at)}" if self.generated_at else ""
        return f"{when} by shm {self.version}" if when and self.version else when

    @property
    def foot(self) -> str:
        """The last line: when it was made, by which version, what holds throughout."""
        statement = (self.made, self.logo.fault, self.closing)
        return ". ".join(each for each in statement if each)
