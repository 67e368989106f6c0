"""The unit of a parameter, from its name and the model class that has it."""

from __future__ import annotations

_NONE = ("theta_F", "theta_L", "sigma", "section", "density", "length", "modulus")
_UNITS = {"kg": "kg", "m": "m", "n": "N", "hz": "Hz", "s": "s", "rad": "rad", "c": "degC"}


def unit_of(name: str, model: str) -> str:
    """As a text, `1` where it has none; empty where the name does not say.

    End springs are in N m/rad for beams, in N/m a node for solids; of a logarithm, the unit of what
    it is the logarithm of.
    """
    if name in _NONE:
        return "1"
    if name.startswith("log10_k") and "+" not in model:
        return "log10(N m/rad)" if model.startswith("beam") else "log10(N/m)"
    return _UNITS.get(name.rpartition("_")[2], "")
