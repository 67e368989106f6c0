"""Are wrong units and exchanged channels doubted, and sound recordings not?

python tests/benchmarks/right_signals.py --tests 40 --seed 2

Simulated hammer tests of rods of 20 to 140 mm by crews of all kinds (hits of 30 N to 8 kN, across,
along and askew, double and soft hits, mains hum, a bridge that moves along).
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import begin
import numpy as np

from shm.identify.plausibility import apparent_mass_kg, ringing, signal_doubts
from shm.simulate.state import HammerPlan, HangerState
from shm.values import Hanger, Recording
from tests.benchmarks.shares import share
from tests.worlds.simulated.hammer import hammer_test

DISTURBED = (["double_hit"], ["soft_hit"], ["mains"], ["deck"], [], [])


def times(record: Recording, factor: float, *names: str) -> Recording:
    channels = (
        replace(c, values=c.values * factor) if c.name in names else c for c in record.channels
    )
    return replace(record, channels=tuple(channels))


def exchanged(record: Recording, name: str) -> Recording:
    values = {channel.name: channel.values for channel in record.channels}
    other = {"force": name, name: "force"}
    channels = (replace(c, values=values[other.get(c.name, c.name)]) for c in record.channels)
    return replace(record, channels=tuple(channels))


def drawn(rng: np.random.Generator) -> tuple[Hanger, HangerState, HammerPlan]:
    """A rod, its state and a crew."""
    diameter = float(np.exp(rng.uniform(np.log(0.02), np.log(0.14))))
    length = float(np.clip(diameter * np.exp(rng.uniform(np.log(60), np.log(250))), 2, 25))
    area = np.pi * diameter**2 / 4
    moment = np.pi * diameter**4 / 64
    hanger = Hanger(1, length, 205e9, area, moment, 7850 * area, 120e6 * area, diameter_m=diameter)
    unit = hanger.bending_stiffness_n_m2 / length
    springs = [float(10 ** rng.uniform(-1.5, 3)) * unit for _ in range(4)]
    tension = float(hanger.nominal_tension_n * rng.uniform(0.4, 1.5))
    state = HangerState(tension, *springs, damping_ratio=float(10 ** rng.uniform(-3.3, -2)))
    low = float(min(rng.uniform(0.8, 2.2), 0.45 * length))
    plan = HammerPlan(
        hits=3,
        seconds_per_hit=8.0,
        sampling_rate_hz=float(rng.choice([512.0, 1024.0])),
        sensors_x_m=(low, min(1.5 * low, 0.48 * length)),
        hammer_x_m=float(min(rng.uniform(0.8, 2.0), 0.4 * length)),
        hammer_angle_deg=float(rng.choice([45.0, 5.0, 80.0, 30.0])),
        peak_force_n=float(10 ** rng.uniform(1.5, 3.9)),
        pulse_seconds=float(rng.choice([0.002, 0.004, 0.008])),
    )
    return hanger, state, plan


def main() -> None:
    args = begin.options(__doc__, tests=10, seed=1)
    rng = np.random.default_rng(args.seed)
    masses, apart, found = [], [], defaultdict(list)
    for number in range(args.tests):
        hanger, state, plan = drawn(rng)
        record = hammer_test(
            hanger, state, plan, rng, disturbances=DISTURBED[number % len(DISTURBED)]
        )
        names = [channel.name for channel in record.accelerations]
        one, mass_kg = str(rng.choice(names)), apparent_mass_kg(record)
        masses.append(mass_kg / hanger.mass_per_length_kg_m / hanger.length_m)
        rate = record.sampling_rate_hz
        assert record.force is not None
        least = min(ringing(channel.values, rate) for channel in record.accelerations)
        apart.append(least / ringing(record.force.values, rate))
        cases = {"right": record, "force and an accelerometer exchanged": exchanged(record, one)}
        for factor in (1000.0, 0.001):
            cases[f"force x {factor:g}"] = times(record, factor, "force")
            cases[f"all accelerations x {factor:g}"] = times(record, factor, *names)
            cases[f"one acceleration x {factor:g}"] = times(record, factor, one)
        for name, case in cases.items():
            found[name].append(bool(signal_doubts([case], hanger)))
    for name, doubts in found.items():
        print(f"{name:38s} doubted {share(sum(doubts), len(doubts))}")
    print(f"J/v over the hanger's mass: {min(masses):.2f} to {max(masses):.2f}")
    print(f"accelerometers ring at least {min(apart):.1f} times as much as the force")


if __name__ == "__main__":
    main()
