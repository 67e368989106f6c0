"""The verbs of the door: ask the reading process, and believe nothing that it says."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from shm.errors import BadInput
from shm.modes_document import parse_modes
from shm.read.apart.answers import Answer, Refused, refusal_of, value_of
from shm.read.apart.asking import Request, ask
from shm.read.apart.sound import refuse_unsound, refuse_unsound_look
from shm.read.base import Peek
from shm.read.bundles import holds_test
from shm.read.content import is_gzipped
from shm.read.limits import Limits
from shm.values import FrequencyResponse, ModalTest, Recording

T = TypeVar("T")


def read_test(
    path: Path, limits: Limits | None = None
) -> tuple[Recording | FrequencyResponse, ...]:
    """The files of one test, as `shm.read.read_test` gives them; raises BadInput."""
    known = limits or Limits()
    answer = _answer("read_test", path, known)
    with _believed(path):
        found = tuple(_either(answer, node) for node in answer.listed())
        refuse_unsound(found, path, known)
    return found


def peek_test(path: Path, limits: Limits | None = None) -> tuple[Peek, ...]:
    """The headers of a test, as `shm.read.peek_test` gives them; raises BadInput."""
    answer = _answer("peek_test", path, limits or Limits())
    with _believed(path):
        looks = tuple(value_of(Peek, node, answer.arrays) for node in answer.listed())
        refuse_unsound_look(looks, path)
    return looks


def load_modes(path: Path, limits: Limits | None = None) -> tuple[ModalTest, ...]:
    """The tests of a `*.modes.json`, as `shm.documents.load_modes` gives them; raises BadInput."""
    answer = _answer("load_modes", path, limits or Limits())
    return parse_modes(answer.found, path)


def missing_bounds() -> dict[str, str]:
    """The bounds of reading that are not in force on this system, by name, and why.

    Raises ShmError where one that this system knows could not be put in force.
    """
    found = _answer("missing_bounds", Path(os.devnull), Limits()).found
    return {str(name): str(why) for name, why in dict(found).items()}


def _answer(verb: str, path: Path, limits: Limits) -> Answer:
    """What the reading process says; its refusal raised as BadInput."""
    with _folder_for(path) as folder:
        answer = ask(Request(verb, str(path), str(Path.cwd()), folder, limits))
    if answer.refused:
        with _believed(path):
            refused = value_of(Refused, answer.found, ())
        raise refusal_of(refused)
    return answer


@contextmanager
def _folder_for(path: Path) -> Iterator[str]:
    """A folder to unpack a packed file in, which also goes where the reader is killed."""
    if not holds_test(path) and not is_gzipped(path):
        yield ""
        return
    with tempfile.TemporaryDirectory(prefix="shm-read-") as folder:
        yield folder


def _either(answer: Answer, node: object) -> Recording | FrequencyResponse:
    if isinstance(node, dict) and "points" in node:
        return value_of(FrequencyResponse, node, answer.arrays)
    return value_of(Recording, node, answer.arrays)


@contextmanager
def _believed(path: Path) -> Iterator[None]:
    """Turns an answer that is none into a BadInput: a reader that was taken over may say anything.

    Raises BadInput for the ValueError of what checks the answer.
    """
    try:
        yield
    except ValueError as error:
        raise BadInput(
            f"the file made the reader give an answer that cannot be: {error}.",
            file=path,
            remedy="The file is damaged or made to harm: export it anew from its source.",
        ) from error
