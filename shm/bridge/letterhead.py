"""The table `[report]`: who makes the reports, and with which logo."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from shm.bridge.table import Table
from shm.errors import BadInput
from shm.values.letterhead import Letterhead

_TEXTS = ("organisation", "prepared_by", "checked_by", "logo")
_SUFFIXES = (".png", ".jpg", ".jpeg")


def letterhead_of(document: Mapping[str, Any], path: Path) -> Letterhead:
    """What `[report]` says; raises BadInput for what it cannot hold. The logo is not opened."""
    values = document.get("report", {})
    if not isinstance(values, dict):
        raise BadInput("report must be a table.", file=path, remedy="Write [report].")
    table = Table(values, "[report]", path)
    table.refuse_unknown(_TEXTS)
    organisation, prepared_by, checked_by, logo = (_text(table, key) for key in _TEXTS)
    if logo and Path(logo).suffix.lower() not in _SUFFIXES:
        raise table.refusal(f"logo = {logo!r} is no PNG or JPEG file", 'Write logo = "logo.png".')
    return Letterhead(organisation, prepared_by, checked_by, path.parent / logo if logo else None)


def _text(table: Table, key: str) -> str:
    return str(table.value(key, str, "is not a text", f'Write {key} = "...".', usual="")).strip()
