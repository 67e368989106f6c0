"""Changes of `bridge.toml` by the page Settings, laid over the file.

A key names a place: `hanger.3.thresholds.alert_probability`, `settings.false_call_years`,
`hook.mail.escalation_after_seconds`. Programs, addresses and secrets of hooks are not among them:
who may sign in must not have the daemon's computer run anything.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from shm.bridge.hooks import QUIET_HOURS
from shm.values import Limits, Thresholds

HANGER_KEYS = tuple(
    f"{table}.{field.name}"
    for table, kind in (("thresholds", Thresholds), ("limits", Limits))
    for field in fields(kind)
)
SETTING_KEYS = (
    "false_call_years",
    "alert_grouping_seconds",
    "hook_attempts",
    "hook_backoff_seconds",
    "hook_timeout_seconds",
    "quiet_days",
    "backup_days",
)
HOOK_KEYS = ("escalation_after_seconds", QUIET_HOURS)


def overlaid(document: Mapping[str, Any], changed: Mapping[str, object]) -> dict[str, Any]:
    """Return a document of `bridge.toml` with changes; those of unknown tables do nothing.

    An empty text takes the key out.
    """
    made = copy.deepcopy(dict(document))
    for key, value in changed.items():
        table, name = _place(made, key)
        if table is not None and value == "":
            table.pop(name, None)
        elif table is not None:
            table[name] = value
    return made


def _place(document: dict[str, Any], key: str) -> tuple[dict[str, Any] | None, str]:
    """Return the table of a key, None where the file has none such, and the key's name there."""
    kind, _, rest = key.partition(".")
    if kind == "settings":
        return document.setdefault("settings", {}), rest
    if kind == "hook":
        hook, _, name = rest.rpartition(".")  # the name of a hook may have dots
        return _one(document, "hook", "name", hook), name
    number, _, rest = rest.partition(".")
    part, _, name = rest.partition(".")
    found = _one(document, "hanger", "id", number) or _one(document, "structure", "id", number)
    return (None if found is None else found.setdefault(part, {})), name


def _one(document: dict[str, Any], kind: str, key: str, value: str) -> dict[str, Any] | None:
    tables = document.get(kind, [])
    return next((each for each in tables if str(each.get(key)) == value), None)
