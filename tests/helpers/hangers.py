"""Hangers that several rooms are tested on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.values import EndPlate, Hanger

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
    diameter_m=_DIAMETER_M,
    plate=EndPlate(
        length_m=1.0915,
        thickness_m=0.040,
        end_width_m=1.0644,
        neck_width_m=0.241,
        slot_m=0.562,
        edge_node_spacing_m=0.0425,
    ),
)
"""The thesis's: a round steel rod of 130 mm, 12 m over all, with a plate at each end."""


ROD = replace(HANGER_3, plate=None)
"""The rod of hanger 3 without its plates."""
