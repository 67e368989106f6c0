"""Do 90 % intervals of tension cover the truth? Simulated tests, the whole way.

Each case plants a random tension and random end springs in a finite-element hanger, hits it with a
hammer in the time domain while traffic shakes the bridge (0.1 m/s^2), identifies the modes and
updates Beam 2. Run:

    python tests/benchmarks/tension_coverage.py --cases 100
"""

from __future__ import annotations

import time

import begin
import numpy as np
from rich.progress import track

from shm.identify import IdentifyOptions, identify
from shm.inference import UpdateOptions, update
from shm.models import THESIS, build
from shm.simulate import HammerPlan, HangerState
from shm.values import Hanger, Posterior
from tests.worlds.simulated.hammer import hammer_test

DIAMETER_M = 0.130
HANGER = Hanger(
    id=3,
    length_m=12.0,
    elastic_modulus_pa=200e9,
    area_m2=np.pi * DIAMETER_M**2 / 4,
    second_moment_m4=np.pi * DIAMETER_M**4 / 64,
    mass_per_length_kg_m=7800 * np.pi * DIAMETER_M**2 / 4,
    nominal_tension_n=711e3,
)


def planted(rng: np.random.Generator) -> HangerState:
    """A random truth: tension 0.6 to 1.8 of nominal, springs 10^6 to 10^9 N m/rad."""
    k1, k2, k3, k4 = 10 ** rng.uniform(6, 9, 4)
    tension = rng.uniform(0.6, 1.8) * HANGER.nominal_tension_n
    return HangerState(tension, k1, k2, k3, k4, damping_ratio=10 ** rng.uniform(-3.2, -2.3))


def posterior_of(case: int, samples: int) -> tuple[HangerState, Posterior]:
    """The truth of a case and the posterior that its recordings lead to."""
    rng = np.random.default_rng(case)
    state = planted(rng)
    plan = HammerPlan(hits=5, seconds_per_hit=10.0, acceleration_noise_m_s2=0.1)
    recording = hammer_test(HANGER, state, plan, rng)
    found = identify([recording], IdentifyOptions(), test_id=str(case), hanger=HANGER)
    options = UpdateOptions(samples=samples, seed=case)
    return state, update([found.test], build("beam2", HANGER, THESIS), options)


def main() -> None:
    """Runs the trial and prints its figures."""
    arguments = begin.options(__doc__, cases=100, first=1000, samples=500)
    started = time.perf_counter()
    covered, errors, widths, effective = 0, [], [], []
    for case in track(range(arguments.first, arguments.first + arguments.cases), "tests"):
        state, posterior = posterior_of(case, arguments.samples)
        low, high = np.quantile(posterior.tension_n, [0.05, 0.95])
        covered += int(low < state.tension_n < high)
        errors.append(abs(np.median(posterior.tension_n) / state.tension_n - 1))
        widths.append((high - low) / state.tension_n)
        effective.append(posterior.effective_sample_size)
    print(f"90 % interval covers the truth in {covered} of {arguments.cases} tests")
    print(f"error of the median: {np.median(errors):.2%} (largest {max(errors):.2%})")
    print(f"width of the interval: median {np.median(widths):.2%}")
    print(f"effective samples of {arguments.samples}: {min(effective):.0f} at least")
    print(f"{(time.perf_counter() - started) / arguments.cases:.1f} s a test")


if __name__ == "__main__":
    main()
