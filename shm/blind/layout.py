"""Which files a blind trial consists of, and what its `trial.json` says.

    DIR/trial.json                the cases, and the SHA-256 of the key
    DIR/cases/c0001/hanger.toml   the description of the hanger, as its owner has it
    DIR/cases/c0001/case.json     what the diagnosis is told: baseline and seed
    DIR/cases/c0001/tests.modes.json, or recordings t1_1.npz (test 1, first plane), ...
    DIR/answers/c0001.json        what the diagnosis said, and DIR/answers.sha256 over all of them
    DIR/left_out/c0001.json       the same without the planted effects, and DIR/left_out.sha256

The key lies beside DIR, never in it.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from shm.errors import BadInput

TRIAL_SCHEMA = "shm.blind_trial/1"
CASE_SCHEMA = "shm.blind_case/1"
HANGER_FILE, CASE_FILE, MODES_FILE = "hanger.toml", "case.json", "tests.modes.json"

Told = Callable[[int, int], None]
"""Hears how many cases are done, and of how many."""

Round = Literal["answers", "left_out"]
"""The folder of a round's answers: with the whole catalogue, then without the planted effects."""


def nobody(done: int, of: int) -> None:
    """No progress is shown."""


@dataclass(frozen=True)
class Trial:
    """A trial in its folder: the names of its cases, and the SHA-256 of its key."""

    directory: Path
    cases: tuple[str, ...]
    key_sha256: str

    def case_directory(self, case: str) -> Path:
        """Where a case's files lie."""
        return self.directory / "cases" / case

    def answers(self, which: Round) -> Path:
        """Where a round's answers lie."""
        return self.directory / which

    def identified(self, case: str) -> Path:
        """Where the modal tests stand that the first round identified in a case's recordings."""
        return self.directory / "answers" / f"{case}.modes.json"

    def seal(self, which: Round) -> Path:
        """The file with the SHA-256 over a round's answers."""
        return self.directory / f"{which}.sha256"


def read_trial(directory: Path) -> Trial:
    """The trial in a folder; raises BadInput where there is none."""
    path = directory / "trial.json"
    if not path.is_file():
        raise BadInput(
            f"{directory} holds no blind trial.", remedy="Make one with `shm gap blind make DIR`."
        )
    document = read_document(path, TRIAL_SCHEMA)
    try:
        cases, sha256 = tuple(map(str, document["cases"])), str(document["key_sha256"])
    except (KeyError, TypeError) as error:
        raise BadInput(f"{error} is missing.", file=path, remedy="Make the trial anew.") from error
    return Trial(directory, cases, sha256)


def key_beside(directory: Path) -> Path:
    """Where the key of a trial lies unless another place was named."""
    whole = directory.resolve()
    return whole.with_name(f"{whole.name}.key.json")


def read_document(path: Path, schema: str) -> dict[str, Any]:
    """A JSON document of a schema; raises BadInput where the file is not one."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise BadInput("no such file.", file=path, remedy="Check the path.") from None
    except (OSError, ValueError) as error:
        raise BadInput(f"cannot be read: {error}.", file=path, remedy="Check the file.") from error
    if not isinstance(document, dict) or document.get("schema") != schema:
        raise BadInput(f"not a document of schema {schema}.", file=path, remedy="Check the path.")
    return document
