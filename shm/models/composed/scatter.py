"""How a bar as made differs from its description."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr, ndtri

from shm.models.effects.base import Parameter
from shm.models.hanger import PhysicalHanger
from shm.values import FloatArray, Hanger

DEVIATIONS = ("section", "density", "length", "modulus")


@dataclass(frozen=True)
class Deviation(Parameter):
    """A parameter with a normal prior: `lower` and `upper` are one standard deviation off."""

    def value(self, share: FloatArray) -> FloatArray:
        return np.asarray(self._mean + self._sd * ndtri(share))

    def share(self, value: FloatArray) -> FloatArray:
        away = value - self._mean
        return np.asarray(ndtr(away / self._sd) if self._sd else np.full_like(value, 0.5))

    @property
    def _mean(self) -> float:
        return (self.lower + self.upper) / 2

    @property
    def _sd(self) -> float:
        return (self.upper - self.lower) / 2


def deviations_of(hanger: Hanger) -> tuple[Deviation, ...]:
    """Of section, density, length and modulus, as fractions."""
    reason = "scatter of manufacture, as the hanger's description states it"
    sds = [(name, getattr(hanger.scatter, name)) for name in DEVIATIONS]
    return tuple(Deviation(name, "fraction", -sd, sd, 0.0, reason) for name, sd in sds)


def scattered(physical: PhysicalHanger, deviations: FloatArray, hanger: Hanger) -> PhysicalHanger:
    """Hangers (n) whose section (area), density, length and modulus deviate by fractions (n, 4).

    Each is multiplied by the exponential of its fraction, so that none can vanish where an owner
    hardly knows it.
    Bending stiffness goes with the square of the area. The bar is longer at its arch end. What is
    told by factors of the bar's own, as turnbuckles are, keeps its own stiffness and mass.
    """
    section, density, length, modulus = np.exp(deviations).T
    stiffness, mass = section**2 * modulus, section * density
    return replace(
        physical,
        arch_end_m=physical.deck_end_m + physical.length_m * length,
        bending_stiffness_n_m2=physical.bending_stiffness_n_m2 * stiffness[:, None],
        mass_per_length_kg_m=physical.mass_per_length_kg_m * mass,
        zones=tuple(
            replace(
                zone,
                stiffness_factor=(zone.stiffness_factor.T / stiffness).T,
                mass_factor=zone.mass_factor / mass,
            )
            for zone in physical.zones
        ),
    )
