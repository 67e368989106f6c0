"""The engine without each of its mechanisms, on hangers of eight kinds that others wrote.

python tests/benchmarks/inference_ablation.py --hangers 24 --seed 31

For each mechanism left out: how many updates of beam2 had to be continued by emcee, how many kept
fewer than 200 effective draws, the median and the longest processor time, how much the evidence
differs from that of the whole engine (root mean square of those not continued, and the worst), and
how many intervals hold the tension. A mechanism that changes none of these is to be left out.
"""

from __future__ import annotations

import importlib
import time
from dataclasses import dataclass, replace
from typing import Any

import begin
import numpy as np

from shm.inference import UpdateOptions, update
from shm.inference.problem import starts
from shm.inference.sampler import sampling, valley
from shm.models import build
from tests.benchmarks.left_out import Change, without
from tests.benchmarks.worlds import hanger_and_tests


@dataclass(frozen=True)
class Run:
    """What one update gave."""

    seconds: float
    effective: float
    continued: bool
    log_evidence: float
    holds: bool


def with_settings(module: Any, **settings: Any) -> list[Change]:
    return [(module, "_SET", replace(module._SET, **settings))]


def chances_of_one_width() -> np.ndarray:
    chances = np.full(len(valley._SCALES), 1e-9)
    chances[1] = 1 - chances.sum() + chances[1]
    return chances


VARIANTS: dict[str, list[Change]] = {
    "whole": [],
    "whole, other seed": [],
    "one attempt": with_settings(sampling, attempts=1),
    "three attempts": with_settings(sampling, attempts=3),
    "one valley": with_settings(valley, most_valleys=1),
    "two valleys": with_settings(valley, most_valleys=2),
    "one width at first": [(valley, "_FIRST_CHANCES", chances_of_one_width())],
    "no draw from the prior": with_settings(valley, from_prior=1e-6),
    "optima by density alone": with_settings(sampling, tempered=1.0),
    "half the starts": [(starts, "_STARTS", 6)],
    "half the points along": with_settings(sampling, along=80),
}


def run(case: Any, seed: int) -> Run:
    """Update beam2 of one hanger."""
    hanger, tests = hanger_and_tests(case)
    started = time.process_time()
    found = update(tests, build("beam2", hanger), UpdateOptions(samples=1000, seed=seed))
    low, high = np.quantile(found.tension_n, [0.05, 0.95])
    return Run(
        time.process_time() - started,
        found.effective_sample_size,
        found.method == "emcee",
        found.log_evidence,
        bool(low <= float(case.truth["tension_n"]) <= high),
    )


def row(name: str, runs: list[Run], whole: list[Run]) -> str:
    """Return the table's row of one variant."""
    both = [(a, b) for a, b in zip(runs, whole, strict=True) if not (a.continued or b.continued)]
    off = np.array([a.log_evidence - b.log_evidence for a, b in both])
    seconds = [each.seconds for each in runs]
    return (
        f"| {name} | {sum(r.continued for r in runs)} | {sum(r.effective < 200 for r in runs)} "
        f"| {np.median(seconds):.1f} | {max(seconds):.0f} | {np.sqrt(np.mean(off**2)):.2f} "
        f"| {np.abs(off).max():.2f} | {sum(r.holds for r in runs)} of {len(runs)} |"
    )


def main() -> None:
    """Print the table."""
    asked = begin.options(
        __doc__, hangers=24, seed=31, world="eight_kinds", variants=list(VARIANTS)
    )
    world = importlib.import_module(f"tests.worlds.{asked.world}")
    cases = world.sound_hangers(asked.seed, asked.hangers)
    print("| left out | by emcee | below 200 | s | most | evidence | worst | holds |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |", flush=True)
    whole: list[Run] = []
    for name in asked.variants:
        seed = 2 if name == "whole, other seed" else 1
        with without(VARIANTS[name]):
            runs = [run(case, seed) for case in cases]
        whole = whole or runs
        print(row(name, runs, whole), flush=True)


if __name__ == "__main__":
    main()
