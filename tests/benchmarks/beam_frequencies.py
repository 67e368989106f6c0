"""What the 12 frequencies of one parameter set of Beam 2 cost, and how wrong they are.

Batches are drawn from the prior box of hanger 3. The time is that of the whole call that the
sampler pays, `Beam2.frequencies_hz(theta, 6)`, and of the bare solver, in processor time: the
median of repeats, and the least, which is judged, as other work on the machine only adds. The error
is the largest over tensions xi of 0.05 to 2000, springs of 0, 1e-6 to 1e8 and infinity and 40
modes, against bisection on the count of modes by dynamic stiffness in extended precision. Exits 1
where a bound fails. Run on one thread:

    OMP_NUM_THREADS=1 python tests/benchmarks/beam_frequencies.py
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from shm.models import build
from shm.models.tensioned_beam import wave_numbers
from tests.helpers.beam_count import roots_by_counting
from tests.helpers.hangers import HANGER_3

SETS, MODES = (250, 1000, 4000), 6
MOST_MICROSECONDS = 3.0
"""The goal of 2 is met where numpy finds AVX-512; it was 2.3 without."""
MOST_ERROR = 1e-10


def microseconds(call: Callable[[], object], sets: int, repeats: int) -> tuple[float, float]:
    """Processor time of one of the `sets` parameter sets of a call: median and least of repeats."""
    calls = max(1, 4000 // sets)
    taken = []
    for _ in range(repeats):
        started = time.process_time()
        for _ in range(calls):
            call()
        taken.append((time.process_time() - started) / (calls * sets) * 1e6)
    return float(np.median(taken)), min(taken)


def cost(sets: int, repeats: int, rng: np.random.Generator) -> float:
    """Prints what 12 frequencies cost; returns the least microseconds of the whole call."""
    model = build("beam2", HANGER_3)
    theta = rng.uniform(model.prior.lower, model.prior.upper, (sets, len(model.prior.names)))
    whole = microseconds(lambda: model.frequencies_hz(theta, MODES), sets, repeats)
    xi, (ka, kb) = rng.uniform(2, 20, (sets, 1)), 10 ** rng.uniform(-1, 7, (2, sets, 2))
    bare = microseconds(lambda: wave_numbers(xi, ka, kb, MODES), sets, repeats)
    print(f"{sets:4d} {whole[0]:9.2f} {whole[1]:5.2f} {bare[0]:9.2f} {bare[1]:5.2f}")
    return whole[1]


def worst_error(sets: int, rng: np.random.Generator) -> float:
    """The largest relative error of Omega = q sqrt(xi^2 + q^2) over 40 modes."""
    xi, (ka, kb) = (
        10 ** rng.uniform(np.log10(0.05), np.log10(2000), sets),
        10 ** rng.uniform(-6, 8, (2, sets)),
    )
    ka[::5], kb[::7], ka[1::9], kb[2::8] = np.inf, np.inf, 0, 0
    exact, found = roots_by_counting(xi, ka, kb, 40), wave_numbers(xi, ka, kb, 40)
    squared = xi.astype(exact.dtype)[:, None] ** 2
    exact_omega, omega = (q * np.sqrt(squared + q**2) for q in (exact, found))
    return float(np.abs(omega / exact_omega - 1).max())


def main() -> int:
    """Runs the trial and prints its figures; 1 where a bound fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=50)
    parser.add_argument("--checked", type=int, default=500, help="parameter sets checked")
    arguments = parser.parse_args()
    rng = np.random.default_rng(1)
    print("microseconds per 12 frequencies, median and least")
    print("sets    whole call     bare solver")
    slowest = max(cost(sets, arguments.repeats, rng) for sets in SETS)
    error = worst_error(arguments.checked, rng)
    print(f"largest relative error of {arguments.checked} sets x 40 modes: {error:.1e}")
    kept = slowest <= MOST_MICROSECONDS and error <= MOST_ERROR
    bounds = f"{MOST_MICROSECONDS:g} microseconds, {MOST_ERROR:g}"
    print(f"bounds ({bounds}): {'kept' if kept else 'FAILED'}")
    return 0 if kept else 1


if __name__ == "__main__":
    raise SystemExit(main())
