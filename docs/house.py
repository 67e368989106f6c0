"""Draws the house in CONTRIBUTING.md: its floors, what lives in each room, its doors.

From the layers of import-linter in pyproject.toml and the first sentence of each room's docstring;
`python docs/build.py --quick` puts it in.
"""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_FOLDERS = {"shm": "shm", "shm_daemon": "daemon/shm_daemon", "shm_cli": "cli/shm_cli"}
"""Where a root package lies in the checkout."""


def house() -> str:
    """Return the floors, the highest first, and below them the other contracts."""
    contracts = _contracts()
    (layers,) = [each["layers"] for each in contracts if each["type"] == "layers"]
    floors = [layer.split(" | ") for layer in layers]
    width = max(len(room) for floor in floors for room in floor)
    lines = []
    for number, floor in zip(range(len(floors), 0, -1), floors, strict=True):
        for place, room in enumerate(floor):
            height = "" if place else str(number)
            lines.append(f"{height:>2}  {room:{width}}  {_first_sentence(_path(room))}")
    others = [f"- {each['name']}." for each in contracts if each["type"] != "layers"]
    return "\n".join(["```text", *lines, "```", "", *others])


def _contracts() -> list[dict[str, str]]:
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    found: list[dict[str, str]] = described["tool"]["importlinter"]["contracts"]
    return found


def _path(room: str) -> Path:
    """Return the package's or module's file; a layer without one is refused."""
    root, *parts = room.split(".")
    base = ROOT.joinpath(_FOLDERS[root], *parts)
    package, module = base / "__init__.py", base.with_suffix(".py")
    if package.is_file() == module.is_file():
        raise FileNotFoundError(f"{room} is a floor of pyproject.toml, and neither file nor folder")
    return package if package.is_file() else module


def _shown(path: Path) -> str:
    shown = path.parent if path.name == "__init__.py" else path
    return shown.relative_to(ROOT).as_posix()


def _first_sentence(path: Path) -> str:
    said = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    if not said:
        raise ValueError(f"{_shown(path)} has no docstring: say what lives there")
    return said.split("\n\n")[0].replace("\n", " ")
