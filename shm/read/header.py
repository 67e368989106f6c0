"""Collect the entries of a file and its sidecar about a recording, each with its file and line."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime
from pathlib import Path
from typing import Any, NamedTuple

from shm.documents import format_time, parse_time
from shm.errors import BadInput
from shm.read.logger_words import (
    ACCELERANCE,
    KNOWN,
    SI,
    UNIT_MISSING,
    Unit,
    accelerance_si,
    means_force_alone,
    plane_meant,
    unit_of,
)
from shm.values import (
    NAN,
    PLANES,
    TEST_CONDITIONS,
    AddedMass,
    FrequencyResponse,
    Plane,
    Quantity,
    Recording,
    collect_conditions,
    outdoor_c,
)

KEYS = (
    "hanger",
    "time",
    "temperature_c",
    "added_mass_kg",
    "added_mass_at_m",
    "added_mass_radius_m",
    "operator",
    "sampling_rate_hz",
)
CHANNEL_KEYS = ("unit", "x_m", "plane", "calibration", "full_scale", "leave_out", "coherence")
_OF_ALL_CHANNELS = ("unit", "calibration", "full_scale")
_OF_MASS = ("added_mass_kg", "added_mass_at_m", "added_mass_radius_m")
_BOTH = "Give both added_mass_kg and added_mass_at_m, from the deck end, or neither."


class _Rule(NamedTuple):
    """Say which numbers a key may have, what is said of others, and what to do about it."""

    fits: Callable[[float], bool]
    fault: str
    remedy: str


_NUMBERS: Mapping[str, _Rule] = {
    "hanger": _Rule(
        lambda n: n.is_integer() and n >= 0, "is not a whole number",
        "Give the hanger's number, as in hanger: 3.",
    ),
    "temperature_c": _Rule(
        lambda n: math.isnan(n) or not math.isnan(outdoor_c(n)), "is no temperature outdoors",
        "Give degrees Celsius, or leave it out.",
    ),
    "added_mass_kg": _Rule(lambda n: n > 0, "is not positive", _BOTH),
    "added_mass_at_m": _Rule(lambda n: n >= 0, "is below the deck end", _BOTH),
    "added_mass_radius_m": _Rule(
        lambda n: n >= 0, "is negative",
        "Give its radius of gyration in m, 0 of a point, or leave it out.",
    ),
    "sampling_rate_hz": _Rule(
        lambda n: n > 0, "is not positive",
        "Give the samples a second, as in sampling_rate_hz: 512.",
    ),
    "x_m": _Rule(lambda n: True, "", "Give metres from the deck end, or leave it empty."),
    "calibration": _Rule(
        lambda n: bool(n) and not math.isnan(n), "is no factor",
        "Give a number other than 0: units of `unit` per recorded volt or count.",
    ),
    "full_scale": _Rule(
        lambda n: not n <= 0, "is not positive",
        "Give the largest value that can be recorded, in the channel's unit.",
    ),
}  # fmt: skip
"""Values are recorded in `unit` where no `calibration` is given."""


@dataclass(frozen=True)
class Entry:
    """A value as written, and where."""

    value: object
    file: Path
    line: int | None = None

    @property
    def text(self) -> str:
        return str(self.value).strip()

    def refusal(self, what: str, remedy: str, channel: str = "") -> BadInput:
        return BadInput(what, file=self.file, line=self.line, channel=channel, remedy=remedy)


@dataclass(frozen=True)
class Header:
    """Entries of the whole recording and of each channel, in the order of the channels."""

    file: Path
    channels: Mapping[str, Mapping[str, Entry]]
    entries: Mapping[str, Entry] = field(default_factory=dict)

    def merged_with(self, other: Header) -> Header:
        """Return this header with the entries of `other` in place of its equal keys."""
        channels = {
            name: {**stated, **other.channels.get(name, {})}
            for name, stated in self.channels.items()
        }
        return Header(self.file, channels, {**self.entries, **other.entries})

    @property
    def of_test(self) -> dict[str, Any]:
        """Return what is stated of the complete test, by the names of `TEST_CONDITIONS`."""
        return {name: getattr(self, name) for name in TEST_CONDITIONS}

    @property
    def hanger(self) -> int | None:
        number = self.number("hanger")
        return None if math.isnan(number) else int(number)

    @property
    def time(self) -> datetime | None:
        entry = self._given("time")
        if entry is None:
            return None
        try:
            text = entry.value.isoformat() if isinstance(entry.value, date) else entry.text
            return parse_time(text)
        except (ValueError, OverflowError):
            raise entry.refusal(
                f"time = {entry.text!r} is not an ISO 8601 time.", "Write 2026-05-01T10:00:00Z."
            ) from None

    @property
    def temperature_c(self) -> float:
        return self.number("temperature_c")

    @property
    def added_mass(self) -> AddedMass | None:
        """The known mass that was clamped on; None where nothing says one."""
        mass, place, radius = map(self._given, _OF_MASS)
        only = mass or place or radius
        if only is None:
            return None
        if mass is None or place is None:
            raise only.refusal("a known mass needs its size and its place.", _BOTH)
        mass_kg, x_m, radius_m = map(self.number, _OF_MASS)
        return AddedMass(mass_kg, x_m, None if radius is None else radius_m)

    @property
    def operator(self) -> str:
        """Return the person who measured; empty where nothing says it."""
        entry = self._given("operator")
        return "" if entry is None else entry.text

    @property
    def sampling_rate_hz(self) -> float:
        """NaN where nothing says it."""
        return self.number("sampling_rate_hz")

    def quantity_and_unit(self, name: str) -> tuple[Quantity, Unit]:
        """Return the quantity and unit of a channel: by its unit, else by its name, in SI."""
        entry = self.channels[name].get("unit")
        named = quantity_named(name)
        if entry is None or not entry.text:
            if named is None:
                raise BadInput(
                    "neither its name nor a unit says what it measures.",
                    file=self.file,
                    channel=name,
                    remedy=f"Name it force or acc_1, or give its unit: {KNOWN}.",
                )
            return named, Unit(named, 1.0)
        if entry.text == UNIT_MISSING:
            raise entry.refusal("nothing says its unit.", f"Give one of {KNOWN}.", name)
        unit = unit_of(entry.text)
        if unit is None or named not in (None, unit.quantity):
            what = f"the unit {entry.text!r} is not one of {named or 'force or acceleration'}."
            raise entry.refusal(what, f"Give one of {KNOWN}.", name)
        return unit.quantity, unit

    def unit_text(self, name: str) -> str:
        """Return the unit as written, else the SI unit of the quantity that the name gives."""
        entry = self.channels[name].get("unit")
        named = quantity_named(name)
        if entry is not None and entry.text:
            return entry.text
        return SI[named] if named else ""

    def accelerance_si(self, name: str) -> float:
        """Return the factor of a frequency response to m/s^2/N by its unit; 1 without a unit."""
        text = self.unit_text(name) if self.has_entry(name, "unit") else ACCELERANCE
        factor = accelerance_si(text, "")
        if factor is None or unit_of(text) is not None:
            raise self.channels[name]["unit"].refusal(
                f"the unit {text!r} is not one of acceleration over force.",
                "Export accelerances, in m/s2/N or g/N.",
                name,
            )
        return factor

    def leaves_out(self, name: str) -> bool:
        """Return whether a channel is not to be used."""
        return self.has_entry(name, "leave_out") and is_true(self.channels[name]["leave_out"])

    def has_entry(self, name: str, key: str) -> bool:
        """Return whether anything is given for a key of a channel."""
        return self._given(key, name) is not None

    def plane(self, name: str) -> Plane | None:
        entry = self._given("plane", name)
        if entry is None:
            return None
        for plane in PLANES:
            if entry.text.lower() == plane:
                return plane
        raise entry.refusal(
            f"plane = {entry.text!r} is unknown.", f"Give {' or '.join(PLANES)}.", name
        )

    def _given(self, key: str, channel: str = "") -> Entry | None:
        entry = (self.channels[channel] if channel else self.entries).get(key)
        return entry if entry is not None and entry.text else None

    def number(self, key: str, channel: str = "") -> float:
        """Return the number of a key of `_NUMBERS`; NaN where it is written so, or none is."""
        entry, rule = self._given(key, channel), _NUMBERS[key]
        if entry is None:
            return NAN
        text = entry.text
        if "," in text and "." not in text:
            text = text.replace(",", ".")
        try:
            number = float(text)
        except ValueError:
            number = math.inf
        if math.isinf(number):
            raise entry.refusal(f"{key} = {entry.text!r} is not a number.", rule.remedy, channel)
        if not rule.fits(number):
            raise entry.refusal(f"{key} = {entry.text} {rule.fault}.", rule.remedy, channel)
        return number


def quantity_named(name: str) -> Quantity | None:
    """Return the quantity that a channel's name gives: force..., hammer..., acc...; else None."""
    lowered = name.lower()
    if lowered.startswith(("force", "hammer")):
        return "force"
    return "acceleration" if lowered.startswith("acc") else None


def is_measured(name: str, unit: str) -> bool:
    """Return whether a file itself says that a column is a force or an acceleration, in a unit."""
    return unit_of(unit) is not None and not _is_doubtful(name, unit)


def _is_doubtful(name: str, unit: str) -> bool:
    """Return whether a load cell, by its name, is in a unit of acceleration: g may be its grams."""
    known = unit_of(unit)
    in_g = known is not None and known.quantity == "acceleration"
    return in_g and means_force_alone(name)


def stated_entries(name: str, unit: str, path: Path, line: int | None = None) -> dict[str, Entry]:
    """Return what a logger's name and unit say of a channel, by the keys of a sidecar."""
    measured, plane = unit_of(unit), plane_meant(name)
    if _is_doubtful(name, unit) or (quantity_named(name) and not unit):
        unit = UNIT_MISSING  # a name such as force promises newtons in our own files alone
    entries = {"unit": unit}
    if plane is not None and measured is not None and measured.quantity == "acceleration":
        entries["plane"] = plane
    return {key: Entry(value, path, line) for key, value in entries.items() if value}


def is_true(entry: Entry) -> bool:
    """Return the truth of `leave_out`; raises BadInput for anything but true and false."""
    if entry.text.lower() not in ("true", "false"):
        raise entry.refusal(
            f"leave_out = {entry.text!r} is neither true nor false.", "Give leave_out = true."
        )
    return entry.text.lower() == "true"


def spread(
    key: str, values: Sequence[Entry], names: Sequence[str], where: Entry
) -> dict[str, Entry]:
    """Return the values of a list, one a channel, by channel name.

    One value alone, and a list as long as the accelerations, goes to the accelerations, except
    that units, calibrations and full scales must be given for all channels.
    """
    if len(values) == len(names):
        return dict(zip(names, values, strict=True))
    accelerations = [name for name in names if quantity_named(name) != "force"]
    if key == "plane" and len(values) == 1:
        return dict.fromkeys(accelerations, values[0])
    if key not in _OF_ALL_CHANNELS and len(values) == len(accelerations):
        return dict(zip(accelerations, values, strict=True))
    raise where.refusal(
        f"{key} has {len(values)} values for {len(names)} channels.",
        f"Give one a channel, in this order: {', '.join(names)}.",
    )


def known_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values that are neither None, nor NaN, nor an empty text."""
    return {
        key: value for key, value in values.items() if value not in (None, "") and value == value
    }


def entries_of(values: Mapping[str, Any], path: Path) -> dict[str, Entry]:
    """Return the known values of a file as entries."""
    return {key: Entry(value, path) for key, value in known_values(values).items()}


def condition_entries(described: Recording | FrequencyResponse) -> dict[str, Any]:
    """Return the entries that state the conditions of a test; what is unknown is left out."""
    known = collect_conditions(described)
    mass: AddedMass | None = known.pop("added_mass")
    if mass is not None:
        known |= {
            "added_mass_kg": mass.mass_kg,
            "added_mass_at_m": mass.x_m,
            "added_mass_radius_m": mass.radius_of_gyration_m,
        }
    return known_values({**known, "time": format_time(known["time"])})
