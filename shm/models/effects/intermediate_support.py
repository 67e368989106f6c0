"""Something that holds the hanger between its ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.base import Conditions
from shm.models.effects import base
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import LateralSpring, PhysicalHanger
from shm.values import FloatArray, Hanger


class IntermediateSupport(Effect):
    """The hanger touches or is tied to something between its ends: a handrail, a tie, a damper.

    A spring to a place that stands still, in both planes alike or in one.
    """

    name = "intermediate_support"
    title = "Held between the ends"
    localised_as = "lateral spring"
    phrase = "an intermediate support of {stiffness_n_m} at {x_m}"
    source = "Grossi and Albarracín (2003), Eigenfrequencies of generally restrained beams."
    seen_by = ("frequencies of low orders", "the other plane", "shapes")
    imitated_by = ("sag", "support_motion", "section_loss", "point_mass", "partial_mass")

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return base.planes(survey)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        own = _lateral_stiffness_n_m(hanger)
        size = Parameter(
            "stiffness_n_m",
            "N/m",
            1e-3 * own,
            100 * own,
            0.0,
            "0.001 to 100 times T/L, what the tension itself resists with (without any, 100 "
            "EI/L^3, the bar): from a cable that leans on the hanger to a stiff tie.",
            spread="logarithmic",
        )
        return size, base.place_along(hanger)

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        stiffness = np.zeros_like(physical.bending_stiffness_n_m2)
        stiffness[:, list(variant.planes)] = values[:, :1]
        spring = LateralSpring(values[:, 1], stiffness, np.zeros(len(values)))
        return replace(physical, springs=(*physical.springs, spring))


def _lateral_stiffness_n_m(hanger: Hanger) -> float:
    if hanger.nominal_tension_n:
        return hanger.nominal_tension_n / hanger.length_m
    return 100 * hanger.bending_stiffness_n_m2 / hanger.length_m**3
