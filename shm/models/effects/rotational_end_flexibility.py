"""An end that turns: a rotational spring between the bar and what holds it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.conditions import Conditions
from shm.models.effects import places, scales
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger


class RotationalEndFlexibility(Effect):
    """The joint, the gusset plate or the deck behind it turns when the hanger bends.

    A rotational spring stands between the bar and the structure; k1 and k3 act in the transverse
    plane (deck end, arch end), k2 and k4 in the longitudinal one. It lowers all frequencies, the
    low orders most, and so passes for less tension where ends are taken as clamped. At both ends
    the ends are alike: k3 = k1 and k4 = k2. Where the description has a hinge it is the other way
    round: what holds the end resists its turning.
    """

    name = "rotational_end_flexibility"
    title = "Ends that turn"
    source = (
        "Monforton and Wu (1963), Matrix analysis of semi-rigidly connected frames; "
        "Geier, De Roeck and Flesch (2006), Accurate cable force determination using ambient "
        "vibration measurements."
    )
    seen_by = ("frequencies", "the other plane", "shapes near the ends")
    imitated_by = (
        "joint_softening",
        "skewed_principal_axes",
        "effective_length",
        "bending_stiffness",
        "translational_end_flexibility",
    )

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        return "" if hanger.supports.ends("clamped", "pinned") else "Nothing holds either end."

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        everywhere = places.springs(survey)
        turning = places.at_ends(everywhere, hanger.supports.ends("pinned"))
        return places.at_ends(everywhere, hanger.supports.ends("clamped")) + turning

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        first = 1 + 2 * variant.ends[0]
        hinge = variant.ends[0] in hanger.supports.ends("pinned")
        return tuple(
            scales.rotational_stiffness(f"log10_k{first + plane}", hanger, hinge)
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
        compliance = physical.rotational_compliance_rad_n_m.copy()
        for end in variant.ends:
            for plane in variant.planes:
                column = 0 if variant.alike else variant.planes.index(plane)
                own, added = compliance[:, end, plane, plane], 10.0 ** -values[:, column]
                compliance[:, end, plane, plane] = np.where(np.isinf(own), added, own + added)
        return replace(physical, rotational_compliance_rad_n_m=compliance)
