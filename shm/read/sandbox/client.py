"""The verbs of the door: ask the reading process, and believe nothing that it says.

What every recording must be, asked once more of what came through the pipe.
"""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import numpy as np

from shm.errors import BadInput
from shm.modes_document import parse_modes
from shm.read.assemble import LARGEST
from shm.read.base import Layout, Peek, Survey
from shm.read.bundles import holds_test
from shm.read.content import is_gzipped
from shm.read.limits import Limits
from shm.read.modal_sets import ForeignModes
from shm.read.sandbox.protocol import Answer, Refused, refusal_of, value_of
from shm.read.sandbox.reading_process import Request, ask
from shm.values import Channel, FloatArray, FrequencyResponse, ModalTest, Recording

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


def survey(path: Path, limits: Limits | None = None) -> Survey:
    """What a file holds, as `shm.read.base.survey` finds it; raises BadInput."""
    known = limits or Limits()
    answer = _answer("survey", path, known)
    with _believed(path):
        found = value_of(Survey, answer.listed()[0], answer.arrays)
        refuse_unsound_survey(found, path, known)
    return found


def layout_of(path: Path, limits: Limits | None = None) -> Layout:
    """The layout of a file, by which its logger is known; raises BadInput."""
    answer = _answer("layout_of", path, limits or Limits())
    with _believed(path):
        return value_of(Layout, answer.listed()[0], answer.arrays)


def foreign_modes(path: Path, limits: Limits | None = None) -> ForeignModes | None:
    """Modes of another program in a UFF file, None where it holds none; raises BadInput."""
    answer = _answer("foreign_modes", path, limits or Limits())
    with _believed(path):
        node = answer.listed()[0]
        return None if node is None else value_of(ForeignModes, node, answer.arrays)


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


_LARGEST_HANGER = 2**31  # a column of PostgreSQL's type integer
_FASTEST_HZ = 1e9  # judgement: a thousand times the fastest converter for vibrations
_EVEN = 1e-6  # judgement: readers make even grids, so that only rounding is allowed for


def refuse_unsound(
    found: Sequence[Recording | FrequencyResponse], path: Path, limits: Limits
) -> None:
    """Raises ValueError for what no reader would give of this file."""
    for each in found:
        _refuse_description(each.source, each.hanger, each.temperature_c, path)
        if isinstance(each, Recording):
            _refuse_recording(each, limits)
        else:
            _refuse_response(each, limits)


def refuse_unsound_look(looks: Sequence[Peek], path: Path) -> None:
    """Raises ValueError for a look at another file, or at impossible numbers."""
    for look in looks:
        _refuse_description(look.source, look.hanger, look.temperature_c, path)
        if look.samples < 0 or look.lines < 0:
            raise ValueError("there are fewer than no samples")


def refuse_unsound_survey(found: Survey, path: Path, limits: Limits) -> None:
    """Raises ValueError for a survey of another file, or with impossible columns."""
    _refuse_description(found.source, found.hanger, found.temperature_c, path)
    if not 0 <= found.samples <= limits.max_samples or found.lines < 0:
        raise ValueError("it has too many samples, or fewer than none")
    for column in found.columns:
        if column.values is not None and column.values.ndim != 1:
            raise ValueError("a column is none")


def _refuse_description(source: str, hanger: int | None, temperature_c: float, path: Path) -> None:
    if path not in (Path(source), Path(source).parent):
        raise ValueError("it is of another file")
    if hanger is not None and not 0 <= hanger < _LARGEST_HANGER:
        raise ValueError("no hanger has such a number")
    if math.isinf(temperature_c):
        raise ValueError("the temperature is infinite")


def _refuse_recording(found: Recording, limits: Limits) -> None:
    if not 1 <= len(found.accelerations) <= limits.max_channels:
        raise ValueError("it has too many accelerations, or none")
    if len(found.channels) - len(found.accelerations) > 1:
        raise ValueError("it has two forces")
    if {channel.values.shape for channel in found.channels} != {(found.samples,)}:
        raise ValueError("its channels are not equally long")
    if not 1 < found.samples <= limits.max_samples:
        raise ValueError("it has too many samples, or none")
    if not 0 < found.sampling_rate_hz < _FASTEST_HZ:
        raise ValueError("it has no sampling rate")
    for channel in found.channels:
        _refuse_channel(channel)


def _refuse_channel(channel: Channel) -> None:
    if not channel.name or math.isinf(channel.x_m) or channel.full_scale <= 0:
        raise ValueError("a channel has no name, no place or no scale")
    # Not the absolute values: those would be a copy of everything.
    least, most = np.fmin.reduce(channel.values), np.fmax.reduce(channel.values)
    if not (least >= -LARGEST and most <= LARGEST):
        raise ValueError(f"channel {channel.name} holds no number, or impossible ones")


def _refuse_response(found: FrequencyResponse, limits: Limits) -> None:
    shape = len(found.points), len(found.frequency_hz)
    coherence = found.coherence
    if found.accelerance.shape != shape or (coherence is not None and coherence.shape != shape):
        raise ValueError("its arrays do not fit together")
    if not (shape[0] >= 1 and 1 < shape[1] <= limits.max_samples):
        raise ValueError("it has too many lines, or none")
    if not _is_even(found.frequency_hz) or np.isinf(found.accelerance).any():
        raise ValueError("its frequencies or its values are impossible")


def _is_even(frequency_hz: FloatArray) -> bool:
    steps = np.diff(frequency_hz)
    return bool(frequency_hz[0] == 0 and steps[0] > 0 and np.allclose(steps, steps[0], rtol=_EVEN))
