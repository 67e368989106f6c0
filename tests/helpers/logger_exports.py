"""Hammer tests as loggers of any make export them: columns with units, and the day in figures."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from shm.read import sidecar_path
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.values import Recording
from tests.helpers.hangers import HANGER_3

SIDECAR = """
hanger = 3
[channel."Acc trans"]
plane = "transverse"
x_m = 2.52
[channel."Acc long"]
plane = "longitudinal"
x_m = 2.52
"""


@cache
def simulate_test(tension_n: float = 700e3, seed: int = 1) -> Recording:
    """Return a hammer test of hanger 3 with one biaxial sensor."""
    plan = HammerPlan(hits=3, seconds_per_hit=8.0, sensors_x_m=(2.52,))
    rng = np.random.default_rng(seed)
    return hammer_test(HANGER_3, HangerState(tension_n=tension_n), plan, rng)


def write_export(path: Path, day: str, tension_n: float = 700e3, seed: int = 1) -> Path:
    """Write a hammer test as a logger of any make does, with the day in figures."""
    found = simulate_test(tension_n, seed)
    columns = np.array([channel.values for channel in found.channels])
    times = np.arange(found.samples) / found.sampling_rate_hz
    rows = "".join(
        f"{t:.6f},{','.join(f'{v:.5g}' for v in row)}\n"
        for t, row in zip(times, columns.T, strict=True)
    )
    head = f"Sample rate: {found.sampling_rate_hz:g}\nStart time: {day}\nStore type: fast\n\n"
    path.write_text(f"{head}Time,Hammer,Acc trans,Acc long\ns,N,m/s2,m/s2\n{rows}")
    return path


def write_described_export(path: Path, day: str, tension_n: float = 700e3, seed: int = 1) -> Path:
    """Write the same with a sidecar that names hanger, planes and places."""
    sidecar_path(path).write_text(SIDECAR)
    return write_export(path, day, tension_n, seed)
