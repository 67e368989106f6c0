"""A tension that changes with the temperature."""

from __future__ import annotations

from dataclasses import replace

from shm.models.conditions import Conditions
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger

_LEAST_RANGE_K = 1.0
_STEEL_EXPANSION_1_K = 1.2e-5


class TemperatureTension(Effect):
    """Warmth changes the tension: the hanger expands otherwise than the bridge that holds it.

    The tension of a test is that at the mean temperature of the tests plus so much for each kelvin.
    """

    name = "temperature_tension"
    title = "Tension that follows the temperature"
    source = (
        "Xia, Chen, Weng, Ni and Xu (2012), Temperature effect on vibration properties of civil "
        "structures: a literature review and case studies."
    )
    seen_by = ("tests at different temperatures",)
    imitated_by = ("timebase", "geometric_hardening")
    follows = ("temperature",)

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if hanger.supports.ends("free"):
            return "An end is free, so that warmth stretches nothing."
        if survey.temperatures_c and _range(survey.temperatures_c) >= _LEAST_RANGE_K:
            return ""
        return "It takes tests at two known temperatures at least 1 K apart."

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        restrained = hanger.elastic_modulus_pa * hanger.area_m2 * _STEEL_EXPANSION_1_K
        size = Parameter(
            "tension_per_kelvin_n_k",
            "N/K",
            1e-5 * restrained,
            restrained,
            0.0,
            "Either way, up to E A times 1.2e-5 per kelvin, a steel bar that cannot expand at all; "
            "a hanger whose bridge warms with it has a small share of that.",
            spread="logarithmic",
            signed=True,
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
        added_n = values[:, 0] * conditions.temperature_shift_k
        return replace(physical, tension_n=physical.tension_n + added_n)


def _range(temperatures_c: tuple[float, ...]) -> float:
    return max(temperatures_c) - min(temperatures_c)
