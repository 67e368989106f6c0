"""Define a model class: named parameters with a prior, and a map from them to frequencies.

Besides, what a known mass, clamped on for one test, does to the frequencies of any class.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from shm.errors import BadInput, UsageError, suggest
from shm.models.classes.end_effects import EndWaves, coupled_bar
from shm.models.hanger import PointMass, solve
from shm.values import PLANES, AddedMass, FloatArray, Hanger, IntArray, ModalTest, Plane, Prior

Swap = tuple[str, str]

THESIS, DESCRIPTION = "thesis", "description"
PRIORS = (DESCRIPTION, THESIS)
"""Ranges made for the hanger of the thesis, an exact description; or what the description says."""
_NOWHERE = np.empty(0)
_POINTS_A_LOBE, _RISEN = 40, 0.01
"""Where the largest value of a shape is sought, and what is its first lobe."""


def silent(fraction: float) -> None:
    """No progress is shown."""


def held_otherwise(hanger: Hanger) -> str:
    """Return why no model class can be updated for `hanger`; empty where one can.

    One can where the hanger is clamped and in tension.
    """
    if hanger.nominal_tension_n == 0:
        return "the hanger carries no tension (nominal_tension_n = 0) that could be updated."
    if not hanger.supports.clamped:
        supports = hanger.supports
        return (
            f"it holds the ends by clamps or springs of its own, and [hanger.supports] has them "
            f"{supports.deck} (deck) and {supports.arch} (arch). `shm gap diagnose` takes them so."
        )
    return ""


RATIOS: Mapping[str, str] = dict.fromkeys(
    (
        *("theta_F", "theta_L", "section", "density", "length", "modulus"),
        *("bending_factor", "shear_share"),
    ),
    "1",
)
"""The unit of parameters that are ratios to the description."""


class Model:
    """A model class of one hanger. A member declares its parameters and overrides two verbs.

    One whose frequencies depend on the conditions of a test overrides `conditions`,
    `frequencies_at` and `refuse` too.

    `bounds` are the uniform priors of the parameters; `swaps` lists pairs of end springs (log10)
    that can be exchanged without changing any frequency, so that sampling may keep to one copy.
    `units` names the unit of each parameter, that of the quantity itself where the parameter is its
    log10; a parameter that is not listed has no known unit.
    `expensive` says that an evaluation costs much more than a beam's; `priors` is one of `PRIORS`.
    """

    name: str
    title: str
    bounds: Mapping[str, tuple[float, float]]
    swaps: Sequence[Swap] = ()
    units: Mapping[str, str] = RATIOS
    expensive: ClassVar[bool] = False
    priors: str = THESIS

    def __init__(self, hanger: Hanger):
        self.hanger = hanger

    def usual(self, name: str) -> float:
        """Return the value of a parameter that older posteriors of this class do not have.

        Raises KeyError for a parameter that all have.
        """
        raise KeyError(name)

    def of_the_thesis(self) -> Model:
        """Return the class with the thesis's reading of the description, where that is another."""
        return self

    def as_it_hangs(self) -> Model:
        """Return the class with the description read as one of the hanger under its tension."""
        return self

    @classmethod
    def unfit(cls, hanger: Hanger) -> str:
        """Return why this class cannot describe `hanger`; empty where it can."""
        return ""

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return tuple(self.bounds)

    @property
    def prior(self) -> Prior:
        lower, upper = np.array(list(self.bounds.values()), dtype=float).T
        return Prior(self.parameter_names, lower, upper)

    def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        """Frequencies of parameter sets `theta` (n, parameters): shape (n, 2, modes).

        The second axis is the plane, transverse and longitudinal.
        """
        raise TypeError(f"{type(self).__name__} does not say how its frequencies follow.")

    def conditions(self, test: ModalTest) -> Conditions:
        """Return the conditions of `test` that this class notices; others stay at the reference.

        Tests whose conditions are equal share their frequencies.
        """
        return Conditions(added_mass=test.added_mass)

    def frequencies_at(self, theta: FloatArray, modes: int, conditions: Conditions) -> FloatArray:
        """Frequencies (n, 2, modes) under the conditions of a test.

        A known mass changes them as it changes those of the general model on the same ends.
        """
        found = self.frequencies_hz(theta, modes)
        if conditions.added_mass is None:
            return found
        values = dict(zip(self.parameter_names, theta.T, strict=True))
        length_m = self.stiffness_mass_length(theta)[2] * self.hanger.length_m
        tension_n = values["theta_F"] * self.hanger.nominal_tension_n
        springs = self.springs_n_m_rad(theta)
        mass = conditions.added_mass
        return found * laden_ratio(self.hanger, length_m, tension_n, springs, mass, modes)

    def reference_frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        """Return the same without any approximation made for speed, where the class makes one."""
        return self.frequencies_hz(theta, modes)

    def prepare(self, modes: int, progress: Callable[[float], None] = silent) -> None:
        """Do what has to be done once before many evaluations; `progress` hears the fraction."""

    def shapes(self, theta: FloatArray, modes: int, x_m: FloatArray) -> FloatArray:
        """Return shapes (n, 2, modes, points) at `x_m` (points,), each of any size and sign."""
        raise TypeError(f"{type(self).__name__} does not say how its shapes follow.")

    @property
    def has_shapes(self) -> bool:
        """Return True where the class says how its shapes follow."""
        return type(self).shapes is not Model.shapes

    def shape(self, theta: FloatArray, plane: Plane, order: int, x_m: FloatArray) -> FloatArray:
        """Return one shape of one parameter set (parameters,) at `x_m` (points,).

        Its largest value is 1, and its first lobe from the deck is positive.
        """
        length_m = float(self.stiffness_mass_length(theta[None])[2][0]) * self.hanger.length_m
        fine = np.linspace(0, length_m, _POINTS_A_LOBE * (order + 2))
        found = self.shapes(theta[None], order, np.append(x_m, fine))
        values = found[0, PLANES.index(plane), order - 1]
        along = values[len(x_m) :]
        largest = np.abs(along).max()
        first = along[np.argmax(np.abs(along) > _RISEN * largest)]
        return np.asarray(values[: len(x_m)] / np.copysign(largest, first))

    def springs_n_m_rad(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rotational stiffness of the deck end and the arch end, each (n, planes).

        Infinite where a class clamps its ends.
        """
        clamped = np.full((len(theta), 2), np.inf)
        return clamped, clamped

    def stiffness_mass_length(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return bending stiffness, mass per length and length, each (n,) over the described one.

        Of parameter sets (n, parameters).

        A class whose length is neither the description's nor `theta_L` says it here.
        """
        one = np.ones(len(theta))
        values = dict(zip(self.parameter_names, theta.T, strict=True))
        return one, one, np.asarray(values.get("theta_L", one))

    def end_waves(
        self, theta: FloatArray, frequency_hz: FloatArray, plane: IntArray
    ) -> tuple[EndWaves, EndWaves]:
        """Return the modes near the deck's and the arch's end.

        They have `frequency_hz` (n, data) of `theta` (n, parameters) in planes `plane` (data,).
        """
        hanger = self.hanger
        e, mu, length = (each[:, None] for each in self.stiffness_mass_length(theta))
        ratio = theta[:, self.parameter_names.index("theta_F")][:, None]
        deck, arch = (
            EndWaves.of(
                frequency_hz,
                ratio * hanger.nominal_tension_n,
                e * hanger.bending_stiffness_n_m2,
                mu * hanger.mass_per_length_kg_m,
                length * hanger.length_m,
                springs[:, plane],
            )
            for springs in self.springs_n_m_rad(theta)
        )
        return deck, arch

    @property
    def stiff_ends_m(self) -> tuple[float, float]:
        """Lengths of fittings, none where the owner states the effective length."""
        stated = math.isfinite(self.hanger.scatter.effective_length)
        return (0.0, 0.0) if stated else self.hanger.fittings_m

    def wave_stiffness_n_m_rad(self, order: float) -> float:
        """Return what an end spring is stiff or soft against: bending stiffness times wave number.

        That of mode `order` of a uniform hanger at its nominal tension.
        """
        hanger = self.hanger
        stretched = hanger.nominal_tension_n / hanger.bending_stiffness_n_m2
        wave_number = math.sqrt(stretched + (order * math.pi / hanger.length_m) ** 2)
        return hanger.bending_stiffness_n_m2 * wave_number

    def refuse(self, test: ModalTest) -> None:
        """Raise BadInput where this class cannot describe the conditions of `test`."""
        mass, length_m = test.added_mass, self.hanger.length_m
        hanger_kg = self.hanger.mass_per_length_kg_m * length_m
        if mass is not None and mass.mass_kg > hanger_kg:
            raise BadInput(
                f"test {test.id} has a known mass of {mass.mass_kg:g} kg, more than hanger "
                f"{self.hanger.id} itself ({hanger_kg:.3g} kg).",
                remedy="Give mass_kg in kg, or check length and section of the hanger.",
            )
        if mass is not None and not 0 <= mass.x_m <= length_m:
            raise BadInput(
                f"test {test.id} has a known mass at {mass.x_m:g} m, beyond the ends of hanger "
                f"{self.hanger.id} (0 to {length_m:g} m).",
                remedy="Measure x_m from the deck end, in m.",
            )

    def pack(self, values: Mapping[str, float]) -> FloatArray:
        """Named values as a parameter set (parameters,); raises UsageError for a wrong name."""
        unknown, missing = values.keys() - self.bounds.keys(), self.bounds.keys() - values.keys()
        if unknown or missing:
            fault = f"unknown {sorted(unknown)}" if unknown else f"missing {sorted(missing)}"
            nearest = "".join(suggest(name, self.parameter_names) for name in sorted(unknown)[:1])
            raise UsageError(
                f"parameters of model class {self.name}: {fault}.",
                remedy=f"{nearest}It takes {', '.join(self.parameter_names)}.",
            )
        return np.array([values[name] for name in self.parameter_names], dtype=float)


def laden_ratio(
    hanger: Hanger,
    length_m: FloatArray,
    tension_n: FloatArray,
    springs_n_m_rad: tuple[FloatArray, FloatArray],
    added_mass: AddedMass,
    modes: int,
) -> FloatArray:
    """Frequencies with the mass over those without (n, 2, modes), by the general model.

    Of bars of `length_m` (n,) from the deck end at tensions (n,), on rotational springs at the deck
    and the arch end, each (n, planes). A mass beyond the bar's end weighs nothing.
    """
    bare = coupled_bar(hanger, length_m, tension_n).on_springs(springs_n_m_rad)
    laden = replace(bare, masses=(point_mass(hanger, added_mass, len(tension_n)),))
    found = [solve(each, modes, _NOWHERE, shapes=False).frequency_hz for each in (laden, bare)]
    return np.asarray(found[0] / found[1])


def point_mass(hanger: Hanger, added_mass: AddedMass, count: int) -> PointMass:
    """Return a known mass as `count` hangers of one description have it."""
    one, turns = np.ones(count), radius_m(hanger, added_mass)
    return PointMass(added_mass.x_m * one, added_mass.mass_kg * one, turns * one if turns else None)


def radius_m(hanger: Hanger, added_mass: AddedMass) -> float:
    """Return the radius of gyration of a known mass, the usual one where none is stated."""
    stated = added_mass.radius_of_gyration_m
    return hanger.assumptions.added_mass_radius_m.value if stated is None else stated


@dataclass(frozen=True)
class Conditions:
    """Describe the conditions of one test, as far as an effect may depend on them.

    `temperature_shift_k` counts from the reference (the mean of the tests), 0 where unknown: the
    diagnosis says so; `amplitude` is relative to the reference level, 1 where unknown.
    `tension_shift_n` is by how much the tension read in the test exceeds the mean of all readings,
    0 where none was read, and `tension_shift_sd_n` the standard deviation of the reading;
    `temperature_sd_k` is that of the steel's temperature.
    """

    test: str = ""
    temperature_shift_k: float = 0.0
    amplitude: float = 1.0
    added_mass: AddedMass | None = None
    tension_shift_n: float = 0.0
    tension_shift_sd_n: float = 0.0
    temperature_sd_k: float = 0.0

    def with_usual_radius(self, radius_m: float) -> Conditions:
        """Return the same with this radius of gyration of a known mass that states none."""
        mass = self.added_mass
        return replace(self, added_mass=mass and mass.with_usual_radius(radius_m))
