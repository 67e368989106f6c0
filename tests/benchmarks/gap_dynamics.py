"""What the whole chain says of hangers that knock, crack or slip, from hammer records in time.

python tests/benchmarks/gap_dynamics.py --cases 8 --seed 300

Bars of `tests/worlds/struck_bar.py`, hit softly and four times as hard, identified and diagnosed;
of four one is sound, one has a guide with play, one a crack that opens, one a joint that slips. The
catalogue is cut to seven effects for time. One process; two minutes of one core a case.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shm.errors import NotIdentifiable  # noqa: E402
from shm.gap import GapOptions, diagnose  # noqa: E402
from shm.values import ModalTest  # noqa: E402
from tests.helpers.effects import all_but  # noqa: E402
from tests.helpers.struck import STRUCK, identified  # noqa: E402
from tests.worlds import struck_bar as world  # noqa: E402

KINDS = ("guide", "sound", "crack", "joint")
TRIED = (
    "joint_softening", "geometric_hardening", "rotational_end_flexibility",
    "intermediate_support", "bending_stiffness", "point_mass", "section_loss",
)  # fmt: skip
LEVELS = (0.25, 1.0)
SWING_M, MOMENT_NM = 4.4e-5, 200.0  # of a hit of the crew at level 1, in the middle third


def drawn(kind: str, rng: np.random.Generator) -> world.Part | None:
    bar = world.Bar()
    x_m = rng.uniform(0.1, 0.9) * bar.length_m
    if kind == "guide":
        chord = bar.tension_n / bar.length_m
        gap = rng.uniform(0.25, 0.8) * SWING_M * max(0.3, np.sin(np.pi * x_m / bar.length_m))
        return world.Guide(x_m, chord * 30.0 ** rng.uniform(), gap)
    if kind == "crack":
        return world.Crack(x_m, 3e-9 * 100 ** rng.uniform(), rng.uniform(0.05, 0.5) * MOMENT_NM)
    if kind == "joint":
        return world.Joint(3e-9 * 17 ** rng.uniform(), 550.0)
    return None


def tests_of(part: world.Part | None, seed: int) -> list[ModalTest]:
    """Those that can be identified."""
    found = []
    for number, level in enumerate(LEVELS):
        try:
            name = f"t{number + 1}"
            made = identified(part, level, [seed, number], name, world.Crew(hits=4))
        except NotIdentifiable:
            continue
        found.append(made.test)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=8)
    parser.add_argument("--seed", type=int, required=True)
    given = parser.parse_args()
    counts: Counter[tuple[str, str]] = Counter()
    for case in range(given.cases):
        kind, seed = KINDS[case % len(KINDS)], given.seed + case // len(KINDS)
        tests = tests_of(drawn(kind, np.random.default_rng(seed)), seed)
        said = "no mode can be trusted"
        if tests:
            found = diagnose(tests, STRUCK, GapOptions(without=all_but(*TRIED), draws=300))
            best = found.leading.effect if found.leading else ""
            said = f"{found.verdict.outcome.value} {best}".strip()
        print(f"{kind} {seed}: {said}", flush=True)
        counts[kind, said] += 1
    for (kind, said), count in sorted(counts.items()):
        print(f"{kind:6} {count:3}  {said}")


if __name__ == "__main__":
    main()
