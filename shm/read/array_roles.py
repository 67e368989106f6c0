"""What each array of a file is for: a channel, a frequency response, times, or nothing of ours."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Literal

from shm.read.arrays import Variable
from shm.read.header import Entry, quantity_named
from shm.read.units import accelerance_si, unit_of

Role = Literal["channel", "response", "coherence", "times", "frequencies", "left out"]

_TIMES = {"t", "time", "times", "timedomain", "timevector", "timeaxis", "times_s"}
_FREQUENCIES = {"f", "freq", "frequency", "frequencies", "frequencyhz", "freqdomain", "freqhz"}
_SECONDS = {"s", "sec", "second", "seconds"}
_RESPONSES = ("frf", "accelerance")
_MASS = {"addedmasskg": "added_mass_kg", "addedmassatm": "added_mass_at_m"}
_RATES = {
    "samplingratehz", "samplingrate", "samplerate", "samplefrequency", "samplingfrequency",
    "samplingfreq", "samplefreq", "fs", "fshz", "timesamplerate",
}  # fmt: skip
_STEPS = {"dt", "dts", "timestep", "samplinginterval", "sampleinterval", "wfincrement"}
_MOMENTS = {"time", "starttime", "wfstarttime", "timeutc"}
_UNITS = ("unit", "units", "unit_string", "unitstring", "y_unit", "engineering_units")


def role(variable: Variable, described: Mapping[str, Entry] | None) -> Role:
    """The role of a variable that the sidecar describes so (None: not at all).

    Unit goes before name; what nobody names and does not look like a channel is left out.
    """
    if not variable.is_series or (described and says(described, "leave_out").lower() == "true"):
        return "left out"
    unit = says(described or {}, "unit") or unit_in(variable)
    named = described is not None or quantity_named(variable.name) is not None
    if variable.kind == "c":
        return "response" if _is_accelerance(unit) or _names_response(variable.name) else "left out"
    by_unit = _role_of_unit(unit)
    if by_unit is not None:
        return by_unit
    if variable.name.lower().endswith("_coherence"):
        return "coherence"
    return "channel" if named else _role_of_name(variable.name)


def unit_in(variable: Variable) -> str:
    """The unit that a variable's attributes give, in any of the spellings of loggers."""
    found = (str(variable.attributes[key]) for key in _UNITS if key in variable.attributes)
    return next((text.strip() for text in found if text.strip()), "")


def facts(attributes: Mapping[str, object]) -> dict[str, object]:
    """Hanger, time, temperature, known mass, sampling rate in any of the spellings of loggers."""
    found: dict[str, object] = {}
    for name, value in attributes.items():
        key = _bare(name)
        if key == "hanger":
            found["hanger"] = value
        elif key == "temperaturec":
            found["temperature_c"] = value
        elif key in _MASS:
            found[_MASS[key]] = value
        elif key in _MOMENTS and not isinstance(value, (int, float)):
            found["time"] = value
        elif key in _RATES:
            found["sampling_rate_hz"] = value
        elif key in _STEPS and isinstance(value, (int, float)) and value > 0:
            found.setdefault("sampling_rate_hz", 1 / value)
    return found


def says(described: Mapping[str, Entry], key: str) -> str:
    """What an entry says, empty where there is none."""
    return described[key].text if key in described else ""


def _role_of_unit(unit: str) -> Role | None:
    plain = unit.strip(" []()").lower()
    if plain in _SECONDS:
        return "times"
    if plain == "hz":
        return "frequencies"
    return "channel" if unit_of(unit) is not None else None


def _role_of_name(name: str) -> Role:
    bare = _bare(name)
    if bare in _TIMES:
        return "times"
    return "frequencies" if bare in _FREQUENCIES else "left out"


def _is_accelerance(unit: str) -> bool:
    return "/" in unit.replace(")(", ")/(") and accelerance_si(unit, "") is not None


def _names_response(name: str) -> bool:
    return name.lower().startswith(_RESPONSES) or quantity_named(name) == "acceleration"


def _bare(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())
