"""What `shm validate --figure` gives of one figure of the thesis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shm.report.figures.prediction_figures import write_curves_png as write_png
from shm.report.figures.specification import Specification


@dataclass(frozen=True, eq=False)
class Figure:
    """A table and a picture of ours: `cells` stand under `heads`, `statement` below them.

    `missed` says what is beyond its mark; empty where nothing is. A picture that no specification
    tells, of a body in space, is written by `draw`.
    """

    title: str
    heads: Sequence[str]
    cells: Sequence[Sequence[str]]
    statement: str
    document: Any
    specification: Specification | None = None
    missed: str = ""
    draw: Callable[[Path, str], None] | None = None

    def write(self, path: Path) -> None:
        """The picture, as PNG, with what it says below."""
        words = f"{self.title}. {self.statement}"
        if self.specification is not None:
            write_png(self.specification, path, words)
        elif self.draw is not None:
            self.draw(path, words)
