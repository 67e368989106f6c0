"""Mass all along the hanger that the description leaves out."""

from __future__ import annotations

from dataclasses import replace

from shm.models.conditions import Conditions
from shm.models.effects.base import Effect, Parameter, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger


class DistributedMass(Effect):
    """The bar has more mass per length than described: coating, grout, a pipe round it, ice."""

    name = "distributed_mass"
    title = "More mass along the hanger"
    source = (
        "Blevins (1979), Formulas for Natural Frequency and Mode Shape; ISO 12494:2001, "
        "Atmospheric icing of structures."
    )
    seen_by = ("frequencies", "a known mass")
    imitated_by = ("timebase", "bending_stiffness", "effective_length", "stiff_end_zones")

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "mass_change",
            "fraction",
            0.002,
            0.3,
            0.0,
            "0.2 to 30 % of the mass: from a coat of paint to a grouted pipe or glaze ice; things "
            "are put on hangers, not taken off.",
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
        mass = physical.mass_per_length_kg_m * (1 + values[:, 0])
        return replace(physical, mass_per_length_kg_m=mass)
