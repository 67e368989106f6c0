"""Time a bar made of terms in a reduced basis, and compare it with all its elements (record 0008).

python tests/benchmarks/bar_of_terms.py

Bars with two fittings, springs from hinge to clamp and sag, drawn anew: functions of the basis, the
worst frequency of 300 of them against all elements, microseconds a bar for frequencies alone and
with slopes by twelve parameters. Mark: no frequency is off by more than 2e-4.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shm.models.reduced_bar import BarTerms, ReducedBar  # noqa: E402

BARS, MOST_OFF = 300, 2e-4
ZONES = [(0.0, 0.04), (0.96, 1.0)]


def drawn(rng: np.random.Generator, count: int, xi: float, shears: bool) -> BarTerms:
    """Return hangers of about one slenderness, uncertain in all else."""
    return BarTerms(
        tension=xi**2 * np.exp(rng.normal(0, 0.4, count)),
        springs=10 ** rng.uniform(-1.5, 4, (count, 2, 2)),
        stiffness=np.exp(rng.normal(2, 0.7, (count, 2))),
        mass=np.exp(rng.normal(1.2, 0.4, (count, 2))),
        sag=rng.exponential(50, count),
        shear=np.full(count, 5e3 if shears else np.nan),
        turning=np.full(count, 1e-4),
        point_masses=np.empty((count, 0)),
    )


def main() -> None:
    """Print the table; raise SystemExit where a frequency is off by more than the mark."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    print("L sqrt(T/EI)  modes  shear  functions  worst off  us a bar  us with slopes")
    for xi in (2.0, 20.0, 100.0):
        for modes in (6, 12):
            for shears in (False, True):
                rng = np.random.default_rng(1)
                reduced = ReducedBar(ZONES, drawn(rng, 60, xi, shears), modes)
                bars = drawn(rng, BARS, xi, shears)
                exact = reduced.full_frequencies(bars)
                started = time.perf_counter()
                found = reduced.frequencies(bars)
                alone = time.perf_counter()
                reduced.modes_about(
                    bars, [replace(bars, tension=1.001 * bars.tension)] * 12, np.empty(0)
                )
                sloped = time.perf_counter()
                off = float(np.abs(found / exact - 1).max())
                print(
                    f"{xi:12g}  {modes:5}  {shears!s:5}  {reduced.basis.shape[1]:9}  {off:9.1e}  "
                    f"{(alone - started) / BARS * 1e6:8.0f}  {(sloped - alone) / BARS * 1e6:14.0f}"
                )
                if off > MOST_OFF:
                    raise SystemExit("a frequency of the reduced basis is off")


if __name__ == "__main__":
    main()
