"""Reads `bridge.toml`: the bridge, its hangers, their thresholds, the hooks, the settings."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from shm.errors import BadInput
from shm.values import Hanger, Thresholds

_REQUIRED = ("id", "length_m", "elastic_modulus_pa", "nominal_tension_n")
_SECTION = ("diameter_m",)
_SECTION_GIVEN = ("area_m2", "second_moment_m4", "mass_per_length_kg_m")
_OPTIONAL = ("name", "density_kg_m3", "thresholds")
_KNOWN = {*_REQUIRED, *_SECTION, *_SECTION_GIVEN, *_OPTIONAL}


@dataclass(frozen=True)
class Hook:
    """A command run for each alert, which it gets as JSON on standard input; no shell."""

    name: str
    command: tuple[str, ...]


@dataclass(frozen=True)
class Bridge:
    """What `bridge.toml` says."""

    name: str
    hangers: tuple[Hanger, ...]
    hooks: tuple[Hook, ...]
    settings_table: Mapping[str, object]
    source: str

    def hanger(self, hanger_id: int) -> Hanger:
        """The hanger of that number; raises BadInput when the bridge has none such."""
        for hanger in self.hangers:
            if hanger.id == hanger_id:
                return hanger
        known = ", ".join(str(hanger.id) for hanger in self.hangers) or "none"
        raise BadInput(
            f"hanger {hanger_id} is not described in {Path(self.source).name} (known: {known}).",
            remedy="Add a [[hanger]] table with this id, or correct the number.",
        )


def load_bridge(path: Path) -> Bridge:
    """Reads and checks `bridge.toml`; raises BadInput naming the table and key at fault."""
    document = _parse(path)
    hangers = tuple(_hanger(table, path) for table in _tables(document, "hanger", path))
    _refuse_doubles([hanger.id for hanger in hangers], "hanger id", path)
    hooks = tuple(_hook(table, path) for table in _tables(document, "hook", path))
    _refuse_doubles([hook.name for hook in hooks], "hook name", path)
    return Bridge(
        name=str(document.get("bridge", {}).get("name", path.parent.name)),
        hangers=hangers,
        hooks=hooks,
        settings_table=document.get("settings", {}),
        source=str(path),
    )


def load_hanger(path: Path, hanger_id: int | None = None) -> Hanger:
    """One hanger of a file (`--hanger-file`); `hanger_id` is needed where the file has several."""
    bridge = load_bridge(path)
    if hanger_id is not None:
        return bridge.hanger(hanger_id)
    if len(bridge.hangers) != 1:
        raise BadInput(
            f"{len(bridge.hangers)} [[hanger]] tables where one is expected.",
            file=path,
            remedy="Keep one table, or say which with --hanger N.",
        )
    return bridge.hangers[0]


def _parse(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise BadInput(
            "no such file.",
            file=path,
            remedy="Make a workspace with `shm init`, or name one with --workspace.",
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise BadInput(
            f"not a readable TOML file: {error}.", file=path, remedy="Correct the file."
        ) from error


def _tables(document: Mapping[str, Any], name: str, path: Path) -> list[dict[str, Any]]:
    tables = document.get(name, [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise BadInput(f"{name} must be a list of tables.", file=path, remedy=f"Write [[{name}]].")
    return tables


def _refuse_doubles(keys: list[Any], what: str, path: Path) -> None:
    for key in keys:
        if keys.count(key) > 1:
            raise BadInput(f"{what} {key} is given twice.", file=path, remedy="Keep one of them.")


def _hanger(table: dict[str, Any], path: Path) -> Hanger:
    label = f"[[hanger]] id {table.get('id', '?')}"
    for key in table.keys() - _KNOWN:
        raise BadInput(
            f"{label}: unknown key {key}.", file=path, remedy=f"Known: {', '.join(sorted(_KNOWN))}."
        )
    numbers = {key: _positive(table, key, label, path) for key in _REQUIRED[1:]}
    area, second_moment, mass = _section(table, label, path)
    return Hanger(
        id=_whole_number(table, label, path),
        area_m2=area,
        second_moment_m4=second_moment,
        mass_per_length_kg_m=mass,
        name=str(table.get("name", "")),
        thresholds=_thresholds(table.get("thresholds", {}), label, path),
        **numbers,
    )


def _section(table: dict[str, Any], label: str, path: Path) -> tuple[float, float, float]:
    """Area, second moment and mass per length, given or those of a round bar."""
    if "diameter_m" not in table:
        area, second_moment, mass = (_positive(table, key, label, path) for key in _SECTION_GIVEN)
        return area, second_moment, mass
    diameter = _positive(table, "diameter_m", label, path)
    area = math.pi * diameter**2 / 4
    round_bar = {
        "area_m2": area,
        "second_moment_m4": math.pi * diameter**4 / 64,
        "mass_per_length_kg_m": area * _positive(table, "density_kg_m3", label, path)
        if "mass_per_length_kg_m" not in table
        else 0.0,
    }
    area, second_moment, mass = (
        _positive(table, key, label, path) if key in table else round_bar[key]
        for key in _SECTION_GIVEN
    )
    return area, second_moment, mass


def _positive(table: Mapping[str, Any], key: str, label: str, path: Path) -> float:
    value = table.get(key)
    if (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and math.isfinite(value)
        and value > 0
    ):
        return float(value)
    problem = (
        f"{key} is missing" if value is None else f"{key} = {value!r} is not a positive number"
    )
    raise BadInput(f"{label}: {problem}.", file=path, remedy=f"Give {key} in SI units.")


def _whole_number(table: Mapping[str, Any], label: str, path: Path) -> int:
    value = table.get("id")
    if isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return value
    raise BadInput(
        f"{label}: id must be a whole number.", file=path, remedy="Give id = 1, 2, 3, ..."
    )


def _thresholds(table: Any, label: str, path: Path) -> Thresholds:
    known = {field.name for field in fields(Thresholds)}
    if not isinstance(table, dict) or table.keys() - known:
        raise BadInput(
            f"{label}: thresholds has an unknown key.",
            file=path,
            remedy=f"Known: {', '.join(sorted(known))}.",
        )
    values = {key: _positive(table, key, f"{label} thresholds", path) for key in table}
    if values.get("alert_probability", 0.5) >= 1:
        raise BadInput(
            f"{label}: alert_probability must lie below 1.", file=path, remedy="Give 0.95, say."
        )
    return Thresholds(**values)


def _hook(table: dict[str, Any], path: Path) -> Hook:
    name, command = table.get("name"), table.get("command")
    whole = isinstance(name, str) and name and isinstance(command, list) and command
    if not whole or not all(isinstance(part, str) for part in command or ()):
        raise BadInput(
            "a [[hook]] needs a name and a command.",
            file=path,
            remedy='Write name = "mail" and command = ["/path/to/program", "argument"].',
        )
    return Hook(name=str(name), command=tuple(command or ()))
