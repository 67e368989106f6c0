"""Formulas of practice beside our answer, on exact frequencies of beams of known tension."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from shm.inference import UpdateOptions, update
from shm.models import build
from shm.models.practice_formulas import FORMULAS
from shm.models.tensioned_beam import frequencies_hz
from shm.values import PLANES, FloatArray, Hanger, ModalTest, Mode, Selection

_ORDERS = 6  # as many as the thesis measured
_SPRING = 10.0  # k L/EI of the springs: half way between pinned and clamped
# Diameter, length and tension of solid steel rods; their xi are 49, 12 and 3.
_RODS = {"slender": (0.040, 20.0, 150e3), "medium": (0.080, 12.0, 400e3), "thick": (0.1, 6.0, 3e5)}

HEADS = ("hanger", "xi", "ends", *(each.name for each in FORMULAS), "ours, 90 % interval")
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
    """Four hangers, clamped and on springs."""
    options = UpdateOptions(samples=1000, seed=seed)
    return [
        _row(name, hanger, spring, options, progress)
        for name, hanger in _hangers(thesis_hanger)
        for spring in (math.inf, _SPRING)
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
    spring: float,
    options: UpdateOptions,
    progress: Callable[[str, float], None],
) -> FormulaRow:
    length, mass = hanger.length_m, hanger.mass_per_length_kg_m
    stiffness, tension = hanger.bending_stiffness_n_m2, hanger.nominal_tension_n
    hz = _exact_hz(hanger, spring)
    ends = "clamped" if math.isinf(spring) else f"k L/EI = {spring:g}"
    test = ModalTest(
        "exact", tuple(Mode(p, n + 1, float(f)) for p in PLANES for n, f in enumerate(hz))
    )

    def tell(_: str, fraction: float) -> None:
        progress(f"{name}, {ends},", fraction)

    found = update([test], build("beam2", hanger), options, tell)
    # As reports state it: where ends of another kind fit as well, the interval reaches to theirs.
    ours = Selection((found,), (1.0,)).averaged().tension_n
    return FormulaRow(
        hanger=name,
        xi=length * math.sqrt(tension / stiffness),
        ends=ends,
        tension_n=tension,
        formulas={
            each.name: each.tension_n(float(hz[each.order - 1]), length, mass, stiffness) / tension
            - 1
            for each in FORMULAS
        },
        ours=ours.mean / tension - 1,
        ours_q05=ours.q05 / tension - 1,
        ours_q95=ours.q95 / tension - 1,
    )


def _exact_hz(hanger: Hanger, spring: float) -> FloatArray:
    end = np.full(1, spring * hanger.bending_stiffness_n_m2 / hanger.length_m)
    described = (hanger.bending_stiffness_n_m2, hanger.mass_per_length_kg_m)
    stiffness, mass = map(np.asarray, described)
    length, tension = np.full(1, hanger.length_m), np.full(1, hanger.nominal_tension_n)
    return np.ravel(frequencies_hz(length, tension, stiffness, mass, end, end, _ORDERS))


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
    return [
        (
            each.name,
            each.source,
            each.ends,
            f"{each.valid_from_xi:g}",
            f"{each.worst_error:.1%}",
            each.leaves_out,
        )
        for each in FORMULAS
    ]
