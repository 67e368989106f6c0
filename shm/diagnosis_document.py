"""The JSON document of a gap diagnosis (`shm.diagnosis/1`), there and back.

And that of a joint diagnosis of several hangers (`shm.bridge_diagnosis/1`), which holds theirs,
and that of a check of what a diagnosis would find (`shm.gap_check/1`).

As all documents it holds NaN until `shm.documents.dump` writes null; reading takes either.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any

from shm.documents import value_of
from shm.values import NAN, BridgeDiagnosis, Cause, Diagnosis, GapCheck, GapVerdict

DIAGNOSIS_SCHEMA = "shm.diagnosis/1"
BRIDGE_DIAGNOSIS_SCHEMA = "shm.bridge_diagnosis/1"
GAP_CHECK_SCHEMA = "shm.gap_check/1"


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the document of `shm gap diagnose --json`."""
    document = asdict(diagnosis)
    return {
        "schema": DIAGNOSIS_SCHEMA,
        "tension_n": {
            "before": document.pop("tension_before_n"),
            "after": document.pop("tension_after_n"),
        },
        "next_measurement": document.pop("next_measurements"),
        **document,
        "causes": [_cause_document(cause) for cause in diagnosis.causes],
        "invisible": [{"effect": name, "why": why} for name, why in diagnosis.invisible],
        "verdict": _verdict_document(diagnosis.verdict),
    }


def bridge_diagnosis_document(found: BridgeDiagnosis) -> dict[str, Any]:
    """Return the document of `shm gap diagnose --bridge --json`.

    `causes` are those that hangers share, with `family` (the hangers tried) and `members` (each
    with its probability and size); `tensions` are before, alone and jointly; `diagnoses` those of
    each hanger alone.
    """
    return {
        "schema": BRIDGE_DIAGNOSIS_SCHEMA,
        **{each.name: getattr(found, each.name) for each in fields(found)},
        "causes": [asdict(cause) for cause in found.causes],
        "tensions": [asdict(tension) for tension in found.tensions],
        "diagnoses": [diagnosis_document(each) for each in found.diagnoses],
    }


def _verdict_document(verdict: GapVerdict) -> dict[str, Any]:
    claim = verdict.claim
    return {
        "outcome": verdict.outcome.name.lower(),
        "reason": verdict.reason,
        "causes": [cause.effect for cause in claim.causes] if claim else [],
        "probability": verdict.probability,
        "rms_z": verdict.rms_z,
        "is_description_off": verdict.is_description_off,
        "is_uncertain": verdict.is_uncertain,
    }


def _cause_document(cause: Cause) -> dict[str, Any]:
    parameters = {}
    for estimate in cause.parameters:
        parameters[estimate.name] = asdict(estimate)
        del parameters[estimate.name]["name"]
    return {**asdict(cause), "parameters": parameters}


def diagnosis_of(document: Mapping[str, Any]) -> Diagnosis:
    """Read a diagnosis from its document; raises KeyError, TypeError or ValueError.

    What a former version did not state is not known; its `compatibility` and `remainder` are left.
    """
    tension = document["tension_n"]
    renamed = {
        "causes": [
            {**cause, "parameters": [{**e, "name": n} for n, e in cause["parameters"].items()]}
            for cause in document["causes"]
        ],
        "tension_before_n": tension["before"],
        "tension_after_n": tension["after"],
        "next_measurements": document["next_measurement"],
        "invisible": [(each["effect"], each["why"]) for each in document["invisible"]],
    }
    if "effective_draws" not in document:
        renamed["effective_draws"] = _find_effective_draws(document["remarks"])
    return value_of(Diagnosis, {**document, **renamed})


def _find_effective_draws(remarks: Sequence[str]) -> float:
    """Return the draws of a sampler that failed, which former versions stated in a remark."""
    found = [
        re.match(r"The sampler failed for .*: (\d+) effective draws", each) for each in remarks
    ]
    return min((float(each[1]) for each in found if each), default=NAN)


def gap_check_document(check: GapCheck) -> dict[str, Any]:
    """Return the document of `shm gap check --json`.

    `found_from` and `alone_from` of an effect are indices of `sizes`; `size` is the former's.
    """
    shown = ("size", "alone_from", "others", "taken_for")
    return {
        "schema": GAP_CHECK_SCHEMA,
        **asdict(check),
        "effects": [
            {**asdict(each), **{name: getattr(each, name) for name in shown}}
            for each in check.effects
        ],
        "invisible": [{"effect": name, "why": why} for name, why in check.invisible],
        "false_gaps": check.false_gaps,
        "is_complete": check.is_complete,
    }


def gap_check_of(document: Mapping[str, Any]) -> GapCheck:
    """Read a check from its document; raises KeyError, TypeError or ValueError."""
    invisible = [(each["effect"], each["why"]) for each in document["invisible"]]
    return value_of(GapCheck, {**document, "invisible": invisible})
