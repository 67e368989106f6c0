"""How long one test takes on one core, part by part.

    python tests/benchmarks/identify_seconds.py

Eight biaxial sensors, five hits, 60 s at 2048 Hz: 17 channels of 122,880 samples. Processor time,
median of five runs; exits 1 at 2 s or more. Set OMP_NUM_THREADS=1 and OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import cProfile
import math
import pstats
import sys
import time
from pathlib import Path

import begin
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

import shm.identify
from shm.identify import Identification, IdentifyOptions, identify
from shm.simulate import HammerPlan, HangerState, spread_places_m
from shm.values import Hanger, Recording
from tests.worlds.simulated.hammer import hammer_test

MOST_SECONDS = 2.0
_ROOM = Path(shm.identify.__file__).parent
_DIAMETER_M = 0.08
_AREA_M2 = math.pi * _DIAMETER_M**2 / 4
HANGER = Hanger(
    id=1,
    length_m=10.0,
    elastic_modulus_pa=200e9,
    area_m2=_AREA_M2,
    second_moment_m4=math.pi * _DIAMETER_M**4 / 64,
    mass_per_length_kg_m=7800 * _AREA_M2,
    nominal_tension_n=_AREA_M2 * 100e6,
)


def recording() -> Recording:
    """The test, always the same."""
    state = HangerState(HANGER.nominal_tension_n, 1e6, 3e6, 2e6, 1e7, damping_ratio=0.002)
    plan = HammerPlan(
        hits=5,
        seconds_per_hit=12.0,
        sampling_rate_hz=2048.0,
        sensors_x_m=spread_places_m(HANGER, 8),
        acceleration_noise_m_s2=0.02,
    )
    return hammer_test(HANGER, state, plan, np.random.default_rng(1))


def identified(record: Recording) -> Identification:
    return identify([record], IdentifyOptions(), test_id="seconds", hanger=HANGER)


def seconds_of(record: Recording) -> float:
    began = time.process_time()
    identified(record)
    return time.process_time() - began


def parts(record: Recording) -> list[tuple[str, float]]:
    """Share of each file of the room in percent, with what it calls outside of the room."""
    profile = cProfile.Profile(time.process_time)
    profile.runcall(identified, record)
    shares: dict[str, float] = {}
    stats = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    for (file, _, _), (_, _, own, _, callers) in stats.items():
        if _ROOM in Path(file).parents:
            shares[_name(file)] = shares.get(_name(file), 0.0) + own
        else:
            _charge(shares, stats, callers, own)
    total = sum(shares.values())
    ranked = sorted(shares.items(), key=lambda item: -item[1])
    return [(name, 100 * value / total) for name, value in ranked]


def _charge(shares, stats, callers, own, depth=0):  # type: ignore[no-untyped-def]
    """Own time of a library's function goes to the files of the room that led to it."""
    total = sum(edge[2] for edge in callers.values())
    for caller, edge in callers.items():
        share = own * edge[2] / total if total else 0.0
        if _ROOM in Path(caller[0]).parents:
            shares[_name(caller[0])] = shares.get(_name(caller[0]), 0.0) + share
        elif depth < 12 and caller in stats and share > 1e-6:
            _charge(shares, stats, stats[caller][4], share, depth + 1)


def _name(file: str) -> str:
    return Path(file).relative_to(_ROOM).with_suffix("").as_posix()


def main() -> int:
    arguments = begin.options(__doc__, runs=5)
    record, console = recording(), Console(highlight=False)
    found = identified(record)  # the first run imports what is imported late
    progress = Console(stderr=True)
    seconds = [seconds_of(record) for _ in track(range(arguments.runs), "runs", console=progress)]
    grid = Table("part", "share")
    for name, share in parts(record):
        if share >= 0.5:
            grid.add_row(name, f"{share:.1f} %")
    console.print(grid)
    middle = float(np.median(seconds))
    verdict = "met" if middle < MOST_SECONDS else "MISSED"
    console.print(
        f"{len(found.test.modes)} modes; {middle:.2f} s of one core (median of {len(seconds)}, "
        f"{min(seconds):.2f} to {max(seconds):.2f}); mark {MOST_SECONDS:g} s: {verdict}"
    )
    return int(middle >= MOST_SECONDS)


if __name__ == "__main__":
    sys.exit(main())
