"""The figures of a report. A new one: a file with a `FIGURE`, and a line in `MEMBERS`."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.figure import Figure

from shm.report.content import HangerReport
from shm.report.figures.frequencies import FIGURE as FREQUENCIES
from shm.report.figures.render import png, svg
from shm.report.figures.response import FIGURE as RESPONSE
from shm.report.figures.stiffness import FIGURE as STIFFNESS
from shm.report.figures.tension import FIGURE as TENSION
from shm.report.figures.trend import FIGURE as TREND

MEMBERS = (TREND, TENSION, FREQUENCIES, RESPONSE, STIFFNESS)


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


def illustrations(data: HangerReport) -> tuple[Illustration, ...]:
    """Every figure that this report has the data for, in reading order."""
    return tuple(
        Illustration(member.name, member.title, member.caption(data), member.alt(data), figure)
        for member in MEMBERS
        if (figure := member.draw(data)) is not None
    )
