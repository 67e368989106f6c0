"""A clamped Timoshenko beam under tension, by the bar of the worlds."""

from __future__ import annotations

import math

from shm.values import FloatArray, Hanger
from tests.worlds.bars import POISSON, Bar, cowper, natural_frequencies_hz


def clamped_frequencies_hz(
    hanger: Hanger, length_m: float, tension_n: float, modes: int
) -> FloatArray:
    """Frequencies (modes,) of a round bar with deflection and rotation held at both ends."""
    modulus, area = hanger.elastic_modulus_pa, hanger.area_m2
    bar = Bar(
        length_m,
        tension_n,
        modulus * hanger.second_moment_m4,
        hanger.mass_per_length_kg_m,
        cowper() * area * modulus / (2 * (1 + POISSON)),
        hanger.mass_per_length_kg_m / area * hanger.second_moment_m4,
        rotation_n_m_rad=(math.inf, math.inf),
    )
    return natural_frequencies_hz(bar, modes)
