"""Draw the modes of a test: poles over model order, damping, uncertainty and shapes."""

from __future__ import annotations

import math

import numpy as np

from shm.report import formatting
from shm.report.contents import ModalTestReport
from shm.report.figures import specification as spec
from shm.report.figures.modal_test_axes import (
    ResponseCurves,
    Spectrum,
    mode_marks,
    shown_range,
    with_headroom,
)
from shm.report.formatting import NORMAL_90
from shm.values import PLANES, BoolArray, Hanger, Mode

# Layout: as many bins as a page has dots; a scale is never narrower than two orders.
_BINS = 550
_LEAST_SPAN = 2.0


def _draw_poles(shown: ResponseCurves) -> spec.Specification | None:
    poles = shown.sheet.identification.poles
    if not len(poles.order):
        return None
    low, high = shown_range(shown.sheet)
    lowest, highest = float(poles.order.min()), float(poles.order.max())
    bottom = lowest - 0.03 * max(highest - lowest, _LEAST_SPAN)
    step = next((each for each in (1, 2, 5, 10, 20, 50) if 6 * each >= highest), 100)
    orders = spec.Axis(
        label="model order", range=with_headroom(bottom, 1.02 * highest),
        ticks=np.arange(0, highest + 1, step).tolist(),
    )  # fmt: skip
    marks = [
        *(_background(shown.spectrum, low, high, bottom, highest) if shown.spectrum else []),
        _poles(shown, ~poles.stable, "dropped pole", "thin cross", "quiet"),
        _poles(shown, poles.stable, "stable pole", "circle", "green"),
        *mode_marks(shown.sheet, low, high),
    ]
    across = spec.Axis(label="frequency (Hz)", range=(low, high))
    return spec.stacked([spec.Panel(y=orders, marks=marks, x=across)], 4.2, legend_columns=3)


def _poles(
    shown: ResponseCurves, which: BoolArray, name: str, symbol: spec.Symbol, colour: str
) -> spec.Points:
    poles = shown.sheet.identification.poles
    return spec.Points(
        x=poles.frequency_hz[which], y=poles.order[which], symbol=symbol, size=3.0, colour=colour,
        name=name, texts=[f"{100 * ratio:.2g}" for ratio in poles.damping_ratio[which]],
        hover="%{x:.3f} Hz, order %{y}, damping %{text} %",
    )  # fmt: skip


def _background(
    found: Spectrum, low_hz: float, high_hz: float, bottom: float, top: float
) -> list[spec.Mark]:
    """Return the log spectrum over all points, drawn between lowest and highest order."""
    start, stop = np.searchsorted(found.frequency_hz, [low_hz, high_hz])
    lines = slice(max(1, int(start)), int(stop) + 1)
    values = found.together[lines]
    known = values[np.isfinite(values) & (values > 0)]
    if not len(known):
        return []
    places = spec.envelope_places(values, _BINS)
    least, most = np.log10([0.5 * np.quantile(known, 0.01), known.max()])
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (np.log10(values[places]) - least) / (most - least)
    name = "spectrum of all points (log scale)"
    return [
        spec.Line(
            x=found.frequency_hz[lines][places], y=bottom + (top - bottom) * share, width=0.8,
            colour="quiet", opacity=0.6, name=name,
        )
    ]  # fmt: skip


def _poles_caption(shown: ResponseCurves) -> str:
    poles = shown.sheet.identification.poles
    stable = int(np.sum(poles.stable))
    return (
        f"{len(poles.order)} poles over the order of the model that gave them, {stable} of them "
        "stable; a column of stable poles is a mode. Marks on top: the chosen modes by plane, and "
        "what was excluded."
    )


def _poles_alt(shown: ResponseCurves) -> str:
    listed = ", ".join(f"{m.plane} {m.order} at {m.frequency_hz:.2f} Hz" for m in shown.sheet.modes)
    return f"Stabilisation diagram with {len(shown.sheet.modes)} chosen modes: {listed}."


STABILISATION = spec.FigureSpec(
    "stabilisation", "Stabilisation diagram", _draw_poles, _poles_caption, _poles_alt
)

ROOM = 1.35
"""To either side of a shape, whose largest value is 1."""
_MOST = 36
_LEAST_POINTS = 2
_NEAR = 0.4
"""A string misses the points by no more than this share of them where it is drawn."""


def shown_modes(sheet: ModalTestReport) -> list[Mode]:
    """Return modes with a shape, as many as there is room for."""
    return modes_with_shape(sheet)[:_MOST]


def modes_with_shape(sheet: ModalTestReport) -> list[Mode]:
    """Return modes measured at enough positions or directions to show a shape."""
    return [mode for mode in sheet.modes if _known_values(mode) >= _LEAST_POINTS]


def _known_values(mode: Mode) -> int:
    values = [value for p in mode.shape if math.isfinite(p.x_m) for value in (p.value, p.cross)]
    return sum(math.isfinite(value) for value in values)


def extent_m(sheet: ModalTestReport) -> tuple[float, float]:
    """Return the ends of the hanger, or of the measured positions where its length is unknown."""
    if sheet.hanger is not None:
        return 0.0, sheet.hanger.length_m
    places = [p.x_m for mode in sheet.modes for p in mode.shape if math.isfinite(p.x_m)]
    low, high = min(places), max(places)
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def panel_title(mode: Mode) -> str:
    """Return `2: 13.85 Hz`."""
    return f"{mode.order}: {mode.frequency_hz:.4g} Hz"


def _guide(hanger: Hanger | None, mode: Mode) -> list[spec.Mark]:
    """Return the shape of a taut string of the mode's order, scaled to the measurement.

    Nothing where it does not come close to the points, or the hanger is not described.
    """
    known = [p for p in mode.shape if math.isfinite(p.x_m) and math.isfinite(p.value)]
    x_m, value = (np.array([getattr(p, name) for p in known]) for name in ("x_m", "value"))
    if hanger is None or len(known) < _LEAST_POINTS:
        return []
    wave = mode.order * np.pi / hanger.length_m
    string = np.sin(wave * x_m)
    size = float(string @ value) / max(float(string @ string), 1e-9)
    misses = float(np.linalg.norm(value - size * string))
    if misses >= _NEAR * np.linalg.norm(value) or abs(size) >= ROOM:
        return []
    places = np.linspace(0, hanger.length_m, 12 * mode.order + 1)
    name = "guide: taut string"
    return [
        spec.Line(x=places, y=size * np.sin(wave * places), colour="quiet", width=0.8, name=name)
    ]


# Layout: panels beside each other.
_MOST_COLUMNS = 5
_PANEL_INCHES = 1.12


def _draw_shapes(shown: ResponseCurves) -> spec.Specification | None:
    sheet = shown.sheet
    if not shown_modes(sheet):
        return None
    rows = [[_shape_panel(sheet, mode) for mode in row] for row in rows_of(sheet)]
    return spec.Specification(
        rows=rows, height_inches=_PANEL_INCHES * len(rows) + 0.85, is_grid=True,
        x_label="position from the deck end (m)" if sheet.hanger else "position (m)",
    )  # fmt: skip


def rows_of(sheet: ModalTestReport) -> list[list[Mode]]:
    """Return the modes in about equally full rows; each plane begins a new row."""
    modes = shown_modes(sheet)
    planes = [[mode for mode in modes if mode.plane == plane] for plane in PLANES]
    longest = max(map(len, planes)) or 1
    columns = math.ceil(longest / math.ceil(longest / _MOST_COLUMNS))
    return [this[i : i + columns] for this in planes for i in range(0, len(this), columns)]


def _shape_panel(sheet: ModalTestReport, mode: Mode) -> spec.Panel:
    points = [p for p in mode.shape if math.isfinite(p.x_m)]
    x_m = [p.x_m for p in points]
    value, cross, sd = np.array([(p.value, p.cross, p.sd) for p in points]).reshape(-1, 3).T
    half = NORMAL_90 * np.nan_to_num(sd)
    low, high = extent_m(sheet)
    margin = 0.03 * (high - low)
    ticks = (low, (low + high) / 2, high)
    marks: list[spec.Mark] = [spec.Rule(at=0, width=0.5), *_guide(sheet.hanger, mode)]
    marks.append(
        spec.Points(
            x=x_m, y=value, low=value - half, high=value + half, size=3.8, name=mode.plane,
            colour=spec.PLANE_HUES[mode.plane], symbol=spec.PLANE_SYMBOLS[mode.plane],
            hover="%{x:.4g} m: %{y:.3g}",
        )
    )  # fmt: skip
    if np.isfinite(cross).any():
        marks.append(
            spec.Points(
                x=x_m, y=cross, symbol="diamond", filled=False, size=3.4, name="other plane",
                hover="%{x:.4g} m: %{y:.3g}",
            )
        )  # fmt: skip
    return spec.Panel(
        y=spec.Axis(range=(-ROOM, ROOM), ticks=(-1, 0, 1)),
        x=spec.Axis(
            range=(low - margin, high + margin), ticks=ticks,
            tick_labels=[f"{tick:.3g}" for tick in ticks],
        ),
        marks=marks, title=panel_title(mode), title_colour=spec.PLANE_HUES[mode.plane],
        title_side="left",
    )  # fmt: skip


def _shapes_caption(shown: ResponseCurves) -> str:
    sheet = shown.sheet
    line = (
        " The thin line is no measurement: it is the shape of a taut string of that order, brought "
        "to the size of the measured points, and left out where it does not come near them."
        if sheet.hanger is not None
        else ""
    )
    some = formatting.some(len(shown_modes(sheet)), len(modes_with_shape(sheet)), "shapes")
    return (
        "Each panel is a mode: its order and frequency, its component in its own plane with the "
        "90 % interval where it is known, and that in the other plane as diamonds. The deck end "
        f"is on the left.{line}{some}"
    )


def _shapes_alt(shown: ResponseCurves) -> str:
    modes = shown_modes(shown.sheet)
    places = len({point.x_m for mode in modes for point in mode.shape})
    listed = ", ".join(f"{mode.plane} {mode.order}" for mode in modes)
    return f"Shapes of {len(modes)} modes at {formatting.counted(places, 'place')}: {listed}."


SHAPES = spec.FigureSpec("shapes", "Mode shapes", _draw_shapes, _shapes_caption, _shapes_alt)
