"""A stretch of the bar that has lost section."""

from __future__ import annotations

from dataclasses import replace

from shm.models.conditions import Conditions
from shm.models.effects import places
from shm.models.effects.base import GRADUAL, Effect, Parameter, Variant
from shm.models.hanger.physical import PhysicalHanger, Zone
from shm.values import NAN, FloatArray, Hanger

_STEEP = (0.8, 1.0, 1.2)
"""Half as gradual: three steps stand for a slope that is a half wider than they span."""


class SectionLoss(Effect):
    """Corrosion, wear or a machined neck: over a stretch the bar has lost a share of its area.

    Mass falls with the area, bending stiffness with its square, as in a thinner round bar.
    """

    name = "section_loss"
    title = "Lost section over a stretch"
    source = (
        "Cawley and Adams (1979), The location of defects in structures from measurements of "
        "natural frequencies."
    )
    seen_by = ("frequencies of many orders", "shapes")
    imitated_by = ("intermediate_support", "point_mass", "stiff_end_zones")
    other_laws = (
        "the loss begins and ends gradually, over three fifths of its extent at each end",
        "pits reach into the section: the stiffness falls as the area, not as its square",
        "the loss begins and ends gradually, over three tenths of its extent at each end",
    )

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "loss",
            "fraction",
            0.005,
            0.6,
            0.0,
            "0.5 to 60 % of the area: from surface rust to a bar about to break.",
            spread="logarithmic",
            most=0.99,
        )
        extent = Parameter(
            "extent_m",
            "m",
            0.02 * hanger.length_m,
            0.5 * hanger.length_m,
            NAN,
            "2 to 50 % of the length: from a splash zone or a notch at the socket to half the bar.",
            spread="logarithmic",
        )
        return size, places.place_along(hanger), extent

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        loss, middle_m, extent_m = values.T
        reaches = {1: GRADUAL, 3: _STEEP}.get(variant.law, (1.0,))
        power = 1 if variant.law == 2 else 2
        left = (1 - loss) ** (1 / len(reaches))
        zones = tuple(
            Zone(
                start_m=middle_m - reach * extent_m / 2,
                end_m=middle_m + reach * extent_m / 2,
                stiffness_factor=left**power,
                mass_factor=left,
            )
            for reach in reaches
        )
        return replace(physical, zones=physical.zones + zones)
