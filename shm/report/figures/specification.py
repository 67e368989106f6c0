"""Figures as data: paper draws them by `with_matplotlib`, a screen by plotly.

Colours are names of `style.PALETTE`, sizes are points. Places may be numbers or times. A
`hover` is a template as plotly takes it; paper leaves it out.

What a figure declares about itself, and what it is once drawn.

Figures as PNG bytes or as SVG text fit to stand inside an HTML page.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from html import escape
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeAlias, TypeVar

import numpy as np

from shm.report.figures.style import PALETTE
from shm.values import FloatArray, IntArray, Plane

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Values: TypeAlias = Any
"""Shape (n,): an array, or a sequence of numbers, of times or of texts; NaN breaks a line."""
Place: TypeAlias = float | datetime
Dash = Literal["solid", "dash", "dot", "dashdot", "longdash"]
Side = Literal["left", "right", "top"]
Symbol = Literal[
    "circle", "square", "diamond", "cross", "thin cross", "triangle", "triangle down", "tick"
]
PLANE_HUES: dict[Plane, str] = {"transverse": "blue", "longitudinal": "orange"}
PLANE_SYMBOLS: dict[Plane, Symbol] = {"transverse": "circle", "longitudinal": "square"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Mark:
    """The fields that all marks share.

    `name` stands in the legend, once a figure. `texts` are what a hover tells of each place, or
    what its template calls `%{text}`. `in_shares`: y is a share of the panel's height.
    """

    colour: str = "ink"
    opacity: float = 1.0
    name: str = ""
    texts: Sequence[str] = ()
    hover: str = ""
    in_shares: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Line(Mark):
    """A line through points; with `dots`, these too."""

    x: Values
    y: Values
    width: float = 1.0
    dash: Dash = "solid"
    dots: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Points(Mark):
    """Symbols, with bars from `low` to `high` where these are given, and `labels` beside them.

    Unless `clipped`, those at the edge of the panel are whole.
    """

    x: Values
    y: Values
    low: Values | None = None
    high: Values | None = None
    symbol: Symbol = "circle"
    filled: bool = True
    size: float = 4.5
    caps: bool = True
    clipped: bool = True
    labels: Sequence[str] = ()
    label_side: Side = "right"


@dataclass(frozen=True, kw_only=True, eq=False)
class Band(Mark):
    """The area between two curves."""

    x: Values
    low: Values
    high: Values


@dataclass(frozen=True, kw_only=True, eq=False)
class Bars(Mark):
    """Upright bars from `base` to `base` + `y`; from the left to the right where `lying`.

    `labels` stand at their ends.
    """

    x: Values
    y: Values
    base: Values = 0.0
    width: float = 0.8
    lying: bool = False
    labels: Sequence[str] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Rule(Mark):
    """A straight line through the whole panel at one value of an axis, with words along it."""

    at: Place
    axis: Literal["x", "y"] = "y"
    width: float = 1.0
    dash: Dash = "solid"
    label: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Span(Mark):
    """All of a panel between two values of an axis.

    With a label at its top, so many lines down, that begins on its `left` or ends on its `right`.
    """

    low: Place
    high: Place
    axis: Literal["x", "y"] = "x"
    label: str = ""
    label_side: Literal["left", "right"] = "left"
    label_line: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Heat(Mark):
    """Colour by value: `z` (y, x) from transparent at its least to `colour` at its largest.

    NaN stays empty. `x` and `y` are the middles of columns and rows.
    """

    x: Values
    y: Values
    z: Values


@dataclass(frozen=True, kw_only=True)
class Axis:
    """`range` is from low to high, of a logarithmic axis too."""

    label: str = ""
    range: tuple[Place, Place] | None = None
    scale: Literal["linear", "log", "date"] = "linear"
    ticks: Sequence[float] | None = None
    tick_labels: Sequence[str] | None = None
    most_ticks: int | None = None
    grid: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """Axes and what is on them, drawn in the order of `marks`.

    Without `x` it shares the horizontal axis of the next panel below that has one; `shares_y`: it
    has the vertical axis of the first panel of its row, or of the row above where it is the first.
    `has_separate_legend`: on paper, apart from the others'.
    """

    y: Axis
    marks: Sequence[Mark]
    x: Axis | None = None
    title: str = ""
    title_colour: str = "ink"
    title_side: Literal["left", "right"] = "right"
    height: float = 1.0
    width: float = 1.0
    shares_y: bool = False
    has_separate_legend: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Specification:
    """Panels row by row, with the height on paper.

    `is_grid`: many small panels of one size, which share the outermost numbers and `x_label`, and
    column by column the horizontal axis.
    """

    rows: Sequence[Sequence[Panel]]
    height_inches: float
    legend_columns: int = 4
    is_grid: bool = False
    x_label: str = ""

    @property
    def panels(self) -> list[Panel]:
        """All of them, in reading order."""
        return [panel for row in self.rows for panel in row]


def stacked(
    panels: Sequence[Panel], height_inches: float, legend_columns: int = 4
) -> Specification:
    """Return panels one below the other."""
    rows = tuple((panel,) for panel in panels)
    return Specification(rows=rows, height_inches=height_inches, legend_columns=legend_columns)


def limits(*values: Values, room: float = 0.08) -> tuple[float, float]:
    """Return the least and the largest known value, with a little room."""
    known = np.concatenate([np.asarray(each, np.float64) for each in values])
    low, high = float(np.nanmin(known)), float(np.nanmax(known))
    margin = room * max(high - low, 1e-3 * abs(high))
    return low - margin, high + margin


def log_axis(label: str, low: float, high: float) -> Axis:
    """Return a logarithmic axis, numbered at each decade; of up to two also at 2 and 5."""
    steps = (1, 2, 5) if high < 200 * low else (1,)
    decades = range(math.floor(math.log10(low)) - 1, math.ceil(math.log10(high)) + 1)
    ticks = [step * 10.0**decade for decade in decades for step in steps]
    shown = [tick for tick in ticks if low <= tick <= high]
    labels = [f"{tick:g}" for tick in shown]
    return Axis(label=label, range=(low, high), scale="log", ticks=shown, tick_labels=labels)


def plane_colour(plane: Plane | None) -> str:
    """Return the name of a plane's colour; purple where the plane is not known."""
    return PLANE_HUES[plane] if plane else "purple"


def envelope_places(values: FloatArray, bins: int) -> IntArray:
    """Return indices of the smallest and the largest of `values` (n,) in each of `bins`, ascending.

    No peak is lost, and every value that is drawn was measured. NaN are passed over; a bin of
    nothing else keeps one, so that the line breaks there. All of a short signal stays.
    """
    if len(values) <= 2 * bins:
        return np.arange(len(values))
    size = -(-len(values) // bins)
    padded = np.full(size * (-(-len(values) // size)), np.nan)
    padded[: len(values)] = values
    rows = padded.reshape(-1, size)
    unknown = np.isnan(rows)
    lowest = np.where(unknown, np.inf, rows).argmin(axis=1)
    highest = np.where(unknown, -np.inf, rows).argmax(axis=1)
    both = np.sort(np.stack([lowest, highest], axis=1), axis=1)
    both += size * np.arange(len(rows))[:, np.newaxis]
    return np.unique(np.minimum(both, len(values) - 1))


def peak_places(values: FloatArray, bins: int) -> IntArray:
    """Return indices of the largest finite of `values` (n,) in each of `bins`, ascending."""
    edges = np.unique(np.linspace(0, len(values), bins + 1).astype(np.int64))
    finite = np.where(np.isnan(values), -np.inf, values)
    pairs = pairwise(edges.tolist())
    return np.array([start + int(np.argmax(finite[start:stop])) for start, stop in pairs])


Data = TypeVar("Data")
DOTS_PER_INCH = 150
"""Of a file, for a screen; a PDF has more (`as_pdf`)."""


@dataclass(frozen=True)
class FigureSpec(Generic[Data]):
    """Define a figure: `draw` gives None where `Data` lacks what it shows.

    `caption` explains what is seen, `alt` says what a blind reader needs. Figures on paper only
    may be drawn at once.
    """

    name: str
    title: str
    draw: Callable[[Data], Specification | Figure | None]
    caption: Callable[[Data], str]
    alt: Callable[[Data], str]

    def figure(self, data: Data) -> Figure | None:
        """Return the figure on paper."""
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
        """Return an `<svg>` element whose ids are its own and whose colours follow the page."""
        return svg(self.figure, self.name, self.title, self.alt)

    def png(self, dots_per_inch: int = DOTS_PER_INCH) -> bytes:
        """Return the picture on white."""
        return png(self.figure, dots_per_inch)


def drawn(members: Sequence[FigureSpec[Data]], data: Data) -> tuple[Illustration, ...]:
    """Return every figure that `data` holds enough for, in the order of `members`."""
    made = (illustration(member, data) for member in members)
    return tuple(each for each in made if each is not None)


def illustration(member: FigureSpec[Data], data: Data) -> Illustration | None:
    """Return the figure with its words; None where `data` lacks what it shows."""
    figure = member.figure(data)
    if figure is None:
        return None
    return Illustration(member.name, member.title, member.caption(data), member.alt(data), figure)


_ID = re.compile(r'\bid="([^"]+)"')
_REFERENCE = re.compile(r'(href="#|url\(#)([^")]+)')


def png(figure: Figure, dots_per_inch: int = DOTS_PER_INCH) -> bytes:
    """Return the figure on white."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dots_per_inch, facecolor="white")
    return buffer.getvalue()


def svg(figure: Figure, name: str, title: str, alt: str) -> str:
    """Return the figure as one `<svg>` element, named for screen readers.

    Its ids are prefixed by `name` and counted (so that they are unique on the page and the same
    on every run), its colours CSS variables with the printed colour as fallback.
    """
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    body = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
    return _named(_themed(_unique_ids(body, name)), name, title, alt)


def _unique_ids(body: str, name: str) -> str:
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
