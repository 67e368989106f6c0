"""An end that gives way sideways: a translational spring."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shm.models.conditions import Conditions
from shm.models.effects import places
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger

_SOFT, _STIFF = 3.0, 3000.0


class TranslationalEndFlexibility(Effect):
    """What holds the end bends: a thin cross beam, a long bracket, a soft bearing.

    A spring without mass holds the end in the plane; kt1 and kt3 act in the transverse plane (deck
    end, arch end), kt2 and kt4 in the longitudinal one. At both ends the ends are alike.
    """

    name = "translational_end_flexibility"
    title = "Ends that give way sideways"
    source = "Rao and Mirza (1989), A note on vibrations of generally restrained beams."
    seen_by = ("frequencies", "the other plane", "shapes near the ends")
    imitated_by = ("support_motion", "shear_and_rotary_inertia", "stiff_end_zones", "point_mass")

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        return "" if hanger.supports.ends("clamped", "pinned") else "Nothing holds either end."

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        held = hanger.supports.ends("clamped", "pinned")
        return places.at_ends(places.springs(survey), held)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        first = 1 + 2 * variant.ends[0]
        own = _lateral_stiffness_n_m(hanger)
        return tuple(
            Parameter(
                f"log10_kt{first + plane}",
                "N/m",
                math.log10(_SOFT * own),
                math.log10(_STIFF * own),
                np.inf,
                "3 to 3000 times T/L + 100 EI/L^3, what the bar itself resists with: what holds a "
                "hanger is stiffer than the hanger, nobody knows by how many orders of magnitude.",
            )
            for plane in places.free_planes(variant)
        )

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        compliance = physical.translational_compliance_m_n.copy()
        for end in variant.ends:
            for plane in variant.planes:
                column = 0 if variant.alike else variant.planes.index(plane)
                compliance[:, end, plane] += 10.0 ** -values[:, column]
        return replace(physical, translational_compliance_m_n=compliance)


def _lateral_stiffness_n_m(hanger: Hanger) -> float:
    length_m = hanger.length_m
    return hanger.nominal_tension_n / length_m + 100 * hanger.bending_stiffness_n_m2 / length_m**3
