"""A hanger as pieces of uniform section: the bar and its turnbuckles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shm.values import Hanger

_CLOSED = 1e-9


@dataclass(frozen=True)
class Piece:
    """A part of a hanger of one section."""

    length_m: float
    bending_stiffness_n_m2: float
    mass_per_length_kg_m: float


def pieces_of(hanger: Hanger, effective_length_m: float) -> Sequence[Piece]:
    """The pieces from the deck end up at an effective length.

    Turnbuckles keep their length; the bar between them takes up what the effective length differs
    from the hanger's own, in proportion.
    """
    clear = _gaps(hanger)
    turnbuckles = sorted(hanger.turnbuckles, key=lambda each: each.x_m)
    stretch = 1 + (effective_length_m - hanger.length_m) / sum(clear)
    found = []
    for gap, turnbuckle in zip(clear, [*turnbuckles, None], strict=True):
        if gap > _CLOSED * hanger.length_m:
            found.append(
                Piece(gap * stretch, hanger.bending_stiffness_n_m2, hanger.mass_per_length_kg_m)
            )
        if turnbuckle is not None:
            mass = turnbuckle.mass_kg / turnbuckle.length_m
            found.append(Piece(turnbuckle.length_m, turnbuckle.bending_stiffness_n_m2, mass))
    return found


def _gaps(hanger: Hanger) -> list[float]:
    """Lengths of bar below, between and above the turnbuckles."""
    turnbuckles = sorted(hanger.turnbuckles, key=lambda each: each.x_m)
    starts = [each.x_m - each.length_m / 2 for each in turnbuckles]
    ends = [each.x_m + each.length_m / 2 for each in turnbuckles]
    pairs = zip([0.0, *ends], [*starts, hanger.length_m], strict=True)
    return [start - end for end, start in pairs]
