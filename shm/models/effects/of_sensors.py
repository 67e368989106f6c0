"""Effects of how it was measured: a wrong clock, sensors and axes that point elsewhere.

Effects of what reads the tension beside the vibration: load cells, jacks, weights.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shm.models.effects import base
from shm.models.effects.base import Case, Effect, OverTime, Parameter, Survey, Variant
from shm.models.hanger.physical import PhysicalHanger
from shm.values import NAN, FloatArray, Hanger


class Timebase(Effect):
    """The logger's clock is off, or the file states a wrong sampling rate.

    Every reported frequency is the true one times 1 + error, in all tests or in one of them.
    """

    name = "timebase"
    title = "A wrong clock"
    phrase = "a clock by which frequencies read {clock_error:too high|too low}"
    over_time = OverTime(
        fell="the logger's clock is wrong",
        rose="the logger's clock is wrong",
        check="check the logger's clock and the sampling rate in the file",
        apart_by="another logger",
    )
    source = "IEEE Std 1057-2017, Standard for Digitizing Waveform Recorders."
    seen_by = ("frequencies", "several tests")
    imitated_by = (
        "distributed_mass",
        "bending_stiffness",
        "effective_length",
        "stiff_end_zones",
        "temperature_tension",
        "section_size",
    )
    size = Parameter(
        "clock_error",
        "fraction",
        1e-6,
        0.1,
        0.0,
        "One millionth to 10 %, either way: from a quartz to a rate that the logger does not "
        "keep, or 48 kHz where it was 44.1.",
        spread="logarithmic",
        signed=True,
        most=0.99,
    )

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        one = tuple(Variant(f"test {test}", test=test) for test in survey.tests)
        return (Variant("all tests"), *one) if len(one) > 1 else (Variant("all tests"),)

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        if case.variant.test and case.variant.test != case.conditions.test:
            return bar
        return replace(bar, clock_factor=bar.clock_factor * (1 + values[:, 0]))


_FEWEST_DECIMALS, _MOST_DECIMALS = 2, 9  # technical: a tape's centimetre, and what ends the search


class SensorMisalignment(Effect):
    """A sensor is turned about the hanger's axis, so that it sees a share of the other plane.

    The angle counts from the transverse to the longitudinal plane. Frequencies do not change.
    """

    name = "sensor_misalignment"
    title = "Turned sensors"
    phrase = "a sensor direction turned by {angle_deg}"
    check = "sight along the sensors and turn them into the planes"
    source = "McConnell (1995), Vibration Testing: Theory and Practice."
    seen_by = ("shapes of biaxial sensors",)
    imitated_by = ("skewed_principal_axes",)
    of_the_hanger = False
    size = Parameter(
        "angle_deg",
        "deg",
        0.05,
        60.0,
        0.0,
        "0.05 to 60 degrees, either way: from the play of a clamp to a sensor put on by eye.",
        spread="logarithmic",
        signed=True,
        most=90.0,
    )

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if survey.biaxial and survey.sensor_places_m:
            return ""
        return "It takes mode shapes of biaxial sensors: what each sees in the other plane."

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        places_m = survey.sensor_places_m
        decimals = _decimals(places_m)
        each = tuple(
            Variant(f"sensor at {place_m:.{decimals}f} m", sensor=index)
            for index, place_m in enumerate(places_m)
        )
        return (Variant("all sensors"), *each) if len(places_m) > 1 else each

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        turn = bar.sensor_turn_rad.copy()
        sensor = case.variant.sensor
        turned = slice(None) if sensor is None else slice(sensor, sensor + 1)
        turn[:, turned] += np.radians(values[:, :1])
        return replace(bar, sensor_turn_rad=turn)


def _decimals(places_m: tuple[float, ...]) -> int:
    """As many as tell the places apart, two at least."""
    for decimals in range(_FEWEST_DECIMALS, _MOST_DECIMALS):
        if len({f"{place_m:.{decimals}f}" for place_m in places_m}) == len(places_m):
            return decimals
    return _MOST_DECIMALS


class SkewedPrincipalAxes(Effect):
    """The end turns about one axis only, and that axis lies askew to the planes of the bridge.

    A pin or a plate set at an angle: the bar bends freely in the plane at this angle from the
    transverse one and is clamped across it, so that each mode moves in both planes.
    """

    name = "skewed_principal_axes"
    title = "Joints askew to the planes"
    phrase = (
        "ends that turn about one axis only, {angle_deg} from the transverse plane, "
        "against {log10_k}"
    )
    check = "look how the pins and plates of both ends lie to the planes"
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
        return base.at_ends(base.ends(), hanger.supports.ends("clamped"))

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
        return base.rotational_stiffness("log10_k", hanger), angle

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        angle = np.radians(values[:, 1])
        axis = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        added = 10.0 ** -values[:, 0, None, None] * axis[:, :, None] * axis[:, None, :]
        compliance = bar.rotational_compliance_rad_n_m.copy()
        compliance[:, list(case.variant.ends)] += added[:, None]
        return replace(bar, rotational_compliance_rad_n_m=compliance)


class LoadScale(Effect):
    """The tension that was read is the true one times 1 + error: load cell, jack, scales.

    Between tests the differences of `tension_read_n` are off by it; where the description knows the
    tension (`[hanger.scatter] tension`), so is that one. The hanger itself is as described.
    """

    name = "load_scale"
    title = "A load cell or jack that is off by a factor"
    phrase = "a load cell or jack that reads {load_error:too much|too little}"
    check = "check the load cell or the jack against another"
    source = (
        "ISO 376:2011, Calibration of force-proving instruments; fib Bulletin 30 (2005), "
        "Acceptance of stay cable systems."
    )
    seen_by = ("tensions that were read", "several tests")
    imitated_by = ("distributed_mass", "effective_length", "temperature_tension")
    of_the_hanger = False
    of_readings = True
    size = Parameter(
        "load_error",
        "fraction",
        0.005,
        0.3,
        0.0,
        "0.5 to 30 %, either way: from a cell out of calibration, over 9.81 taken as 10 and "
        "the friction of a jack, to the factor of another gauge.",
        spread="logarithmic",
        signed=True,
        most=0.9,
    )

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        if not hanger.nominal_tension_n:
            return "The bar carries no tension that could be read."
        if math.isfinite(hanger.scatter.tension) or len(survey.tensions_read_n) > 1:
            return ""
        return (
            "It takes a tension that is known, or tests between which a load cell or jack reads "
            "different tensions."
        )

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        return (Variant("all readings"),)

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        error = values[:, 0]
        known = math.isfinite(case.hanger.scatter.tension)
        read_n = bar.tension_n if known else case.conditions.tension_shift_n
        return replace(bar, tension_n=bar.tension_n - read_n * error / (1 + error))
