"""A mass clamped on the hanger that nobody wrote down."""

from __future__ import annotations

from dataclasses import replace

from shm.models.conditions import Conditions
from shm.models.effects import places, scales
from shm.models.effects.base import Effect, Parameter, Variant
from shm.models.hanger.physical import PhysicalHanger, PointMass
from shm.values import FloatArray, Hanger

GYRATION_M = 0.1


class UnknownPointMass(Effect):
    """Something heavy sits at one place: a clamp, a coupler, a lamp, a bracket left behind.

    It lowers the modes that move there and leaves those with a node there alone. Frequencies of a
    uniform hanger cannot tell its place from the mirrored one; shapes can.
    """

    name = "point_mass"
    title = "A mass at one place"
    source = "Chen (1963), On the vibration of beams or rods carrying a concentrated mass."
    seen_by = ("frequencies of many orders", "shapes")
    imitated_by = (
        "translational_end_flexibility",
        "intermediate_support",
        "section_loss",
        "sensor_mass",
    )
    other_laws = ("it turns with the bar, with a radius of gyration of 0.1 m",)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        own_kg = scales.mass_kg(hanger)
        size = Parameter(
            "mass_kg",
            "kg",
            5e-5 * own_kg,
            0.1 * own_kg,
            0.0,
            "0.005 to 10 % of the hanger's mass: from a cable tie to a coupler or a heavy clamp.",
            spread="logarithmic",
        )
        return size, places.place_along(hanger)

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        mass_kg, x_m = values.T
        if not variant.law:
            return replace(physical, masses=(*physical.masses, PointMass(x_m, mass_kg)))
        halves = [PointMass(x_m + side * GYRATION_M, mass_kg / 2) for side in (-1, 1)]
        return replace(physical, masses=(*physical.masses, *halves))
