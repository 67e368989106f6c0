"""Every number that is written down in a package, and the table of those that were agreed.

Most were measured or judged: what depends on one stays plausible with another, so that no other
test need notice. Who changes one on purpose measures again what stands beside it, and writes the
tables anew: `python -m tests.helpers.agreed`.
"""

from __future__ import annotations

import ast
import inspect
import math
import pkgutil
import re
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import MISSING, fields, is_dataclass
from datetime import timedelta
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

TABLES = Path(__file__).parent / "agreed"
PACKAGES = (
    "shm.read", "shm.identify", "shm.models", "shm.simulate", "shm.inference", "shm.watch",
    "shm.plausibility", "shm.monitor", "shm.gap", "shm.store", "shm.report", "shm.pipeline",
    "shm.blind", "shm.values", "shm.bridge", "shm_cli", "shm_daemon",
)  # fmt: skip
_LONGEST = 60
"""Signs of a value in a table: what is longer is kept as its checksum."""


def changed_numbers(package: str) -> dict[str, tuple[str | None, str | None]]:
    """What a package says now and what was agreed, by name, where these differ."""
    now, kept = numbers_of(package), _kept(package)
    return {
        name: (now.get(name), kept.get(name))
        for name in sorted(now.keys() | kept.keys())
        if now.get(name) != kept.get(name)
    }


def numbers_of(package: str) -> dict[str, str]:
    """Module constants, defaults of functions and of classes, and what their bodies name."""
    return {name: _short(said) for name, said in _numbers(package)}


def _numbers(package: str) -> Iterator[tuple[str, str]]:
    for module in _modules(package):
        place = module.__name__.removeprefix(package).lstrip(".")
        tree = ast.parse(Path(module.__file__ or "").read_text(encoding="utf-8"))
        for name in _assigned(tree):
            yield from _told(f"{place}.{name}", getattr(module, name, None))
        for made in vars(module).values():
            if getattr(made, "__module__", None) != module.__name__:
                continue
            if inspect.isclass(made):
                yield from _of_class(f"{place}.{made.__name__}", made)
            elif inspect.isfunction(made):
                yield from _of_function(f"{place}.{made.__name__}", made)


def _modules(package: str) -> Iterator[ModuleType]:
    root = import_module(package)
    yield root
    for found in pkgutil.walk_packages(getattr(root, "__path__", ()), f"{package}."):
        if not found.name.endswith("__main__"):
            yield import_module(found.name)


def _assigned(tree: ast.Module) -> Iterator[str]:
    for node in tree.body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        for target in targets:
            for each in ast.walk(target) if target else ():
                if isinstance(each, ast.Name):
                    yield each.id


def _of_class(name: str, made: type) -> Iterator[tuple[str, str]]:
    if is_dataclass(made):
        for field in fields(made):
            if field.default is not MISSING:
                yield from _told(f"{name}.{field.name}", field.default)
    for key, value in vars(made).items():
        if inspect.isfunction(value):
            yield from _of_function(f"{name}.{key}", value)
        elif not key.startswith("__") and not key.startswith("_abc"):
            yield from _told(f"{name}.{key}", value)


def _of_function(name: str, made: Callable[..., Any]) -> Iterator[tuple[str, str]]:
    for parameter in inspect.signature(made).parameters.values():
        if parameter.default is not inspect.Parameter.empty:
            yield from _told(f"{name}({parameter.name})", parameter.default)


def _told(name: str, value: Any) -> Iterator[tuple[str, str]]:
    said = _words(value)
    if said is not None and re.search(r"\d|nan|inf|True|False", said):
        yield name, said


def _words(value: Any) -> str | None:
    """None for what is no number and holds none."""
    if isinstance(value, bool | np.bool_ | int | np.integer):
        return str(value)
    if isinstance(value, float | np.floating):
        return "nan" if math.isnan(value) else f"{float(value):.6g}"
    if isinstance(value, timedelta):
        return f"{value.total_seconds():.6g} s"
    if isinstance(value, complex):
        return f"{value:.6g}"
    if isinstance(value, str):
        return None
    if isinstance(value, Mapping):
        parts = [f"{key}: {said}" for key, each in value.items() if (said := _words(each))]
        return f"{{{', '.join(parts)}}}" if parts else None
    if isinstance(value, Set):
        return f"{{{', '.join(sorted(filter(None, map(_words, value))))}}}"
    if isinstance(value, np.ndarray | Sequence):
        parts = [said for each in value if (said := _words(each))]
        return f"[{', '.join(parts)}]" if parts else None
    if is_dataclass(value) and not isinstance(value, type):
        own = {each.name: getattr(value, each.name) for each in fields(value)}
        return _words(own)
    return None


def _short(said: str) -> str:
    plain = " ".join(said.split())
    return plain if len(plain) <= _LONGEST else f"crc {zlib.crc32(plain.encode()):08x}"


def _kept(package: str) -> dict[str, str]:
    lines = (TABLES / f"{package}.txt").read_text(encoding="utf-8").splitlines()
    return dict(line.split(" = ", 1) for line in lines)


def main() -> None:
    TABLES.mkdir(exist_ok=True)
    for package in PACKAGES:
        lines = [f"{name} = {said}\n" for name, said in sorted(numbers_of(package).items())]
        (TABLES / f"{package}.txt").write_text("".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
