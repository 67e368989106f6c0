"""Runs the command line in this process, and a bridge that holds a short history."""

from __future__ import annotations

import json
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from shm.store import Workspace
from shm_cli import working
from shm_cli.main import run
from tests.helpers.flows import threads
from tests.helpers.taken_in import with_a_loss
from tests.helpers.workspaces import make_workspace, write_test


@dataclass(frozen=True)
class Ended:
    """How a command ended and what it wrote; `told` and `said` are its outputs on one line."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> Any:
        return json.loads(self.out)

    @property
    def told(self) -> str:
        return " ".join(self.out.split())

    @property
    def said(self) -> str:
        return " ".join(self.err.split())


@dataclass(frozen=True)
class Shm:
    """The command line; a single text is taken apart as a shell does it."""

    capsys: pytest.CaptureFixture[str]
    before: tuple[object, ...] = ()

    def at(self, workspace: Workspace | Path) -> Shm:
        folder = workspace.folder if isinstance(workspace, Workspace) else workspace
        return replace(self, before=("--workspace", folder))

    def __call__(self, *arguments: object) -> Ended:
        if len(arguments) == 1 and isinstance(arguments[0], str):
            arguments = tuple(shlex.split(arguments[0]))
        self.capsys.readouterr()
        code = run([str(argument) for argument in (*self.before, *arguments)])
        written = self.capsys.readouterr()
        return Ended(code, written.out, written.err)

    def done(self, *arguments: object) -> Ended:
        """Run a command that must not fail."""
        ended = self(*arguments)
        assert ended.code == 0, ended.err
        return ended

    def told(self, *arguments: object) -> str:
        return self.done(*arguments).told

    def json(self, *arguments: object) -> Any:
        if len(arguments) == 1 and isinstance(arguments[0], str):
            arguments = tuple(shlex.split(arguments[0]))
        return self.done(*arguments, "--json").document


@pytest.fixture
def shm(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Shm:
    monkeypatch.delenv("SHM_WORKSPACE", raising=False)
    # What it ingests begins no processes: each first command would import all steps in new ones.
    monkeypatch.setattr(working, "executor_of", threads)
    return Shm(capsys)


@pytest.fixture(scope="session")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 has three tests, the last two with a fifth less tension; hanger 4 has none."""
    return with_a_loss(tmp_path_factory.mktemp("cli") / "bridge")


@pytest.fixture
def copied(bridge: Workspace, tmp_path: Path) -> Workspace:
    """Return the same bridge, to be changed at will."""
    return with_a_loss(tmp_path / "bridge")


@pytest.fixture
def empty(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "empty")


@pytest.fixture
def on_bridge(shm: Shm, bridge: Workspace) -> Shm:
    return shm.at(bridge)


@pytest.fixture
def on_copy(shm: Shm, copied: Workspace) -> Shm:
    return shm.at(copied)


@pytest.fixture
def on_empty(shm: Shm, empty: Workspace) -> Shm:
    return shm.at(empty)


@pytest.fixture(scope="session")
def hanger_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Hanger 3 of the thesis."""
    path = tmp_path_factory.mktemp("hanger") / "H.toml"
    path.write_text(
        "[[hanger]]\nid = 3\ndiameter_m = 0.130\nlength_m = 12.0\nelastic_modulus_pa = 200e9\n"
        "density_kg_m3 = 7800\nnominal_tension_n = 711e3\n"
    )
    return path


@pytest.fixture
def modes_file(tmp_path: Path, bridge: Workspace) -> Path:
    """Return a test of hanger 3 at 90 % of its nominal tension."""
    path = tmp_path / "t9.modes.json"
    write_test(path, bridge, tension=0.9)
    return path
