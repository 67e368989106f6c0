"""A length that vibrates which is not the length of the drawing."""

from __future__ import annotations

from dataclasses import replace

from shm.models.conditions import Conditions
from shm.models.effects import places
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger


class EffectiveLength(Effect):
    """The bar vibrates over another length than the one given.

    It is held inside of its plate or socket (negative), or beyond the face that the drawing shows
    (positive). At both ends the change is shared evenly.
    """

    name = "effective_length"
    title = "Another length than the drawing's"
    source = (
        "Amabili, Carra, Collini, Garziera and Panno (2010), Estimation of tensile force in "
        "tie-rods using a frequency-based identification method."
    )
    seen_by = ("frequencies", "shapes", "a known mass")
    imitated_by = (
        "distributed_mass",
        "timebase",
        "bending_stiffness",
        "stiff_end_zones",
        "rotational_end_flexibility",
    )

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return places.ends()

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "length_change_m",
            "m",
            0.001 * hanger.length_m,
            0.12 * hanger.length_m,
            0.0,
            "0.1 to 12 % of the length, either way: from the tolerance of a drawing to a whole end "
            "plate that holds the bar or does not.",
            spread="logarithmic",
            signed=True,
            most=hanger.length_m / 2,
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
        each = values[:, 0] / len(variant.ends)
        return replace(
            physical,
            deck_end_m=physical.deck_end_m - each * (0 in variant.ends),
            arch_end_m=physical.arch_end_m + each * (1 in variant.ends),
        )
