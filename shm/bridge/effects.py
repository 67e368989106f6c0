"""What an owner says of the gap diagnosis: ranges of effects, and how exactly the bar was made."""

from __future__ import annotations

import math
from dataclasses import fields

from shm.bridge.table import Table
from shm.values import EffectPrior, Scatter

_LARGEST_SCATTER = 0.5


def scatter_of(table: Table | None) -> Scatter:
    """The `[hanger.scatter]` table; raises BadInput naming the key at fault."""
    if table is None:
        return Scatter()
    known = {field.name: getattr(Scatter(), field.name) for field in fields(Scatter)}
    table.refuse_unknown(known)
    return Scatter(
        **{key: table.fraction(key, usual, 0.0, _LARGEST_SCATTER) for key, usual in known.items()}
    )


def effect_priors_of(table: Table | None) -> tuple[EffectPrior, ...]:
    """The ranges of all `[hanger.effects.NAME]` tables, in the file's order.

    Whether the catalogue knows the names is for `shm.models.effects.check_effect_priors` to say.
    Raises BadInput where something is no range.
    """
    if table is None:
        return ()
    return tuple(
        EffectPrior(effect, parameter, *_range(inner, parameter))
        for effect in table.values
        for inner in (_effect(table, effect),)
        for parameter in inner.values
    )


def _effect(table: Table, effect: str) -> Table:
    values = table.values[effect]
    if not isinstance(values, dict):
        raise table.refusal(
            f"{effect} is not a table",
            "Write [hanger.effects.NAME], NAME an effect of docs/effects.md, and below it the "
            "ranges of its parameters.",
        )
    return Table(values, f"{table.label}.{effect}", table.path)


def _range(table: Table, parameter: str) -> tuple[float, float]:
    values = table.values[parameter]
    remedy = f"Write {parameter} = [LOWER, UPPER], two finite numbers."
    if not isinstance(values, list) or len(values) != 2 or not all(map(_is_number, values)):
        raise table.refusal(f"{parameter} = {values!r} is not a range", remedy)
    lower, upper = map(float, values)
    if lower >= upper:
        raise table.refusal(f"{parameter} = {values!r} does not rise", remedy)
    return lower, upper


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
