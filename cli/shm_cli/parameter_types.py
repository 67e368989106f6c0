"""What options take besides plain texts and paths: a text that is not empty, a file to write.

Whether a file can be written is checked before the work, not after it.
"""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path
from typing import Any

import rich_click as click

from shm.documents import parse_time
from shm.errors import BadInput


class Words(click.ParamType[str]):
    """A text with something in it."""

    name = "text"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The text without blanks around it; refuses an empty one."""
        if not value.strip():
            self.fail("it is empty. Say it in a few words.", param, ctx)
        return value.strip()


class Time(click.ParamType[datetime]):
    """An ISO 8601 time; one without zone is taken as UTC."""

    name = "time"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> datetime:
        try:
            return parse_time(str(value))
        except (ValueError, OverflowError):
            raise BadInput(
                f"{value} is not an ISO 8601 time.", remedy="Write 2026-05-01T10:00:00Z."
            ) from None


class NewFile(click.Path):
    """A path at which a file can be written, new or in the place of one."""

    def __init__(self) -> None:
        super().__init__(dir_okay=False, writable=True, path_type=Path)

    def convert(
        self, value: Any, parameter: click.Parameter | None, context: click.Context | None
    ) -> Any:
        path = Path(os.fsdecode(super().convert(value, parameter, context)))
        folder = path.absolute().parent
        if not folder.is_dir():
            raise BadInput(f"{folder} is no folder.", remedy="Make it first, or name another.")
        if not os.access(folder, os.W_OK):
            raise BadInput(f"nothing can be written into {folder}.", remedy="Name another.")
        return path
