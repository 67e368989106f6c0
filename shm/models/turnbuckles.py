"""The bar that a hanger with turnbuckles is, in the terms of the general model.

A turnbuckle is what it is, whatever the effective length: theta_L stretches or shortens the bar
between the turnbuckles, each piece in proportion, and the turnbuckles keep their length, mass and
bending stiffness.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.errors import UsageError
from shm.models.hanger import PhysicalHanger
from shm.values import FloatArray, Hanger

_ALIKE = 1e-9  # rounding


def coupled_bar(hanger: Hanger, length_m: FloatArray, tension_n: FloatArray) -> PhysicalHanger:
    """Clamped bars of effective lengths `length_m` (n,) at tensions (n,).

    Raises UsageError where one is not longer than the turnbuckles together.
    """
    fixed = sum(each.length_m for each in hanger.turnbuckles)
    if np.any(length_m <= fixed):
        raise UsageError(
            f"the turnbuckles of hanger {hanger.id} are {fixed:g} m long together, no shorter than "
            f"the effective length.",
            remedy="Give a larger theta_L.",
        )
    described = PhysicalHanger.clamped(hanger, tension_n)
    stretch = (length_m - fixed) / (hanger.length_m - fixed)
    zones = []
    for own, zone in zip(hanger.turnbuckles, described.zones, strict=True):
        below = sum(each.length_m for each in hanger.turnbuckles if each.x_m < own.x_m)
        start = below + (own.x_m - own.length_m / 2 - below) * stretch
        zones.append(replace(zone, start_m=start, end_m=start + own.length_m))
    return replace(described, arch_end_m=length_m, zones=tuple(zones))


def alike_from_both_ends(hanger: Hanger) -> bool:
    """Whether the turnbuckles look the same from the arch end as from the deck end."""
    if not hanger.turnbuckles:
        return True
    rows = np.array(
        [(t.x_m, t.length_m, t.mass_kg, t.bending_stiffness_n_m2) for t in hanger.turnbuckles]
    ).reshape(-1, 4)
    turned = rows * [-1, 1, 1, 1] + [hanger.length_m, 0, 0, 0]
    order, back = rows[:, 0].argsort(), turned[:, 0].argsort()
    return bool(np.allclose(rows[order], turned[back], rtol=_ALIKE))
