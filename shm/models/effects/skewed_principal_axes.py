"""A joint whose axes lie askew to the planes of the bridge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.conditions import Conditions
from shm.models.effects import places, scales
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import NAN, FloatArray, Hanger


class SkewedPrincipalAxes(Effect):
    """The end turns about one axis only, and that axis lies askew to the planes of the bridge.

    A pin or a plate set at an angle: the bar bends freely in the plane at this angle from the
    transverse one and is clamped across it, so that each mode moves in both planes.
    """

    name = "skewed_principal_axes"
    title = "Joints askew to the planes"
    source = (
        "Monforton and Wu (1963), Matrix analysis of semi-rigidly connected frames; Perkins and "
        "Mote (1986), Comments on curve veering in eigenvalue problems."
    )
    seen_by = ("shapes of biaxial sensors", "both planes")
    imitated_by = ("rotational_end_flexibility", "sensor_misalignment")

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if not hanger.supports.ends("clamped"):
            return "No end is clamped across any axis."
        if survey.biaxial and survey.sensor_places_m:
            return ""
        return (
            "It takes mode shapes of biaxial sensors: without what each sees in the other plane it "
            "cannot be told from plain end flexibility."
        )

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return places.at_ends(places.ends(), hanger.supports.ends("clamped"))

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        angle = Parameter(
            "angle_deg",
            "deg",
            -90.0,
            90.0,
            NAN,
            "A pin may be set at any angle; half a turn brings it back.",
            least=-90.0,
            most=90.0,
        )
        return scales.rotational_stiffness("log10_k", hanger), angle

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        angle = np.radians(values[:, 1])
        axis = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        own = 10.0 ** -values[:, 0, None, None] * axis[:, :, None] * axis[:, None, :]
        compliance = physical.rotational_compliance_rad_n_m.copy()
        compliance[:, list(variant.ends)] += own[:, None]
        return replace(physical, rotational_compliance_rad_n_m=compliance)
