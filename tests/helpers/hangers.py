"""Hangers that several rooms are tested on."""

from __future__ import annotations

import numpy as np

from shm.values import Hanger

_DIAMETER_M = 0.130
_AREA_M2 = np.pi * _DIAMETER_M**2 / 4

HANGER_3 = Hanger(
    id=3,
    length_m=12.0,
    elastic_modulus_pa=200e9,
    area_m2=_AREA_M2,
    second_moment_m4=np.pi * _DIAMETER_M**4 / 64,
    mass_per_length_kg_m=7800 * _AREA_M2,
    nominal_tension_n=711e3,
)
"""The thesis's: a round steel rod of 130 mm, 12 m over all."""
