"""Define an effect of the catalogue: places where it may act, parameters and a physical term.

Where effects may act: ends, planes, any place along the hanger.

What the size of an effect is measured against in a given hanger, and the priors it makes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from shm.models.classes.base import Conditions, Model
from shm.models.hanger.physical import PhysicalHanger, Zone
from shm.values import NAN, PLANES, AddedMass, FloatArray, Hanger, Plane


@dataclass(frozen=True)
class Survey:
    """List what a hanger's tests measure and vary; each field sorted, without repeats or NaN."""

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
    """Name where an effect acts: `ends` (deck 0, arch 1), `planes`, the index of a sensor, a test.

    `at` says it in words; `key` in a word that may stand in the name of a model class. `places_m`
    are those of the sensors where the effect acts at each of them. With `isotropic` one value
    serves all its planes.
    """

    at: str = "everywhere"
    ends: tuple[int, ...] = ()
    planes: tuple[int, ...] = (0, 1)
    sensor: int | None = None
    test: str = ""
    places_m: tuple[float, ...] = ()
    isotropic: bool = False

    @property
    def key(self) -> str:
        return self.at.replace(", ", ".").replace(" ", "_")


@dataclass(frozen=True)
class Case:
    """The hanger that an effect acts on, where it acts, and the test's conditions."""

    hanger: Hanger
    variant: Variant = Variant()
    conditions: Conditions = field(default_factory=Conditions)


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
        """Return the inverse of `value`."""
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
    for. The first parameter is the effect's size. Set `size` if the effect has one parameter and
    its prior does not depend on the hanger; otherwise override `parameters`. `follows` are the
    conditions of a test that it depends on; where it `dissipates`, damping rises with the level.
    `of_the_hanger` is False for an effect of the measurement, which other sensors would not have;
    `of_readings` is True if it is in readings of the tension alone, which no recording holds.
    `over_time` is None of an effect that the watch does not look for; then `check` is what a crew
    looks at first, empty where there is nothing to see. `localised_as` is what one is
    called that a diagnosis looks for at each place along the hanger.

    An effect that says no more than that the description is wrong is also named in
    `DESCRIPTION_EFFECTS` (shm/values/verdict.py).
    """

    name: ClassVar[str]
    title: ClassVar[str]
    phrase: ClassVar[str]
    source: ClassVar[str]
    seen_by: ClassVar[tuple[str, ...]]
    imitated_by: ClassVar[tuple[str, ...]]
    size: ClassVar[Parameter | None] = None
    follows: ClassVar[tuple[Literal["temperature", "amplitude"], ...]] = ()
    dissipates: ClassVar[bool] = False
    of_the_hanger: ClassVar[bool] = True
    of_readings: ClassVar[bool] = False
    over_time: ClassVar[OverTime | None] = None
    check: ClassVar[str] = ""
    localised_as: ClassVar[str] = ""

    def invisible(self, hanger: Hanger, survey: Survey) -> str:
        """Return a sentence on why these data cannot show the effect; empty where they can."""
        return ""

    def variants(self, hanger: Hanger, survey: Survey) -> tuple[Variant, ...]:
        """Return the places where it may act, of those that these data could show."""
        return (Variant(),)

    def parameters(self, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
        """Its parameters with the catalogue's priors, the size first."""
        if self.size is None:
            raise TypeError(f"{type(self).__name__} declares no parameters.")
        return (self.size,)

    def act(self, bar: PhysicalHanger, values: FloatArray, case: Case) -> PhysicalHanger:
        """Return the bars (n) with this effect of `values` (n, parameters) in one test.

        With the size at its `zero` they are the same.
        """
        raise TypeError(f"{type(self).__name__} does not say what it does to a hanger.")


_ENDS = (("deck end", (0,)), ("arch end", (1,)), ("both ends", (0, 1)))


def single_planes(survey: Survey) -> tuple[Variant, ...]:
    """Return the whole hanger in each measured plane alone."""
    return tuple(
        Variant(f"everywhere, {plane}", planes=(PLANES.index(plane),)) for plane in survey.planes
    )


def planes(survey: Survey) -> tuple[Variant, ...]:
    """Return the whole hanger in both planes, where both were measured, and in each alone."""
    both = (Variant(),) if len(survey.planes) == len(PLANES) else ()
    return both + single_planes(survey)


def ends() -> tuple[Variant, ...]:
    """Each end and both, both planes alike."""
    return tuple(Variant(at, ends=where) for at, where in _ENDS)


def ends_and_planes(survey: Survey) -> tuple[Variant, ...]:
    """Each end and both; of the planes those that `planes` lists."""
    return tuple(
        Variant(plane.at.replace("everywhere", at), ends=where, planes=plane.planes)
        for at, where in _ENDS
        for plane in planes(survey)
    )


def springs(survey: Survey) -> tuple[Variant, ...]:
    """Of springs at the ends: those of `ends_and_planes`, and alike in both measured planes.

    What holds an end round its axis gives way the same in all directions; two free springs would
    pay for a freedom that it does not have.
    """
    both = len(survey.planes) == len(PLANES)
    equal = tuple(
        Variant(f"{at}, both planes alike", ends=where, isotropic=True)
        for at, where in _ENDS
        if both
    )
    return ends_and_planes(survey) + equal


def at_ends(variants: tuple[Variant, ...], ends: tuple[int, ...]) -> tuple[Variant, ...]:
    """Return those of `variants` that act at no other ends."""
    return tuple(each for each in variants if set(each.ends) <= set(ends))


def free_planes(variant: Variant) -> tuple[int, ...]:
    """Return the planes with a spring of their own; the first stands for all alike."""
    return variant.planes[:1] if variant.isotropic else variant.planes


def place_along(hanger: Hanger) -> Parameter:
    """Return the place of a local effect."""
    return Parameter(
        "x_m",
        "m",
        0.0,
        hanger.length_m,
        NAN,
        "Nobody knows where along the hanger: every place is as likely.",
        least=0.0,
        most=hanger.length_m,
    )


def zone_about(
    middle_m: FloatArray,
    extent_m: FloatArray,
    stiffness_factor: FloatArray,
    mass_factor: FloatArray,
) -> Zone:
    """Return a stretch about its middle; arrays (draws,)."""
    half_m = extent_m / 2
    return Zone(middle_m - half_m, middle_m + half_m, stiffness_factor, mass_factor)


_MIDDLE_ORDER = 4  # of the seven or so orders that a hammer test finds


def mass_kg(hanger: Hanger) -> float:
    """Return the hanger's own mass."""
    return hanger.mass_per_length_kg_m * hanger.length_m


def rotational_stiffness(name: str, hanger: Hanger, hinge: bool = False) -> Parameter:
    """Return the log10 of an end spring's stiffness, scaled by EI p of a mode of order 4.

    No effect is an infinite stiffness, or none at all where the description has a `hinge`.
    """
    stiffness = Model(hanger).wave_stiffness_n_m_rad(_MIDDLE_ORDER)
    pinned, clamped = hanger.assumptions.end_restraint.bounds
    return Parameter(
        name,
        "N m/rad",
        math.log10(pinned * stiffness),
        math.log10(clamped * stiffness),
        -np.inf if hinge else np.inf,
        f"{pinned:g} to {clamped:g} times EI p, what the bar itself resists with in mode 4: "
        "softer is a hinge, stiffer a clamp; nobody knows the order of magnitude.",
    )
