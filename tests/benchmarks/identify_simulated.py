"""How well `identify` does on simulated hammer tests of random hangers.

    python tests/benchmarks/identify_simulated.py --tests 50

Random are tension, length, diameter, end springs, damping (0.05 to 1 %), noise (20 to 60 dB below
the accelerations), sensors (1 to 4 biaxial), hits (3 to 10 of 5 to 20 s). A mode counts where its
ring-down is 20 dB above the noise (rms over the hits, at its best sensor). Two modes of the two
planes nearer than 0.1 %, hit from one direction, move as one: they are counted apart.
Set OMP_NUM_THREADS=1 for the seconds of one core.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from shm.errors import NotIdentifiable
from shm.identify import Identification, IdentifyOptions, identify
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.simulate.elements import PlaneModes, plane_modes
from shm.values import PLANES, Hanger, Mode, Plane

LEAST_SNR_DB = 20.0
SAME_MODE = 0.003
MERGED = 0.001
BAND_HZ = (2.0, 100.0)


@dataclass(frozen=True)
class Truth:
    """One mode of the simulated hanger in the band."""

    plane: Plane
    order: int
    frequency_hz: float
    snr_db: float


@dataclass
class Score:
    """Counts and errors over all tests."""

    expected: int = 0
    found: int = 0
    merged_expected: int = 0
    merged_found: int = 0
    reported: int = 0
    false: int = 0
    misplaced: int = 0
    seconds: list[float] = field(default_factory=list)
    frequency_errors: list[float] = field(default_factory=list)
    frequency_z: list[float] = field(default_factory=list)
    damping_errors: list[float] = field(default_factory=list)
    damping_z: list[float] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def random_hanger(rng: np.random.Generator) -> Hanger:
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


def random_test(
    rng: np.random.Generator, hits: int | None = None
) -> tuple[Hanger, HangerState, HammerPlan]:
    hanger = random_hanger(rng)
    springs = 10 ** rng.uniform(4.0, 9.0, 4)
    state = HangerState(
        hanger.nominal_tension_n, *springs, damping_ratio=10 ** rng.uniform(-3.3, -2.0)
    )
    sensors = np.sort(rng.uniform(0.8, 3.5, int(rng.integers(1, 5)))).round(2)
    plan = HammerPlan(
        hits=hits or int(rng.integers(3, 11)),
        seconds_per_hit=rng.uniform(5.0, 20.0),
        sampling_rate_hz=float(rng.choice([512.0, 1024.0, 2048.0])),
        sensors_x_m=tuple(sensors),
        hammer_x_m=round(rng.uniform(1.0, 1.8), 2),
        hammer_angle_deg=rng.uniform(30.0, 60.0),
        pulse_seconds=rng.uniform(0.002, 0.005),
        acceleration_noise_m_s2=0.0,
    )
    return hanger, state, plan


def noisy(
    hanger: Hanger, state: HangerState, plan: HammerPlan, rng: np.random.Generator
) -> HammerPlan:
    """The plan with noise 20 to 60 dB below the rms acceleration."""
    quiet = hammer_test(hanger, state, replace(plan, hits=1), np.random.default_rng(0))
    rms = math.sqrt(np.mean([np.mean(c.values**2) for c in quiet.accelerations]))
    return replace(plan, acceleration_noise_m_s2=rms * 10 ** (-rng.uniform(20.0, 60.0) / 20))


def truths(hanger: Hanger, state: HangerState, plan: HammerPlan) -> list[Truth]:
    """The modes in the band and how far each stands above the noise."""
    result = []
    for plane in PLANES:
        modes = plane_modes(hanger, state, plane, 40)
        levels = _levels(modes, plane, state, plan)
        for index, omega in enumerate(modes.angular_frequency_rad_s):
            frequency = float(omega / (2 * math.pi))
            if BAND_HZ[0] < frequency < BAND_HZ[1]:
                snr = 20 * math.log10(levels[index] / plan.acceleration_noise_m_s2 + 1e-300)
                result.append(Truth(plane, index + 1, frequency, snr))
    return result


def _levels(
    modes: PlaneModes, plane: Plane, state: HangerState, plan: HammerPlan
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Rms acceleration of each mode's ring-down over a hit, at its best sensor, in m/s^2."""
    omega = modes.angular_frequency_rad_s
    angle = math.radians(plan.hammer_angle_deg)
    push = plan.peak_force_n * (math.cos(angle) if plane == "transverse" else math.sin(angle))
    width = plan.pulse_seconds
    phase = omega * width / 2
    shape = np.abs(np.cos(phase) / (1 - (2 * phase / math.pi) ** 2))
    impulse = push * 2 * width / math.pi * shape
    best = np.max(np.abs(modes.at(np.array(plan.sensors_x_m))), axis=0)
    start = best * np.abs(modes.at(np.array([plan.hammer_x_m]))[0]) * omega * impulse
    decay = 2 * state.damping_ratio * omega * (plan.seconds_per_hit - plan.pre_trigger_s)
    return np.asarray(start * np.sqrt(-np.expm1(-decay) / decay / 2))


def score_test(
    score: Score, label: str, truth: Sequence[Truth], result: Identification | None, damping: float
) -> None:
    """Adds one test to the score."""
    modes = list(result.test.modes) if result else []
    score.reported += len(modes)
    for expected in sorted(truth, key=lambda t: -t.snr_db):
        mode = _nearest(modes, expected)
        _count(score, label, expected, _is_merged(expected, truth), mode is not None)
        if mode is not None:
            modes.remove(mode)
            _add_mode(score, label, expected, mode, damping)
    score.false += len(modes)
    score.remarks += [
        f"{label}: false {m.plane} {m.order} {m.frequency_hz:.3f} Hz, "
        f"damping {m.damping_ratio:.4f}, sd {m.frequency_sd_hz:.4f}"
        for m in modes
    ]


def _nearest(modes: Sequence[Mode], expected: Truth) -> Mode | None:
    """The mode taken for the expected one: near it, in its plane if any is."""
    near = [m for m in modes if abs(m.frequency_hz / expected.frequency_hz - 1) < SAME_MODE]
    return min(
        near,
        key=lambda m: (m.plane != expected.plane, abs(m.frequency_hz - expected.frequency_hz)),
        default=None,
    )


def _is_merged(mode: Truth, truth: Sequence[Truth]) -> bool:
    others = [other for other in truth if other is not mode]
    return any(abs(other.frequency_hz / mode.frequency_hz - 1) < MERGED for other in others)


def _count(score: Score, label: str, expected: Truth, merged: bool, found: bool) -> None:
    if expected.snr_db < LEAST_SNR_DB:
        return
    if merged:
        score.merged_expected += 1
        score.merged_found += found
        return
    score.expected += 1
    score.found += found
    if not found:
        score.remarks.append(f"{label}: missed {expected}")


def _add_mode(score: Score, label: str, expected: Truth, mode: Mode, damping: float) -> None:
    if (mode.plane, mode.order) != (expected.plane, expected.order):
        score.misplaced += 1
        score.remarks.append(f"{label}: {expected} is called {mode.plane} {mode.order}")
    error = mode.frequency_hz / expected.frequency_hz - 1
    score.frequency_errors.append(error)
    score.frequency_z.append((mode.frequency_hz - expected.frequency_hz) / mode.frequency_sd_hz)
    score.damping_errors.append(mode.damping_ratio / damping - 1)
    score.damping_z.append((mode.damping_ratio - damping) / mode.damping_sd)


def run(tests: int, seed: int, hits: int | None = None) -> Score:
    score = Score()
    for number in range(tests):
        rng = np.random.default_rng([seed, number])
        hanger, state, plan = random_test(rng, hits)
        plan = noisy(hanger, state, plan, rng)
        recording = hammer_test(hanger, state, plan, rng)
        began = time.process_time()
        try:
            result = identify(
                [recording],
                IdentifyOptions(*BAND_HZ),
                test_id=f"t{number}",
                hanger=hanger,
            )
        except NotIdentifiable as error:
            score.remarks.append(f"test {number}: {error}")
            result = None
        score.seconds.append(time.process_time() - began)
        label = f"test {number} ({plan.hits} hits, {len(plan.sensors_x_m)} sensors)"
        if result:
            dropped_hits = [h for h in result.hits if not h.used]
            score.remarks += [f"{label}: hit dropped: {h.reason}" for h in dropped_hits]
            if len(result.hits) != plan.hits:
                score.remarks.append(f"{label}: {len(result.hits)} hits found of {plan.hits}")
        score_test(score, label, truths(hanger, state, plan), result, state.damping_ratio)
    return score


def robust_sd(values: Sequence[float]) -> float:
    return float(1.4826 * np.nanmedian(np.abs(values)))


def coverage(values: Sequence[float]) -> float:
    """Percentage inside the 90 % interval."""
    return float(100 * np.mean(np.abs(values) < 1.645))


def report(score: Score) -> str:
    errors = np.abs(score.frequency_errors)
    rows = (
        (
            "modes above 20 dB found",
            f"{100 * score.found / score.expected:.2f} % of {score.expected}",
        ),
        (
            "of two nearer than 0.1 % found",
            f"{100 * score.merged_found / max(score.merged_expected, 1):.1f} % of "
            f"{score.merged_expected}",
        ),
        ("false modes", f"{100 * score.false / score.reported:.2f} % of {score.reported}"),
        ("wrong plane or order", f"{100 * score.misplaced / score.reported:.2f} %"),
        ("median frequency error", f"{100 * np.median(errors):.6f} %"),
        ("largest frequency error", f"{100 * np.max(errors):.4f} %"),
        ("frequency z, robust sd", f"{robust_sd(score.frequency_z):.2f}"),
        ("frequency 90 % interval covers", f"{coverage(score.frequency_z):.1f} %"),
        ("median damping error", f"{100 * np.median(np.abs(score.damping_errors)):.3f} %"),
        ("damping z, robust sd", f"{robust_sd(score.damping_z):.2f}"),
        ("damping 90 % interval covers", f"{coverage(score.damping_z):.1f} %"),
        (
            "seconds a test",
            f"{np.mean(score.seconds):.2f} (at most {max(score.seconds):.2f}), of one core",
        ),
    )
    return "\n".join(f"{name:34}{value}" for name, value in rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tests", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--hits", type=int, default=None, help="hits a test (default: 3 to 10)")
    parser.add_argument("--remarks", action="store_true", help="list what went wrong")
    arguments = parser.parse_args()
    score = run(arguments.tests, arguments.seed, arguments.hits)
    if arguments.remarks:
        print("\n".join(score.remarks))
    print(report(score))


if __name__ == "__main__":
    main()
