"""Makes the generated pages: commands, settings, and the validation table.

python docs/build.py            # all, the table included (a minute)
python docs/build.py --quick    # without the table
"""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path

import rich_click as click

from shm.settings import TABLE
from shm_cli.main import VERBS, cli
from shm_cli.validate import compared, markdown

DOCS = Path(__file__).parent
_MARKS = ("<!-- validation -->", "<!-- /validation -->")


def commands_page() -> str:
    """docs/commands.md from the help texts."""
    parts = [
        "# Commands\n\nMade by `make docs` from the help texts; `shm VERB --help` says the same."
    ]
    with click.Context(cli, info_name="shm") as context:
        for verb in VERBS:
            command = cli.get_command(context, verb)
            assert command is not None
            parts.append(_command(command, f"shm {verb}", context))
    return "\n\n".join(parts) + "\n"


def _command(command: click.Command, name: str, parent: click.Context) -> str:
    lines = [f"## {name}", _prose(command.help or "")]
    with click.Context(command, info_name=name.split()[-1], parent=parent) as context:
        for parameter in command.params:
            record = parameter.get_help_record(context)
            if record:
                lines.append(f"- `{record[0]}`: {record[1]}" if record[1] else f"- `{record[0]}`")
        if isinstance(command, click.Group):
            lines += [
                _command(inner, f"{name} {key}", context) for key, inner in command.commands.items()
            ]
    return "\n\n".join(lines)


def _prose(text: str) -> str:
    cleaned = re.sub(r"^\s*\x08\s*\n", "", inspect.cleandoc(text), flags=re.MULTILINE)
    return re.sub(r"Example: (.+)", r"Example: `\1`", cleaned)


def settings_page() -> str:
    """docs/settings.md from the one table of settings."""
    head = (
        "# Settings\n\nMade by `make docs` from `shm/settings.py`. A value comes from the flag, "
        "else the environment, else `[settings]` of `bridge.toml`, else the default.\n\n"
        "| setting | default | unit | range | environment | meaning |\n|---|---|---|---|---|---|\n"
    )
    rows = [
        f"| `{row.name}` | {row.default} | {row.unit} | {_range(row.low, row.high)} "
        f"| `{row.environment_variable}` | {row.help} |"
        for row in TABLE
    ]
    return head + "\n".join(rows) + "\n"


def _range(low: float | None, high: float | None) -> str:
    return " ".join(
        text
        for text in (
            "" if low is None else f"from {low:g}",
            "" if high is None else f"to {high:g}",
        )
        if text
    )


def _fill_in(path: Path, table: str) -> None:
    text = path.read_text(encoding="utf-8")
    before, rest = text.split(_MARKS[0])
    after = rest.split(_MARKS[1])[1]
    path.write_text(f"{before}{_MARKS[0]}\n{table}\n{_MARKS[1]}{after}", encoding="utf-8")


def main() -> None:
    """Writes the pages."""
    (DOCS / "commands.md").write_text(commands_page(), encoding="utf-8")
    (DOCS / "settings.md").write_text(settings_page(), encoding="utf-8")
    if "--quick" not in sys.argv:
        table = markdown(compared(seed=1))
        for path in (DOCS / "validation.md", DOCS.parent / "README.md"):
            _fill_in(path, table)


if __name__ == "__main__":
    main()
