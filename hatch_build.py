"""Put the manual that `make docs` has built into the wheel, where there is one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Manual(BuildHookInterface):  # type: ignore[type-arg]
    """Find the manual as hatchling begins a wheel; an editable install reads it where it is."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Include `build/manual` as `shm/manual`."""
        built = Path(self.root) / "build" / "manual"
        if version == "standard" and (built / "index.html").is_file():
            build_data["force_include"][str(built)] = "shm/manual"
