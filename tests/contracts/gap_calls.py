"""Fixed inputs and calls of the contract of the gap diagnosis, and how they are run.

`write_gap_golden.py` makes the golden files from them, `test_gap_contract.py` compares.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from typing import Any

import shm
from shm.bridge import load_hanger
from shm.diagnosis_document import bridge_diagnosis_document, diagnosis_document
from shm.documents import dump
from shm.gap import GapOptions, diagnose_bridge
from shm.modes_document import load_modes
from tests.contracts import inference_calls
from tests.helpers.effects import all_but

GOLDEN = inference_calls.GOLDEN / "gap"
ROD = inference_calls.ROD
FORMER = GOLDEN / "former.json"
"""Two documents as version 1.0.0 wrote them of `CLAMPED`: `explained` is `point_mass`, and
`unexplained` the same without the point mass in the catalogue."""
VOLATILE = "seconds"

SOUND = GOLDEN / "sound.modes.json"
"""Six modes a plane with shapes, of a hanger that is as it is described."""
CLAMPED = GOLDEN / "clamped.modes.json"
"""The same with 12 kg at 3.4 m."""
BARE = GOLDEN / "bare.modes.json"
"""`CLAMPED`, with frequencies without standard deviations."""
BLUNDER = GOLDEN / "blunder.modes.json"
"""Frequencies of `SOUND` alone, one of them 4 % too high."""
SOFT = GOLDEN / "soft.modes.json"
"""Five modes of one plane, without shapes, of a hanger a fifth less stiff."""

LEFT_OUT: Mapping[str, tuple[str, ...]] = {
    "sound": all_but("point_mass", "bending_stiffness"),
    "point_mass": all_but("point_mass", "timebase"),
    "without_sds": all_but("point_mass", "timebase"),
    "gross_error": all_but("distributed_mass", "bending_stiffness"),
    "bridge": all_but("bending_stiffness", "distributed_mass"),
}
"""Effects taken out of the catalogue of each diagnosis, so that it is quick."""


def call(verb: str, name: str, *words: object) -> inference_calls.Ended:
    """Run `shm gap diagnose` or `shm gap plan` with the catalogue of a diagnosis."""
    without = [word for effect in LEFT_OUT[name] for word in ("--without", effect)]
    return inference_calls.call("gap", verb, "--hanger-file", ROD, *without, *words)


def settle(value: Any) -> Any:
    """Return a document as JSON has it, without what differs from run to run."""
    if isinstance(value, dict):
        return {key: settle(each) for key, each in value.items() if key != VOLATILE}
    return [settle(each) for each in value] if isinstance(value, list) else value


def read_back(document: object) -> Any:
    """Return a document as it is read from JSON."""
    return settle(json.loads(dump(document)))


def diagnose(name: str, modes: object, seed: int) -> Any:
    """Return the document of a diagnosis by `shm.diagnose`."""
    tests = load_modes(modes)  # type: ignore[arg-type]
    found = shm.diagnose(tests, load_hanger(ROD), without=LEFT_OUT[name], seed=seed)
    return read_back(diagnosis_document(found))


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


def diagnose_two(seed: int) -> Any:
    """Return the joint diagnosis of two hangers that are both less stiff."""
    hanger, tests = load_hanger(ROD), load_modes(SOFT)
    options = GapOptions("beam1", LEFT_OUT["bridge"], seed=seed)
    found = diagnose_bridge(
        [(replace(hanger, id=n), [replace(each, hanger=n) for each in tests]) for n in (3, 4)],
        options,
    )
    return read_back(bridge_diagnosis_document(found))


CASES: Mapping[str, Callable[[int], Any]] = {
    "sound": lambda seed: diagnose("sound", SOUND, seed),
    "point_mass": lambda seed: settle(
        call("diagnose", "point_mass", CLAMPED, "--seed", seed, "--json").document
    ),
    "without_sds": lambda seed: diagnose("without_sds", BARE, seed),
    "gross_error": lambda seed: diagnose("gross_error", BLUNDER, seed),
    "plan": lambda seed: call("plan", "point_mass", CLAMPED, "--seed", seed, "--json").document,
    "plan_soft": lambda seed: call("plan", "bridge", SOFT, "--seed", seed, "--json").document,
    "bridge": diagnose_two,
    "line": diagnose_line,
}
"""Calls whose numbers come from a sampler, by the name of their golden file."""


def golden(name: str) -> Any:
    """Return a golden file."""
    return json.loads((GOLDEN / f"{name}.json").read_text(encoding="utf-8"))
