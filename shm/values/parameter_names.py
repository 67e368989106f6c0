"""Names of parameters: what is a logarithm, and what a text calls a parameter beside its unit."""

from __future__ import annotations

import re

_LOGARITHM = "log10_"


def base_name(name: str) -> str:
    """Return a parameter's name in the catalogue; in a pair, its effect stands before a dot."""
    return name.rpartition(".")[2]


def is_logarithm(name: str) -> bool:
    """Return True if the parameter is the log10 of a quantity."""
    return base_name(name).startswith(_LOGARITHM)


def quantity_name(name: str, unit: str) -> str:
    """Return the name of a parameter's quantity without its unit, which the text gives next to it.

    `mass_kg` is `mass`, `log10_k1` is `k1`, `x_m` is `place`.
    """
    plain = base_name(name).removeprefix(_LOGARITHM)
    plain = plain.removesuffix("_" + re.sub(r"\W+", "_", unit.lower()))
    return "place" if plain == "x" else plain.replace("_", " ")
