from __future__ import annotations

import math

import pytest

from shm.values import Hanger


@pytest.fixture
def hanger() -> Hanger:
    """A round bar like hanger 3 of the thesis."""
    diameter = 0.130
    area = math.pi * diameter**2 / 4
    return Hanger(
        id=3,
        length_m=12.0,
        elastic_modulus_pa=200e9,
        area_m2=area,
        second_moment_m4=math.pi * diameter**4 / 64,
        mass_per_length_kg_m=7800 * area,
        nominal_tension_n=711e3,
    )
