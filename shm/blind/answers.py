"""The answers of a round: their documents, and the SHA-256 over all of them."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from shm.blind.layout import Round, Trial, read_document
from shm.diagnosis_document import diagnosis_document, diagnosis_of
from shm.documents import dump
from shm.errors import BadInput, NothingThere
from shm.read.atomic import replace_text
from shm.values import Answer

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
    return tuple(read_answer(path) for path in _answers_in(directory))


def answered(directory: Path) -> set[str]:
    """The cases whose answers lie in a folder."""
    return {path.stem for path in _answers_in(directory)}


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
            remedy="Run `shm gap blind solve` once more; it goes on where it stopped.",
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


def _answers_in(directory: Path) -> list[Path]:
    return [path for path in _files_in(directory) if not path.name.endswith(".modes.json")]
