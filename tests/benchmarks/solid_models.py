"""The solid models' exactness and cost: mesh, reduction over the prior box, memory. Run:

python tests/benchmarks/solid_models.py --held-out 100
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.progress import track

from shm.bridge import load_hanger
from shm.models import THESIS, build
from shm.models.classes.base import silent
from shm.models.classes.solid.assembly import assembled
from shm.models.classes.solid.basis import transverse_basis
from shm.models.classes.solid.geometry import Fineness
from shm.models.classes.solid.reduction import natural_modes
from shm.values import FloatArray, Hanger

HANGER_FILE = Path(__file__).parents[2] / "cli/shm_cli/example/hanger3.toml"
MESHES = {
    "default": Fineness(),
    "12,000": Fineness(rod=60, overlap=6, bare_plate=6, wing=4),
    "50,000": Fineness(rod=72, overlap=7, bare_plate=8, wing=4, section=2),
}
MODES = 6
LIMITS = {"solid0": (15, 60.0), "solid2": (30, 60.0), "solid1": (70, 240.0)}


def meshes(hanger: Hanger) -> list[str]:
    """solid0 on three meshes; the faults found."""
    description = build("solid0", hanger, THESIS).description()  # type: ignore[attr-defined]
    found, faults = {}, []
    for name, fineness in MESHES.items():
        geometry = replace(description.geometry, fineness=fineness)
        started = time.process_time()
        system = assembled(geometry, description.material, description.support, "transverse")
        middle = time.process_time()
        modes = natural_modes(system, hanger.nominal_tension_n, np.array([]), MODES)
        solving = time.process_time() - middle
        found[name] = modes.frequencies_hz
        print(
            f"solid0, mesh {name}: {system.unknowns} unknowns, assembly {middle - started:.2f} s, "
            f"solution {solving:.2f} s of processor time, {np.round(found[name], 3)} Hz"
        )
        if name == "default" and (system.unknowns > 15_000 or solving > 5):
            faults.append("solid0 is over 15,000 unknowns or 5 s a solution")
    change = 100 * np.abs(found["12,000"] / found["50,000"] - 1).max()
    print(f"12,000 against 50,000 unknowns: {change:.4f} %")
    return faults + (["the mesh has not converged to 0.1 %"] if change > 0.1 else [])


def reduction(hanger: Hanger, name: str, held_out: int) -> list[str]:
    """A class's basis made from nothing, and its error on fresh points and corners."""
    model = build(name, hanger, THESIS)
    started = time.process_time()
    model.prepare(MODES)
    offline = time.process_time() - started
    basis = transverse_basis(model.description(), MODES, silent)  # type: ignore[attr-defined]
    prior, rng = model.prior, np.random.default_rng(2026)
    inside = rng.uniform(prior.lower, prior.upper, (held_out, len(prior.names)))
    corners = np.where(rng.random(inside.shape) < 0.5, prior.lower, prior.upper)
    errors = [_error_percent(model, theta) for theta in (inside, corners)]
    started = time.process_time()
    model.frequencies_hz(rng.uniform(prior.lower, prior.upper, (4000, len(prior.names))), MODES)
    online = (time.process_time() - started) / 4000
    print(
        f"{name}: {basis.projected.unknowns} unknowns from {basis.solutions} solutions, offline "
        f"{offline:.1f} s, online {1e6 * online:.0f} us a set of 12; error on {held_out} prior "
        f"points {errors[0]:.4f} %, on {held_out} corners {errors[1]:.4f} %"
    )
    most, seconds = LIMITS[name]
    missed = max(errors) > 0.02 or basis.projected.unknowns > most or offline > seconds
    return [f"{name}: over 0.02 %, {most} unknowns or {seconds:.0f} s"] if missed else []


def _error_percent(model: object, theta: FloatArray) -> float:
    worst = 0.0
    for block in track(np.array_split(theta, min(20, len(theta))), "full model", transient=True):
        reference = model.reference_frequencies_hz(block, MODES)  # type: ignore[attr-defined]
        reduced = model.frequencies_hz(block, MODES)  # type: ignore[attr-defined]
        worst = max(worst, 100 * float(np.abs(reduced / reference - 1).max()))
    return worst


def main() -> None:
    """Runs all and prints the figures; exit code 1 where one misses its mark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--held-out", type=int, default=100)
    held_out = parser.parse_args().held_out
    hanger = load_hanger(HANGER_FILE)
    with tempfile.TemporaryDirectory() as cache:
        os.environ["SHM_CACHE"] = cache
        faults = [fault for name in LIMITS for fault in reduction(hanger, name, held_out)]
    memory_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"largest memory of all classes {memory_gb:.2f} GB")
    if memory_gb > 2:
        faults.append("over 2 GB of memory")
    sys.exit("; ".join(faults + meshes(hanger)) or 0)


if __name__ == "__main__":
    main()
