"""Sensors that do not point where the protocol says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.conditions import Conditions
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger

_FEWEST_DECIMALS, _MOST_DECIMALS = 2, 9


class SensorMisalignment(Effect):
    """A sensor is turned about the hanger's axis, so that it sees a share of the other plane.

    The angle counts from the transverse to the longitudinal plane. Frequencies do not change.
    """

    name = "sensor_misalignment"
    title = "Turned sensors"
    source = "McConnell (1995), Vibration Testing: Theory and Practice."
    seen_by = ("shapes of biaxial sensors",)
    imitated_by = ("skewed_principal_axes",)
    of_the_hanger = False

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if survey.biaxial and survey.sensor_places_m:
            return ""
        return "It takes mode shapes of biaxial sensors: what each sees in the other plane."

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        places_m = survey.sensor_places_m
        decimals = _decimals(places_m)
        each = tuple(
            Variant(f"sensor at {place_m:.{decimals}f} m", sensor=index)
            for index, place_m in enumerate(places_m)
        )
        return (Variant("all sensors"), *each) if len(places_m) > 1 else each

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "angle_deg",
            "deg",
            0.05,
            60.0,
            0.0,
            "0.05 to 60 degrees, either way: from the play of a clamp to a sensor put on by eye.",
            spread="logarithmic",
            signed=True,
            most=90.0,
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
        turn = physical.sensor_turn_rad.copy()
        turned = (
            slice(None) if variant.sensor is None else slice(variant.sensor, variant.sensor + 1)
        )
        turn[:, turned] += np.radians(values[:, :1])
        return replace(physical, sensor_turn_rad=turn)


def _decimals(places_m: tuple[float, ...]) -> int:
    """As many as tell the places apart, two at least."""
    for decimals in range(_FEWEST_DECIMALS, _MOST_DECIMALS):
        if len({f"{place_m:.{decimals}f}" for place_m in places_m}) == len(places_m):
            return decimals
    return _MOST_DECIMALS
