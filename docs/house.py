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
    """The floors as a table, the highest first, and below it the contracts beside them."""
    contracts = _contracts()
    (layers,) = [each["layers"] for each in contracts if each["type"] == "layers"]
    lines = ["| floor | room | what lives there |", "| --- | --- | --- |"]
    for number, layer in zip(range(len(layers), 0, -1), layers, strict=True):
        for place, room in enumerate(layer.split(" | ")):
            path = _path(room)
            floor = "" if place else str(number)
            lines.append(f"| {floor} | [`{room}`]({_shown(path)}) | {_first_sentence(path)} |")
    others = [f"- {each['name']}." for each in contracts if each["type"] != "layers"]
    return "\n".join([*lines, "", *others])


def _contracts() -> list[dict[str, str]]:
    described = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    found: list[dict[str, str]] = described["tool"]["importlinter"]["contracts"]
    return found


def _path(room: str) -> Path:
    """The package's or module's file; a layer that has none is refused."""
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
    return said.split("\n\n")[0].replace("\n", " ").replace("|", "/")
