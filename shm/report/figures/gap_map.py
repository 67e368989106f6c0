"""The gap by plane and order, by place along the hanger, and by the conditions of the test."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from shm.report import formatting
from shm.report.contents import DiagnosisSheet
from shm.report.figures import specification as spec
from shm.report.formatting import NORMAL_90
from shm.values import PLANES, GapPlace, Plane, Residual, Trend, is_excluded


def measured(sheet: DiagnosisSheet) -> list[Residual]:
    """Return the residuals that are known."""
    return [r for r in sheet.diagnosis.where if math.isfinite(r.residual_percent)]


def retained(sheet: DiagnosisSheet) -> list[Residual]:
    """Return those that were not excluded as gross errors."""
    return [r for r in measured(sheet) if not is_excluded(sheet.diagnosis, r)]


def excluded(sheet: DiagnosisSheet) -> list[Residual]:
    """Return those that were excluded as gross errors."""
    return [r for r in measured(sheet) if is_excluded(sheet.diagnosis, r)]


def planes(residuals: Sequence[Residual]) -> list[Plane]:
    return [plane for plane in PLANES if any(r.plane == plane for r in residuals)]


def orders(residuals: Sequence[Residual], plane: Plane) -> list[int]:
    return sorted({r.order for r in residuals if r.plane == plane})


def by_plane(
    made: Mapping[Plane, Sequence[spec.Mark]],
    residuals: Sequence[Residual],
    y: spec.Axis,
    is_on_screen: bool,
) -> list[list[spec.Panel]]:
    """Return a panel of marks for each plane over its orders, with one vertical axis.

    They stand side by side on paper, one below the other on a screen, which may be narrow."""
    panels: list[spec.Panel] = []
    for plane, marks in made.items():
        there = orders(residuals, plane)
        if is_on_screen:
            there = sorted({r.order for r in residuals})
        is_alone = is_on_screen or not panels
        panels.append(
            spec.Panel(
                y=y if is_alone else replace(y, label=""),
                marks=[spec.Rule(at=0, width=0.8), *marks],
                x=spec.Axis(
                    label="order of the mode", range=(there[0] - 0.6, there[-1] + 0.6), grid=False,
                    ticks=there[:: math.ceil(len(there) / 12)],
                ),
                title=f"{plane} plane", title_colour=spec.PLANE_HUES[plane], title_side="left",
                shares_y=bool(panels),
            )
        )  # fmt: skip
    if not is_on_screen:
        return [panels]
    return [[replace(panel, x=None)] for panel in panels[:-1]] + [panels[-1:]]


_SPREAD = 0.62
"""Width over which the tests of one mode stand side by side, in orders."""
_ROOM, _EDGE = 0.06, 0.16
"""Above and below the map, as a share of its height: as it is, and for what lies beyond it."""
_CLEAR_SD = 2.0
"""Standard deviations beyond which a gap or a trend is drawn as clear."""
# Layout: places that have room for their words, and inches of the map and of what stands below.
_FEW_PLACES = 4
_LOOKS: tuple[tuple[str, spec.Dash], ...] = (
    ("purple", "solid"),
    ("green", "dash"),
    ("ink", "dashdot"),
    ("red", "dot"),
)
_MAP_INCHES = 2.7
_BELOW_INCHES = 2.2


def specify(sheet: DiagnosisSheet, is_on_screen: bool = False) -> spec.Specification | None:
    """Return the map; on paper with what stands below it."""
    residuals = measured(sheet)
    if not residuals:
        return None
    ordinary, gross = retained(sheet), excluded(sheet)
    halves = np.nan_to_num([NORMAL_90 * _sd_percent(r) for r in ordinary])
    inside = np.array([r.residual_percent for r in ordinary or gross])
    low, high = (
        spec.limits(inside - halves, inside + halves, [0.0]) if ordinary else spec.limits(inside)
    )
    made = {
        plane: [
            *_marks([r for r in ordinary if r.plane == plane], plane, sheet.diagnosis.tests),
            *_excluded([r for r in gross if r.plane == plane], sheet, low, high),
        ]
        for plane in planes(residuals)
    }
    margin = (_EDGE if gross else 0.0) * (high - low)
    label = "gap (%)" if is_on_screen else "measured / baseline - 1 (%)"
    axis = spec.Axis(label=label, range=(low - margin, high + margin))
    rows = by_plane(made, residuals, axis, is_on_screen)
    below = [draw(sheet) for draw, there in ((profiles, local), (goes_with, known)) if there(sheet)]
    if is_on_screen or not below:
        return spec.Specification(rows=rows, height_inches=_MAP_INCHES, legend_columns=3)
    inches = _BELOW_INCHES if local(sheet) else 0.9 + 0.3 * len(known(sheet))
    rows = [[replace(panel, height=_MAP_INCHES) for panel in rows[0]],
            [replace(panel, height=inches) for panel in below]]  # fmt: skip
    return spec.Specification(rows=rows, height_inches=_MAP_INCHES + inches, legend_columns=3)


def _marks(residuals: Sequence[Residual], plane: Plane, tests: Sequence[str]) -> list[spec.Mark]:
    """Return a mark for each test beside the others of its mode, filled where the gap is clear."""
    this = spec.PLANE_SYMBOLS[plane]
    kinds: tuple[tuple[list[Residual], spec.Symbol, bool, str], ...] = (
        ([r for r in residuals if abs(r.z) >= _CLEAR_SD], this, True, "beyond 2 sd"),
        ([r for r in residuals if abs(r.z) < _CLEAR_SD], this, False, "within 2 sd"),
        ([r for r in residuals if math.isnan(r.z)], "thin cross", True, "sd not known"),
    )
    found: list[spec.Mark] = []
    for chosen, symbol, filled, name in kinds:
        if chosen:
            y = np.array([r.residual_percent for r in chosen])
            half = np.array([NORMAL_90 * _sd_percent(r) for r in chosen])
            found.append(
                spec.Points(
                    x=[r.order + _offset(r.test, tests) for r in chosen], y=y, low=y - half,
                    high=y + half, caps=False, symbol=symbol, filled=filled, name=name,
                    size=4.6 if len(tests) <= 6 else 3.2, colour=spec.PLANE_HUES[plane],
                    texts=_wording(chosen),
                )
            )  # fmt: skip
    return found


def _excluded(
    residuals: Sequence[Residual], sheet: DiagnosisSheet, low: float, high: float
) -> list[spec.Mark]:
    """Return gross errors as crosses with their size, at the edge if they exceed the others."""
    last = max(r.order for r in measured(sheet))
    return [
        spec.Points(
            x=[r.order + _offset(r.test, sheet.diagnosis.tests)],
            y=[min(max(r.residual_percent, low), high)], symbol="cross", size=7, colour="red",
            name="set aside", labels=[f"{r.residual_percent:+z.2f} %"],
            label_side="left" if r.order > (1 + last) / 2 else "right", texts=_wording([r]),
        )
        for r in residuals
    ]  # fmt: skip


def _wording(residuals: Sequence[Residual]) -> list[str]:
    return [
        f"{r.plane} {r.order}, {r.test}: {r.residual_percent:+.2f} %, measured "
        f"{formatting.number(r.measured_hz, '.3f')} Hz"
        for r in residuals
    ]


def _offset(test: str, tests: Sequence[str]) -> float:
    if test not in tests or len(tests) < 2:
        return 0.0
    return _SPREAD * (tests.index(test) / (len(tests) - 1) - 0.5)


def _sd_percent(residual: Residual) -> float:
    """Return the standard deviation that the z-score was counted in."""
    return abs(residual.residual_percent / residual.z) if residual.z else math.nan


def local(sheet: DiagnosisSheet) -> list[GapPlace]:
    """Return places with a profile, those that explain most first."""
    found = [place for place in sheet.diagnosis.places if len(place.profile) > 1]
    return sorted(found, key=lambda place: -place.share)[: len(_LOOKS)]


def profiles(sheet: DiagnosisSheet) -> spec.Panel:
    """Return the density of the place along the hanger of each kind of local cause, largest 1."""
    looks = zip(local(sheet), _LOOKS, strict=False)
    return spec.Panel(
        y=spec.Axis(label="density, largest 1", range=(0, 1.08), ticks=(0, 0.5, 1)),
        marks=[mark for place, look in looks for mark in _profile(place, *look)],
        x=spec.Axis(label="position from the deck end (m)", range=(0, sheet.hanger.length_m)),
        width=1.6, has_separate_legend=True,
    )  # fmt: skip


def _profile(place: GapPlace, colour: str, dash: spec.Dash) -> list[spec.Mark]:
    """Return one kind of cause as a curve, or as bars where it can only be at a few places."""
    x_m, density = np.array(place.profile).T
    density = density / max(float(np.nanmax(density)), 1e-300)
    name, hover = f"{formatting.quantity(place.kind)} ({_share(place)})", "%{x:.2f} m"
    if len(x_m) <= _FEW_PLACES:
        return [spec.Bars(x=x_m, y=density, width=0.12, colour=colour, name=name, hover=hover)]
    found: list[spec.Mark] = [
        spec.Band(x=x_m, low=np.zeros(len(x_m)), high=density, colour=colour, opacity=0.1),
        spec.Line(x=x_m, y=density, colour=colour, dash=dash, width=1.4, name=name, hover=hover),
    ]
    if math.isfinite(place.x_m):
        at = spec.Points(
            x=[place.x_m], y=[0], symbol="triangle", size=6, colour=colour, hover=hover
        )
        found.append(at)
    return found


def _share(place: GapPlace) -> str:
    return f"{100 * place.share:.0f} %" if math.isfinite(place.share) else "share not known"


def known(sheet: DiagnosisSheet) -> list[Trend]:
    return [trend for trend in sheet.diagnosis.trends if math.isfinite(trend.slope_percent)]


def goes_with(sheet: DiagnosisSheet) -> spec.Panel:
    """Return the change of the mean residual over the range of each condition."""
    found = known(sheet)
    rows = np.arange(len(found))
    slope = np.array([trend.slope_percent for trend in found])
    sd = np.nan_to_num([trend.slope_sd_percent for trend in found])
    clear = np.abs(slope) >= _CLEAR_SD * np.array([trend.slope_sd_percent for trend in found])
    ends = np.column_stack([slope - NORMAL_90 * sd, slope + NORMAL_90 * sd, [np.nan] * len(found)])
    marks: list[spec.Mark] = [
        spec.Rule(at=0, axis="x", width=0.8),
        spec.Line(x=ends.ravel(), y=rows.repeat(3)),
    ]
    for chosen, filled in ((clear, True), (~clear, False)):
        look = {"symbol": "diamond", "filled": filled}
        marks.append(spec.Points(x=slope[chosen], y=rows[chosen], **look))  # type: ignore[arg-type]
    return spec.Panel(
        y=spec.Axis(
            range=(len(found) - 0.4, -0.6), ticks=rows.tolist(), grid=False,
            tick_labels=[trend.condition for trend in found],
        ),
        marks=marks, x=spec.Axis(label="change over its range (%)"), title="goes with",
        title_side="left",
    )  # fmt: skip


def caption(sheet: DiagnosisSheet, is_on_screen: bool = False) -> str:
    tests = len(sheet.diagnosis.tests)
    order = " The tests of one mode stand side by side in their order." if tests > 1 else ""
    profiles = (
        " Below: where along the hanger a local cause of each kind would have to sit, with the "
        "share of the misfit that it would explain there."
        if local(sheet) and not is_on_screen
        else ""
    )
    trends = (
        " Diamonds: how the mean gap changes over the range of a condition, with 90 % intervals."
        if known(sheet) and not is_on_screen
        else ""
    )
    crosses = (
        " Crosses: gross errors, set aside; at the edge where they lie beyond it."
        if excluded(sheet)
        else ""
    )
    return (
        f"Measured frequency over what the baseline {sheet.diagnosis.baseline} predicts at its "
        "best, less 1, by plane and order. Bars: 90 % interval of the measurement and of what the "
        f"baseline leaves open; filled: beyond 2 standard deviations.{crosses}{order}{profiles}"
        f"{trends}"
    )


def places_in_words(sheet: DiagnosisSheet) -> str:
    places = "; ".join(
        f"as {formatting.quantity(place.kind)} it would sit at "
        f"{formatting.number(place.x_m, '.2f')} m"
        for place in local(sheet)
    )
    return f"Along the hanger: {places}."


def _alt(sheet: DiagnosisSheet) -> str:
    residuals = measured(sheet)
    worst = sorted(residuals, key=lambda r: -abs(r.residual_percent))[:3]
    wording = ", ".join(
        f"{r.plane} {r.order} in {r.test} {r.residual_percent:+z.2f} %" for r in worst
    )
    there = f" {places_in_words(sheet)}" if local(sheet) else ""
    count = formatting.counted(len(residuals), "residual")
    gross = ", ".join(f"{r.plane} {r.order} in {r.test}" for r in excluded(sheet))
    gross_words = f" Set aside as a gross error: {gross}." if gross else ""
    return f"{count} of frequencies; the largest: {wording}.{gross_words}{there}"


FIGURE = spec.FigureSpec("gap_map", "Where the gap lies", specify, caption, _alt)
