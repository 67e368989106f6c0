"""What an owner says of the ends: how they are held, and what hangs from a free one."""

from __future__ import annotations

from typing import get_args

from shm.bridge.table import Table
from shm.values import Support, Supports

_KINDS: tuple[Support, ...] = get_args(Support)
_KNOWN = ("deck", "arch", "both", "hanging_mass_kg")


def supports_of(table: Table | None) -> Supports:
    """The `[hanger.supports]` table; raises BadInput naming the key at fault."""
    if table is None:
        return Supports()
    table.refuse_unknown(_KNOWN)
    if "both" in table and ("deck" in table or "arch" in table):
        raise table.refusal("both stands beside deck or arch", "Give both, or each end.")
    both = _kind(table, "both", "clamped")
    supports = Supports(
        _kind(table, "deck", both),
        _kind(table, "arch", both),
        table.positive("hanging_mass_kg") if "hanging_mass_kg" in table else 0.0,
    )
    if supports.hanging_mass_kg and len(supports.ends("free")) != 1:
        raise table.refusal(
            "hanging_mass_kg needs one free end that it hangs from",
            'Write deck = "free", or leave the mass out.',
        )
    return supports


def _kind(table: Table, key: str, usual: Support) -> Support:
    value = table.values.get(key, usual)
    for kind in _KINDS:
        if value == kind:
            return kind
    raise table.refusal(
        f"{key} = {value!r} is no way to hold an end", f"Known: {', '.join(_KINDS)}."
    )
