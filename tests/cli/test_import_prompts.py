"""`shm import` at a terminal: what it asks, wrong answers, and a person who leaves in between.

The command runs at a pseudo-terminal, as a person would have it.
"""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import sys
import time
import tomllib
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from scipy.io import wavfile

from shm.store import Workspace
from shm_cli.main import run
from tests.cli.test_import import export, modes_file
from tests.helpers.workspaces import make_workspace

PATIENCE_S = 120.0
_STYLE = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


OF_TEST = {"When was the test": "2026-05-01T10:00Z", "How warm": "12,5", "Who measured": "Ann"}


class Terminal:
    """A command at a terminal, and a person at its keys."""

    def __init__(self, process: int, keys: int):
        self._process, self._keys = process, keys
        self._code: int | None = None
        self.shown, self._seen = "", 0

    def answer(self, question: str, *answers: str) -> None:
        """Wait for a question, and again for each further answer."""
        for answer in answers:
            self.wait_for(question)
            self.press(f"{answer}\n")

    def press(self, keys: str) -> None:
        os.write(self._keys, keys.encode())

    def wait_for(self, text: str) -> None:
        """Until a text is shown after what was waited for before."""
        deadline = time.monotonic() + PATIENCE_S
        while text not in self.shown[self._seen :]:
            assert time.monotonic() < deadline, f"no {text!r} in:\n{self.shown}"
            assert self._more(), f"ended without {text!r}:\n{self.shown}"
        self._seen = self.shown.index(text, self._seen) + len(text)

    def end(self) -> int:
        """Its exit code."""
        while self._more():
            pass
        deadline = time.monotonic() + PATIENCE_S
        while not self._has_ended() and time.monotonic() < deadline:
            time.sleep(0.01)
        assert self._code is not None, f"it goes on after its terminal was closed:\n{self.shown}"
        return self._code

    def leave(self, key: str) -> int:
        """Press a key until the command ends, and return its exit code.

        A key in the moment between a question and the wait for its answer is not seen.
        """
        deadline = time.monotonic() + PATIENCE_S
        while not self._has_ended() and time.monotonic() < deadline:
            self.press(key)
            while self._more(1.0):
                pass
        return self.end()

    def kill(self) -> None:
        if not self._has_ended():
            os.kill(self._process, signal.SIGKILL)
            os.waitpid(self._process, 0)

    def _has_ended(self) -> bool:
        if self._code is None:
            process, status = os.waitpid(self._process, os.WNOHANG)
            self._code = os.waitstatus_to_exitcode(status) if process else None
        return self._code is not None

    def _more(self, patience_s: float = PATIENCE_S) -> bool:
        ready, _, _ = select.select([self._keys], [], [], patience_s)
        try:
            piece = os.read(self._keys, 65536) if ready else b""
        except OSError:  # the other end of the terminal is closed
            piece = b""
        self.shown += _STYLE.sub("", piece.decode(errors="replace"))
        return bool(piece)


@contextmanager
def terminal(workspace: Workspace, *arguments: object, verb: str = "import") -> Iterator[Terminal]:
    """In a process forked off this one, which has everything imported."""
    words = ["--workspace", str(workspace.folder), verb, *map(str, arguments)]
    with warnings.catch_warnings():  # the threads of pytest-xdist hold nothing that a command needs
        warnings.simplefilter("ignore", DeprecationWarning)
        process, keys = pty.fork()
    if process == 0:
        _become(words)
    person = Terminal(process, keys)
    try:
        yield person
    finally:
        person.kill()
        os.close(keys)


def _become(words: list[str]) -> NoReturn:
    """Return the command at its terminal; of the tests' own streams and signals it has none."""
    code = 1
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.environ.update(COLUMNS="200", TERM="dumb")
        sys.stdin, sys.stdout, sys.stderr = os.fdopen(0), os.fdopen(1, "w"), os.fdopen(2, "w")
        code = run(words)
    except BaseException:
        traceback.print_exc()
        raise
    finally:
        sys.stdout.flush()
        os._exit(code)


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "bridge", hangers=(3, 4))


def kept(workspace: Workspace) -> list[str]:
    """All files that an import leaves."""
    places = (workspace.folder / "loggers", workspace.spool)
    return sorted(
        str(path.relative_to(workspace.folder))
        for place in places
        for path in place.rglob("*")
        if path.is_file()
    )


def test_wrong_answer_is_asked_again(workspace: Workspace, tmp_path: Path) -> None:
    with terminal(workspace, export(tmp_path / "a.csv")) as person:
        person.answer("When was the test", "lately", "2026-05-01T10:00Z")
        person.answer("How warm", "very", "12,5")
        person.answer("Who measured", "Ann")
        person.answer("Which hanger", "three", "9", "3")
        person.answer("Where did the hammer hit (column Kraft)", "1,9")
        person.answer("Where is A1", "high up", "2,52")
        person.answer("which plane does A1", "sideways", "quer")
        person.answer("Where is A2", "unknown")
        person.answer("which plane does A2", "l")
        person.answer("of hanger 3, too?", "y")
        assert person.end() == 0
    landed = tomllib.loads((workspace.spool / "a.toml").read_text())
    assert (landed["temperature_c"], landed["time"].hour, landed["operator"]) == (12.5, 10, "Ann")
    assert "Which hanger was tested? [3, 4]" in person.shown
    for wrong in ("'lately' is no day", "'very' is no temperature", "'three' is no number",
                  "hanger 9 is not described", "'high up' is no place"):  # fmt: skip
        assert wrong in person.shown
    (profile,) = (workspace.folder / "loggers").iterdir()
    said = tomllib.loads(profile.read_text())
    assert said["hanger"] == 3
    assert said["channel"] == {
        "Kraft": {"x_m": 1.9},
        "A1": {"x_m": 2.52, "plane": "transverse"},
        "A2": {"x_m": "", "plane": "longitudinal"},
    }
    assert kept(workspace) == [f"loggers/{profile.name}", "spool/a.csv", "spool/a.toml"]


def test_carried_logger_is_asked_again(workspace: Workspace, tmp_path: Path) -> None:
    said = ("--place", "Kraft=1.9", "--place", "2.52", "--plane", "transverse,longitudinal")
    with terminal(workspace, export(tmp_path / "a.csv"), *said) as person:
        for question in OF_TEST:
            person.answer(question, "unknown")
        person.answer("Which hanger", "3")
        person.answer("of hanger 3, too?", "")
        assert person.end() == 0
    with terminal(workspace, export(tmp_path / "b.csv", 2)) as person:
        for question, answer in OF_TEST.items():
            person.answer(question, answer)
        person.answer("Which hanger", "4")
        assert person.end() == 0
    assert tomllib.loads((workspace.spool / "b.toml").read_text())["hanger"] == 4
    (profile,) = (workspace.folder / "loggers").iterdir()
    assert "hanger" not in tomllib.loads(profile.read_text())


def test_what_follows_from_an_answer_is_asked_next(workspace: Workspace, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    path = tmp_path / "tape.wav"
    wavfile.write(path, 1000, (rng.normal(0, 0.1, (3000, 2)) * 32767).astype(np.int16))
    with terminal(workspace, path, "--hanger", 3) as person:
        for question, answer in OF_TEST.items():
            person.answer(question, answer)
        person.answer("full scale of channel_1", "loud", "2000 N")
        person.answer("full scale of channel_2", "50 g")
        person.answer("Where did the hammer hit (column channel_1)", "unknown")
        person.answer("Where is channel_2", "2.52")
        person.answer("which plane does channel_2", "transverse")
        person.answer("of hanger 3, too?", "y")
        assert person.end() == 0
    assert "spool/tape.wav" in kept(workspace)


@pytest.mark.parametrize(
    ("key", "at"),
    [("\x03", "Which hanger"), ("\x04", "which plane does A2"), ("\x03", "of hanger 3, too?")],
    ids=["Ctrl-C at first", "Ctrl-D", "Ctrl-C at last"],
)
def test_leaving_keeps_nothing(workspace: Workspace, tmp_path: Path, key: str, at: str) -> None:
    answers = {
        **OF_TEST,
        "Which hanger": "3",
        "Where did the hammer hit (column Kraft)": "2",
        "Where is A1": "2",
    }
    answers |= {"which plane does A1": "t"}
    answers |= {"Where is A2": "2", "which plane does A2": "l", "of hanger 3, too?": "y"}
    with terminal(workspace, export(tmp_path / "a.csv")) as person:
        for question, answer in answers.items():
            if question == at:
                break
            person.answer(question, answer)
        person.wait_for(at)
        assert person.leave(key) != 0
    assert "Traceback" not in person.shown
    assert kept(workspace) == []


def test_planes_of_foreign_modes(workspace: Workspace, tmp_path: Path) -> None:
    with terminal(workspace, modes_file(tmp_path / "m.uff")) as person:
        person.answer("Which hanger", "-3", "3")
        person.answer("axis x", "up", "transverse")
        person.answer("axis y", "longitudinal")
        person.answer("of hanger 3, too?", "n")
        assert person.end() == 0
    assert "'up' is no plane" in person.shown
    (profile,) = (workspace.folder / "loggers").iterdir()
    assert tomllib.loads(profile.read_text())["roams"] is True
