"""Fixed recordings of the contract of identification, and how its documents are compared.

`write_identify_golden.py` makes the golden files from them, `test_identify_contract.py` compares.
The recordings are of `tests/worlds/recordings.py`, which was written without regard to `identify`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

import shm
from shm.documents import dump
from shm.errors import ShmError
from shm.identify import Identification
from shm.values import Hanger, Recording
from tests.benchmarks.recordings_trial import as_record, described
from tests.contracts.inference_calls import GOLDEN, call
from tests.worlds import recordings as world

FOLDER = GOLDEN / "identify"
COMMANDS: Mapping[str, tuple[str, int]] = {
    "command_plain": ("plain", 700),
    "command_taps": ("taps", 705),
}
"""Recordings that go through a file and `shm identify --json`, by the name of their golden file."""
FRONTS: Mapping[str, tuple[str, int]] = {
    "plain": ("plain", 704),
    "one_axis": ("one_axis", 705),
    "close_planes": ("close_planes", 704),
    "softening": ("softening", 704),
    "single_hit": ("single_hit", 702),
    "clipped": ("clipped_acceleration", 703),
    "sidebands": ("sidebands", 705),
    "ambient": ("ambient", 701),
    "structure": ("any_bridge", 704),
}
"""Recordings that go through `shm.identify`, by the name of their golden file."""
UNDESCRIBED = "undescribed"
"""Golden file of `plain` without a hanger's description."""
REFUSED = "refused"
"""Golden file of records that are refused: noise alone, and channels without a plane."""


def identify_file(kind: str, seed: int, folder: Path) -> Any:
    """Return exit code and document of `shm identify --json` for a recording written to a file."""
    case = world.case(kind, seed)
    path, hanger = folder / f"{kind}.csv", folder / "hanger.toml"
    path.write_text(_as_csv(as_record(case)), encoding="utf-8")
    hanger.write_text(_as_table(described(case)), encoding="utf-8")
    ended = call("identify", path, "--hanger-file", hanger, "--json")
    return {"exit_code": ended.code, "document": json.loads(ended.out)}


def identify_record(kind: str, seed: int, *, is_described: bool = True) -> Any:
    """Return what the Python front makes of a recording, as a document."""
    case = world.case(kind, seed)
    hanger = described(case) if is_described else None
    return as_document(shm.identify(as_record(case), hanger=hanger, cross_check="none"))


def refuse_records() -> Any:
    """Return the errors of records in which no mode can be trusted or named."""
    record = as_record(world.case("plain", 704))
    rng = np.random.default_rng(1)
    noise = [
        _with(channel, values=rng.standard_normal(len(channel.values)))
        if channel.quantity == "acceleration"
        else channel
        for channel in record.channels
    ]
    return {
        "noise": _error_of(_with(record, channels=tuple(noise))),
    }


def as_document(found: Identification) -> Any:
    """Return an identification as a document: all that a report or a program reads of it."""
    return json.loads(dump({
        "modes": [asdict(mode) for mode in found.test.modes],
        "amplitude": found.test.amplitude,
        "rattles_above": found.test.rattles_above,
        "quality": [asdict(check) for check in found.quality],
        "set_aside": [asdict(mode) for mode in found.set_aside],
        "hits": [asdict(hit) for hit in found.hits],
        "notes": list(found.notes),
        "has_response": found.frequency_response is not None,
        "has_fit": found.fit is not None,
        "has_poles": bool(found.poles.stable.any()),
    }))  # fmt: skip


def golden(name: str) -> Any:
    """Return a golden file."""
    return json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))


def _error_of(record: Recording) -> Any:
    try:
        shm.identify(record, cross_check="none")
    except ShmError as error:
        return {"type": type(error).__name__, "has_remedy": bool(error.remedy)}
    return None


def _with(value: Any, **changes: Any) -> Any:
    from dataclasses import replace

    return replace(value, **changes)


def _as_csv(record: Recording) -> str:
    """Return a record as a file of the documented format."""
    listed = {
        "plane": [channel.plane or "" for channel in record.channels],
        "x_m": ["" if math.isnan(c.x_m) else f"{c.x_m:g}" for c in record.channels],
        "unit": ["N" if c.quantity == "force" else "m/s2" for c in record.channels],
    }
    head = [f"# sampling_rate_hz: {record.sampling_rate_hz}"]
    head += [f"# {key}: {', '.join(values)}" for key, values in listed.items()]
    names = ("force" if c.quantity == "force" else c.name for c in record.channels)
    rows = np.array([channel.values for channel in record.channels]).T
    lines = (",".join(f"{value:.9g}" for value in row) for row in rows)
    return "\n".join([*head, ",".join(names), *lines]) + "\n"


def _as_table(hanger: Hanger) -> str:
    """Return the description as a `[[hanger]]` table."""
    return (
        f"[[hanger]]\nid = {hanger.id}\nlength_m = {hanger.length_m}\n"
        f"diameter_m = {hanger.diameter_m}\nelastic_modulus_pa = {hanger.elastic_modulus_pa}\n"
        f"density_kg_m3 = {hanger.mass_per_length_kg_m / hanger.area_m2}\n"
        f"nominal_tension_n = {hanger.nominal_tension_n}\n"
    )
