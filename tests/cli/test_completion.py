"""`shm completion`: what a shell is offered, through the script's own protocol."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete

from shm.models.effects import EFFECTS
from shm.models.registry import MODELS
from shm.store import Workspace
from shm_cli.main import VERBS, cli
from tests.cli.conftest import Shm


def offered(*words: str, incomplete: str = "") -> list[str]:
    completer = ShellComplete(cli, {}, "shm", "_SHM_COMPLETE")
    return [item.value for item in completer.get_completions(list(words), incomplete)]


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_the_script_is_one_that_the_shell_understands(shm: Shm, shell: str, tmp_path: Path) -> None:
    ended = shm("completion", shell)
    assert ended.code == 0
    assert "_SHM_COMPLETE" in ended.out
    if shutil.which(shell):
        (tmp_path / "script").write_text(ended.out)
        subprocess.run([shell, "-n", tmp_path / "script"], check=True)


def test_the_help_says_how_to_install_it(shm: Shm) -> None:
    said = shm("completion", "--help").out
    assert 'eval "$(shm completion bash)"' in said
    assert "~/.zshrc" in said


def test_every_verb_is_offered_without_loading_one() -> None:
    assert offered() == list(VERBS)
    assert offered(incomplete="de") == ["demo"]


def test_the_hangers_of_the_workspace_are_offered(
    bridge: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = str(bridge.folder)
    assert offered("--workspace", folder, "report", "--hanger") == ["3", "4"]
    assert offered("drift", "--workspace", folder, "--hanger", incomplete="4") == ["4"]
    monkeypatch.setenv("SHM_WORKSPACE", folder)
    assert offered("alerts", "--hanger") == ["3", "4"]


def test_the_hooks_of_the_workspace_are_offered(bridge: Workspace) -> None:
    hooks = offered("--workspace", str(bridge.folder), "alerts", "test", "--hook")
    assert hooks == [hook.name for hook in bridge.bridge.hooks]


def test_nothing_is_offered_where_there_is_no_workspace(tmp_path: Path) -> None:
    assert offered("--workspace", str(tmp_path), "report", "--hanger") == []


def test_model_classes_are_offered_after_a_comma_too() -> None:
    beams = [name for name in MODELS if name.startswith("be")]
    assert offered("update", "--model", incomplete="be") == beams
    assert offered("predict") == list(MODELS)
    beams.remove("beam1")
    others = offered("select", "--models", incomplete="beam1,be")
    assert others == [f"beam1,{name}" for name in beams]


def test_effects_are_offered() -> None:
    assert offered("gap", "diagnose", "--without") == list(EFFECTS)
    assert offered("gap", "adopt", "--effect", incomplete="sa") == ["sag"]
