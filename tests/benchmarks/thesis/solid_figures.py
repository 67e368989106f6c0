"""Figures 3.5 to 3.20 of the thesis: frequencies of the solids over meshes, springs and modes.

The thesis's curves are its tables A.1 to A.7; ours are the rows that `frequencies` compares with
these. Under each panel of frequencies stands the same over its reference, where differences show.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shm.models import THESIS, build
from shm.report.figures.specification import (
    Axis,
    Line,
    Mark,
    Panel,
    Points,
    Rule,
    Specification,
    Symbol,
    limits,
)
from shm.values import PLANES, FloatArray, Hanger, Plane
from tests.benchmarks.thesis import frequencies, thesis_data
from tests.benchmarks.thesis.frequencies import FrequencyRow
from tests.benchmarks.thesis.thesis_figures import Figure

Tell = Callable[[str, float], None]
HUES = ("blue", "orange", "green", "purple", "red", "quiet")  # in a fixed order
_SYMBOLS: tuple[Symbol, ...] = ("circle", "square", "diamond", "triangle", "triangle down", "cross")
_INCHES = 5.6  # layout


@dataclass(frozen=True, eq=False)
class _Series:
    """Frequencies (points,) at `x` (points,); `printed` are the thesis's, where it has them there.

    All are drawn over `reference` too, a number or an array (points,).
    """

    name: str
    x: FloatArray
    hz: FloatArray
    reference: Any
    printed: FloatArray | None = None
    is_line: bool = True


@dataclass(frozen=True, eq=False)
class _Part:
    """A column of two panels; `measured` (hz, its share of the reference) are rules across it."""

    title: str
    x: Axis
    series: Sequence[_Series]
    measured: Sequence[tuple[float, float]] = ()


def convergence(hanger: Hanger, tell: Tell, number: str) -> Figure:
    """Figures 3.5, 3.7 and 3.9: frequencies over the size of the mesh, the thesis's and ours."""
    name, table = {"3.5": ("s1", "A.1"), "3.7": ("s2", "A.2"), "3.9": ("solid0", "A.3")}[number]
    printed = tomllib.loads(thesis_data.TABLES_FILE.read_text(encoding="utf-8"))[name]
    rows = [r for r in frequencies.compared(hanger, tell, table) if np.isfinite(r.unknowns)]
    theirs = _over(np.array(printed["elements"], float), np.array(printed["meshes"]))
    ours = _over(np.array([row.unknowns for row in rows]), np.array([row.ours_hz for row in rows]))
    parts = [
        _Part(title, Axis(label=label, scale="log", range=_log_range(series[0].x)), series)
        for title, label, series in (
            (f"thesis, table {table}", "ten-node tetrahedra", theirs),
            ("ours", "unknowns of our mesh", ours),
        )
    ]
    statement = (
        "Below: percent from the finest mesh. Tetrahedra and hexahedra do not compare one by one."
    )
    return _figure(
        f"Figure {number}: class {name} over its mesh", parts, "off the finest mesh (%)", statement
    )


def _over(x: FloatArray, hz: FloatArray) -> list[_Series]:
    return [_Series(f"mode {mode}", x, own, own[-1]) for mode, own in enumerate(hz.T, start=1)]


def _log_range(x: FloatArray) -> tuple[float, float]:
    return float(x.min()) / 1.2, float(x.max()) * 1.2


def over_springs(hanger: Hanger, tell: Tell, number: str) -> Figure:
    """Figures 3.16 and 3.17: over the springs' stiffness, beside class 0 and measured."""
    table = {"3.16": "A.4", "3.17": "A.5"}[number]
    rows = frequencies.compared(hanger, tell, table)
    held_hz = _held_hz(hanger, "solid0")
    parts = [_over_springs(rows, plane, held_hz[place]) for place, plane in enumerate(PLANES)]
    statement = (
        "Lines: ours; circles: the thesis's (1e26 N/m at 1e13, a clamp too); dotted: measured "
        "(table 1.1). Below: over class 0."
    )
    title = f"Figure {number}: class {rows[0].model} over the stiffness of its springs"
    return _figure(title, parts, "off class 0 (%)", statement)


def _over_springs(rows: Sequence[FrequencyRow], plane: Plane, held_hz: FloatArray) -> _Part:
    own = sorted((row for row in rows if row.plane == plane), key=lambda row: row.spring_n_m)
    x = np.array([row.spring_n_m for row in own])
    ours, printed = (
        np.array([getattr(row, name) for row in own]) for name in ("ours_hz", "printed_hz")
    )
    series = [
        _Series(f"mode {place + 1}", x, ours[:, place], held_hz[place], printed[:, place])
        for place in range(len(held_hz))
    ]
    measured = [(hz, hz / held) for hz, held in zip(_measured(plane), held_hz, strict=True)]
    axis = Axis(label="spring stiffness (N/m a node)", scale="log", range=_log_range(x))
    return _Part(f"{plane} ({'xy'[PLANES.index(plane)]})", axis, series, measured)


def all_models(hanger: Hanger, tell: Tell, number: str) -> Figure:
    """Figure 3.18: every solid at 711 kN beside the measurement, springs very stiff."""
    names = ("s1", "s2", "solid0", "solid1", "solid2")
    held = {}
    for done, name in enumerate(names, start=1):
        held[name] = _held_hz(hanger, name)
        tell("figure 3.18", done / len(names))
    parts = [
        _by_mode(
            f"{plane} ({'xy'[place]})",
            {"measured": (_measured(plane), None)}
            | {name: (hz[place], None) for name, hz in held.items()},
            _measured(plane),
        )
        for place, plane in enumerate(PLANES)
    ]
    statement = "Below: over the measured frequency of table 1.1. Springs as stiff as a clamp."
    return _figure(
        f"Figure {number}: all solids at 711 kN", parts, "off the measured (%)", statement
    )


def solid_and_beam(hanger: Hanger, tell: Tell, number: str) -> Figure:
    """Figures 3.19 and 3.20: the plain rods beside the clamped beam of their length."""
    name, table = {"3.19": ("s1", "A.6"), "3.20": ("s2", "A.7")}[number]
    beam = frequencies.compared(hanger, tell, table)[0]
    tables = tomllib.loads(thesis_data.TABLES_FILE.read_text(encoding="utf-8"))
    solid_hz = _held_hz(hanger, name)[0]
    shown = {
        name: (solid_hz, np.array(tables[name]["converged"])),
        "beam1": (np.array(beam.ours_hz), np.array(beam.printed_hz)),
    }
    statement = (
        "Filled: ours; open circles: the thesis's, which carry another tension or section "
        "(docs/trials/validation.md). Below: over our solid."
    )
    title = f"Figure {number}: class {name} and the clamped beam of its length, 711 kN"
    return _figure(title, [_by_mode("", shown, solid_hz)], f"off {name} (%)", statement)


def _by_mode(
    title: str,
    shown: Mapping[str, tuple[FloatArray, FloatArray | None]],
    reference_hz: FloatArray,
) -> _Part:
    orders = np.arange(1.0, len(reference_hz) + 1)
    series = [
        _Series(name, orders, hz, reference_hz, printed, is_line=False)
        for name, (hz, printed) in shown.items()
    ]
    axis = Axis(label="mode", range=(0.5, orders[-1] + 0.5), ticks=orders.tolist())
    return _Part(title, axis, series)


def _held_hz(hanger: Hanger, name: str) -> FloatArray:
    """Of both planes (2, modes) at nominal tension, springs as stiff as a clamp."""
    model = build(name, hanger, THESIS)
    springs = model.parameter_names[1:]
    theta = np.array([[1.0, *[np.log10(frequencies.STIFFEST_SOLVED)] * len(springs)]])
    return np.asarray(model.reference_frequencies_hz(theta, frequencies.MODES)[0])


def _measured(plane: Plane) -> FloatArray:
    (test,) = thesis_data.measured_tests("table 1.1")
    own = sorted((mode for mode in test.modes if mode.plane == plane), key=lambda mode: mode.order)
    return np.array([mode.frequency_hz for mode in own])


def _figure(title: str, parts: Sequence[_Part], unit: str, statement: str) -> Figure:
    bounds = [limits(*(_values(each, share) for each in parts)) for share in (False, True)]
    labels = ("frequency (Hz)", unit)
    rows = [
        [
            Panel(
                x=part.x,
                y=Axis(label=labels[share] if place == 0 else "", range=bounds[share]),
                marks=list(_marks(part, bool(share))),
                title="" if share else part.title,
                title_side="left",
                shares_y=place > 0,
            )
            for place, part in enumerate(parts)
        ]
        for share in (0, 1)
    ]
    points = list(_points(parts))
    heads = ("panel", "series", "at", "drawn (Hz)", "thesis there (Hz)")
    cells = [
        (
            each["panel"], each["series"], f"{each['at']:g}", f"{each['hz']:.2f}",
            "" if each["thesis_hz"] is None else f"{each['thesis_hz']:.2f}",
        )
        for each in points
    ]  # fmt: skip
    made = Specification(rows=rows, height_inches=_INCHES, legend_columns=7)
    return Figure(title, heads, cells, statement, points, made)


def _values(part: _Part, share: bool) -> FloatArray:
    drawn = [
        np.ravel(_shown(hz, each, share))
        for each in part.series
        for hz in (each.hz, each.printed)
        if hz is not None
    ]
    rules = [100 * own - 100 if share else hz for hz, own in part.measured]
    return np.concatenate([*drawn, rules])


def _shown(hz: FloatArray, series: _Series, share: bool) -> FloatArray:
    return 100 * (hz / series.reference - 1) if share else hz


def _marks(part: _Part, share: bool) -> Iterator[Mark]:
    for place, (hz, own) in enumerate(part.measured):
        at = 100 * own - 100 if share else hz
        yield Rule(at=at, colour=HUES[place % len(HUES)], dash="dot", opacity=0.8)
    for place, each in enumerate(part.series):
        colour, y = HUES[place % len(HUES)], _shown(each.hz, each, share)
        if each.is_line:
            yield Line(x=each.x, y=y, colour=colour, name=each.name, dots=each.printed is None)
        else:
            yield Points(x=each.x, y=y, colour=colour, name=each.name, symbol=_SYMBOLS[place])
        if each.printed is not None:
            theirs = _shown(each.printed, each, share)
            yield Points(x=each.x, y=theirs, colour=colour, filled=False)


def _points(parts: Sequence[_Part]) -> Iterator[dict[str, Any]]:
    for part in parts:
        for each in part.series:
            theirs = [None] * len(each.x) if each.printed is None else each.printed.tolist()
            for x, hz, printed in zip(each.x.tolist(), each.hz.tolist(), theirs, strict=True):
                yield {
                    "panel": part.title, "series": each.name, "at": x, "hz": hz,
                    "thesis_hz": printed,
                }  # fmt: skip


FIGURES: dict[str, Callable[[Hanger, Tell, str], Figure]] = {
    **dict.fromkeys(("3.5", "3.7", "3.9"), convergence),
    **dict.fromkeys(("3.16", "3.17"), over_springs),
    "3.18": all_models,
    **dict.fromkeys(("3.19", "3.20"), solid_and_beam),
}
