"""Runs the command line in this process, and a bridge that holds a short history."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
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
    """How a command ended and what it wrote."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> Any:
        return json.loads(self.out)


Shm = Callable[..., Ended]


@pytest.fixture
def shm(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Shm:
    monkeypatch.delenv("SHM_WORKSPACE", raising=False)
    # What it ingests begins no processes: each first command would import all steps in new ones.
    monkeypatch.setattr(working, "executor_of", threads)

    def call(*arguments: object) -> Ended:
        capsys.readouterr()
        code = run([str(argument) for argument in arguments])
        written = capsys.readouterr()
        return Ended(code, written.out, written.err)

    return call


@pytest.fixture(scope="session")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 has three tests, the last two with a fifth less tension; hanger 4 has none."""
    return with_a_loss(tmp_path_factory.mktemp("cli") / "bridge")


@pytest.fixture
def empty(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "bridge")


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
