"""Formulas of practice beside our answer, on exact frequencies of beams of known tension."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from shm.inference import UpdateOptions, update
from shm.models import build
from shm.models.classes import equal_springs
from shm.models.classes.tensioned_beam import frequencies_hz
from shm.models.practice_formulas import FORMULAS
from shm.values import PLANES, FloatArray, Hanger, ModalTest, Mode, Selection

_ORDERS = 6  # as many as the thesis measured
# k L/EI of the deck's and the arch's end; 10 is half way between pinned and clamped, 100 stiff.
_ENDS = {
    "clamped": (math.inf, math.inf),
    "k L/EI = 10": (10.0, 10.0),
    "k L/EI = 10 and 100": (10.0, 100.0),
}
# Diameter, length and tension of solid steel rods; their xi are 49, 12 and 3.
_RODS = {"slender": (0.040, 20.0, 150e3), "medium": (0.080, 12.0, 400e3), "thick": (0.1, 6.0, 3e5)}

_NAMES = (*(each.name for each in FORMULAS), equal_springs.NAME)

HEADS = ("hanger", "xi", "ends", *_NAMES, "ours, 90 % interval")
FORMULA_HEADS = ("formula", "source", "ends", "valid from xi", "error there", "leaves out")


@dataclass(frozen=True)
class FormulaRow:
    """One hanger on one kind of ends: errors of the tension, as fractions."""

    hanger: str
    xi: float
    ends: str
    tension_n: float
    formulas: dict[str, float]
    ours: float
    ours_q05: float
    ours_q95: float


def compared(
    thesis_hanger: Hanger, seed: int, progress: Callable[[str, float], None]
) -> list[FormulaRow]:
    """Four hangers, clamped, on equal springs and on unequal ones."""
    options = UpdateOptions(samples=1000, seed=seed)
    return [
        _row(name, hanger, ends, options, progress)
        for name, hanger in _hangers(thesis_hanger)
        for ends in _ENDS
    ]


def _hangers(thesis_hanger: Hanger) -> Iterator[tuple[str, Hanger]]:
    """The thesis's as a plain rod over its full length, and rods of its steel."""
    plain = replace(thesis_hanger, plate=None)
    yield "hanger 3", plain
    for name, (diameter, length, tension) in _RODS.items():
        share = (diameter / plain.diameter_m) ** 2
        yield (
            name,
            replace(
                plain,
                diameter_m=diameter,
                length_m=length,
                nominal_tension_n=tension,
                area_m2=plain.area_m2 * share,
                second_moment_m4=plain.second_moment_m4 * share**2,
                mass_per_length_kg_m=plain.mass_per_length_kg_m * share,
            ),
        )


def _row(
    name: str,
    hanger: Hanger,
    ends: str,
    options: UpdateOptions,
    progress: Callable[[str, float], None],
) -> FormulaRow:
    length, mass = hanger.length_m, hanger.mass_per_length_kg_m
    stiffness, tension = hanger.bending_stiffness_n_m2, hanger.nominal_tension_n
    hz = _exact_hz(hanger, *_ENDS[ends])
    found_n = {
        each.name: each.tension_n(float(hz[each.order - 1]), length, mass, stiffness)
        for each in FORMULAS
    }
    by_order = dict(enumerate(hz.tolist(), start=1))
    found_n[equal_springs.NAME] = equal_springs.tension_n(by_order, length, mass, stiffness)
    test = ModalTest(
        "exact", tuple(Mode(p, n + 1, float(f)) for p in PLANES for n, f in enumerate(hz))
    )

    def tell(_: str, fraction: float) -> None:
        progress(f"{name}, {ends},", fraction)

    found = update([test], build("beam2", hanger), options, tell)
    # As reports state it: where ends of another kind fit as well, the interval reaches to theirs.
    ours = Selection((found,), (1.0,)).averaged.tension_n
    return FormulaRow(
        hanger=name,
        xi=length * math.sqrt(tension / stiffness),
        ends=ends,
        tension_n=tension,
        formulas={name: each / tension - 1 for name, each in found_n.items()},
        ours=ours.mean / tension - 1,
        ours_q05=ours.q05 / tension - 1,
        ours_q95=ours.q95 / tension - 1,
    )


def _exact_hz(hanger: Hanger, deck: float, arch: float) -> FloatArray:
    unit = hanger.bending_stiffness_n_m2 / hanger.length_m
    springs = np.full(1, deck * unit), np.full(1, arch * unit)
    described = (hanger.bending_stiffness_n_m2, hanger.mass_per_length_kg_m)
    stiffness, mass = map(np.asarray, described)
    length, tension = np.full(1, hanger.length_m), np.full(1, hanger.nominal_tension_n)
    return np.ravel(frequencies_hz(length, tension, stiffness, mass, *springs, _ORDERS))


def cells(row: FormulaRow) -> tuple[str, ...]:
    """The row as texts under `HEADS`."""
    return (
        row.hanger,
        f"{row.xi:.1f}",
        row.ends,
        *(f"{error:+.1%}" for error in row.formulas.values()),
        f"{row.ours:+.1%} ({row.ours_q05:+.1%} to {row.ours_q95:+.1%})",
    )


def formula_cells() -> list[tuple[str, ...]]:
    """What each formula is, under `FORMULA_HEADS`."""
    fitted = (equal_springs.NAME, equal_springs.SOURCE, equal_springs.ENDS)
    rows = [
        (e.name, e.source, e.ends, e.valid_from_xi, e.worst_error, e.leaves_out) for e in FORMULAS
    ]
    span = (equal_springs.VALID_FROM_XI, equal_springs.WORST_ERROR)
    rows.append((*fitted, *span, equal_springs.LEAVES_OUT))
    return [
        (*what, f"{lowest:g}", f"{worst:.2%}", leaves_out)
        for *what, lowest, worst, leaves_out in rows
    ]
