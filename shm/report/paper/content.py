"""What is set on paper: parts in reading order, of the same nouns that the HTML pages show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from shm.report import words
from shm.report.figures.member import Illustration
from shm.report.table import Table

Fact = tuple[str, str, str]
"""What, value, what stands beside it."""


@dataclass(frozen=True, eq=False)
class Part:
    """A headed part; what it has stands in the order of its fields.

    `style` is that of an answer of its own, as `Paper.style` is of the whole; empty: the paper's.
    """

    title: str
    summary: str = ""
    facts: Sequence[Fact] = ()
    remarks: Sequence[str] = ()
    illustrations: Sequence[Illustration] = ()
    tables: Sequence[Table] = ()
    style: str = ""

    @property
    def is_empty(self) -> bool:
        return not any((self.summary, self.facts, self.remarks, self.illustrations, self.tables))


@dataclass(frozen=True, eq=False)
class Paper:
    """One document: `status` is the state in a word, `style` its name among the page's styles.

    `generated_at` is None and `version` empty where nobody says.
    """

    title: str
    bridge: str
    status: str
    style: str
    parts: Sequence[Part]
    generated_at: datetime | None
    version: str
    closing: str

    @property
    def name(self) -> str:
        """The document's title for its properties and for a list of files."""
        return ", ".join(word for word in (self.title, self.bridge) if word)

    @property
    def made(self) -> str:
        """`Made 2026-05-01 10:00 UTC by shm 0.1.0`, as far as it is known."""
        when = f" {words.moment(self.generated_at)}" if self.generated_at else ""
        return f"Made{when} by shm {self.version}".rstrip()
