"""Gap diagnoses made by hand: a cause, causes alike, no gap, unexplained, hardly any data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.report.contents import DiagnosisSheet
from shm.values import (
    NAN,
    PLANES,
    Cause,
    Diagnosis,
    EffectEstimate,
    GapPlace,
    Hanger,
    NextMeasurement,
    Outlier,
    Plane,
    Residual,
    Shrinkage,
    TensionEstimate,
    Trend,
)

HANGER = Hanger(3, 12.0, 200e9, 0.013273, 1.4019e-5, 103.5, 711e3, name="north")
MASS = (
    EffectEstimate("mass_kg", "kg", 12.1, 1.8, 9.2, 15.1),
    EffectEstimate("x_m", "m", 3.41, 0.18, 3.11, 3.70),
)


def make_cause(effect: str, probability: float, at: str = "everywhere", **more: object) -> Cause:
    cause = Cause(effect, at, probability, 40 * probability - 4, 52.0, -11.0, (), "normal")
    return replace(cause, **more)  # type: ignore[arg-type]


def make_residuals(tests: int = 5, orders: int = 8, seed: int = 4) -> tuple[Residual, ...]:
    """Return the pattern of a point mass at 3.4 m, with noise."""
    rng, found = np.random.default_rng(seed), []
    for plane in PLANES:
        for order in range(1, orders + 1):
            for test in range(tests):
                gap = -3.0 * float(np.sin(order * np.pi * 3.4 / 12)) ** 2 + 1.2
                found.append(_residual(plane, order, f"t{test + 1}", gap, rng))
    total = sum(residual.z**2 for residual in found) or 1.0
    return tuple(replace(residual, share=residual.z**2 / total) for residual in found)


def _residual(
    plane: Plane, order: int, test: str, gap: float, rng: np.random.Generator
) -> Residual:
    noise, rest, held = rng.normal(0, [0.12, 0.15, 0.3]).tolist()
    frequency_hz = 5.8 * order**1.2
    off = gap + noise
    return Residual(
        plane, order, test, frequency_hz * (1 + off / 100), frequency_hz, off, off / 0.13, NAN,
        after_percent=rest, held_out_before_percent=1.1 * off, held_out_after_percent=rest + held,
    )  # fmt: skip


def profile(x_m: float, sd_m: float) -> tuple[tuple[float, float], ...]:
    places = np.linspace(0, 12, 121)
    density = np.exp(-(((places - x_m) / sd_m) ** 2) / 2)
    density /= density.sum() * 0.1
    return tuple(zip(places.tolist(), density.tolist(), strict=True))


LED = Diagnosis(
    hanger=3,
    baseline="beam1",
    tests=("t1", "t2", "t3", "t4", "t5"),
    where=make_residuals(),
    trends=(
        Trend("temperature", 0.12, 0.1, 0.01),
        Trend("amplitude", -0.05, 0.09, 0.0),
        Trend("order", 1.4, 0.3, 0.35),
        Trend("added mass", 0.3, 0.25, 0.05),
    ),
    places=(
        GapPlace("mass", 3.4, 3.1, 3.7, 0.92, profile(3.4, 0.18)),
        GapPlace("stiffness", 5.1, 2.2, 9.0, 0.41, profile(5.1, 2.0)),
    ),
    no_gap_probability=0.0004,
    unexplained_probability=0.03,
    causes=(
        make_cause("point_mass", 0.93, parameters=MASS, log_bayes_factor=41.2),
        make_cause("section_loss", 0.02, log_bayes_factor=33.0),
        make_cause(
            "point_mass + sag", 0.0136, "everywhere + everywhere, transverse", method="sampled"
        ),
        make_cause("intermediate_support", 0.004, "everywhere, transverse", method="screened"),
        make_cause("rotational_end_flexibility", 0.002, "both ends"),
        make_cause("translational_end_flexibility", 0.0, "deck end, transverse", method="screened"),
        make_cause("effective_length", 0.0, "arch end", method="screened"),
        make_cause("bending_stiffness", 0.0, method="screened"),
        make_cause("distributed_mass", 0.0, method="screened"),
        make_cause("stiff_end_zones", 0.0, "both ends", method="screened"),
        make_cause("shear_and_rotary_inertia", 0.0, method="screened"),
        make_cause("timebase", 0.0, "all tests", method="screened"),
    ),
    groups=(),
    invisible=(
        ("sensor_misalignment", "No test has shapes of biaxial sensors."),
        ("temperature_tension", "All tests were made within 2 K."),
    ),
    left_out=(),
    fit_p_value=0.42,
    model_error_percent=0.01,
    shrinkage=Shrinkage(2.31, 0.21, 2.52, 0.34),
    tension_before_n=TensionEstimate(731.4e3, 2.1e3, 728.0e3, 734.9e3),
    tension_after_n=TensionEstimate(702.3e3, 7.4e3, 690.2e3, 714.6e3),
    next_measurements=(
        NextMeasurement("known mass of 25 kg at 3.6 m", ("point_mass", "section_loss"), 6.04),
        NextMeasurement("two more modes in each plane", ("point_mass", "section_loss"), 2.2),
        NextMeasurement("a test 15 K warmer", ("point_mass", "intermediate_support"), 0.2),
    ),
    remarks=("Test t4: transverse 9 and 10 are out of order and were left out.",),
    seed=1,
    seconds=14.2,
)

ALIKE = replace(
    LED,
    causes=(
        make_cause(
            "rotational_end_flexibility", 0.52, "both ends", group=0, parameters=(
                EffectEstimate("log10_k1", "N m/rad", 6.8, 0.2, 6.5, 7.1),
                EffectEstimate("log10_k2", "N m/rad", 6.6, 0.3, 6.1, 7.2),
            ),
        ),
        make_cause("effective_length", 0.31, "both ends", group=0, parameters=(
            EffectEstimate("length_change_m", "m", 0.122, 0.02, 0.09, 0.155),)),
        make_cause("bending_stiffness", 0.07, group=0, parameters=(
            EffectEstimate("stiffness_change", "fraction", -0.12, 0.02, -0.15, -0.09),)),
        make_cause("sag", 0.05, "everywhere, transverse"),
    ),
    groups=(("rotational_end_flexibility", "effective_length", "bending_stiffness"),),
    no_gap_probability=0.001,
    unexplained_probability=0.049,
    next_measurements=(
        NextMeasurement(
            "known mass of 25 kg at 3.6 m", ("rotational_end_flexibility", "effective_length"), 6.0
        ),
    ),
    remarks=(),
)  # fmt: skip

STRING_HANGER = replace(HANGER, nominal_tension_n=37.5)
STRING = replace(
    LED,
    tension_before_n=TensionEstimate(38.34, 0.91, 37.12, 39.95),
    tension_after_n=TensionEstimate(41.04, 2.9, 35.9, 45.7),
)
"""Tensions of a string: a thousandth of a hanger's and less."""

NO_GAP = replace(
    LED,
    where=tuple(
        replace(r, residual_percent=r.after_percent, z=r.after_percent / 0.13) for r in LED.where
    ),
    causes=tuple(replace(c, probability=0.01, group=None) for c in LED.causes[:6]),
    no_gap_probability=0.92,
    unexplained_probability=0.02,
    shrinkage=Shrinkage(0.15, NAN, 0.16, NAN),
    next_measurements=(),
    trends=(),
    places=(),
    remarks=(),
)

UNEXPLAINED = replace(
    LED,
    causes=(make_cause("point_mass", 0.11, parameters=MASS), make_cause("sag", 0.02)),
    no_gap_probability=0.0,
    unexplained_probability=0.87,
    fit_p_value=0.0003,
    left_out=("rotational_end_flexibility",),
)

UNDECIDED = replace(
    LED,
    causes=(make_cause("point_mass", 0.45, parameters=MASS), make_cause("sag", 0.3)),
    no_gap_probability=0.04,
    unexplained_probability=0.21,
    next_measurements=(),
)

BLUNDER = replace(
    LED,
    where=tuple(
        replace(r, measured_hz=r.predicted_hz * 1.3, residual_percent=30.0, z=230.0, share=0.0,
                after_percent=29.5, held_out_before_percent=NAN, held_out_after_percent=NAN)
        if (r.plane, r.order, r.test) == ("transverse", 3, "t4") else r
        for r in LED.where
    ),
    outliers=(Outlier("transverse", 3, "t4", 28.17, 21.7, 0.02, 0.9999),),
    next_measurements=LED.next_measurements[:1],
    tension_after_n=TensionEstimate(702.3e3, 7.4e3, 690.2e3, 714.6e3, 687.9e3, 716.8e3),
)  # fmt: skip

ONE_MODE = replace(
    NO_GAP,
    tests=("only",),
    where=(Residual("transverse", 1, "only", 5.82, 5.81, 0.17, NAN, NAN),),
    causes=(),
    no_gap_probability=0.6,
    unexplained_probability=0.4,
    shrinkage=Shrinkage(0.17, NAN, NAN, NAN),
    fit_p_value=NAN,
    remarks=("Only one frequency is given: tension and any effect trade freely.",),
)

NOTHING_KNOWN = replace(
    ONE_MODE,
    where=(Residual("transverse", 1, "only", NAN, NAN, NAN, NAN, NAN),),
    trends=(Trend("order", NAN, NAN, NAN),),
    places=(GapPlace("mass", NAN, NAN, NAN, NAN),),
    causes=(
        Cause("point_mass", "everywhere", NAN, NAN, NAN, NAN,
              (EffectEstimate("mass_kg", "kg", NAN, NAN, NAN, NAN),), "screened"),
    ),
    no_gap_probability=NAN,
    unexplained_probability=NAN,
    shrinkage=Shrinkage(NAN, NAN, NAN, NAN),
    tension_before_n=TensionEstimate(NAN, NAN, NAN, NAN),
    tension_after_n=TensionEstimate(NAN, NAN, NAN, NAN),
    next_measurements=(NextMeasurement("two more modes", ("point_mass", ""), NAN),),
    model_error_percent=NAN,
    seconds=NAN,
)  # fmt: skip

CASES = {
    "led": LED,
    "alike": ALIKE,
    "no gap": NO_GAP,
    "unexplained": UNEXPLAINED,
    "undecided": UNDECIDED,
    "blunder": BLUNDER,
    "one mode": ONE_MODE,
    "nothing known": NOTHING_KNOWN,
}


def sheet(name: str) -> DiagnosisSheet:
    return DiagnosisSheet(CASES[name], HANGER, "Arch bridge")
