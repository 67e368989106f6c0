"""Random simulated tests of random hangers, with the truth of each.

Random are tension, length, diameter, end springs, damping (0.05 to 1 %), noise (20 to 60 dB below
the accelerations), sensors (1 to 8 biaxial), hits (3 to 10 of 5 to 20 s) and sampling rate. In
three of ten hangers the two planes differ by little more than nothing. Two of ten tests carry a
disturbance, each kind in its turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from shm.simulate import HammerPlan, HangerState
from shm.simulate.response import Strike
from shm.values import PLANES, Hanger, Plane
from tests.worlds.simulated.disturbances.base import Planted
from tests.worlds.simulated.disturbances.registry import DISTURBANCES
from tests.worlds.simulated.elements import PlaneModes, plane_modes
from tests.worlds.simulated.hammer import SimulatedTest, hammer_test, simulated_test

BAND_HZ = (2.0, 100.0)
_BEYOND_BAND = 1.02
_CLOSE_SHARE = 0.3
_FAULTY_OF_TEN = (3, 8)
_UNDER_A_TONE = 0.005
_MERGED = 0.001


@dataclass(frozen=True)
class Truth:
    """One mode of the simulated hanger; `snr_db` of its ring-down over a hit, best sensor.

    `merged`: within 0.1 % of a mode of the other plane. `under_tone`: within 0.5 % of a planted
    tone or foreign resonance.
    """

    plane: Plane
    order: int
    frequency_hz: float
    snr_db: float
    merged: bool = False
    under_tone: bool = False

    def __str__(self) -> str:
        close = ", close to one of the other plane" if self.merged else ""
        return (
            f"{self.plane} {self.order} ({self.frequency_hz:.4f} Hz, {self.snr_db:.0f} dB{close})"
        )

    @property
    def in_band(self) -> bool:
        return BAND_HZ[0] < self.frequency_hz < BAND_HZ[1]


@dataclass(frozen=True, eq=False)
class Case:
    """One simulated test and all that is true of it."""

    number: int
    hanger: Hanger
    state: HangerState
    plan: HammerPlan
    made: SimulatedTest
    truths: tuple[Truth, ...]

    @property
    def planted(self) -> Planted | None:
        return self.made.planted[0] if self.made.planted else None

    @property
    def label(self) -> str:
        fault = f", {self.planted.disturbance}" if self.planted else ""
        return f"test {self.number} ({self.plan.hits} hits, {self._sensors} sensors{fault})"

    @property
    def _sensors(self) -> int:
        return len(self.plan.sensors_x_m)


def random_case(seed: int, number: int, disturbance: str | None = None) -> Case:
    """Test `number` of a seed; a `disturbance` is planted in place of its own."""
    rng = np.random.default_rng([seed, number])
    hanger, state, plan = _random_test(rng)
    plan = _noisy(hanger, state, plan, rng)
    names = [disturbance] if disturbance else _own_disturbance(number)
    made = simulated_test(hanger, state, plan, rng, disturbances=names)
    return Case(number, hanger, state, plan, made, _truths(hanger, state, plan, made))


def heard_db(planted: Planted, case: Case) -> float:
    """How far a planted foreign resonance stands above the noise, like a mode."""
    ringing = plan_seconds(case.plan) * 2 * math.pi * planted.frequency_hz
    decay = 2 * _foreign_damping(planted, case) * ringing
    rms = planted.acceleration_m_s2 * math.sqrt(-math.expm1(-decay) / decay / 2)
    return 20 * math.log10(rms / case.plan.acceleration_noise_m_s2)


def plan_seconds(plan: HammerPlan) -> float:
    """Seconds of ring-down after a hit."""
    return plan.seconds_per_hit - plan.pre_trigger_s


def _foreign_damping(planted: Planted, case: Case) -> float:
    return case.state.damping_ratio if planted.disturbance == "harmonic" else 0.015


def _own_disturbance(number: int) -> list[str]:
    if number % 10 not in _FAULTY_OF_TEN:
        return []
    kinds = tuple(DISTURBANCES)
    turn = number // 10 * len(_FAULTY_OF_TEN) + _FAULTY_OF_TEN.index(number % 10)
    return [kinds[turn % len(kinds)]]


def _random_hanger(rng: np.random.Generator) -> Hanger:
    """A round steel rod whose first dozen modes a plane reach about 100 Hz."""
    diameter = rng.uniform(0.04, 0.13)
    area = math.pi * diameter**2 / 4
    return Hanger(
        id=1,
        length_m=rng.uniform(6.0, 16.0),
        elastic_modulus_pa=200e9,
        area_m2=area,
        second_moment_m4=math.pi * diameter**4 / 64,
        mass_per_length_kg_m=7800 * area,
        nominal_tension_n=area * rng.uniform(50e6, 250e6),
    )


def _random_test(rng: np.random.Generator) -> tuple[Hanger, HangerState, HammerPlan]:
    hanger = _random_hanger(rng)
    springs = _random_springs(rng)
    # The nominal tension is what the owner believes; the true one differs.
    tension = hanger.nominal_tension_n * rng.uniform(0.8, 1.25)
    state = HangerState(tension, *springs, damping_ratio=10 ** rng.uniform(-3.3, -2.0))
    sensors = np.sort(rng.uniform(0.8, 3.5, int(rng.integers(1, 9)))).round(2)
    plan = HammerPlan(
        hits=int(rng.integers(3, 11)),
        seconds_per_hit=rng.uniform(5.0, 20.0),
        sampling_rate_hz=float(rng.choice([512.0, 1024.0, 2048.0])),
        sensors_x_m=tuple(sensors.tolist()),
        hammer_x_m=round(rng.uniform(1.0, 1.8), 2),
        hammer_angle_deg=rng.uniform(30.0, 60.0),
        pulse_seconds=rng.uniform(0.002, 0.005),
        acceleration_noise_m_s2=0.0,
    )
    return hanger, state, plan


def _random_springs(rng: np.random.Generator) -> NDArray[np.float64]:
    """k1 to k4; in three of ten hangers those of the two planes differ by 0.1 % to a factor 2."""
    springs = 10 ** rng.uniform(4.0, 9.0, 4)
    if rng.random() < _CLOSE_SHARE:
        springs[[1, 3]] = springs[[0, 2]] * 10 ** (10 ** rng.uniform(-3.3, -0.5))
    return np.asarray(springs)


def _noisy(
    hanger: Hanger, state: HangerState, plan: HammerPlan, rng: np.random.Generator
) -> HammerPlan:
    """The plan with noise 20 to 60 dB below the rms acceleration."""
    quiet = hammer_test(hanger, state, replace(plan, hits=1), np.random.default_rng(0))
    rms = math.sqrt(np.mean([np.mean(c.values**2) for c in quiet.accelerations]))
    return replace(plan, acceleration_noise_m_s2=rms * 10 ** (-rng.uniform(20.0, 60.0) / 20))


def _truths(
    hanger: Hanger, state: HangerState, plan: HammerPlan, made: SimulatedTest
) -> tuple[Truth, ...]:
    """The modes in and just beside the band."""
    bare = [truth for plane in PLANES for truth in _plane_truths(hanger, state, plan, made, plane)]
    tones = [each.frequency_hz for each in made.planted if math.isfinite(each.frequency_hz)]
    lines = [order * tone for tone in tones for order in (1, 2)]
    return tuple(
        replace(
            truth,
            merged=_near(truth, [o.frequency_hz for o in bare if o is not truth], _MERGED),
            under_tone=_near(truth, lines, _UNDER_A_TONE),
        )
        for truth in bare
    )


def _plane_truths(
    hanger: Hanger, state: HangerState, plan: HammerPlan, made: SimulatedTest, plane: Plane
) -> list[Truth]:
    modes = plane_modes(hanger, state, plane, 40)
    frequencies = modes.angular_frequency_rad_s / (2 * math.pi)
    snr = _snr_db(modes, plane, state, plan, made.strikes)
    return [
        Truth(plane, index + 1, float(frequency), float(snr[index]))
        for index, frequency in enumerate(frequencies)
        if BAND_HZ[0] / _BEYOND_BAND < frequency < BAND_HZ[1] * _BEYOND_BAND
    ]


def _near(truth: Truth, others: Sequence[float], share: float) -> bool:
    return any(abs(other / truth.frequency_hz - 1) < share for other in others)


def _snr_db(
    modes: PlaneModes,
    plane: Plane,
    state: HangerState,
    plan: HammerPlan,
    strikes: Sequence[Strike],
) -> NDArray[np.float64]:
    """Rms acceleration of each mode over a hit's ring-down at its best sensor, over the noise."""
    omega = modes.angular_frequency_rad_s
    best = np.max(np.abs(modes.at(np.array(plan.sensors_x_m))), axis=0)
    starts = [best * _kick(modes, plane, strike) * omega for strike in strikes]
    level = np.sqrt(np.mean(np.square(starts), axis=0)) if starts else np.zeros_like(omega)
    decay = 2 * state.damping_ratio * omega * plan_seconds(plan)
    rms = level * np.sqrt(-np.expm1(-decay) / decay / 2)
    return np.asarray(20 * np.log10(rms / plan.acceleration_noise_m_s2 + 1e-300))


def _kick(modes: PlaneModes, plane: Plane, strike: Strike) -> NDArray[np.float64]:
    """Velocity that a half sine gives each mode: its spectrum at the mode's frequency."""
    phase = modes.angular_frequency_rad_s * strike.seconds / 2
    spectrum = np.abs(np.cos(phase) / (1 - (2 * phase / math.pi) ** 2))
    impulse = strike.peak_n * strike.share(plane) * 2 * strike.seconds / math.pi
    return np.asarray(np.abs(modes.at(np.array([strike.x_m]))[0]) * np.abs(impulse) * spectrum)
