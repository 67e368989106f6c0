"""A hammer test whose truth is known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np

from shm.errors import UsageError
from shm.simulate import (
    HammerPlan,
    HangerState,
    PlantedEffect,
    TestConditions,
    hammer_test,
    spread_places_m,
)
from shm.values import NAN, AddedMass, Hanger, Recording


def simulate(
    hanger: Hanger,
    *,
    tension_n: float | None = None,
    k1_n_m_rad: float = math.inf,
    k2_n_m_rad: float = math.inf,
    k3_n_m_rad: float = math.inf,
    k4_n_m_rad: float = math.inf,
    damping_ratio: float = 0.001,
    hits: int = 5,
    seconds_per_hit: float = 20.0,
    sampling_rate_hz: float = 512.0,
    sensors: int = 2,
    hammer_x_m: float = NAN,
    acceleration_noise_m_s2: float = 0.02,
    effects: Sequence[PlantedEffect] = (),
    disturbances: Sequence[str] = (),
    amplitude: float = 1.0,
    temperature_c: float = NAN,
    reference_c: float = 10.0,
    added_mass: AddedMass | None = None,
    time: datetime | None = None,
    seed: int = 1,
) -> Recording:
    """The recording of a hammer test of a hanger whose truth you choose.

    Beam finite elements and modal superposition, no code of `shm.models`: what is planted here and
    found there agrees only if both are right. Left out, `tension_n` is the nominal one, the end
    springs (k1, k3 transverse at deck and arch end; k2, k4 longitudinal) are clamped, and the
    hammer hits at 0.16 of the length. Each of 1 to 8 `sensors` is biaxial, two channels in m/s^2.
    Effects of the gap diagnosis are planted as `PlantedEffect(name, at, values)`; `disturbances`
    are names of `shm.simulate.DISTURBANCES`. The level of the hits is `amplitude`; the tension is
    the planted one at `reference_c`. The same seed gives the same recording, that of
    `shm simulate --seed`.

    `Recording.channels` are `force`, then `acc_1`, `acc_2`, ..., each (hits x seconds x rate,).
    Raises UsageError for what cannot be, and for a hanger that is not clamped and in tension.
    `shm.simulate` holds more: ambient records, campaigns of modal tests.

    Example:
        >>> recording = shm.simulate(hanger, tension_n=650e3, k1_n_m_rad=1e7, seed=1)
        >>> len(recording.channels), recording.duration_s
        (5, 100.0)
    """
    _refuse_other_supports(hanger)
    plan = HammerPlan(
        hits=hits,
        seconds_per_hit=seconds_per_hit,
        sampling_rate_hz=sampling_rate_hz,
        sensors_x_m=spread_places_m(hanger, sensors),
        hammer_x_m=hammer_x_m,
        acceleration_noise_m_s2=acceleration_noise_m_s2,
    )
    shift_k = 0.0 if math.isnan(temperature_c) else temperature_c - reference_c
    recording = hammer_test(
        hanger,
        HangerState(
            hanger.nominal_tension_n if tension_n is None else tension_n,
            k1_n_m_rad, k2_n_m_rad, k3_n_m_rad, k4_n_m_rad,
            damping_ratio=damping_ratio,
        ),
        replace(plan, peak_force_n=plan.peak_force_n * amplitude),
        np.random.default_rng([seed, 0]),
        time=time,
        temperature_c=temperature_c,
        disturbances=disturbances,
        effects=effects,
        conditions=TestConditions("", shift_k, amplitude, added_mass),
    )  # fmt: skip
    return replace(recording, added_mass=added_mass)


def _refuse_other_supports(hanger: Hanger) -> None:
    if not hanger.as_hanger:
        raise UsageError(
            f"hanger {hanger.id} is not clamped at both ends, or carries no tension: it cannot be "
            "simulated.",
            remedy="Describe it clamped and in tension; soft ends are k1_n_m_rad to k4_n_m_rad.",
        )
