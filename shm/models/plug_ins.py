"""Members of a registry from outside this package, by the entry points of installed packages.

A package offers them in its `pyproject.toml`::

    [project.entry-points."shm.effects"]
    lamp = "bridge_extras.lamps:Lamp"

What cannot be loaded is named and left out with a `PlugInSkipped`, so that another's mistake does
not stop a measurement. A name that is taken raises UsageError: whichever of the two were silently
chosen, results would depend on what else is installed.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

from shm.errors import UsageError

EFFECTS_GROUP, MODELS_GROUP = "shm.effects", "shm.models"

M = TypeVar("M")


class PlugInSkipped(UserWarning):
    """A plug-in was left out; the message names it, its package and the reason."""


def members_with_plug_ins(group: str, built_in: Mapping[str, M], kind: type) -> dict[str, M]:
    """Return the `built_in` members and those installed under `group`, which are of `kind`.

    The built-in ones are all instances of `kind` or all classes of it, and what is plugged in
    becomes the same: of a class of effects an instance is made.
    """
    classes = all(isinstance(each, type) for each in built_in.values())
    found, home = dict(built_in), dict.fromkeys(built_in, "shm")
    for entry in sorted(entry_points(group=group), key=lambda each: (each.name, each.value)):
        try:
            name, member = _loaded(entry, kind, classes)
        except Exception as error:  # noqa: BLE001 - another's code may raise anything
            warnings.warn(
                f"{_describe(entry)} of {group} is left out: {type(error).__name__}: {error}",
                PlugInSkipped,
                stacklevel=2,
            )
            continue
        if name in found:
            raise UsageError(
                f"{group}: two are called {name!r}, that of {home[name]} and {_describe(entry)}.",
                remedy="Rename the plug-in's, or uninstall its package.",
            )
        found[name], home[name] = member, _describe(entry)
    return found


def _loaded(entry: EntryPoint, kind: type, as_class: bool) -> tuple[str, Any]:
    member = entry.load()
    if isinstance(member, type) and not as_class:
        member = member()
    of_class = member if isinstance(member, type) else type(member)
    if isinstance(member, type) != as_class or not issubclass(of_class, kind):
        raise TypeError(f"{entry.value} is no {kind.__name__}")
    name = getattr(member, "name", None)
    if not isinstance(name, str) or not name.isidentifier():
        raise TypeError(f"{entry.value} has no `name` of one word")
    return name, member


def _describe(entry: EntryPoint) -> str:
    package = entry.dist.name if entry.dist else "an unknown package"
    return f"plug-in {entry.name} = {entry.value} (package {package})"
