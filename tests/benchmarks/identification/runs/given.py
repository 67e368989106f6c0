"""What every identifier is given, and the line in which it answers.

A file with `acceleration` (channels, samples) in m/s^2, `force` (samples,) in N, both at `rate` Hz,
`accelerance` (channels, lines) over `frequency` (lines,), the `band` in Hz, and `told` (modes,):
frequencies that somebody who knows the hanger would tell, within 1 % of the truth.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Given:
    """One test."""

    acceleration: NDArray[np.float64]
    force: NDArray[np.float64]
    rate: float
    frequency: NDArray[np.float64]
    accelerance: NDArray[np.complex128]
    band: tuple[float, float]
    told: NDArray[np.float64]


def answer(package: str, run: Callable[[Given], NDArray[np.float64]]) -> None:
    """Reads the test of the command line, identifies, prints one line of JSON.

    The processor time is that of `run` in all its threads, imports not.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--limit", type=int, default=60, help="processor time in s")
    arguments = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_CPU, (arguments.limit, arguments.limit + 1))
    with np.load(arguments.file) as kept:
        low, high = kept["band"]
        given = Given(
            kept["acceleration"],
            kept["force"],
            float(kept["rate"]),
            kept["frequency"],
            kept["accelerance"],
            (float(low), float(high)),
            kept["told"],
        )
    began = time.process_time()
    found = run(given)
    seconds = time.process_time() - began
    line = {
        "version": version(package),
        "seconds": seconds,
        "frequency_hz": sorted(map(float, found)),
    }
    print(json.dumps(line), flush=True)
