"""A bending stiffness that is not the one given."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shm.models.conditions import Conditions
from shm.models.effects import places
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger


class BendingStiffness(Effect):
    """EI differs from the description, all along the hanger.

    Wires of a strand slide (less), a tube or grout round the bar bends with it (more), or the
    section is not the one of the drawing. In one plane only: a section that is not round, which a
    hanger with a diameter has not.
    """

    name = "bending_stiffness"
    title = "Another bending stiffness"
    source = (
        "Papailiou (1997), On the bending stiffness of transmission line conductors; Cardou and "
        "Jolicoeur (1997), Mechanical models of helical strands."
    )
    seen_by = ("frequencies", "the other plane")
    imitated_by = (
        "distributed_mass",
        "timebase",
        "effective_length",
        "stiff_end_zones",
        "rotational_end_flexibility",
    )

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        round_section = math.isfinite(hanger.diameter_m)
        return (Variant(),) if round_section else places.planes(survey)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "stiffness_change",
            "fraction",
            0.005,
            0.8,
            0.0,
            "0.5 to 80 %, either way: from a rolling tolerance to wires that slide freely or a "
            "grouted tube.",
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
        factor = np.ones_like(physical.bending_stiffness_n_m2)
        factor[:, list(variant.planes)] += values[:, :1]
        return replace(physical, bending_stiffness_n_m2=physical.bending_stiffness_n_m2 * factor)
