"""How long everyday steps take, in seconds of this process's processor time, beside their limits.

    python tests/benchmarks/durations.py
    python tests/benchmarks/durations.py --repeats 1

The best of some repeats; a limit is twice to ten times what a laptop takes. Exit code 1 where one
is missed.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import begin
import numpy as np

from shm.identify import IdentifyOptions
from shm.monitor import read_window
from shm.read import read, write
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.values import Channel, Hanger, Recording
from tests.helpers.ambient_stream import LENGTH_M, drawn, piece, stream, values
from tests.worlds.network_seasons import season


def steps(folder: Path) -> Iterator[tuple[str, float, Callable[[], float]]]:
    """Yield what is measured, its limit in seconds, and what does it once and returns seconds."""
    names = ["force", "acc_1", "acc_2", "acc_3", "acc_4"]
    rows = np.random.default_rng(1).standard_normal((5, 100_000))
    channels = tuple(
        Channel(name, "acceleration" if number else "force", row)
        for number, (name, row) in enumerate(zip(names, rows, strict=True))
    )
    path = folder / "test.csv"
    write(Recording("", channels, 2048.0), path)
    yield "read a CSV of 100,000 rows and five columns", 0.5, timed(lambda: read(path))

    bar, generator = Hanger(3, 12.0, 200e9, 0.0133, 1.4e-5, 103.5, 711e3), np.random.default_rng
    plan, state = HammerPlan(), HangerState(711e3)
    yield (
        "simulate a hammer test",
        0.3,
        timed(lambda: hammer_test(bar, state, plan, generator(3))),
    )

    strand = Hanger(3, LENGTH_M, 2.1e11, 5.03e-3, 2.01e-6, 39.5, 400e3)
    rng, options = generator(11), IdentifyOptions(band_high_hz=60.0)
    motion = drawn(rng)
    pieces = [piece(values(motion, rng))]
    yield (
        "track ten minutes of four channels of 200 Hz, ten modes",
        0.3,
        timed(lambda: read_window(pieces, stream(), motion.known(), strand, options)),
    )
    yield "make a season of thirty hangers", 15.0, timed(lambda: season(1))
    yield "import shm", 0.1, import_shm


def timed(does: Callable[[], object]) -> Callable[[], float]:
    """Return what does a step and measures it."""

    def measure() -> float:
        began = time.process_time()
        does()
        return time.process_time() - began

    return measure


def import_shm() -> float:
    """Return the seconds that `import shm` takes in a process of its own."""
    code = "import time; t = time.process_time(); import shm; print(time.process_time() - t)"
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=begin.ROOT, capture_output=True, text=True, check=True
    )
    return float(ran.stdout)


def main() -> int:
    """Print the table; return 1 where a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3)
    repeats, missed = parser.parse_args().repeats, 0
    with tempfile.TemporaryDirectory() as folder:
        for name, limit_s, measure in steps(Path(folder)):
            best_s = min(measure() for _ in range(repeats))
            missed += best_s >= limit_s
            print(f"{name}: {best_s:.3f} s (limit {limit_s:g} s)")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
