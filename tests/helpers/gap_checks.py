"""Diagnoses that take no time, for checks of what a diagnosis would find."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from shm.gap import GapOptions
from shm.gap.twin import Twin
from shm.models.effects import Variant
from shm.values import (
    Diagnosis,
    EffectCheck,
    FloatArray,
    GapCheck,
    GapTrial,
    Hanger,
    ModalTest,
    PlantedParameter,
)
from tests.helpers.diagnoses import MASS, a_diagnosis

Diagnose = Callable[[Sequence[ModalTest], Hanger, GapOptions], Diagnosis]


def names_from(twin: Twin, least: float, *effects: str) -> Diagnose:
    """Make a diagnosis that names `effects` where the first frequency is further than `least` off.

    Several are of one group, the first the likeliest; none is something unknown.
    """
    sound_hz = sound_frequencies_hz(twin)

    def diagnose(tests: Sequence[ModalTest], hanger: Hanger, options: GapOptions) -> Diagnosis:
        away = abs(np.log(frequencies_hz(tests) / sound_hz)[0])  # that which errs least
        if away < least:
            return replace(a_diagnosis(causes=()), no_gap_probability=0.9)
        group = 0 if len(effects) > 1 else None
        causes = [
            replace(MASS, effect=name, probability=0.5 / 2**k, group=group)
            for k, name in enumerate(effects)
        ]
        return a_diagnosis(causes=causes)

    return diagnose


@cache
def sound_frequencies_hz(twin: Twin) -> FloatArray:
    """Return the mean frequencies of a twin without any effect."""
    rng = np.random.default_rng(0)
    sound = [frequencies_hz(twin.measure("", Variant(), np.empty(0), rng)) for _ in range(50)]
    return np.mean(sound, axis=0)


def frequencies_hz(tests: Sequence[ModalTest]) -> FloatArray:
    return np.array([mode.frequency_hz for test in tests for mode in test.modes])


def a_check() -> GapCheck:
    """Make a check of one effect that is found from the third of four sizes on."""
    masses = (0.2, 1.2, 7.0, 48.0)
    trials = tuple(
        GapTrial(
            "point_mass", "everywhere", step, (PlantedParameter("mass_kg", "kg", masses[step]),),
            1, "alone" if step > 1 else "no gap",
        )
        for step in (2, 1)
    )  # fmt: skip
    return GapCheck(
        hanger=3, baseline="beam1", tests=("t1",), tension_n=711e3, misfit_percent=0.02,
        frequency_sd_percent=0.01,
        effects=(EffectCheck("point_mass", "mass_kg", "kg", masses, 2, trials),),
        sound=(GapTrial("", "", -1, (), 1, "no gap"),),
        invisible=(("sensor_mass", "It takes sensors."),),
        searches=2, searches_done=2, seeds=1, seed=1,
    )  # fmt: skip
