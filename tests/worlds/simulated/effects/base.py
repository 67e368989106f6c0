"""What can be planted in a hanger: names, places, parameters with ranges, and what it does."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from shm.errors import UsageError
from shm.simulate import PlantedEffect
from shm.values import NAN, PLANES, AddedMass, Hanger
from tests.worlds.simulated.bar.description import Bar

__all__ = [
    "Plantable", "PlantedEffect", "Range", "Scene", "TestConditions", "Where", "where_of",
]  # fmt: skip

_ENDS = {"deck end": (0,), "arch end": (1,), "both ends": (0, 1)}
_SENSOR = re.compile(r"sensor at (\d+(?:\.\d+)?) m")
_ROUNDED = 0.0051  # m: sensors are named to the centimetre


@dataclass(frozen=True)
class TestConditions:
    """What a test is made under: `temperature_shift_k` from the tests' mean, `amplitude` from the
    reference level, a known mass clamped on, and the test's name.
    """

    __test__ = False

    test: str = ""
    temperature_shift_k: float = 0.0
    amplitude: float = 1.0
    added_mass: AddedMass | None = None


@dataclass(frozen=True)
class Where:
    """Where an effect acts, read from its `at`; `sensor_m` NaN is all sensors, no `test` all."""

    ends: tuple[int, ...] = ()
    planes: tuple[int, ...] = (0, 1)
    sensor_m: float = NAN
    test: str = ""

    def chosen(self, places_m: Sequence[float]) -> tuple[float, ...]:
        """The sensors' places that are meant."""
        if math.isnan(self.sensor_m):
            return tuple(places_m)
        return tuple(place for place in places_m if abs(place - self.sensor_m) < _ROUNDED)


@dataclass(frozen=True)
class Range:
    """What is physical for a parameter, from its weakest value to its strongest.

    `zero` is the value without effect, NaN where the parameter only says where or how. A `signed`
    range holds for either sign.
    """

    weak: float
    strong: float
    zero: float = NAN
    logarithmic: bool = False
    signed: bool = False

    @property
    def is_size(self) -> bool:
        return not math.isnan(self.zero)

    def value(self, share: float) -> float:
        """From the weakest at 0 to the strongest at 1."""
        if self.logarithmic:
            return float(self.weak * (self.strong / self.weak) ** share)
        return self.weak + (self.strong - self.weak) * share


@dataclass(frozen=True)
class Scene:
    """What an effect is told: where it acts, the test, the hanger, and where sensors sit."""

    where: Where
    conditions: TestConditions
    hanger: Hanger
    places_m: tuple[float, ...]


@dataclass(frozen=True)
class Plantable:
    """A member of the registry.

    `places` are the kinds of `at`, `only_if_not_round` further ones that a round bar has not;
    `ranges` gives the parameters, sizes first; `apply` changes the bar.
    """

    name: str
    places: tuple[str, ...]
    ranges: Callable[[Hanger, Where], dict[str, Range]]
    apply: Callable[[Bar, Mapping[str, float], Scene], Bar]
    only_if_not_round: tuple[str, ...] = ()


def where_of(at: str) -> Where:
    """Reads an `at`; raises UsageError where it is none."""
    found: dict[str, object] = {}
    for word in at.split(", "):
        sensor = _SENSOR.fullmatch(word)
        if word in _ENDS:
            found["ends"] = _ENDS[word]
        elif word in PLANES:
            found["planes"] = (PLANES.index(word),)
        elif sensor:
            found["sensor_m"] = float(sensor[1])
        elif word.startswith("test "):
            found["test"] = word.removeprefix("test ")
        elif word not in ("everywhere", "all sensors", "all tests"):
            raise UsageError(
                f"{at!r} is no place of an effect.",
                remedy="Use everywhere, deck end, arch end, both ends, all sensors, all tests, "
                "`sensor at 3.60 m` or `test t3`, with a plane after a comma for that one alone.",
            )
    return Where(**found)  # type: ignore[arg-type]
