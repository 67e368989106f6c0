"""Reading a foreign file in a process of its own, which may crash, hang or grow without harm.

The verbs are those of `shm.read` and `shm.modes_document`, and take `limits` besides. Parsers of
others are written in C and were seen to crash and to allocate gigabytes on damaged files, so
everything unattended reads through here. `shm.read.read` and `read_test` themselves stay in the
caller's process: for a person's own files in a notebook they save the second that the first reading
costs.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from shm.errors import BadInput
from shm.modes_document import parse_modes
from shm.read.assemble import LARGEST
from shm.read.base import Layout, Peek, Survey
from shm.read.bundles import holds_test
from shm.read.content import is_gzipped
from shm.read.limits import Limits
from shm.read.modal_sets import ForeignModes
from shm.read.sandbox.protocol import Answer
from shm.read.sandbox.reading_process import ask
from shm.values import FrequencyResponse, ModalTest, Recording

__all__ = [
    "Limits", "foreign_modes", "layout_of", "load_modes", "missing_bounds", "peek_test",
    "read_test", "survey",
]  # fmt: skip
T = TypeVar("T")
_LARGEST_HANGER = 2**31  # a column of PostgreSQL's type integer


def read_test(
    path: Path, limits: Limits | None = None
) -> tuple[Recording | FrequencyResponse, ...]:
    """Return the files of one test, as `shm.read.read_test` gives them; raises BadInput."""
    known = limits or Limits()
    answer = _answer("read_test", path, known)
    with _believed(path):
        found = tuple(
            answer.value(FrequencyResponse, node) if "points" in node
            else answer.value(Recording, node)
            for node in answer.listed()
        )  # fmt: skip
        for each in found:
            _refuse_unsound(each, path, known)
    return found


def peek_test(path: Path, limits: Limits | None = None) -> tuple[Peek, ...]:
    """Return the headers of a test, as `shm.read.peek_test` gives them; raises BadInput."""
    return tuple(_values("peek_test", Peek, path, limits))


def survey(path: Path, limits: Limits | None = None) -> Survey:
    """Return what a file holds, as `shm.read.registry.survey` finds it; raises BadInput."""
    return _values("survey", Survey, path, limits)[0]


def layout_of(path: Path, limits: Limits | None = None) -> Layout:
    """Return the layout of a file, by which its logger is known; raises BadInput."""
    return _values("layout_of", Layout, path, limits)[0]


def foreign_modes(path: Path, limits: Limits | None = None) -> ForeignModes | None:
    """Return modes of another program in a UFF file, None where it holds none; raises BadInput."""
    found = _values("foreign_modes", ForeignModes, path, limits)
    return found[0] if found else None


def load_modes(path: Path, limits: Limits | None = None) -> tuple[ModalTest, ...]:
    """Return the tests of a `*.modes.json`, as `shm.documents.load_modes` gives them."""
    return parse_modes(_answer("load_modes", path, limits or Limits()).found, path)


def missing_bounds() -> dict[str, str]:
    """Return the bounds of reading that this system does not have, by name, and why.

    Raises ShmError where one that it has could not be put in force.
    """
    found = _answer("missing_bounds", Path(os.devnull), Limits()).found
    return {str(name): str(why) for name, why in dict(found).items()}


def _values(verb: str, kind: type[T], path: Path, limits: Limits | None) -> list[T]:
    answer = _answer(verb, path, limits or Limits())
    with _believed(path):
        return [answer.value(kind, node) for node in answer.listed()]


def _answer(verb: str, path: Path, limits: Limits) -> Answer:
    """Return what the reading process says; its refusal raised as BadInput."""
    with _folder_for(path) as folder:
        answer = ask(verb, path, folder, limits)
    if answer.refused:
        with _believed(path):
            refusal = answer.refusal()
        raise refusal
    return answer


@contextmanager
def _folder_for(path: Path) -> Iterator[str]:
    """Make a folder to unpack a packed file in, which also goes where the reader is killed."""
    if not holds_test(path) and not is_gzipped(path):
        yield ""
        return
    with tempfile.TemporaryDirectory(prefix="shm-read-") as folder:
        yield folder


@contextmanager
def _believed(path: Path) -> Iterator[None]:
    """Turn an answer that is none into a BadInput: a reader that was taken over may say anything.

    Raises BadInput for what checks the answer.
    """
    try:
        yield
    except (ValueError, TypeError) as error:
        raise BadInput(
            f"the file made the reader give an answer that cannot be: {error}.",
            file=path,
            remedy="The file is damaged or made to harm: export it anew from its source.",
        ) from error


def _refuse_unsound(found: Any, path: Path, limits: Limits) -> None:
    """Raise ValueError for what no reader would give of this file."""
    if path not in (Path(found.source), *Path(found.source).parents):
        raise ValueError("it is of another file")
    if found.hanger is not None and not 0 <= found.hanger < _LARGEST_HANGER:
        raise ValueError("no hanger has such a number")
    is_response = isinstance(found, FrequencyResponse)
    if not is_response and len(found.channels) - len(found.accelerations) > 1:
        raise ValueError("it has two forces")
    rows = found.accelerance.real if is_response else [c.values for c in found.channels]
    size = len(found.frequency_hz) if is_response else found.samples
    if not 1 <= len(rows) <= limits.max_channels + 1 or not 1 < size <= limits.max_samples:
        raise ValueError("it has too many channels or samples, or none")
    for row in rows:
        # Not the absolute values: those would be a copy of everything.
        least, most = np.fmin.reduce(row), np.fmax.reduce(row)
        if row.shape != (size,) or not (least >= -LARGEST and most <= LARGEST):
            raise ValueError("channels are not equally long, or hold no number or impossible ones")
    if not is_response and not found.sampling_rate_hz > 0:
        raise ValueError("it has no sampling rate")
