"""`shm settings`: every setting with its default and meaning, which is also the manual's page."""

from __future__ import annotations

import rich_click as click

from shm.settings import TABLE, Setting
from shm_cli import flags
from shm_cli.common import markdown, show, show_rows

_HEADS = ("setting", "default", "unit", "range", "meaning")


@click.command()
@flags.json
def command() -> None:
    """Every setting: its default, its range, what it means.

    A value comes from the flag, else the environment (`workers` from SHM_WORKERS), else
    `[settings]` of `bridge.toml`, else the default.

    \b
    Example: shm settings
    """
    if flags.wants_json():
        show({"settings": [_document(row) for row in TABLE]})
    else:
        show_rows("", _HEADS, [(row.name, *_cells(row)) for row in TABLE])


def settings_page() -> str:
    """The manual's page of settings in Markdown, from the one table of settings."""
    head = (
        "# Settings\n\n"
        "A value comes from the flag, else the environment (`workers` from `SHM_WORKERS`), else "
        "`[settings]` of `bridge.toml`, else the default. `shm settings` says the same.\n\n"
    )
    return head + markdown(_HEADS, [(f"`{row.name}`", *_cells(row)) for row in TABLE]) + "\n"


def _cells(row: Setting) -> tuple[str, ...]:
    return str(row.default), row.unit, _range(row), row.help


def _range(row: Setting) -> str:
    bounds = (
        ", ".join(row.choices),
        "" if row.low is None else f"from {row.low:g}",
        "" if row.high is None else f"to {row.high:g}",
    )
    return " ".join(text for text in bounds if text)


def _document(row: Setting) -> dict[str, object]:
    return {
        "setting": row.name,
        "default": row.default,
        "unit": row.unit,
        "choices": list(row.choices),
        "from": row.low,
        "to": row.high,
        "environment": row.environment_variable,
        "meaning": row.help,
    }
