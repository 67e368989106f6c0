"""Mode shapes along the hanger, each beside a thin line that guides the eye."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shm.report import formatting
from shm.report.contents import ModalTestReport
from shm.report.figures.modal_test_response import Shown
from shm.report.figures.specification import (
    PLANE_HUES,
    PLANE_SYMBOLS,
    Axis,
    Line,
    Mark,
    Member,
    Panel,
    Points,
    Rule,
    Specification,
)
from shm.report.formatting import NORMAL_90
from shm.values import PLANES, FloatArray, Mode

ROOM = 1.35
"""To either side of a shape, whose largest value is 1."""
_MOST = 36
_LEAST_POINTS = 2
_NEAR = 0.4
"""A string misses the points by no more than this share of them where it is drawn."""


@dataclass(frozen=True, eq=False)
class Guide:
    """A line through a shape: places (n,) from the deck end in m, values (n,)."""

    x_m: FloatArray
    value: FloatArray


def shown_modes(sheet: ModalTestReport) -> list[Mode]:
    """Those with a shape, as many as there is room for."""
    return modes_with_shape(sheet)[:_MOST]


def modes_with_shape(sheet: ModalTestReport) -> list[Mode]:
    """Modes measured at so many places or directions that there is a shape to see."""
    return [mode for mode in sheet.modes if _known_values(mode) >= _LEAST_POINTS]


def _known_values(mode: Mode) -> int:
    values = [value for p in mode.shape if math.isfinite(p.x_m) for value in (p.value, p.cross)]
    return sum(math.isfinite(value) for value in values)


def extent_m(sheet: ModalTestReport) -> tuple[float, float]:
    """From end to end of the hanger, or of the measured places where its length is not known."""
    if sheet.hanger is not None:
        return 0.0, sheet.hanger.length_m
    places = [p.x_m for mode in sheet.modes for p in mode.shape if math.isfinite(p.x_m)]
    low, high = min(places), max(places)
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def panel_title(mode: Mode) -> str:
    """`2: 13.85 Hz`."""
    return f"{mode.order}: {mode.frequency_hz:.4g} Hz"


def guide_name(sheet: ModalTestReport) -> str:
    """What the guides of a test are, for a legend."""
    return "places joined" if sheet.hanger is None else "guide: taut string"


def guide(sheet: ModalTestReport, mode: Mode) -> Guide | None:
    """A taut string's shape of the mode's order in the measured size, None where it does not come
    near the points; straight lines between the places where the hanger is not described."""
    known = [p for p in mode.shape if math.isfinite(p.x_m) and math.isfinite(p.value)]
    pairs = sorted((p.x_m, p.value) for p in known)
    x_m, value = np.array(pairs, dtype=np.float64).reshape(-1, 2).T
    if sheet.hanger is None:
        return Guide(x_m, value)
    wave = mode.order * np.pi / sheet.hanger.length_m
    string = np.sin(wave * x_m)
    size = float(string @ value) / max(float(string @ string), 1e-9)
    misses = float(np.linalg.norm(value - size * string))
    if len(x_m) < _LEAST_POINTS or misses >= _NEAR * np.linalg.norm(value) or abs(size) >= ROOM:
        return None
    places = np.linspace(0, sheet.hanger.length_m, 12 * mode.order + 1)
    return Guide(places, size * np.sin(wave * places))


# Layout: panels beside each other on a page, and on a screen.
_MOST_COLUMNS, _LEAST_COLUMNS = 7, 4
_MOST_ON_SCREEN = 4
_PANEL_INCHES = 1.12


def _draw(shown: Shown) -> Specification | None:
    sheet = shown.sheet
    if not shown_modes(sheet):
        return None
    rows = [[_panel(sheet, mode) for mode in row] for row in rows_of(sheet, shown.is_on_screen)]
    return Specification(
        rows=rows, height_inches=_PANEL_INCHES * len(rows) + 0.85, is_grid=True,
        x_label="position from the deck end (m)" if sheet.hanger else "position (m)",
    )  # fmt: skip


def rows_of(sheet: ModalTestReport, is_on_screen: bool) -> list[list[Mode]]:
    """The modes row by row, the rows of a plane about equally full: a plane begins a new row."""
    modes = shown_modes(sheet)
    planes = [[mode for mode in modes if mode.plane == plane] for plane in PLANES]
    longest = max(map(len, planes)) or 1
    most = _MOST_ON_SCREEN if is_on_screen else _MOST_COLUMNS
    columns = math.ceil(longest / math.ceil(longest / most))
    columns = columns if is_on_screen else max(_LEAST_COLUMNS, columns)
    return [own[i : i + columns] for own in planes for i in range(0, len(own), columns)]


def _panel(sheet: ModalTestReport, mode: Mode) -> Panel:
    points = [p for p in mode.shape if math.isfinite(p.x_m)]
    x_m = [p.x_m for p in points]
    value, cross, sd = np.array([(p.value, p.cross, p.sd) for p in points]).reshape(-1, 3).T
    half = NORMAL_90 * np.nan_to_num(sd)
    low, high = extent_m(sheet)
    margin = 0.03 * (high - low)
    ticks = (low, (low + high) / 2, high)
    marks: list[Mark] = [Rule(at=0, width=0.5)]
    if found := guide(sheet, mode):
        marks.append(
            Line(x=found.x_m, y=found.value, colour="quiet", width=0.8, name=guide_name(sheet))
        )
    marks.append(
        Points(
            x=x_m, y=value, low=value - half, high=value + half, size=3.8, name=mode.plane,
            colour=PLANE_HUES[mode.plane], symbol=PLANE_SYMBOLS[mode.plane],
            hover="%{x:.4g} m: %{y:.3g}",
        )
    )  # fmt: skip
    if np.isfinite(cross).any():
        marks.append(
            Points(
                x=x_m, y=cross, symbol="diamond", filled=False, size=3.4, name="other plane",
                hover="%{x:.4g} m: %{y:.3g}",
            )
        )  # fmt: skip
    return Panel(
        y=Axis(range=(-ROOM, ROOM), ticks=(-1, 0, 1)),
        x=Axis(
            range=(low - margin, high + margin), ticks=ticks,
            tick_labels=[f"{tick:.3g}" for tick in ticks],
        ),
        marks=marks, title=panel_title(mode), title_colour=PLANE_HUES[mode.plane],
        title_side="left",
    )  # fmt: skip


def _caption(shown: Shown) -> str:
    sheet = shown.sheet
    line = (
        "The thin line is no measurement: it is the shape of a taut string of that order, brought "
        "to the size of the measured points, and left out where it does not come near them."
        if sheet.hanger is not None
        else "Thin lines only join the measured places."
    )
    some = formatting.some(len(shown_modes(sheet)), len(modes_with_shape(sheet)), "shapes")
    return (
        "Each panel is a mode: its order and frequency, its component in its own plane with the "
        "90 % interval where it is known, and that in the other plane as diamonds. The deck end "
        f"is on the left. {line}{some}"
    )


def _alt(shown: Shown) -> str:
    modes = shown_modes(shown.sheet)
    places = len({point.x_m for mode in modes for point in mode.shape})
    listed = ", ".join(f"{mode.plane} {mode.order}" for mode in modes)
    return f"Shapes of {len(modes)} modes at {formatting.counted(places, 'place')}: {listed}."


FIGURE = Member("shapes", "Mode shapes", _draw, _caption, _alt)
