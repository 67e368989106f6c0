"""What a known mass, clamped on for one test, does to the frequencies of any model class."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.hanger import PointMass, solve
from shm.models.turnbuckles import coupled_bar
from shm.values import AddedMass, FloatArray, Hanger

_NOWHERE = np.empty(0)


def laden_ratio(
    hanger: Hanger,
    length_m: FloatArray,
    tension_n: FloatArray,
    springs_n_m_rad: tuple[FloatArray, FloatArray],
    added_mass: AddedMass,
    modes: int,
) -> FloatArray:
    """Frequencies with the mass over those without (n, 2, modes), by the general model.

    Of bars of `length_m` (n,) from the deck end at tensions (n,), on rotational springs at the deck
    and the arch end, each (n, planes). A mass beyond the bar's end weighs nothing.
    """
    bare = coupled_bar(hanger, length_m, tension_n).on_springs(springs_n_m_rad)
    one = np.ones(len(tension_n))
    mass = PointMass(added_mass.x_m * one, added_mass.mass_kg * one)
    laden = replace(bare, masses=(mass,))
    found = [solve(each, modes, _NOWHERE, shapes=False).frequency_hz for each in (laden, bare)]
    return np.asarray(found[0] / found[1])
