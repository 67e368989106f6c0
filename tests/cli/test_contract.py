"""What holds for every verb: help with an example, --json, exit codes, a clean stdout."""

from __future__ import annotations

import re
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


def options_of(command: click.Command) -> set[str]:
    return {name for parameter in command.params for name in parameter.opts}


@pytest.mark.parametrize("name", VERBS)
def test_every_verb_of_the_list_exists(name: str) -> None:
    assert find_spec(VERBS[name].module) is not None


def test_every_option_is_explained() -> None:
    for name, command in commands():
        for parameter in command.params:
            if isinstance(parameter, click.Option) and parameter.name not in _PLAIN:
                assert parameter.help, f"{name} {parameter.opts}"


_PLAIN = {"modes", "hits", "tests", "form", "out", "help"}


def test_the_list_of_verbs_says_what_each_verb_says_of_itself() -> None:
    found = dict(commands())
    for name, verb in VERBS.items():
        assert (found[name].help or "").splitlines()[0] == verb.summary


def test_help_is_shown_without_loading_what_the_verbs_need() -> None:
    asked = (
        "import sys; from shm_cli.main import run; run(['--help']); "
        "sys.exit(bool({'numpy', 'scipy', 'sqlalchemy', 'matplotlib'} & set(sys.modules)))"
    )
    ended = subprocess.run([sys.executable, "-c", asked], capture_output=True, check=False)
    assert ended.returncode == 0


def test_what_is_told_in_words_is_told_without_loading_what_draws() -> None:
    asked = (
        "import sys, shm_cli.status, shm_cli.report, shm_cli.alerts; "
        "sys.exit(bool({'matplotlib', 'jinja2', 'reportlab'} & set(sys.modules)))"
    )
    ended = subprocess.run([sys.executable, "-c", asked], capture_output=True, check=False)
    assert ended.returncode == 0


def test_the_status_is_told_without_loading_what_reads_computes_or_delivers(
    bridge: Workspace,
) -> None:
    unused = {
        "alembic", "h5py", "matplotlib", "nptdms", "pandas", "pymseed", "requests",
        "scipy.fft", "scipy.io", "scipy.linalg", "scipy.ndimage", "scipy.optimize", "scipy.signal",
        "scipy.sparse", "scipy.special", "scipy.stats", "shm.pipeline.flow", "shm.read.registry",
    }  # fmt: skip
    asked = (
        f"import sys; from shm_cli.main import run; run(['--workspace', '{bridge.folder}', "
        "'status']); print(*sys.modules, file=sys.stderr)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, text=True, check=True
    )
    assert "3 done" in ended.stdout
    assert not unused & set(ended.stderr.split())


def test_the_version_is_that_of_the_package(shm: Shm) -> None:
    assert package.__version__ in shm("--version").out


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["frobnicate"], 2, "No such command"),
        (["report"], 2, "--hanger"),
        (["predict", "beam1"], 2, "which hanger?"),
        (["identify", "there-is-no-such.csv"], 2, "does not exist"),
        (["--workspace", "there-is-none", "status"], 3, "shm init"),
    ],
)
def test_a_wrong_call_ends_with_its_exit_code_and_a_remedy(
    shm: Shm, arguments: list[str], code: int, said: str
) -> None:
    ended = shm(*arguments)
    assert ended.code == code
    assert said in ended.err
    assert ended.out == ""


def test_with_json_an_error_is_a_document(shm: Shm, empty: Workspace) -> None:
    ended = shm("--workspace", empty.folder, "report", "--hanger", 3, "--json")
    assert ended.code == 4
    assert ended.document == {
        "schema": "shm.error/1",
        "error": "nothing_there",
        "message": "no test of hanger 3 has been through updating yet.",
        "remedy": "Take recordings in with `shm ingest FILE`, or see `shm status`.",
        "exit_code": 4,
    }
    assert "shm ingest" in ended.err


def test_an_outdated_store_is_exit_code_5(shm: Shm, empty: Workspace) -> None:
    empty.database.write_bytes(b"")
    ended = shm("--workspace", empty.folder, "status")
    assert ended.code == 5
    assert "shm db upgrade" in ended.err


def test_an_unexpected_error_is_short_and_says_how_to_see_more(
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


def test_the_workspace_may_stand_before_or_after_the_verb_or_in_the_environment(
    shm: Shm, bridge: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = shm("--workspace", bridge.folder, "status", "--json")
    after = shm("status", "--json", "--workspace", bridge.folder)
    monkeypatch.setenv("SHM_WORKSPACE", str(bridge.folder))
    documents = [before.document, after.document, shm("status", "--json").document]
    assert [d["bridge"] for d in documents] == ["Test bridge"] * 3


def test_a_reader_that_closes_early_sees_no_traceback() -> None:
    shown = f"{shlex.join(PROGRAM)} --help | true"
    ended = subprocess.run(
        ["/bin/bash", "-o", "pipefail", "-c", shown], capture_output=True, text=True, check=False
    )
    assert ended.returncode in (0, 1)
    assert ended.stderr == ""


def test_the_console_script_ends_with_the_code_of_the_contract(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(SystemExit) as ended:
        command_line.main(["frobnicate"])
    assert ended.value.code == 2


def test_a_message_keeps_its_brackets(shm: Shm, tmp_path: Path) -> None:
    """Remedies name TOML tables such as [[hanger]]; they must not be taken for markup."""
    described = tmp_path / "H.toml"
    described.write_text("")
    ended = shm("predict", "beam1", "--hanger-file", described)
    assert re.search(r"0 \[\[hanger\]\] tables", ended.err)
