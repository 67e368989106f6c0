"""The quality sheet: each check with its verdict, its figure beside the limit, what to do."""

from __future__ import annotations

import textwrap

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report.figures import style
from shm.report.figures.modal_test_spectra import Shown
from shm.report.figures.specification import Member
from shm.report.figures.style import VERDICT_COLOURS
from shm.report.quality_table import SYMBOLS, overall, verdict_label, with_unit
from shm.values import QualityCheck

# Layout: inches of a line of small type, its cell and head; characters that a column holds.
_LINE_INCHES = 0.155
_PAD_INCHES = 0.11
_HEAD_INCHES = 0.3
_BASE_INCHES = 0.17
_WORDS_WIDTH = 62
_CELL_WIDTH = 14
_COLUMNS = (0.004, 0.125, 0.255, 0.38, 0.505)
_HEADINGS = ("verdict", "check", "figure", "limit", "what was found, what to do")


def _draw(shown: Shown) -> Figure | None:
    checks = shown.sheet.identification.quality
    if not checks:
        return None
    rows = [_cells(check) for check in checks]
    heights = [_LINE_INCHES * max(len(cell) for cell in row) + _PAD_INCHES for row in rows]
    figure = style.new_figure(sum(heights) + _HEAD_INCHES)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0, 1)
    axes.set_ylim(sum(heights) + _HEAD_INCHES, 0)
    _row(axes, _BASE_INCHES, tuple([heading] for heading in _HEADINGS), style.QUIET)
    top = _HEAD_INCHES
    for check, row, height in zip(checks, rows, heights, strict=True):
        axes.axhline(top, color=style.GRID, linewidth=0.8)
        _row(axes, top + _BASE_INCHES, row, VERDICT_COLOURS[check.verdict])
        top += height
    return figure


def _cells(check: QualityCheck) -> tuple[list[str], ...]:
    """The cells of a row, each in lines."""
    found = textwrap.wrap(check.found, _WORDS_WIDTH)
    todo = textwrap.wrap(f"→ {check.remedy}", _WORDS_WIDTH) if check.remedy else []
    return (
        [verdict_label(check.verdict)],
        textwrap.wrap(check.name, _CELL_WIDTH),
        textwrap.wrap(with_unit(check.value, check.unit), _CELL_WIDTH),
        textwrap.wrap(with_unit(check.limit, check.unit), _CELL_WIDTH),
        [*found, *todo],
    )


def _row(axes: Axes, base: float, cells: tuple[list[str], ...], first_colour: str) -> None:
    for column, (x, lines) in enumerate(zip(_COLUMNS, cells, strict=True)):
        for number, line in enumerate(lines):
            axes.text(
                x, base + number * _LINE_INCHES, line, fontsize=style.TINY,
                color=first_colour if column == 0 else style.INK,
                fontweight="bold" if column == 0 else "normal",
            )  # fmt: skip


def _caption(shown: Shown) -> str:
    marks = ", ".join(f"{symbol} {verdict}" for verdict, symbol in SYMBOLS.items())
    return f"Everything that can be wrong with a test, as a figure beside its limit: {marks}."


def _alt(shown: Shown) -> str:
    checks = shown.sheet.identification.quality
    listed = ", ".join(f"{check.name}: {check.verdict}" for check in checks)
    return f"{len(checks)} quality checks, together {overall(checks)}. {listed}."


FIGURE = Member("quality", "Quality sheet", _draw, _caption, _alt)
