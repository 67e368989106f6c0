"""What holds for every verb: help with an example, --json, exit codes, a clean stdout."""

from __future__ import annotations

import shlex
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
import rich_click as click

import shm as package
from shm.store import Workspace
from shm_cli import main as command_line
from shm_cli.main import VERBS, run
from tests.cli.conftest import Shm
from tests.helpers.command_lines import commands

PROGRAM = [sys.executable, "-c", "from shm_cli.main import main; main()"]


def test_every_verb_and_option_is_explained() -> None:
    """The list of verbs says what each verb says of itself."""
    found = dict(commands())
    for name, verb in VERBS.items():
        assert find_spec(verb.module) is not None
        assert (found[name].help or "").splitlines()[0] == verb.summary
    for name, command in found.items():
        for parameter in command.params:
            if isinstance(parameter, click.Option) and parameter.name not in _PLAIN:
                assert parameter.help, f"{name} {parameter.opts}"


_PLAIN = {"modes", "hits", "tests", "form", "out", "help"}


@pytest.mark.parametrize(
    ("code", "unused"),
    [
        ("from shm_cli.main import run; run(['--help'])", "numpy scipy sqlalchemy matplotlib"),
        ("import shm_cli.status, shm_cli.report, shm_cli.alerts", "matplotlib jinja2 reportlab"),
        ("from shm_cli.main import run; run(['--workspace', '{bridge}', 'status'])",
         "alembic h5py matplotlib nptdms pandas pymseed requests scipy.fft scipy.io scipy.linalg "
         "scipy.ndimage scipy.optimize scipy.signal scipy.sparse scipy.special scipy.stats "
         "shm.pipeline.flow shm.read.registry"),
    ],
)  # fmt: skip
def test_command_loads_only_what_it_needs(bridge: Workspace, code: str, unused: str) -> None:
    """Help loads no library, words nothing that draws, the status nothing that computes."""
    code = f"import sys; {code.replace('{bridge}', str(bridge.folder))}"
    ended = subprocess.run(
        [sys.executable, "-c", f"{code}; print(*sys.modules, file=sys.stderr)"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert ("3 done" in ended.stdout) is ("'status'" in code)
    assert not set(unused.split()) & set(ended.stderr.split())


def test_the_version_is_that_of_the_package(shm: Shm) -> None:
    assert package.__version__ in shm("--version").out


def test_unexpected_error_is_short(
    shm: Shm, monkeypatch: pytest.MonkeyPatch, hanger_file: Path
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("by [zero]")

    monkeypatch.setattr("shm_cli.predict.build", broken)
    ended = shm("predict", "beam1", "--hanger-file", hanger_file)
    assert ended.code == 1
    assert "ZeroDivisionError: by [zero]" in ended.err
    assert "--debug" in ended.err
    assert "Traceback" not in ended.err
    with pytest.raises(ZeroDivisionError):
        run(["--debug", "predict", "beam1", "--hanger-file", str(hanger_file)])


def test_places_of_the_workspace(
    shm: Shm, bridge: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = shm("--workspace", bridge.folder, "status", "--json")
    after = shm("status", "--json", "--workspace", bridge.folder)
    monkeypatch.setenv("SHM_WORKSPACE", str(bridge.folder))
    documents = [before.document, after.document, shm("status", "--json").document]
    assert [d["bridge"] for d in documents] == ["Test bridge"] * 3


def test_console_script_ends_quietly(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = f"{shlex.join(PROGRAM)} --help | true"
    ended = subprocess.run(
        ["/bin/bash", "-o", "pipefail", "-c", shown], capture_output=True, text=True, check=False
    )
    assert ended.returncode in (0, 1)
    assert ended.stderr == ""
    with pytest.raises(SystemExit) as ended:
        command_line.main(["frobnicate"])
    assert ended.value.code == 2
