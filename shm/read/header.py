"""Collect the entries of a file and its sidecar about a recording, each with its file and line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime
from pathlib import Path
from typing import Any

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
        number, entry = self._number("hanger", "Give the hanger's number, as in hanger: 3.")
        if entry is None:
            return None
        if not number.is_integer() or number < 0:
            raise entry.refusal(
                f"hanger = {entry.text} is not a whole number.", "Give the hanger's number."
            )
        return int(number)

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
        remedy = "Give degrees Celsius, or leave it out."
        number, entry = self._number("temperature_c", remedy)
        if entry is not None and not math.isnan(number) and math.isnan(outdoor_c(number)):
            raise entry.refusal(f"temperature_c = {entry.text} is no temperature outdoors.", remedy)
        return number

    @property
    def added_mass(self) -> AddedMass | None:
        """The known mass that was clamped on; None where nothing says one."""
        remedy = "Give both added_mass_kg and added_mass_at_m, from the deck end, or neither."
        mass_kg, mass = self._number("added_mass_kg", remedy)
        x_m, place = self._number("added_mass_at_m", remedy)
        of_radius = "Give its radius of gyration in m, 0 of a point, or leave it out."
        radius_m, radius = self._number("added_mass_radius_m", of_radius)
        only = mass or place or radius
        if only is None:
            return None
        if mass is None or place is None:
            raise only.refusal("a known mass needs its size and its place.", remedy)
        if not mass_kg > 0:
            raise mass.refusal(f"added_mass_kg = {mass.text} is not positive.", remedy)
        if not x_m >= 0:
            raise place.refusal(f"added_mass_at_m = {place.text} is below the deck end.", remedy)
        if radius is not None and not radius_m >= 0:
            raise radius.refusal(f"added_mass_radius_m = {radius.text} is negative.", of_radius)
        return AddedMass(mass_kg, x_m, None if radius is None else radius_m)

    @property
    def operator(self) -> str:
        """Return the person who measured; empty where nothing says it."""
        entry = self._given("operator")
        return "" if entry is None else entry.text

    @property
    def sampling_rate_hz(self) -> float:
        """NaN where nothing says it."""
        remedy = "Give the samples a second, as in sampling_rate_hz: 512."
        rate, entry = self._number("sampling_rate_hz", remedy)
        if entry is not None and not rate > 0:
            raise entry.refusal(f"sampling_rate_hz = {entry.text} is not positive.", remedy)
        return rate

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

    def calibration(self, name: str) -> float:
        """Return the units of `unit` per recorded unit, NaN where values are recorded in `unit`."""
        remedy = "Give a number other than 0: units of `unit` per recorded volt or count."
        factor, entry = self._number("calibration", remedy, name)
        if entry is not None and (factor == 0 or math.isnan(factor)):
            raise entry.refusal(f"calibration = {entry.text} is no factor.", remedy, name)
        return factor

    def full_scale(self, name: str) -> float:
        """Return the largest value that can be recorded, in `unit`; NaN if unknown."""
        remedy = "Give the largest value that can be recorded, in the channel's unit."
        largest, entry = self._number("full_scale", remedy, name)
        if entry is not None and largest <= 0:
            raise entry.refusal(f"full_scale = {entry.text} is not positive.", remedy, name)
        return largest

    def leaves_out(self, name: str) -> bool:
        """Return whether a channel is not to be used."""
        return self.has_entry(name, "leave_out") and is_true(self.channels[name]["leave_out"])

    def has_entry(self, name: str, key: str) -> bool:
        """Return whether anything is given for a key of a channel."""
        return self._given(key, name) is not None

    def x_m(self, name: str) -> float:
        return self._number("x_m", "Give metres from the deck end, or leave it empty.", name)[0]

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

    def _number(self, key: str, remedy: str, channel: str = "") -> tuple[float, Entry | None]:
        """Return a finite number and its entry; NaN where it is written as such, or none is."""
        entry = self._given(key, channel)
        if entry is None:
            return NAN, None
        text = entry.text
        if "," in text and "." not in text:
            text = text.replace(",", ".")
        try:
            number = float(text)
        except ValueError:
            number = math.inf
        if math.isinf(number):
            raise entry.refusal(f"{key} = {entry.text!r} is not a number.", remedy, channel)
        return number, entry


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
