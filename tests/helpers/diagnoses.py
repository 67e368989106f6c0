"""A small diagnosis for tests of what is kept of one."""

from __future__ import annotations

from collections.abc import Sequence

from shm.values import (
    NAN,
    Cause,
    Diagnosis,
    EffectEstimate,
    NextMeasurement,
    Residual,
    Shrinkage,
    TensionEstimate,
)

MASS = Cause(
    effect="point_mass",
    at="everywhere",
    probability=0.9,
    log_bayes_factor=14.0,
    log_fit=20.0,
    log_occam=-6.0,
    parameters=(
        EffectEstimate("mass_kg", "kg", 12.0, 0.5, 11.2, 12.8),
        EffectEstimate("x_m", "m", 3.4, 0.05, 3.32, 3.48),
    ),
    method="normal",
)
WARMTH = Cause(
    effect="temperature_tension",
    at="everywhere",
    probability=0.05,
    log_bayes_factor=11.0,
    log_fit=15.0,
    log_occam=-4.0,
    parameters=(EffectEstimate("tension_per_kelvin_n_k", "N/K", -1000.0, 50.0, -1082.0, -918.0),),
    method="normal",
)


def a_diagnosis(
    tests: Sequence[str] = ("t1",), causes: Sequence[Cause] = (MASS, WARMTH)
) -> Diagnosis:
    return Diagnosis(
        hanger=3,
        baseline="beam1",
        tests=tuple(tests),
        where=(Residual("transverse", 1, tests[0], 5.8, 5.9, -1.7, -17.0, 0.6),),
        trends=(),
        places=(),
        no_gap_probability=0.02,
        unexplained_probability=0.03,
        causes=tuple(causes),
        groups=(),
        invisible=(("sensor_mass", "It takes sensors with known places."),),
        left_out=(),
        fit_p_value=0.4,
        model_error_percent=NAN,
        shrinkage=Shrinkage(2.3, 0.6, 2.5, NAN),
        tension_before_n=TensionEstimate(800e3, 9e3, 785e3, 815e3),
        tension_after_n=TensionEstimate(711e3, 4e3, 704e3, 718e3),
        next_measurements=(NextMeasurement("a known mass", ("point_mass", "sag"), 6.0),),
        remarks=("Only one temperature.",),
        seed=1,
        seconds=2.0,
    )
