"""Fixed inputs and calls of the contract of the gap diagnosis, and how they are run.

`write_gap_golden.py` makes the golden files from them, `test_gap_contract.py` compares.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import shm
from shm.diagnosis_document import bridge_diagnosis_document, diagnosis_document
from shm.documents import dump
from shm.gap import GapOptions, diagnose_bridge
from tests.contracts.inference_calls import GOLDEN, ROD, call
from tests.helpers.effects import all_but

FOLDER = GOLDEN / "gap"
VOLATILE = "seconds"
SEED = 11
SOUND = FOLDER / "sound.modes.json"
"""Six modes a plane with shapes, of a hanger that is as it is described."""
CLAMPED = FOLDER / "clamped.modes.json"
"""The same with 12 kg at 3.4 m."""
BARE = FOLDER / "bare.modes.json"
"""`CLAMPED`, with frequencies without standard deviations."""
BLUNDER = FOLDER / "blunder.modes.json"
"""Frequencies of `SOUND` alone, one of them 4 % too high."""
SOFT = FOLDER / "soft.modes.json"
"""Five modes of one plane, without shapes, of a hanger a fifth less stiff."""

MASS_OR_CLOCK = all_but("point_mass", "timebase")
MASS_OR_STIFFNESS = all_but("distributed_mass", "bending_stiffness")
"""Effects taken out of the catalogue, so that a diagnosis is quick."""


def read_back(document: object) -> Any:
    """Return a document as it is read from JSON, without what differs from run to run."""

    def drop_volatile(found: dict[str, Any]) -> dict[str, Any]:
        return {key: value for key, value in found.items() if key != VOLATILE}

    return json.loads(dump(document), object_hook=drop_volatile)


def run(verb: str, modes: Path, without: tuple[str, ...], seed: int) -> Any:
    """Return the document of `shm gap diagnose` or `shm gap plan`."""
    left_out = [word for effect in without for word in ("--without", effect)]
    words = (modes, "--hanger-file", ROD, *left_out, "--seed", seed, "--json")
    return read_back(call("gap", verb, *words).document)


def list_effects() -> Any:
    """Return the document of `shm gap effects`."""
    return call("gap", "effects", "--json").document


def diagnose_sound(seed: int) -> Any:
    """Return the diagnosis of a sound hanger, as a notebook has it."""
    tests, hanger = shm.load_modes(SOUND), shm.load_hanger(ROD)
    found = shm.diagnose(tests, hanger, without=MASS_OR_STIFFNESS, seed=seed)
    return read_back(diagnosis_document(found))


def diagnose_two(seed: int) -> Any:
    """Return the joint diagnosis of two hangers that are both less stiff."""
    hanger, tests = shm.load_hanger(ROD), shm.load_modes(SOFT)
    both = [(replace(hanger, id=n), [replace(each, hanger=n) for each in tests]) for n in (3, 4)]
    options = GapOptions("beam1", all_but("bending_stiffness"), seed=seed)
    return read_back(bridge_diagnosis_document(diagnose_bridge(both, options)))


def diagnose_line(seed: int) -> Any:
    """Return the diagnosis of a line that lies 0.4 too high."""

    def line(values: Mapping[str, Any], at: Mapping[str, Any]) -> Mapping[str, Any]:
        return {"y": values["slope"] * at["x"] + values.get("offset", 0.0)}

    offset = shm.SimulatorEffect("offset", {"offset": shm.Prior("normal", 0.0, 1.0)}, line)
    simulator = shm.Simulator(line, {"slope": shm.Prior("normal", 1.0, 0.5)}, [offset])
    readings = [shm.Reading({"x": x}, "y", 1.3 * x + 0.4, 0.1) for x in (0.0, 1.0, 2.0, 3.0)]
    candidates = [{"x": 0.0}, {"x": 1.7}]
    found = shm.diagnose_simulator(simulator, readings, candidates=candidates, seed=seed)
    return read_back({**asdict(found), "named": found.named})


CASES: Mapping[str, Callable[[int], Any]] = {
    "sound": diagnose_sound,
    "point_mass": lambda seed: run("diagnose", CLAMPED, MASS_OR_CLOCK, seed),
    "without_sds": lambda seed: run("diagnose", BARE, MASS_OR_CLOCK, seed),
    "gross_error": lambda seed: run("diagnose", BLUNDER, MASS_OR_STIFFNESS, seed),
    "plan": lambda seed: run("plan", SOFT, MASS_OR_STIFFNESS, seed),
    "bridge": diagnose_two,
    "line": diagnose_line,
}
"""Calls whose numbers come from a sampler, by the name of their golden file."""
SINGLE = ("sound", "point_mass", "without_sds", "gross_error")


def golden(name: str) -> Any:
    """Return a golden file; `former` holds two diagnoses of `CLAMPED` by version 1.0.0.

    One is `explained`, the other `unexplained`, with stiffness instead of a mass in the catalogue.
    """
    return json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
