"""Makes the generated pages: commands, settings, effects, and the tables of validation and gap.

python docs/build.py            # all, the tables included (two minutes)
python docs/build.py --quick    # without the tables

The blind trial takes hours; its page is filled from one that was solved by docs/blind_page.py.
The real measurements are not in this repository; docs/real_cases_page.py fills their page in two
minutes where they are.
"""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path

import rich_click as click

from docs.effects_page import effects_page
from docs.filling import fill_in
from docs.gap_page import hanger_3_table
from shm.settings import TABLE, Setting
from shm_cli.main import VERBS, cli
from shm_cli.validate import compared, markdown
from shm_cli.validation import frequencies, selection

DOCS = Path(__file__).parent


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
        f"| `{row.name}` | {row.default} | {row.unit} | {_range(row)} "
        f"| `{row.environment_variable}` | {row.help} |"
        for row in TABLE
    ]
    return head + "\n".join(rows) + "\n"


def _range(row: Setting) -> str:
    bounds = (
        ", ".join(row.choices),
        "" if row.low is None else f"from {row.low:g}",
        "" if row.high is None else f"to {row.high:g}",
    )
    return " ".join(text for text in bounds if text)


def main() -> None:
    """Writes the pages."""
    (DOCS / "commands.md").write_text(commands_page(), encoding="utf-8")
    (DOCS / "settings.md").write_text(settings_page(), encoding="utf-8")
    (DOCS / "effects.md").write_text(effects_page(), encoding="utf-8")
    if "--quick" in sys.argv:
        return
    tables, chosen = compared(seed=1)
    computed = markdown(frequencies.HEADS, [frequencies.cells(row) for row in tables])
    preferred = markdown(selection.HEADS, [selection.cells(row) for row in chosen])
    fill_in(DOCS / "validation.md", "frequencies", computed)
    fill_in(DOCS / "validation.md", "selection", preferred)
    fill_in(DOCS / "gap.md", "hanger 3", hanger_3_table())
    latest = [row for row in chosen if (row.printing, row.repeat) == ("table 1.1", 10)]
    short = markdown(selection.HEADS[2:-1], [selection.cells(row)[2:-1] for row in latest])
    fill_in(DOCS.parent / "README.md", "selection", short)


if __name__ == "__main__":
    main()
