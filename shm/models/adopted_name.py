"""Names of adopted model classes: a baseline and the effects that a hanger's owner made part of it.

    beam1+point_mass@everywhere
    beam1+rotational_end_flexibility@deck_end.transverse+bending_stiffness@everywhere
    beam1+temperature_tension@everywhere:reference_c=10:tension_per_kelvin_n_k=-1300..-900

Behind an effect stands where it acts (`Variant.key`), then what the effect needs to be predicted in
a single test: `reference_c`, the temperature at which it vanishes, and ranges of its parameters as
the diagnosis of many tests found them. So a name says all of a class that its hanger does not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from shm.errors import UsageError
from shm.values import NAN

_REFERENCE = "reference_c"
_REMEDY = "Write BASELINE+EFFECT@WHERE, such as beam1+point_mass@everywhere."


@dataclass(frozen=True)
class AdoptedEffect:
    """One effect of an adopted class: its name and the key of where it acts.

    `reference_c` is NaN where the effect does not follow the temperature; `ranges` replace those of
    the class's parameters.
    """

    effect: str
    key: str
    reference_c: float = NAN
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __str__(self) -> str:
        reference = (
            "" if math.isnan(self.reference_c) else f":{_REFERENCE}={_text(self.reference_c)}"
        )
        ranges = "".join(
            f":{name}={_text(low)}..{_text(high)}" for name, (low, high) in self.ranges.items()
        )
        return f"{self.effect}@{self.key}{reference}{ranges}"


@dataclass(frozen=True)
class AdoptedName:
    """A baseline with effects; as text, the name of their model class."""

    baseline: str
    effects: tuple[AdoptedEffect, ...]

    def __str__(self) -> str:
        return "+".join([self.baseline, *map(str, self.effects)])

    @classmethod
    def parse(cls, text: str) -> AdoptedName:
        """The parts of a name; raises UsageError where it is malformed."""
        baseline, *effects = text.split("+")
        if not baseline or not effects:
            raise _malformed(text, "it names no baseline or no effect")
        return cls(baseline, tuple(_effect(part, text) for part in effects))


def is_adopted(name: str) -> bool:
    """Whether a model class's name is that of a baseline with effects."""
    return "+" in name


def _effect(part: str, text: str) -> AdoptedEffect:
    where, *options = part.split(":")
    effect, _, key = where.partition("@")
    if not effect or not key:
        raise _malformed(text, f"{part!r} is not EFFECT@WHERE")
    values = dict(_option(option, text) for option in options)
    (reference_c, _) = values.pop(_REFERENCE, (NAN, NAN))
    return AdoptedEffect(effect, key, reference_c, values)


def _option(option: str, text: str) -> tuple[str, tuple[float, float]]:
    """A name and its range; that of the reference begins and ends alike."""
    name, _, value = option.partition("=")
    low, _, high = value.partition("..")
    try:
        limits = float(low), float(high or low)
    except ValueError:
        raise _malformed(text, f"{option!r} is not NAME=LOW..HIGH") from None
    wrong = bool(high) if name == _REFERENCE else not limits[0] < limits[1]
    if wrong or not all(map(math.isfinite, limits)):
        raise _malformed(text, f"{option!r} is neither a temperature nor a rising range")
    return name, limits


def _text(value: float) -> str:
    """A number without the sign that joins effects."""
    return f"{value:.6g}".replace("e+", "e")


def _malformed(text: str, why: str) -> UsageError:
    return UsageError(f"{text!r} is no name of a model class: {why}.", remedy=_REMEDY)
