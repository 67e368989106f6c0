"""A logger whose clock is wrong."""

from __future__ import annotations

from dataclasses import replace

from shm.models.conditions import Conditions
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger


class Timebase(Effect):
    """The logger's clock is off, or the file states a wrong sampling rate.

    Every reported frequency is the true one times 1 + error, in all tests or in one of them.
    """

    name = "timebase"
    title = "A wrong clock"
    source = "IEEE Std 1057-2017, Standard for Digitizing Waveform Recorders."
    seen_by = ("frequencies", "several tests")
    imitated_by = (
        "distributed_mass",
        "bending_stiffness",
        "effective_length",
        "stiff_end_zones",
        "temperature_tension",
    )

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        one = tuple(Variant(f"test {test}", test=test) for test in survey.tests)
        return (Variant("all tests"), *one) if len(one) > 1 else (Variant("all tests"),)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "clock_error",
            "fraction",
            1e-6,
            0.05,
            0.0,
            "One millionth to 5 %, either way: from a quartz to a nominal rate that the logger "
            "does not keep.",
            spread="logarithmic",
            signed=True,
            most=0.99,
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
        if variant.test and variant.test != conditions.test:
            return physical
        return replace(physical, clock_factor=physical.clock_factor * (1 + values[:, 0]))
