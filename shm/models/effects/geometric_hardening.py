"""A hard hit stretches the hanger, so that its tension rises."""

from __future__ import annotations

from dataclasses import replace

from shm.models.conditions import Conditions
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.effects.levels import missing_levels
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger

_DYING = 1.5


class GeometricHardening(Effect):
    """Swinging widely stretches the hanger and raises its mean tension with the amplitude squared.

    All frequencies rise with the level of the hit, the low orders most.
    """

    name = "geometric_hardening"
    title = "Tension that rises with the amplitude"
    source = (
        "Woinowsky-Krieger (1950), The effect of an axial force on the vibration of hinged bars; "
        "Nayfeh and Mook (1979), Nonlinear Oscillations."
    )
    seen_by = ("tests at different levels",)
    imitated_by = ("temperature_tension", "timebase")
    other_laws = ("the swing dies away the faster the wider it is: the power of the level is 1.5",)
    follows = ("amplitude",)

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if hanger.nominal_tension_n == 0 or hanger.supports.ends("free"):
            return "It takes a tension between two ends that are held."
        return missing_levels(survey)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "hardening",
            "fraction",
            1e-6,
            0.05,
            0.0,
            "One millionth to 5 % of the tension at the reference level: a hammer seldom moves a "
            "hanger by more than a few millimetres.",
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
        power = _DYING if variant.law else 2.0
        factor = 1 + values[:, 0] * conditions.amplitude**power
        return replace(physical, tension_n=physical.tension_n * factor)
