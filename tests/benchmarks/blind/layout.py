"""Which files a blind trial consists of, and what its `trial.json` says.

    DIR/trial.json                the cases, and the SHA-256 of the key
    DIR/cases/c0001/hanger.toml   the description of the hanger, as its owner has it
    DIR/cases/c0001/case.json     what the diagnosis is told: baseline and seed
    DIR/cases/c0001/tests.modes.json
    DIR/answers/c0001.json        what the diagnosis said, and DIR/answers.sha256 over all of them
    DIR/left_out/c0001.json       the same without the planted effects, and DIR/left_out.sha256

The key lies beside DIR, never in it.

The answers of a round: their documents, and the SHA-256 over all of them.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from shm.diagnosis_document import diagnosis_document, diagnosis_of
from shm.documents import dump
from shm.errors import BadInput, NothingThere
from shm.read.atomic import replace_text
from tests.benchmarks.blind.truth import Answer

TRIAL_SCHEMA = "shm.blind_trial/1"
CASE_SCHEMA = "shm.blind_case/1"
HANGER_FILE, CASE_FILE, MODES_FILE = "hanger.toml", "case.json", "tests.modes.json"

Round = Literal["answers", "left_out"]
"""The folder of a round's answers: with the whole catalogue, then without the planted effects."""


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

    def seal(self, which: Round) -> Path:
        """The file with the SHA-256 over a round's answers."""
        return self.directory / f"{which}.sha256"


def read_trial(directory: Path) -> Trial:
    """The trial in a folder; raises BadInput where there is none."""
    path = directory / "trial.json"
    if not path.is_file():
        raise BadInput(
            f"{directory} holds no blind trial.", remedy="Make one with `blind_trial.py make DIR`."
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


ANSWER_SCHEMA = "shm.blind_answer/1"


def answer_document(answer: Answer) -> dict[str, Any]:
    """The document of an answer; `diagnosis` is a `shm.diagnosis/1`, null where it failed."""
    found = answer.diagnosis
    return {
        "schema": ANSWER_SCHEMA,
        "case": answer.case,
        "left_out": list(answer.left_out),
        "failure": answer.failure,
        "diagnosis": None if found is None else diagnosis_document(found),
    }


def write_answer(answer: Answer, directory: Path) -> None:
    """Writes an answer as CASE.json, whole or not at all."""
    replace_text(directory / f"{answer.case}.json", dump(answer_document(answer)) + "\n")


def read_answer(path: Path) -> Answer:
    """An answer back from its file; raises BadInput where it is none."""
    document = read_document(path, ANSWER_SCHEMA)
    try:
        found = document["diagnosis"]
        return Answer(
            str(document["case"]),
            tuple(document["left_out"]),
            None if found is None else diagnosis_of(found),
            str(document["failure"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(
            f"not a whole answer ({error!r}).", file=path, remedy="Delete it and solve again."
        ) from error


def read_answers(directory: Path) -> tuple[Answer, ...]:
    """All answers in a folder, in the order of their cases; raises BadInput for a broken one."""
    return tuple(read_answer(path) for path in _files_in(directory))


def answered(directory: Path) -> set[str]:
    """The cases whose answers lie in a folder."""
    return {path.stem for path in _files_in(directory)}


def answers_sha256(directory: Path) -> str:
    """Over each file's name, size and content, in the order of the names."""
    whole = hashlib.sha256()
    for path in _files_in(directory):
        content = path.read_bytes()
        whole.update(f"{path.name}\0{len(content)}\0".encode())
        whole.update(content)
    return whole.hexdigest()


def seal_answers(trial: Trial, which: Round) -> str:
    """Writes the SHA-256 of a round that is complete, and gives it."""
    sha256 = answers_sha256(trial.answers(which))
    replace_text(trial.seal(which), f"{sha256}\n")
    return sha256


def verified_sha256(trial: Trial, which: Round) -> str:
    """The SHA-256 of a round's answers as it was sealed.

    Raises NothingThere where the round is not sealed, BadInput where the answers are others now.
    """
    seal = trial.seal(which)
    if not seal.exists():
        done, of = len(answered(trial.answers(which))), len(trial.cases)
        raise NothingThere(
            f"the answers in {trial.answers(which)} are not complete: {done} of {of} cases.",
            remedy="Run `blind_trial.py solve` once more; it goes on where it stopped.",
        )
    sealed, found = seal.read_text(encoding="utf-8").strip(), answers_sha256(trial.answers(which))
    if sealed != found:
        raise BadInput(
            f"the answers in {trial.answers(which)} were changed after they were sealed: their "
            f"SHA-256 is {found}, sealed was {sealed}.",
            file=seal,
            remedy="Restore them, or delete the folder and this file and solve again.",
        )
    return sealed


def _files_in(directory: Path) -> list[Path]:
    found = directory.glob("*.json") if directory.is_dir() else ()
    return sorted(path for path in found if not path.name.startswith("."))
