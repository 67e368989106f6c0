"""Fixed inputs and calls of the contract of inference, models and simulate, and how they are run.

`write_inference_golden.py` makes the golden files from them, `test_inference_contract.py` compares.
"""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shm_cli.main import run

GOLDEN = Path(__file__).with_name("golden")
ROD = GOLDEN / "rod.toml"
"""Hanger 3 of the thesis as a plain bar: no plate, no fittings."""
PLATED = GOLDEN / "plated.toml"
"""The same with its end plates."""
LIMITED = GOLDEN / "limited.toml"
"""The plain bar with limits of the tension and one assumption of its owner."""
SPRUNG = GOLDEN / "sprung.modes.json"
"""Three modes a plane at 661 kN on springs of some 1e7 N m/rad, by beam2, off by 0.02 %."""
SPRUNG_HIGHER = GOLDEN / "sprung_higher.modes.json"
"""The same with five modes a plane, which the wider priors of the thesis need."""
FEW = GOLDEN / "few.modes.json"
"""Two modes a plane at 640 kN between clamps, by beam1, off by 0.02 %."""
WEIGHTED = GOLDEN / "weighted.modes.json"
"""Four modes a plane at 640 kN with 40 kg at 3.4 m, off by 0.02 %."""

ADOPTED = "beam1+point_mass@everywhere"
SPRINGS = ("log10_k1=7.1", "log10_k2=7", "log10_k3=7.2", "log10_k4=6.9")


def sets(*pairs: str) -> tuple[str, ...]:
    """Return the `--set` options of named values."""
    return tuple(word for pair in pairs for word in ("--set", pair))


UPDATES: Mapping[str, tuple[object, ...]] = {
    "update_description": ("update", SPRUNG, "--hanger-file", ROD, "--model", "beam2"),
    "update_thesis": (
        "update", SPRUNG_HIGHER, "--hanger-file", ROD, "--model", "beam2", "--priors", "thesis",
    ),
    "update_few": ("update", FEW, "--hanger-file", ROD, "--model", "beam1"),
    "update_adopted": ("update", WEIGHTED, "--hanger-file", ROD, "--model", ADOPTED),
    "select": ("select", FEW, "--hanger-file", ROD, "--models", "beam1,beam2,solid0"),
    "select_limits": ("select", FEW, "--hanger-file", LIMITED, "--models", "beam1"),
}  # fmt: skip
"""Calls whose numbers come from a sampler, by the name of their golden file."""

PREDICTIONS: Mapping[str, tuple[object, ...]] = {
    "beam1": ("beam1", "--hanger-file", ROD, *sets("theta_F=0.9", "theta_L=0.97")),
    "beam2": ("beam2", "--hanger-file", ROD, *sets("theta_F=0.93", *SPRINGS), "--modes", 4),
    "beam3": ("beam3", "--hanger-file", ROD, *sets("theta_F=0.93", *SPRINGS), "--modes", 4),
    "adopted": (
        ADOPTED, "--hanger-file", ROD, "--modes", 3,
        *sets("theta_F=0.9", "section=0.01", "density=0", "length=0.001", "modulus=0",
              "log10_mass_kg=1.6", "x_m=3.4"),
    ),
    "sweep": ("beam1", "--hanger-file", ROD, "--sweep", "theta_F=0.8:1.2:3", "--modes", 2),
    "plated beam1": ("beam1", "--hanger-file", PLATED, "--modes", 3),
    "solid0": ("solid0", "--hanger-file", PLATED, "--modes", 2),
}  # fmt: skip
"""Calls of `shm predict`, by their name in predict.json."""

HAMMER = (
    "--tension-n", "640e3", "--k1", "1e7", "--k3", "1e7", "--temperature-c", "7.5",
    "--hits", 2, "--seconds", 4, "--rate", 256,
    "--effect", "point_mass:everywhere:mass_kg=12,x_m=3.4",
)  # fmt: skip
AMBIENT = ("--ambient", "--seconds", 40, "--rate", 128, "--sensors", 1)
SIMULATIONS: Mapping[str, tuple[object, ...]] = {
    "hammer": ("simulate", "--hanger-file", ROD, *HAMMER),
    "known mass": (
        "simulate", "--hanger-file", ROD, "--added-mass", "25:3.6", "--hits", 1, "--seconds", 8,
        "--rate", 256, "--sensors", 3, "--first", "2026-04-01",
    ),
    "ambient": ("simulate", "--hanger-file", ROD, *AMBIENT),
}  # fmt: skip
"""Calls of `shm simulate`, by their name in simulate.json."""


@dataclass(frozen=True)
class Ended:
    """How a command ended and what it wrote."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> Any:
        """Return the one JSON document on standard output."""
        assert self.code == 0, self.err
        return json.loads(self.out)


def call(*words: object) -> Ended:
    """Run one command of `shm` in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run([str(word) for word in words])
    return Ended(code, out.getvalue(), err.getvalue())


def update(name: str, samples: int, seed: int) -> Any:
    """Return the document of one of `UPDATES`."""
    return call(*UPDATES[name], "--samples", samples, "--seed", seed, "--json").document


def predict(name: str) -> Any:
    """Return the document of one of `PREDICTIONS`."""
    return call("predict", *PREDICTIONS[name], "--json").document


def simulate(name: str, folder: Path, seed: int = 7) -> Path:
    """Return the one file that one of `SIMULATIONS` writes into a folder."""
    written = call(*SIMULATIONS[name], "--out", folder, "--seed", seed, "--json").document
    assert set(written) - {"schema"} == {"files"}
    (path,) = written["files"]
    return Path(path)


def header_of(path: Path) -> dict[str, str]:
    """Return the header of a CSV recording by key, and its column names as `columns`."""
    found: dict[str, str] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            return {**found, "columns": line}
        key, _, value = line[1:].partition(":")
        found[key.strip()] = value.strip()
    return found


def golden(name: str) -> Any:
    """Return a golden file."""
    return json.loads((GOLDEN / f"{name}.json").read_text(encoding="utf-8"))
