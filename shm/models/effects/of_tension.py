"""Effects by which tension or joints change with temperature, amplitude or sag."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.effects import base
from shm.models.effects.base import Case, Effect, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, Hanger

# Judgement: by less, thermometers at one spot (0.5 K) and hits (10 %) scatter themselves.
_LEAST_RANGE_K = 1.0
_LEAST_RATIO = 1.2

# Judgement: bolted joints lose a few per cent to tens of them. A diagnosis uses only that it rises.
_LOSS_AT_REFERENCE_LEVEL = 0.1


class TemperatureTension(Effect):
    """Warmth changes the tension: the hanger expands otherwise than the bridge that holds it.

    The tension of a test is that at the mean temperature of the tests plus so much for each kelvin.
    """

    name = "temperature_tension"
    title = "Tension that follows the temperature"
    phrase = (
        "a tension that changes with the temperature, by "
        "{tension_per_kelvin_n_k:(rising)|(falling)}"
    )
    source = (
        "Xia, Chen, Weng, Ni and Xu (2012), Temperature effect on vibration properties of civil "
        "structures: a literature review and case studies."
    )
    seen_by = ("tests at different temperatures",)
    imitated_by = ("timebase", "geometric_hardening")
    follows = ("temperature",)

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if hanger.supports.ends("free"):
            return "An end is free, so that warmth stretches nothing."
        if survey.temperatures_c and _range(survey.temperatures_c) >= _LEAST_RANGE_K:
            return ""
        return "It takes tests at two known temperatures at least 1 K apart."

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        expansion_1_k = hanger.assumptions.thermal_expansion_1_k.value
        restrained = hanger.elastic_modulus_pa * hanger.area_m2 * expansion_1_k
        size = Parameter(
            "tension_per_kelvin_n_k",
            "N/K",
            1e-5 * restrained,
            restrained,
            0.0,
            f"Either way, up to E A times {expansion_1_k * 1e6:g}e-6 per kelvin, a steel bar that "
            "cannot expand at all; a hanger whose bridge warms with it has a small share of that.",
            spread="logarithmic",
            signed=True,
        )
        return (size,)

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        added_n = values[:, 0] * case.conditions.temperature_shift_k
        return replace(bar, tension_n=bar.tension_n + added_n)


def _range(temperatures_c: tuple[float, ...]) -> float:
    return max(temperatures_c) - min(temperatures_c)


class GeometricHardening(Effect):
    """Swinging widely stretches the hanger and raises its mean tension with the amplitude squared.

    All frequencies rise with the level of the hit, the low orders most.
    """

    name = "geometric_hardening"
    title = "Tension that rises with the amplitude"
    phrase = "a tension that grows with the level of motion, by {hardening} at the reference level"
    source = (
        "Woinowsky-Krieger (1950), The effect of an axial force on the vibration of hinged bars; "
        "Nayfeh and Mook (1979), Nonlinear Oscillations."
    )
    seen_by = ("tests at different levels",)
    imitated_by = ("temperature_tension", "timebase")
    follows = ("amplitude",)
    size = Parameter(
        "hardening",
        "fraction",
        1e-6,
        0.05,
        0.0,
        "One millionth to 5 % of the tension at the reference level: a hammer seldom moves a "
        "hanger by more than a few millimetres.",
        spread="logarithmic",
    )

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if hanger.nominal_tension_n == 0 or hanger.supports.ends("free"):
            return "It takes a tension between two ends that are held."
        return missing_levels(survey)

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        factor = 1 + values[:, 0] * case.conditions.amplitude**2
        return replace(bar, tension_n=bar.tension_n * factor)


class JointSoftening(Effect):
    """Friction in pins and bolts slips: the end spring falls with the amplitude, and damps.

    The rotational stiffness of the joint is k over the level of the hit, in both planes alike; its
    loss factor is 0.1 times the level. Frequencies fall with the level. Damping rises too,
    by how much nobody knows.
    """

    name = "joint_softening"
    title = "Joints that soften with the amplitude"
    phrase = (
        "joints that soften as the hanger moves more, with "
        "{log10_k_at_reference_level} at the reference level"
    )
    source = "Gaul and Nitsche (2001), The role of friction in mechanical joints."
    seen_by = ("tests at different levels",)
    imitated_by = ("rotational_end_flexibility", "skewed_principal_axes")
    follows = ("amplitude",)
    dissipates = True

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if not hanger.supports.ends("clamped"):
            return "No end is clamped, by a joint that could soften."
        return missing_levels(survey)

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return base.at_ends(base.ends(), hanger.supports.ends("clamped"))

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        return (base.rotational_stiffness("log10_k_at_reference_level", hanger),)

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        ends = list(case.variant.ends)
        joint = case.conditions.amplitude * 10.0 ** -values[:, 0]
        compliance = bar.rotational_compliance_rad_n_m.copy()
        compliance[:, ends] += joint[:, None, None, None] * np.eye(2)
        loss = bar.joint_loss_factor.copy()
        loss[:, ends] += (_LOSS_AT_REFERENCE_LEVEL * case.conditions.amplitude - loss[:, ends]) * (
            _share(joint, compliance[:, ends])
        )
        return replace(bar, rotational_compliance_rad_n_m=compliance, joint_loss_factor=loss)


def _share(joint: FloatArray, compliance: FloatArray) -> FloatArray:
    """Return the joint's part (n, ends) of compliances (n, ends, 2, 2), the mean of both planes.

    Springs in series share their strain energy as they share the compliance, so that the loss
    factor of both is the mean weighted by it.
    """
    whole = np.trace(compliance, axis1=-2, axis2=-1)
    part = np.broadcast_to(2 * joint[:, None], whole.shape)
    return np.asarray(np.divide(part, whole, out=np.zeros_like(whole), where=whole > 0))


class Sag(Effect):
    """An inclined or slack hanger hangs in a curve, so that swinging stretches it.

    Irvine's parameter lambda squared weighs the stretch against the tension. In the plane of the
    sag it raises the odd orders, the first one most, and leaves the even ones alone.
    """

    name = "sag"
    title = "Sag"
    phrase = "sag with Irvine's lambda squared of {sag_parameter}"
    source = "Irvine and Caughey (1974), The linear theory of free vibrations of a suspended cable."
    seen_by = ("frequency of the first order", "the other plane")
    imitated_by = ("intermediate_support", "support_motion")
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

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if hanger.nominal_tension_n == 0 or hanger.supports.ends("free"):
            return "It takes a tension between two ends that are held."
        return ""

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return base.single_planes(survey)

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        parameter = bar.sag_parameter.copy()
        parameter[:, list(case.variant.planes)] += values[:, :1]
        return replace(bar, sag_parameter=parameter)


def missing_levels(survey: Survey) -> str:
    """Return why an effect of the amplitude is not seen; empty where the levels differ enough."""
    levels = survey.amplitudes
    if levels and max(levels) >= _LEAST_RATIO * min(levels):
        return ""
    return "It takes tests at two known levels, one at least 1.2 times the other."
