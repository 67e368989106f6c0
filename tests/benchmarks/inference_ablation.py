"""The engine without each of its mechanisms, on hangers of eight kinds that others wrote.

python tests/benchmarks/inference_ablation.py --hangers 24 --seed 31

For each mechanism left out: how many updates of beam2 had to be continued by emcee, how many kept
fewer than 200 effective draws, the median and the longest processor time, how much the evidence
differs from that of the whole engine (root mean square of those not continued, and the worst), and
how many intervals hold the tension. A mechanism that changes none of these is to be left out.
"""

from __future__ import annotations

import argparse
import importlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shm.inference import UpdateOptions, sampling, starts, update, valley
from shm.models import build
from tests.benchmarks.worlds import hanger_and_tests


@dataclass(frozen=True)
class Run:
    """What one update gave."""

    seconds: float
    effective: float
    continued: bool
    log_evidence: float
    holds: bool


def set_to(module: Any, name: str, value: Any) -> Callable[[], None]:
    """Set a module's setting and return what sets it back."""
    before = getattr(module, name)
    setattr(module, name, value)
    return lambda: setattr(module, name, before)


def valley_with(**settings: Any) -> Callable[[], Callable[[], None]]:
    return lambda: set_to(valley, "_SET", replace(valley._SET, **settings))


def sampling_with(**settings: Any) -> Callable[[], Callable[[], None]]:
    return lambda: set_to(sampling, "_SET", replace(sampling._SET, **settings))


def of_one_width() -> Callable[[], None]:
    chances = np.full(len(valley._SCALES), 1e-9)
    chances[1] = 1 - chances.sum() + chances[1]
    return set_to(valley, "_FIRST_CHANCES", chances)


VARIANTS: dict[str, Callable[[], Callable[[], None]]] = {
    "whole": lambda: lambda: None,
    "whole, other seed": lambda: lambda: None,
    "one attempt": sampling_with(attempts=1),
    "three attempts": sampling_with(attempts=3),
    "one valley": valley_with(most_valleys=1),
    "two valleys": valley_with(most_valleys=2),
    "one width at first": of_one_width,
    "no draw from the prior": valley_with(from_prior=1e-6),
    "optima by density alone": sampling_with(tempered=1.0),
    "half the starts": lambda: set_to(starts, "_STARTS", 6),
    "half the points along": sampling_with(along=80),
}


@contextmanager
def variant(name: str) -> Iterator[None]:
    """Run with a mechanism left out."""
    undo = VARIANTS[name]()
    try:
        yield
    finally:
        undo()


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
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--hangers", type=int, default=24)
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--world", default="eight_kinds")
    parser.add_argument("--variants", nargs="*", default=list(VARIANTS))
    asked = parser.parse_args()
    world = importlib.import_module(f"tests.worlds.{asked.world}")
    cases = world.sound_hangers(asked.seed, asked.hangers)
    print("| left out | by emcee | below 200 | s | most | evidence | worst | holds |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |", flush=True)
    whole: list[Run] = []
    for name in asked.variants:
        seed = 2 if name == "whole, other seed" else 1
        with variant(name):
            runs = [run(case, seed) for case in cases]
        whole = whole or runs
        print(row(name, runs, whole), flush=True)


if __name__ == "__main__":
    main()
