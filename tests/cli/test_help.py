"""Every command explains itself, with examples that are taken; a shell completes them."""

from __future__ import annotations

import io
import shutil
import subprocess
from pathlib import Path

import click
import pytest
from click.shell_completion import ShellComplete
from rich.console import Console

from shm.models.classes.registry import MODELS
from shm.models.effects import EFFECTS
from shm.store import Workspace
from shm_cli.main import GROUPS, VERBS, cli
from tests.cli.conftest import Shm
from tests.helpers.command_lines import commands, examples, parse

COMMANDS = dict(commands())
CONVERT = click.Path.convert


@pytest.fixture(autouse=True)
def files_need_not_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        click.Path, "convert", lambda self, value, *_: self.coerce_path_result(value)
    )


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_has_help_and_its_examples_are_taken(name: str) -> None:
    command = COMMANDS[name]
    assert len((command.help or "").split("\f")[0].strip()) > 20
    found = examples(command)
    assert found, "no line begins with `Example: shm `"
    for line in found:
        called = parse(line)
        assert f" {name} " in f"{called} ", f"{line} is no example of {name}"


def test_wrong_examples_are_found_out() -> None:
    for line in ("shm drift --hangar 3", "shm gap diagnos x.modes.json"):
        with pytest.raises(click.UsageError):
            parse(line)


def test_help_shows_verbs_in_groups_that_explain_each_other(shm: Shm) -> None:
    shown = shm("--help").out
    starts = [shown.index(f" {title} ") for title in GROUPS]
    assert starts == sorted(starts)
    for (title, verbs), start, end in zip(
        GROUPS.items(), starts, [*starts[1:], len(shown)], strict=True
    ):
        panel = shown[start:end]
        listed = [line.split()[1] for line in panel.splitlines() if line.startswith("│ ")]
        assert [name for name in listed if name in COMMANDS] == list(verbs), title
    assert "shm ingest FILE" in shm("import", "--help").out
    assert "shm import FILE" in shm("ingest", "--help").out


def test_misspelt_word_gets_a_suggestion(shm: Shm, tmp_path: Path) -> None:
    for line, suggestion in (
        ("raport", "Did you mean report?"),
        ("gap diagnos", "Did you mean 'diagnose'?"),
        ("report --hangar 3", "Did you mean '--hanger'?"),
        ("report --hanger 3 --format htm", "Did you mean html?"),
        ("gap effects pointmass", "Did you mean point_mass?"),
    ):
        ended = shm(line)
        assert ended.code == 2
        assert suggestion in ended.err
    assert "Did you mean" not in shm("drift --since 2026-05-01").err  # --json is no such word
    (tmp_path / "hanger3.csv").touch()
    with pytest.MonkeyPatch.context() as real:
        real.setattr(click.Path, "convert", CONVERT)
        ended = shm("ingest", tmp_path / "hanger3.cvs")
    assert ended.code == 2
    assert "Did you mean hanger3.csv?" in ended.err


@pytest.mark.parametrize("width", [80, 200])
def test_help_fits_the_terminal(shm: Shm, monkeypatch: pytest.MonkeyPatch, width: int) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    console = Console(file=io.StringIO())
    for words in ("", "gap", "simulate", "db backup"):
        lines = shm.done(f"{words} --help").out.splitlines()
        assert max(console.measure(line).maximum for line in lines) <= width


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


def test_verbs_model_classes_and_effects_are_offered() -> None:
    assert offered() == list(VERBS)
    assert offered(incomplete="de") == ["demo"]
    beams = [name for name in MODELS if name.startswith("be")]
    assert offered("update", "--model", incomplete="be") == beams
    assert offered("predict") == list(MODELS)
    beams.remove("beam1")
    others = offered("select", "--models", incomplete="beam1,be")
    assert others == [f"beam1,{name}" for name in beams]
    assert offered("gap", "diagnose", "--without") == list(EFFECTS)
    assert offered("gap", "adopt", "--effect", incomplete="sa") == ["sag"]


def test_hangers_and_hooks_of_the_workspace_are_offered(
    bridge: Workspace, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    folder = str(bridge.folder)
    assert offered("--workspace", folder, "report", "--hanger") == ["3", "4"]
    assert offered("drift", "--workspace", folder, "--hanger", incomplete="4") == ["4"]
    monkeypatch.setenv("SHM_WORKSPACE", folder)
    assert offered("alerts", "--hanger") == ["3", "4"]
    hooks = offered("--workspace", str(bridge.folder), "alerts", "test", "--hook")
    assert hooks == [hook.name for hook in bridge.bridge.hooks]
    assert offered("--workspace", str(tmp_path), "report", "--hanger") == []
