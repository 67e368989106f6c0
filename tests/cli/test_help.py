"""Every command explains itself, with examples that the command line takes."""

from __future__ import annotations

import io
from pathlib import Path

import click
import pytest
from rich.console import Console

from shm_cli.main import GROUPS
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


def test_an_example_with_an_option_that_is_not_there_is_found_out() -> None:
    with pytest.raises(click.UsageError):
        parse("shm drift --hangar 3")
    with pytest.raises(click.UsageError):
        parse("shm gap diagnos x.modes.json")


def test_help_shows_verbs_in_groups(shm: Shm) -> None:
    shown = shm("--help").out
    starts = [shown.index(f" {title} ") for title in GROUPS]
    assert starts == sorted(starts)
    for (title, verbs), start, end in zip(
        GROUPS.items(), starts, [*starts[1:], len(shown)], strict=True
    ):
        panel = shown[start:end]
        listed = [line.split()[1] for line in panel.splitlines() if line.startswith("│ ")]
        assert [name for name in listed if name in COMMANDS] == list(verbs), title


@pytest.mark.parametrize(
    ("line", "suggestion"),
    [
        ("raport", "Did you mean report?"),
        ("gap diagnos", "Did you mean 'diagnose'?"),
        ("report --hangar 3", "Did you mean '--hanger'?"),
        ("report --hanger 3 --format htm", "Did you mean html?"),
        ("gap effects pointmass", "Did you mean point_mass?"),
    ],
)
def test_misspelt_word_gets_a_suggestion(shm: Shm, line: str, suggestion: str) -> None:
    ended = shm(*line.split())
    assert ended.code == 2
    assert suggestion in ended.err


def test_missing_file_gets_a_suggestion(shm: Shm, tmp_path: Path) -> None:
    (tmp_path / "hanger3.csv").touch()
    with pytest.MonkeyPatch.context() as real:
        real.setattr(click.Path, "convert", CONVERT)
        ended = shm("ingest", tmp_path / "hanger3.cvs")
    assert ended.code == 2
    assert "Did you mean hanger3.csv?" in ended.err


def test_import_and_ingest_explain_each_other(shm: Shm) -> None:
    assert "shm ingest FILE" in shm("import", "--help").out
    assert "shm import FILE" in shm("ingest", "--help").out


@pytest.mark.parametrize("width", [80, 200])
def test_help_fits_the_terminal(shm: Shm, monkeypatch: pytest.MonkeyPatch, width: int) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    for words in (
        ["--help"],
        ["gap", "--help"],
        ["simulate", "--help"],
        ["db", "backup", "--help"],
    ):
        ended = shm(*words)
        assert ended.code == 0
        assert (
            max(
                Console(file=io.StringIO()).measure(line).maximum for line in ended.out.splitlines()
            )
            <= width
        )
