"""What an effect of the catalogue is: places where it may act, parameters, and a physical term."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from shm.models.base import Conditions
from shm.models.hanger.physical import PhysicalHanger
from shm.values import AddedMass, FloatArray, Hanger, Plane

GRADUAL = (0.6, 1.0, 1.4)
"""Reaches of three steps that stand for one gradual edge."""
STEEP = (0.8, 1.0, 1.2)
"""Half as gradual."""


@dataclass(frozen=True)
class Survey:
    """What the tests of a hanger measure and vary; each field sorted, without repeats or NaN."""

    tests: tuple[str, ...]
    planes: tuple[Plane, ...]
    sensor_places_m: tuple[float, ...]
    biaxial: bool
    temperatures_c: tuple[float, ...]
    amplitudes: tuple[float, ...]
    added_masses: tuple[AddedMass, ...]
    tensions_read_n: tuple[float, ...] = ()


@dataclass(frozen=True)
class Variant:
    """Where an effect acts: `ends` (deck 0, arch 1), `planes`, the index of a sensor, a test.

    `at` says it in words; `key` in a word that may stand in the name of a model class. `places_m`
    are those of the sensors where the effect acts at each of them. With `alike` one value serves
    all its planes. `law` counts the effect's `other_laws` from 1; 0 is its own.
    """

    at: str = "everywhere"
    ends: tuple[int, ...] = ()
    planes: tuple[int, ...] = (0, 1)
    sensor: int | None = None
    test: str = ""
    places_m: tuple[float, ...] = ()
    alike: bool = False
    law: int = 0

    @property
    def key(self) -> str:
        return self.at.replace(", ", ".").replace(" ", "_")


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect with its prior, and why an engineer would defend it.

    `spread` says in what the prior is uniform: the value or its logarithm; `signed` lets a
    logarithmic one have either sign with equal chance. `zero` is the value at which the effect
    vanishes, NaN for a parameter that only says where or how. `least` and `most` are what physics
    allows an owner's range to hold. `unit` is that of the quantity itself where the parameter is
    its log10.
    """

    name: str
    unit: str
    lower: float
    upper: float
    zero: float
    reason: str
    spread: Literal["uniform", "logarithmic"] = "uniform"
    signed: bool = False
    least: float = -np.inf
    most: float = np.inf

    def value(self, share: FloatArray) -> FloatArray:
        """Values at shares (n,) of the prior, from 0 to 1."""
        if self.signed:
            sign = np.where(share < 0.5, -1.0, 1.0)
            return np.asarray(sign * self._between(np.abs(2 * share - 1)))
        return self._between(share)

    def share(self, value: FloatArray) -> FloatArray:
        """The inverse of `value`."""
        if not self.signed:
            return self._part(value)
        return np.asarray(0.5 + np.sign(value) * self._part(np.abs(value)) / 2)

    def _between(self, part: FloatArray) -> FloatArray:
        if self.spread == "uniform":
            return np.asarray(self.lower + (self.upper - self.lower) * part)
        return np.asarray(self.lower * (self.upper / self.lower) ** part)

    def _part(self, value: FloatArray) -> FloatArray:
        if self.spread == "uniform":
            return np.asarray((value - self.lower) / (self.upper - self.lower))
        return np.asarray(np.log(value / self.lower) / np.log(self.upper / self.lower))


@dataclass(frozen=True)
class OverTime:
    """An effect that came between two tests, in the words of an alert.

    `fell` and `rose` say what has happened where the frequencies did so in the mean, `check` what a
    crew looks at first, and `apart_by` with what a test is made that tells it from other causes.
    """

    fell: str
    rose: str
    check: str
    apart_by: str = "more modes and their shapes"


class Effect:
    """A member of the catalogue. It declares its names and overrides the verbs.

    Its docstring says what it is, in words for the manual. `phrase` is what a report says of it,
    with each parameter's size and unit in the place of its name in braces; after a colon stand the
    words for either sign (`{x_change_m:longer|shorter}`), and `{log10_k}` also stands for the
    springs `log10_k1` to `log10_k4`. `source` is the literature it follows;
    `seen_by` are the measurements that show it, `imitated_by` the effects that it is easily taken
    for. The first parameter is the effect's size. `follows` are the conditions of a test that it
    depends on; where it `dissipates`, damping rises with the level. `of_the_hanger` is False where
    it is one of the measurement, that other sensors would not have. `other_laws` says in words by
    which other laws, about as likely as its own, the same parameters may act. `over_time` is None
    of an effect that the watch does not look for.
    `localised_as` is what one is called that a diagnosis looks for at each place along the hanger.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    phrase: ClassVar[str]
    source: ClassVar[str]
    seen_by: ClassVar[tuple[str, ...]]
    imitated_by: ClassVar[tuple[str, ...]]
    follows: ClassVar[tuple[Literal["temperature", "amplitude"], ...]] = ()
    dissipates: ClassVar[bool] = False
    of_the_hanger: ClassVar[bool] = True
    other_laws: ClassVar[tuple[str, ...]] = ()
    over_time: ClassVar[OverTime | None] = None
    localised_as: ClassVar[str] = ""

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        """Why these data cannot show the effect, a sentence for people; empty where they can."""
        return ""

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        """Where it may act, of what these data could show."""
        return (Variant(),)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        """Its parameters with the catalogue's priors, the size first."""
        raise TypeError(f"{type(self).__name__} declares no parameters.")

    def applied(
        self,
        physical: PhysicalHanger,
        values: FloatArray,
        variant: Variant,
        conditions: Conditions,
        hanger: Hanger,
    ) -> PhysicalHanger:
        """The hangers (n) with this effect of `values` (n, parameters) in one test.

        With the size at its `zero` they are the same.
        """
        raise TypeError(f"{type(self).__name__} does not say what it does to a hanger.")
