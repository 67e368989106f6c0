"""What a figure of the report declares about itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from shm.report.content import HangerReport


@dataclass(frozen=True)
class Member:
    """A figure: `draw` gives None where the report lacks its data; `caption` explains what is
    seen, `alt` says what a blind reader needs."""

    name: str
    title: str
    draw: Callable[[HangerReport], Figure | None]
    caption: Callable[[HangerReport], str]
    alt: Callable[[HangerReport], str]
