"""The diagnosis of any simulator on three textbook systems that are no hangers.

Of each system some cases with the effect planted, some sound ones, and the planted ones again with
the true effect taken out of the catalogue. Marks: named first or in its group >= 0.9, false alarms
<= 0.03, blamed <= 0.05 where the true effect is missing and what is blamed was not in its group.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from shm.gap.simulator.any_simulator import SimulatorDiagnosis, diagnose_simulator
from shm.gap.simulator.simulator_problem import Reading, Simulator
from tests.helpers.textbook_simulators import CANTILEVER, FRAME, OSCILLATOR
from tests.worlds.textbook_systems import Read, cantilever, frame, oscillator

World = Callable[[np.random.Generator, float], list[Read]]
SYSTEMS: dict[str, tuple[Simulator, World, str, tuple[float, float]]] = {
    "frame": (FRAME, frame, "loose_joint", (1e-4, 6e-4)),
    "cantilever": (CANTILEVER, cantilever, "support_moves", (5e-8, 6e-7)),
    "oscillator": (OSCILLATOR, oscillator, "friction", (0.8, 5.0)),
}


def diagnosed(
    system: str, seed: int, planted: bool, without: bool = False
) -> tuple[SimulatorDiagnosis, float]:
    """One case and how long its diagnosis took, in seconds."""
    simulator, world, true, sizes = SYSTEMS[system]
    rng = np.random.default_rng([seed, planted])
    size = float(np.exp(rng.uniform(*np.log(sizes)))) if planted else 0.0
    readings = [Reading(*each) for each in world(rng, size)]
    if without:
        left = [each for each in simulator.effects if each.name != true]
        simulator = replace(simulator, effects=left)
    start = time.perf_counter()
    return diagnose_simulator(simulator, readings, seed=seed), time.perf_counter() - start


def trial(system: str, cases: int, first_seed: int) -> None:
    """Prints a line of what came out."""
    true = SYSTEMS[system][2]
    count: Counter[str] = Counter()
    seconds = []
    for seed in range(first_seed, first_seed + cases):
        sound, took = diagnosed(system, seed, planted=False)
        seconds.append(took)
        others = [*(each.probability for each in sound.causes), sound.unexplained_probability]
        count["beaten"] += sound.no_gap_probability < max(others)
        count["alarm"] += sound.no_gap_probability < 0.05
        full, took = diagnosed(system, seed, planted=True)
        seconds.append(took)
        count["first"] += full.named[:1] == (true,)
        count["named"] += true in full.named
        left, took = diagnosed(system, seed, planted=True, without=True)
        seconds.append(took)
        mimics = set(full.named) - {true}
        count["blamed"] += bool(set(left.named) - mimics)
        count["unknown"] += left.unexplained_probability > max(e.probability for e in left.causes)
        if true not in full.named or left.named or sound.no_gap_probability < max(others):
            print(f"  seed {seed}: full {full.named}, left out {left.named}, sound {others}")
    shares = ", ".join(
        f"{name} {count[name]}/{cases}"
        for name in ("first", "named", "beaten", "alarm", "blamed", "unknown")
    )
    print(f"{system}: {shares}; {np.median(seconds):.1f} s (most {max(seconds):.1f} s)", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=30)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--systems", nargs="+", default=list(SYSTEMS))
    given = parser.parse_args()
    for each in given.systems:
        trial(each, given.cases, given.first_seed)
