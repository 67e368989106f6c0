"""The stepped beam that a bar with turnbuckles is.

A turnbuckle is what it is, whatever the effective length: theta_L stretches or shortens the bar
between the turnbuckles, each piece in proportion, and the turnbuckles keep their length, mass and
bending stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.errors import UsageError
from shm.models.stepped.beam import SteppedBeam
from shm.values import BoolArray, FloatArray, Hanger

_NOTHING = 1e-9
_ALIKE = 1e-9


def stepped_beam(
    hanger: Hanger,
    length_m: FloatArray,
    tension_n: FloatArray,
    k_deck_n_m_rad: FloatArray,
    k_arch_n_m_rad: FloatArray,
) -> SteppedBeam:
    """Beams of effective lengths `length_m` (beams,).

    Raises UsageError where one is not longer than the turnbuckles together.
    """
    pieces = _pieces(hanger)
    fixed = pieces.length_m[pieces.turnbuckle].sum()
    if np.any(length_m <= fixed):
        raise UsageError(
            f"the turnbuckles of hanger {hanger.id} are {fixed:g} m long together, no shorter than "
            f"the effective length.",
            remedy="Give a larger theta_L.",
        )
    stretch = (length_m - fixed) / (hanger.length_m - fixed)
    shape = (len(pieces.length_m), len(length_m))
    column = pieces.length_m[:, None]
    return SteppedBeam(
        np.where(pieces.turnbuckle[:, None], column, column * stretch),
        np.broadcast_to(pieces.bending_stiffness_n_m2[:, None], shape),
        np.broadcast_to(pieces.mass_per_length_kg_m[:, None], shape),
        tension_n,
        k_deck_n_m_rad,
        k_arch_n_m_rad,
    )


def alike_from_both_ends(hanger: Hanger) -> bool:
    """Whether the turnbuckles look the same from the arch end as from the deck end."""
    pieces = _pieces(hanger)
    fields = (pieces.length_m, pieces.bending_stiffness_n_m2, pieces.mass_per_length_kg_m)
    return all(np.allclose(field, field[::-1], rtol=_ALIKE) for field in fields)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Bar and turnbuckles in turn from the deck end up, each field (pieces,)."""

    length_m: FloatArray
    bending_stiffness_n_m2: FloatArray
    mass_per_length_kg_m: FloatArray
    turnbuckle: BoolArray


def _pieces(hanger: Hanger) -> _Pieces:
    bar = (hanger.bending_stiffness_n_m2, hanger.mass_per_length_kg_m, False)
    rows: list[tuple[float, float, float, bool]] = []
    reached = 0.0
    for each in sorted(hanger.turnbuckles, key=lambda turnbuckle: turnbuckle.x_m):
        rows.append((each.x_m - each.length_m / 2 - reached, *bar))
        mass = each.mass_kg / each.length_m
        rows.append((each.length_m, each.bending_stiffness_n_m2, mass, True))
        reached = each.x_m + each.length_m / 2
    rows.append((hanger.length_m - reached, *bar))
    rows = [row for row in rows if row[0] > _NOTHING * hanger.length_m]
    length, stiffness, mass_per_length, turnbuckle = (
        np.array(field) for field in zip(*rows, strict=True)
    )
    return _Pieces(length, stiffness, mass_per_length, turnbuckle)
