"""Joints that get softer the harder they are shaken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.conditions import Conditions
from shm.models.effects import places, scales
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.effects.levels import missing_levels
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger

_LOSS_AT_REFERENCE_LEVEL = 0.1
_SLIP = 0.5


class JointSoftening(Effect):
    """Friction in pins and bolts slips: the end spring falls with the amplitude, and damps.

    The rotational stiffness of the joint is k over the level of the hit, in both planes alike; its
    loss factor is 0.1 times the level. Frequencies fall with the level. Damping rises too,
    which the diagnosis does not use.
    """

    name = "joint_softening"
    title = "Joints that soften with the amplitude"
    source = "Gaul and Nitsche (2001), The role of friction in mechanical joints."
    seen_by = ("tests at different levels",)
    imitated_by = ("rotational_end_flexibility", "skewed_principal_axes")
    other_laws = ("the compliance grows with the square root of the level",)
    follows = ("amplitude",)

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if not hanger.supports.ends("clamped"):
            return "No end is clamped, by a joint that could soften."
        return missing_levels(survey)

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return places.at_ends(places.ends(), hanger.supports.ends("clamped"))

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        return (scales.rotational_stiffness("log10_k_at_reference_level", hanger),)

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        ends = list(variant.ends)
        power = _SLIP if variant.law else 1.0
        own = conditions.amplitude**power * 10.0 ** -values[:, 0]
        compliance = physical.rotational_compliance_rad_n_m.copy()
        compliance[:, ends] += own[:, None, None, None] * np.eye(2)
        loss = physical.joint_loss_factor.copy()
        loss[:, ends] += (_LOSS_AT_REFERENCE_LEVEL * conditions.amplitude - loss[:, ends]) * (
            _share(own, compliance[:, ends])
        )
        return replace(physical, rotational_compliance_rad_n_m=compliance, joint_loss_factor=loss)


def _share(own: FloatArray, compliance: FloatArray) -> FloatArray:
    """The joint's part (n, ends) of the ends' compliance (n, ends, 2, 2), mean of both planes.

    Springs in series share their strain energy as they share the compliance, so that the loss
    factor of both is the mean weighted by it.
    """
    whole = np.trace(compliance, axis1=-2, axis2=-1)
    part = np.broadcast_to(2 * own[:, None], whole.shape)
    return np.asarray(np.divide(part, whole, out=np.zeros_like(whole), where=whole > 0))
