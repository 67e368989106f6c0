"""What a figure declares about itself, and what it is once drawn.

Figures as PNG bytes or as SVG text fit to stand inside an HTML page.
"""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Generic, TypeVar

from shm.report.figures.specification import Specification
from shm.report.figures.style import INK, PALETTE, TINY

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Data = TypeVar("Data")
DOTS_PER_INCH = 150
"""Of a file, for a screen; a PDF has more (`as_pdf`)."""
_COLUMNS_AN_INCH = 17  # layout: letters of the smallest size, about half as wide as high


@dataclass(frozen=True)
class Member(Generic[Data]):
    """A figure: `draw` gives None where `Data` lacks what it shows; `caption` explains what is
    seen, `alt` says what a blind reader needs. What only paper shows may be drawn at once."""

    name: str
    title: str
    draw: Callable[[Data], Specification | Figure | None]
    caption: Callable[[Data], str]
    alt: Callable[[Data], str]

    def figure(self, data: Data) -> Figure | None:
        """The figure on paper."""
        found = self.draw(data)
        if not isinstance(found, Specification):
            return found
        # What draws is loaded where something is drawn: it takes a third of a second.
        from shm.report.figures.with_matplotlib import draw

        return draw(found)


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

    def png(self, dots_per_inch: int = DOTS_PER_INCH) -> bytes:
        """The picture on white."""
        return png(self.figure, dots_per_inch)


def drawn(members: Sequence[Member[Data]], data: Data) -> tuple[Illustration, ...]:
    """Every figure that `data` holds enough for, in the order of `members`."""
    made = (illustration(member, data) for member in members)
    return tuple(each for each in made if each is not None)


def illustration(member: Member[Data], data: Data) -> Illustration | None:
    """The figure with its words; None where `data` lacks what it shows."""
    figure = member.figure(data)
    if figure is None:
        return None
    return Illustration(member.name, member.title, member.caption(data), member.alt(data), figure)


_ID = re.compile(r'\bid="([^"]+)"')
_REFERENCE = re.compile(r'(href="#|url\(#)([^")]+)')


def png(figure: Figure, dots_per_inch: int = DOTS_PER_INCH, words: str = "") -> bytes:
    """The figure on white; with `words` below it, where it goes without a page that says them."""
    box = None
    if words:
        columns = round(_COLUMNS_AN_INCH * figure.get_figwidth())
        lines = "\n".join(textwrap.wrap(words, columns))
        figure.text(0.01, -0.02, lines, va="top", fontsize=TINY, color=INK)
        box = "tight"
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dots_per_inch, facecolor="white", bbox_inches=box)
    return buffer.getvalue()


def svg(figure: Figure, name: str, title: str, alt: str) -> str:
    """The figure as one `<svg>` element: named for screen readers, its ids prefixed by `name`
    and counted (so that they are unique on the page and the same on every run), its colours
    CSS variables with the printed colour as fallback."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    body = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
    return _named(_themed(_own_ids(body, name)), name, title, alt)


def _own_ids(body: str, name: str) -> str:
    numbers: dict[str, str] = {}
    for found in _ID.findall(body):
        numbers.setdefault(found, f"{name}-{len(numbers)}")
    body = _ID.sub(lambda match: f'id="{numbers[match[1]]}"', body)
    return _REFERENCE.sub(lambda match: match[1] + numbers[match[2]], body)


def _themed(body: str) -> str:
    for variable, colour in PALETTE.items():
        body = body.replace(colour, f"var(--{variable}, {colour})")
    return body


def _named(body: str, name: str, title: str, alt: str) -> str:
    labels = f'role="img" aria-labelledby="{name}-title {name}-alt"'
    words = (
        f'<title id="{name}-title">{escape(title)}</title>'
        f'<desc id="{name}-alt">{escape(alt)}</desc>'
    )
    return re.sub(r"<svg\b([^>]*)>", rf"<svg {labels}\1>{words}", body, count=1, flags=re.DOTALL)
