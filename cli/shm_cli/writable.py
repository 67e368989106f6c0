"""Files that a command is to write: whether they can be is told before the work, not after it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import rich_click as click

from shm.errors import BadInput


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
