"""What each verb takes, as programs call it: `options.txt`.

Who changes it on purpose writes that file anew: `python -m tests.cli.test_options`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from shm_cli.main import cli

KEPT = Path(__file__).parent / "options.txt"
_FACTS = ("required", "default", "nargs", "multiple", "is_flag", "hidden", "count", "envvar")


def lines(command: click.Command, name: str) -> Iterator[str]:
    """A line for each option and argument of a command and of those below it."""
    yield f"{name}{' (hidden)' if command.hidden else ''}"
    for each in command.params:
        info = each.to_info_dict()
        facts = [f"{key}={info[key]}" for key in _FACTS if _is_said(key, info.get(key))]
        yield f"  {' '.join(info['opts'])} {_type(info['type'])} {' '.join(facts)}".rstrip()
    if isinstance(command, click.Group):
        context = click.Context(command)
        for below in command.list_commands(context):
            found = command.get_command(context, below)
            assert found is not None
            yield from lines(found, f"{name} {below}")


def _is_said(key: str, value: object) -> bool:
    return value is not None and value is not False and (key, value) != ("nargs", 1)


def _type(info: dict[str, Any]) -> str:
    bounds = [f"{key}={info[key]}" for key in sorted(info) if key not in ("param_type", "name")]
    return " ".join([info["name"], *bounds])


def test_each_verb_takes_what_was_agreed() -> None:
    made = list(lines(cli, "shm"))
    kept = KEPT.read_text(encoding="utf-8").splitlines()
    assert [line for line in made if line not in kept] == []
    assert made == kept


if __name__ == "__main__":
    KEPT.write_text("\n".join(lines(cli, "shm")) + "\n", encoding="utf-8")
