"""Hangers drawn as they are built: round rods of arch bridges."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shm.simulate.state import HangerState
from shm.values import Hanger

_YIELD_PA = 355e6
_MODULUS_PA, _DENSITY_KG_M3 = 210e9, 7850.0
_LENGTH_M = (6.0, 15.0)
_DIAMETERS_MM = np.arange(80, 141, 5)
_TENSION_N, _OF_YIELD = (150e3, 900e3), (0.15, 0.5)
_NOMINAL_OFF = 0.1
_DAMPING = (0.0005, 0.002)


def drawn_hanger(rng: np.random.Generator, *, number: int = 1) -> tuple[Hanger, HangerState]:
    """A steel rod of 6 to 15 m and 80 to 140 mm, clamped, with its true tension.

    That is 150 to 900 kN and 0.15 to 0.5 of the yield force of S355 steel, log-uniform between the
    tighter of both. The nominal tension is off by 10 % and rounded to 1 kN, lengths to 0.1 m.
    Damping is 0.05 to 0.2 %, log-uniform.
    """
    diameter_m = float(rng.choice(_DIAMETERS_MM)) / 1000
    area_m2 = math.pi * diameter_m**2 / 4
    low, high = np.log(_tensions_n(area_m2))
    tension_n = float(np.exp(rng.uniform(low, high)))
    nominal_n = 1e3 * round(tension_n * math.exp(_NOMINAL_OFF * rng.standard_normal()) / 1e3)
    hanger = Hanger(
        id=number,
        length_m=round(float(rng.uniform(*_LENGTH_M)), 1),
        elastic_modulus_pa=_MODULUS_PA,
        area_m2=area_m2,
        second_moment_m4=math.pi * diameter_m**4 / 64,
        mass_per_length_kg_m=_DENSITY_KG_M3 * area_m2,
        nominal_tension_n=nominal_n,
        diameter_m=diameter_m,
    )
    damping = float(np.exp(rng.uniform(*np.log(_DAMPING))))
    return hanger, replace(HangerState(tension_n), damping_ratio=damping)


def _tensions_n(area_m2: float) -> tuple[float, float]:
    """From the lowest to the highest for a section."""
    yields_n = _YIELD_PA * area_m2
    return max(_TENSION_N[0], _OF_YIELD[0] * yields_n), min(_TENSION_N[1], _OF_YIELD[1] * yields_n)
