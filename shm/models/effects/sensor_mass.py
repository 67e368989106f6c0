"""Sensors that load the hanger."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.conditions import Conditions
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger, PointMass
from shm.values import FloatArray, Hanger


class SensorMass(Effect):
    """Sensors with their clamps and magnets are heavy: each adds the same mass where it sits."""

    name = "sensor_mass"
    title = "Heavy sensors"
    source = (
        "Ewins (2000), Modal Testing: Theory, Practice and Application; Maes, Peeters, Reynders, "
        "Lombaert and De Roeck (2013), Identification of axial forces in beam members by local "
        "vibration measurements."
    )
    seen_by = ("frequencies of many orders", "known places of the sensors")
    imitated_by = ("point_mass", "section_loss")
    of_the_hanger = False

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if survey.sensor_places_m:
            return ""
        return "It takes sensors with known places: give the mode shapes with their x_m."

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return (Variant("all sensors", places_m=survey.sensor_places_m),)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "mass_kg",
            "kg",
            0.01,
            20.0,
            0.0,
            "10 g to 20 kg each: from a piezo on wax to a boxed seismometer on a clamp.",
            spread="logarithmic",
        )
        return (size,)

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        mass_kg = values[:, 0]
        added = tuple(
            PointMass(np.full_like(mass_kg, place_m), mass_kg) for place_m in variant.places_m
        )
        return replace(physical, masses=physical.masses + added)
