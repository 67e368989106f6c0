"""The thesis's tables of computed frequencies beside ours, at the nominal tension."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from shm.models import THESIS, build
from shm.models.classes.solid.classes import SolidModel
from shm.values import PLANES, FloatArray, Hanger, Plane
from tests.benchmarks.thesis import thesis_data

# Of the thesis's tables A.1 to A.7: modes, springs of a class.
MODES = 6
_SPRINGS = {"solid1": 8, "solid2": 4}

STIFFEST_SOLVED = 1e13  # numerical: a clamp; table A.4 goes on to 1e26 with the same frequencies

_EVEN_FROM_N_M = 1e7  # found: from here the printed x and y agree to 0.1 %

_RODS = (6, 12, 24, 48)  # cells along the rod: from one a mode to eight

# Found: what makes tables A.2, A.6 and A.7 come out (docs/trials/validation.md).
_CORNERS_OF_TABLE_A_2 = 10
_TENSIONS_OF_BEAM_TABLES_N = {"length_12": 745e3, "length_9_817": 724e3}
_MISPRINT = {("length_9_817", 2)}


@dataclass(frozen=True)
class FrequencyRow:
    """One column of a table: transverse frequencies of modes 1 to 6, ours and the printed ones.

    `limit_percent` is the mark that `difference_percent` has to keep; NaN where the difference is
    only stated. `seconds` are those of a mesh whose size is told, NaN elsewhere; `thesis_time` is
    that of the thesis's meshes.
    """

    table: str
    model: str
    condition: str
    ours_hz: tuple[float, ...]
    printed_hz: tuple[float, ...]
    difference_percent: float
    limit_percent: float
    plane: Plane = "transverse"
    seconds: float = np.nan
    thesis_time: str = ""

    @property
    def missed(self) -> bool:
        return self.difference_percent > self.limit_percent


def compared(
    hanger: Hanger, progress: Callable[[str, float], None], table: str = ""
) -> list[FrequencyRow]:
    """All columns of one table, or of all."""
    tables = tomllib.loads(thesis_data.TABLES_FILE.read_text(encoding="utf-8"))
    makers = [make for make, made in _PARTS.items() if not table or table in made]
    rows: list[FrequencyRow] = []
    for done, make in enumerate(makers, start=1):
        rows += make(hanger, tables)
        progress("frequency tables", done / len(makers))
    return [row for row in rows if table in ("", row.table)]


def _fixed_ends(hanger: Hanger, tables: dict[str, Any]) -> Iterator[FrequencyRow]:
    nominal = np.array([[1.0]])
    for name, table, limit in (("s1", "A.1", 0.3), ("s2", "A.2", np.nan), ("solid0", "A.3", 0.3)):
        found = build(name, hanger, THESIS).reference_frequencies_hz(nominal, MODES)[0, 0]
        yield _row(table, name, "711 kN", found, tables[name]["converged"], limit)


def _held_faces(hanger: Hanger, tables: dict[str, Any]) -> Iterator[FrequencyRow]:
    """Tables 3.1 to 3.3. Our elements have displacements only, as the thesis's C3D10 have, and our
    face is held or sprung as a whole: of part of its nodes held the difference is only stated."""
    model = build("solid0", hanger, THESIS)
    ours = model.reference_frequencies_hz(np.array([[1.0]]), MODES)[0, 0]
    held = tables["rotational"]["ends_held"]
    yield _row("3.1", "solid0", "with and without rotations held", ours, held, 0.3)
    for key, printed in tables["fixed_nodes"].items():
        whole = key == "fixed_surface"
        condition = (
            "whole face" if whole else f"{key.removeprefix('nodes_')} nodes; ours whole face"
        )
        yield _row("3.2", "solid0", condition, ours, printed, 0.3 if whole else np.nan)
    stiff = np.array([[1.0, *[np.log10(STIFFEST_SOLVED)] * _SPRINGS["solid1"]]])
    sprung = build("solid1", hanger, THESIS).reference_frequencies_hz(stiff, MODES)[0]
    for place, plane in enumerate(PLANES):
        printed = tables["rotational"][f"stiff_springs{'_y' * place}"]
        condition = f"stiff springs, with and without rotations{', y' * place}"
        row = _row("3.3", "solid1", condition, sprung[place], printed, 1.5)
        yield replace(row, plane=plane)


def _table_a_2_explained(hanger: Hanger, tables: dict[str, Any]) -> Iterator[FrequencyRow]:
    """Table A.2 is that of a rod meshed as a regular decagon under the same stress."""
    plate_m = hanger.plate.length_m if hanger.plate else 0.0
    corners, radius = _CORNERS_OF_TABLE_A_2, hanger.diameter_m / 2
    angle = 2 * np.pi / corners
    area = corners / 2 * radius**2 * np.sin(angle)
    faceted = replace(
        hanger,
        area_m2=area,
        second_moment_m4=corners * radius**4 / 24 * np.sin(angle) * (2 + np.cos(angle)),
        mass_per_length_kg_m=hanger.mass_per_length_kg_m * area / hanger.area_m2,
        nominal_tension_n=hanger.nominal_tension_n * area / hanger.area_m2,
    )
    theta = np.array([[1.0, 1 - 2 * plate_m / hanger.length_m]])
    euler = build("beam1", faceted, THESIS).frequencies_hz(theta, MODES)[0, 0]
    shear = _solid_over_beam(hanger, theta)
    condition = f"section of {corners} corners, same stress"
    yield _row("A.2", "s2", condition, euler * shear, tables["s2"]["converged"], 0.3)


def _solid_over_beam(hanger: Hanger, theta: FloatArray) -> FloatArray:
    """What shear and rotary inertia take off the clamped beam's frequencies."""
    solid = build("s2", hanger, THESIS).reference_frequencies_hz(theta[:, :1], MODES)[0, 0]
    return np.asarray(solid / build("beam1", hanger, THESIS).frequencies_hz(theta, MODES)[0, 0])


def _springs(hanger: Hanger, tables: dict[str, Any]) -> Iterator[FrequencyRow]:
    for name, table in (("solid1", "A.4"), ("solid2", "A.5")):
        stiffness = {key: min(float(key[1:]), STIFFEST_SOLVED) for key in tables[name]}
        theta = np.array([[1.0, *[np.log10(k)] * _SPRINGS[name]] for k in stiffness.values()])
        found = build(name, hanger, THESIS).reference_frequencies_hz(theta, MODES)
        for place, plane in enumerate(PLANES):
            for (key, value), ours in zip(stiffness.items(), found[:, place], strict=True):
                # Softer, the printed y leaves the printed x by up to 1.6 %, for equal springs.
                kept = not place or value >= _EVEN_FROM_N_M
                condition = f"k = {float(key[1:]):.0e} N/m{', y' * place}"
                printed = tables[f"{name}{'_y' * place}"][key]
                row = _row(table, name, condition, ours, printed, 1.5 if kept else np.nan)
                yield replace(row, plane=plane)


def _meshes(hanger: Hanger, tables: dict[str, Any]) -> Iterator[FrequencyRow]:
    """Convergence of our own meshes: their cells are hexahedra, so unknowns stand for elements."""
    for name, table in (("s1", "A.1"), ("s2", "A.2"), ("solid0", "A.3")):
        model = build(name, hanger, THESIS)
        assert isinstance(model, SolidModel)
        times = tables[name]["seconds"]
        thesis_time = f"{times[0]:g} to {times[-1]:g} s"
        began = perf_counter()
        for unknowns, ours in model.convergence_hz(_RODS, MODES):
            seconds = perf_counter() - began
            condition = f"our mesh of {unknowns} unknowns"
            row = _row(table, name, condition, ours, tables[name]["converged"], np.nan)
            yield replace(row, seconds=seconds, thesis_time=thesis_time)
            began = perf_counter()


def _clamped_beams(hanger: Hanger, tables: dict[str, Any]) -> Iterator[FrequencyRow]:
    """Tables A.6 and A.7 at the stated tension, and at the one that they carry."""
    model = build("beam1", hanger, THESIS)
    for key, length_m, table in (("length_12", 12.0, "A.6"), ("length_9_817", 9.817, "A.7")):
        printed = list(tables["beam1_in_thesis"][key])
        carried_n = _TENSIONS_OF_BEAM_TABLES_N[key]
        for tension_n, limit in ((hanger.nominal_tension_n, np.nan), (carried_n, 0.1)):
            theta = np.array([[tension_n / hanger.nominal_tension_n, length_m / hanger.length_m]])
            ours = model.frequencies_hz(theta, MODES)[0, 0]
            kept = [m for m in range(MODES) if (key, m) not in _MISPRINT or np.isnan(limit)]
            left_out = "" if len(kept) == MODES else ", mode 3 left out as a misprint"
            condition = f"{tension_n / 1e3:.0f} kN{left_out}"
            yield _row(table, "beam1", condition, ours, printed, limit, kept)


_PARTS = {
    _held_faces: ("3.1", "3.2", "3.3"),
    _fixed_ends: ("A.1", "A.2", "A.3"),
    _table_a_2_explained: ("A.2",),
    _meshes: ("A.1", "A.2", "A.3"),
    _springs: ("A.4", "A.5"),
    _clamped_beams: ("A.6", "A.7"),
}
TABLES = tuple(sorted({table for made in _PARTS.values() for table in made}))


def _row(
    table: str,
    model: str,
    condition: str,
    ours: FloatArray,
    printed: list[float],
    limit: float,
    kept: list[int] | None = None,
) -> FrequencyRow:
    difference = 100 * np.abs(ours / np.array(printed) - 1)[kept or slice(None)].max()
    ours_hz = tuple(float(value) for value in ours)
    return FrequencyRow(table, model, condition, ours_hz, tuple(printed), float(difference), limit)


HEADS = (
    "table", "class", "condition", "ours, modes 1 to 6 (Hz)", "printed (Hz)",
    "largest difference", "mark",
)  # fmt: skip


def cells(row: FrequencyRow) -> tuple[str, ...]:
    """The row as texts under `HEADS`."""
    mark = "stated" if np.isnan(row.limit_percent) else f"{row.limit_percent:g} %"
    return (
        row.table,
        row.model,
        row.condition,
        ", ".join(f"{value:.2f}" for value in row.ours_hz),
        ", ".join(f"{value:.2f}" for value in row.printed_hz),
        f"{row.difference_percent:.2f} %",
        mark,
    )


TIMED_HEADS = (*HEADS, "time", "thesis, time")


def timed_cells(row: FrequencyRow) -> tuple[str, ...]:
    """The row as texts under `TIMED_HEADS`: ours was measured as it ran, on this machine."""
    return (*cells(row), f"{row.seconds:.1f} s" if row.thesis_time else "", row.thesis_time)


def misses(rows: list[FrequencyRow]) -> list[str]:
    """The marks that were missed."""
    return [
        f"table {row.table}, {row.condition}: {row.difference_percent:.2f} % off, "
        f"the mark is {row.limit_percent:g} %"
        for row in rows
        if row.missed
    ]
