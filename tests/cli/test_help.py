"""Every command explains itself, with examples that the command line takes."""

from __future__ import annotations

import io

import click
import pytest
from rich.console import Console

from tests.cli.conftest import Shm
from tests.helpers.command_lines import commands, examples, parse

COMMANDS = dict(commands())


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
