"""The key of a trial: what was planted. It is kept apart, and its SHA-256 stands in the trial.

A random salt makes the SHA-256 one that nobody can reach by guessing the truth.
"""

from __future__ import annotations

import hashlib
import math
import os
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from shm.documents import dump, value_of
from shm.errors import BadInput
from tests.benchmarks.blind.layout import Trial, read_document
from tests.benchmarks.blind.truth import TrueCase

KEY_SCHEMA = "shm.blind_key/1"


def write_key(path: Path, cases: Sequence[TrueCase], seed: int) -> str:
    """Writes the key, which only its owner may read, and gives its SHA-256."""
    document = {
        "schema": KEY_SCHEMA,
        "salt": secrets.token_hex(32),
        "seed": seed,
        "cases": [_case_document(case) for case in cases],
    }
    content = (dump(document) + "\n").encode()
    path.parent.mkdir(parents=True, exist_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as stream:
        stream.write(content)
    return hashlib.sha256(content).hexdigest()


def read_key(path: Path) -> tuple[tuple[TrueCase, ...], int]:
    """What was planted in each case, and the seed; raises BadInput where the file is no key."""
    if not path.is_file():
        raise BadInput(
            f"there is no key at {path}.",
            remedy="Move it there: `blind_trial.py make` wrote it beside the trial's folder.",
        )
    document = read_document(path, KEY_SCHEMA)
    try:
        return tuple(_case(each) for each in document["cases"]), int(document["seed"])
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(f"not a whole key ({error!r}).", file=path, remedy="Restore it.") from error


def key_of(trial: Trial, path: Path) -> tuple[tuple[TrueCase, ...], int]:
    """The key of this trial; raises BadInput where it is another's, or was changed."""
    key = read_key(path)
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    if sha256 != trial.key_sha256:
        raise BadInput(
            f"not the key of {trial.directory}, or changed since: its SHA-256 is {sha256}, the "
            f"trial was sealed with {trial.key_sha256}.",
            file=path,
            remedy="Give the key that was made with this trial, unchanged.",
        )
    return key


def _case_document(case: TrueCase) -> dict[str, Any]:
    """An infinite parameter is written as text."""
    document = asdict(case)
    for effect in document["effects"]:
        effect["values"] = {
            name: value if math.isfinite(value) else str(value)
            for name, value in effect["values"].items()
        }
    return document


def _case(document: Mapping[str, Any]) -> TrueCase:
    effects = [
        {**each, "values": {name: float(value) for name, value in each["values"].items()}}
        for each in document["effects"]
    ]
    return value_of(TrueCase, {**document, "effects": effects})
