"""How often a copy that was altered is known again, and how often distinct hits pass for copies.

`python tests/benchmarks/copies.py 20`: so many recordings a kind, of hanger 3 and, as pairs alone,
the real ones in `shared/data` where that is there.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from shm.plausibility import fingerprint_of
from shm.plausibility.copies import shared
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.values import Channel, Fingerprint, Recording
from tests.helpers.altered import ALTERED
from tests.helpers.hangers import HANGER_3
from tests.helpers.workspaces import START

STATE = HangerState(711e3, 1e7, 1e6, 1e7, 1e8)
MACHINE = {"peak_force_scatter": 0.001, "hit_time_scatter_s": 0.0}
"""A clamped machine that repeats a force to a thousandth and a time to the sample."""
KINDS: dict[str, dict[str, float]] = {
    "by hand, one hit": {"hits": 1},
    "by hand, three hits": {"hits": 3},
    "by machine, one hit": {"hits": 1, **MACHINE},
    "by machine, three hits": {"hits": 3, **MACHINE},
    "by machine, a tenth of the noise": {
        "hits": 3,
        **MACHINE,
        "acceleration_noise_m_s2": 2e-4,
    },
    "by machine, 16 bits": {"hits": 3, **MACHINE, "adc_bits": 16},
}
REAL = Path(__file__).resolve().parents[3] / "shared" / "data" / "pyfrf_hits"


def made(seed: int, plan: dict[str, float]) -> Recording:
    rng = np.random.default_rng(seed)
    return hammer_test(HANGER_3, STATE, HammerPlan(**plan), rng, time=START, source="s")  # type: ignore[arg-type]


def print_of(recording: Recording) -> Fingerprint:
    found = fingerprint_of([recording])
    assert found is not None
    return found


def tell_distinct(name: str, recordings: Sequence[Recording]) -> None:
    pairs = list(itertools.combinations(map(print_of, recordings), 2))
    held = sum(shared(*pair) is not None for pair in pairs)
    print(f"distinct, {name}: {held} of {len(pairs)} pairs pass for copies", flush=True)


def tell_altered(
    name: str, alter: Callable[[Recording], Recording], recordings: Sequence[Recording]
) -> None:
    known = sum(shared(print_of(alter(each)), print_of(each)) is not None for each in recordings)
    print(f"copies, {name}: {known} of {len(recordings)} known", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("number", nargs="?", type=int, default=20)
    number = parser.parse_args().number
    for kind, plan in KINDS.items():
        tell_distinct(kind, [made(seed, plan) for seed in range(number)])
    if REAL.exists():
        rows = [np.load(path)[2] for path in sorted(REAL.glob("*.npy"))]
        hits = [Recording("s", (Channel("a", "acceleration", row),), 25_600.0) for row in rows]
        tell_distinct("five real hits", hits)
    by_hand = [made(seed, KINDS["by hand, three hits"]) for seed in range(number)]
    for name, alter in ALTERED.items():
        tell_altered(name, alter, by_hand)


if __name__ == "__main__":
    main()
