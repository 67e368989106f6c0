"""A hanger that sags: its tension changes as it swings."""

from __future__ import annotations

from dataclasses import replace

from shm.models.conditions import Conditions
from shm.models.effects import places
from shm.models.effects.base import Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger


class Sag(Effect):
    """An inclined or slack hanger hangs in a curve, so that swinging stretches it.

    Irvine's parameter lambda squared weighs the stretch against the tension. In the plane of the
    sag it raises the odd orders, the first one most, and leaves the even ones alone.
    """

    name = "sag"
    title = "Sag"
    source = "Irvine and Caughey (1974), The linear theory of free vibrations of a suspended cable."
    seen_by = ("frequency of the first order", "the other plane")
    imitated_by = ("intermediate_support", "support_motion")
    other_laws = ("it sags as its bending and its ends let it, not as a string",)

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if hanger.nominal_tension_n == 0 or hanger.supports.ends("free"):
            return "It takes a tension between two ends that are held."
        return ""

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return places.single_planes(survey)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        size = Parameter(
            "sag_parameter",
            "lambda^2",
            0.001,
            20.0,
            0.0,
            "0.001 to 20: from a taut, nearly upright bar to a slack stay well below the first "
            "crossing at 4 pi^2.",
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
        parameter = physical.sag_parameter.copy()
        parameter[:, list(variant.planes)] += values[:, :1]
        as_it_bends = physical.sags_as_it_bends or variant.law == 1
        return replace(physical, sag_parameter=parameter, sags_as_it_bends=as_it_bends)
