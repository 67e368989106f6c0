"""Add to a table what its sidecar says, which goes before what the file says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from shm.errors import UsageError
from shm.read import logger_words as words
from shm.read.header import Entry, Header
from shm.read.sidecar import channels_described, with_sidecar
from shm.read.table import Column, Description, Role, Table


def describe(
    table: Table, *, with_sidecars: bool = True, units: Mapping[str, str] | None = None
) -> Description:
    """Return the table with what its sidecar says; raises BadInput where that is faulty.

    `units` by the names of columns override file and sidecar; raises UsageError for another name.
    """
    in_sidecar = channels_described(table.path) if with_sidecars else {}
    given = _by_column(units or {}, table)
    in_sidecar |= {name: {**in_sidecar.get(name, {}), **entry} for name, entry in given.items()}
    roles = {column.name: role_of(column, in_sidecar.get(column.name)) for column in table.columns}
    channels, responses = (
        [column for column in table.columns if roles[column.name] == role]
        for role in ("channel", "response")
    )
    # Time records go before frequency responses, but not a force alone.
    recorded = any(not column.name.lower().startswith("force") for column in channels)
    is_response = bool(responses) and not recorded
    found = responses if is_response else channels
    others = [column for column in table.columns if column not in found]
    header = Header(table.path, {c.name: c.stated for c in found}, table.entries_with(found))
    if with_sidecars:
        known = [*(column.name for column in others), *table.left_out]
        header = with_sidecar(header, table.path, known)
    header = header.merged_with(Header(table.path, given))
    out = [column for column in found if header.leaves_out(column.name)]
    used = tuple(column for column in found if column not in out)
    size = next((column.size for column in used or table.choosable), 0)
    fitting = [column for column in others if column.size == size]
    clocks = [column for column in fitting if roles[column.name] == "times"]
    times = next(iter(clocks), None)
    frequencies = next((c for c in fitting if roles[c.name] == "frequencies"), None)
    unit = _text(in_sidecar.get(times.name, {}), "unit") or times.unit if times else ""
    idle = [
        column
        for column in others
        if roles[column.name] == "other"
        or (roles[column.name] in ("times", "frequencies") and column.name in in_sidecar)
    ]
    named = [c.label or c.name for c in idle if c is not times and c is not frequencies]
    return Description(
        table,
        replace(header, channels={c.name: header.channels[c.name] for c in used}),
        used,
        is_response,
        times,
        words.seconds_of(unit) or 1.0,
        tuple(clocks[1:]),
        frequencies,
        (*named, *table.left_out, *(column.name for column in out)),
    )


def _by_column(units: Mapping[str, str], table: Table) -> dict[str, dict[str, Entry]]:
    names = [column.name for column in table.columns]
    for name in units:
        if name not in names:
            raise UsageError(
                f"units names the channel {name!r}, which the file does not have.",
                remedy=f"Its channels are {', '.join(names)}.",
            )
    return {name: {"unit": Entry(unit, table.path)} for name, unit in units.items()}


def role_of(column: Column, described: Mapping[str, Entry] | None) -> Role:
    """Return the role of a column that a sidecar describes so (None: not at all).

    Its unit goes before its name.
    """
    if described is None:
        return column.role
    if _text(described, "leave_out").lower() == "true":
        return column.role if column.role in ("channel", "response") else "other"
    unit = _text(described, "unit") or column.unit
    if column.is_complex:
        return "response" if column.role == "response" or words.is_accelerance(unit) else "other"
    if words.seconds_of(unit) is not None:
        return "times"
    if unit.strip(" []()").lower() == "hz":
        return "frequencies"
    return "coherence" if column.role == "coherence" else "channel"


def _text(described: Mapping[str, Entry], key: str) -> str:
    return described[key].text if key in described else ""
