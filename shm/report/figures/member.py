"""What a figure declares about itself, and what it is once drawn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from matplotlib.figure import Figure

from shm.report.figures.render import png, svg

Data = TypeVar("Data")


@dataclass(frozen=True)
class Member(Generic[Data]):
    """A figure: `draw` gives None where `Data` lacks what it shows; `caption` explains what is
    seen, `alt` says what a blind reader needs."""

    name: str
    title: str
    draw: Callable[[Data], Figure | None]
    caption: Callable[[Data], str]
    alt: Callable[[Data], str]


@dataclass(frozen=True, eq=False)
class Illustration:
    """A drawn figure with the words that go with it."""

    name: str
    title: str
    caption: str
    alt: str
    figure: Figure

    def svg(self) -> str:
        """An `<svg>` element whose ids are its own and whose colours follow the page."""
        return svg(self.figure, self.name, self.title, self.alt)

    def png(self, dots_per_inch: int = 150) -> bytes:
        """The picture on white."""
        return png(self.figure, dots_per_inch)


def drawn(members: Sequence[Member[Data]], data: Data) -> tuple[Illustration, ...]:
    """Every figure that `data` holds enough for, in the order of `members`."""
    made = (illustration(member, data) for member in members)
    return tuple(each for each in made if each is not None)


def illustration(member: Member[Data], data: Data) -> Illustration | None:
    """The figure with its words; None where `data` lacks what it shows."""
    figure = member.draw(data)
    if figure is None:
        return None
    return Illustration(member.name, member.title, member.caption(data), member.alt(data), figure)
