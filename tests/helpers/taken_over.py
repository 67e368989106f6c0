"""A reading child that was taken over: it does what a file says in Python, within its bounds."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from shm.read import sandbox
from shm.read.sandbox import reading_process

_VERB = """
from shm.read import registry
from shm.read.sandbox import serving
known = registry.VERBS['read_test']
def verb(path):
    if '.py' not in path.suffixes: return known(path)
    space = {'path': path}
    exec(path.read_text(), space)
    return space['found']
registry.VERBS['read_test'] = verb
"""


@contextmanager
def obeying_readers(first: str = "pass") -> Iterator[None]:
    """One reading process whose children run what a .py, or a .py.gz, says.

    `first` is done in the reading process before, to `serving` for example.
    """
    reading_process._forget()
    with pytest.MonkeyPatch.context() as patch:
        begin, end = reading_process._CODE.split("from shm", 1)
        patch.setattr(
            reading_process, "_CODE", f"{begin.rstrip('; ')}{_VERB}{first}\nfrom shm{end}"
        )
        yield
        reading_process._forget()


def obey(path: Path, code: str, limits: sandbox.Limits | None = None) -> object:
    """Lets a child run some code, which may leave what it has `found`."""
    path.write_text(f"import os, sys\n{textwrap.dedent(code)}\n")
    return sandbox.read_test(path, limits)
