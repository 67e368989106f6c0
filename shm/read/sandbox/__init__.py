"""Reading a foreign file in a process of its own, which may crash, hang or grow without harm.

The verbs are those of `shm.read` and `shm.modes_document`, and take `limits` besides. Parsers of
others are written in C and were seen to crash and to allocate gigabytes on damaged files, so
everything unattended reads through here. `shm.read.read` and `read_test` themselves stay in the
caller's process: for a person's own files in a notebook they save the second that the first reading
costs.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from shm.read.base import Layout, Peek, Survey
from shm.read.limits import Limits
from shm.read.modal_sets import ForeignModes
from shm.read.sandbox.reading_process import ask
from shm.values import FrequencyResponse, ModalTest, Recording

__all__ = [
    "Limits", "foreign_modes", "layout_of", "load_modes", "missing_bounds", "peek_test",
    "read_test", "survey",
]  # fmt: skip


def read_test(
    path: Path, limits: Limits | None = None
) -> tuple[Recording | FrequencyResponse, ...]:
    """Return the files of one test, as `shm.read.read_test` gives them; raises BadInput."""
    return tuple(ask("read_test", path, limits))


def peek_test(path: Path, limits: Limits | None = None) -> tuple[Peek, ...]:
    """Return the headers of a test, as `shm.read.peek_test` gives them; raises BadInput."""
    return tuple(ask("peek_test", path, limits))


def survey(path: Path, limits: Limits | None = None) -> Survey:
    """Return what a file holds, as `shm.read.registry.survey` finds it; raises BadInput."""
    found: Survey = ask("survey", path, limits)[0]
    return found


def layout_of(path: Path, limits: Limits | None = None) -> Layout:
    """Return the layout of a file, by which its logger is known; raises BadInput."""
    found: Layout = ask("layout_of", path, limits)[0]
    return found


def foreign_modes(path: Path, limits: Limits | None = None) -> ForeignModes | None:
    """Return modes of another program in a UFF file, None where it holds none; raises BadInput."""
    return next(iter(ask("foreign_modes", path, limits)), None)


def load_modes(path: Path, limits: Limits | None = None) -> tuple[ModalTest, ...]:
    """Return the tests of a `*.modes.json`, as `shm.documents.load_modes` gives them."""
    return tuple(ask("load_modes", path, limits))


def missing_bounds() -> dict[str, str]:
    """Return the bounds of reading that this system does not have, by name, and why.

    Raises ShmError where one that it has could not be put in force.
    """
    ask("do_nothing", Path(os.devnull), None)
    return {} if sys.platform == "linux" else {"a limit of memory": "only Linux enforces one"}
