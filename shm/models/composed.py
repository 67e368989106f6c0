"""A model class as the baseline of a diagnosis, told in the terms of the general hanger model, and
how a bar as made differs from its description.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import scipy

from shm.errors import UsageError
from shm.models.as_made import AsMade
from shm.models.base import Model, point_mass
from shm.models.beam import Beam, Beam3
from shm.models.effects import EFFECTS, Conditions, Parameter, Variant, parameters_of
from shm.models.hanger import HangerModes, PhysicalHanger, solve
from shm.models.registry import MODELS
from shm.models.solid import S2
from shm.values import NAN, FloatArray, Hanger


class ComposedHanger:
    """`hanger` by the baseline `baseline_name` with `effects` (name and variant), in that order.

    `places_m` are those of the sensors. `parameters` are the baseline's, the four deviations of
    manufacture, and the effects' own; where two have one name, the effect's name stands before its
    own: `point_mass.x_m`.
    """

    def __init__(
        self,
        hanger: Hanger,
        baseline_name: str,
        effects: Sequence[tuple[str, Variant]],
        places_m: Sequence[float],
    ):
        self.hanger = hanger
        self.baseline = Baseline(baseline_name, hanger)
        self.effects = tuple(effects)
        self.places_m = np.asarray(places_m, dtype=float)
        own = [(name, parameters_of(name, hanger, variant)) for name, variant in self.effects]
        self._counts = [len(parameters) for _, parameters in own]
        self.parameters = _named_apart(
            (*self.baseline.parameters, *deviations_of(hanger)),
            [(name, each) for name, parameters in own for each in parameters],
        )

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(parameter.name for parameter in self.parameters)

    def modes(
        self, theta: FloatArray, conditions: Conditions, modes: int, shapes: bool = True
    ) -> HangerModes:
        """What the logger would report of `theta` (n, parameters) in one test."""
        return self.modes_of_tests(theta, [conditions], modes, shapes)[0]

    def modes_of_tests(
        self, theta: FloatArray, tests: Sequence[Conditions], modes: int, shapes: bool = True
    ) -> list[HangerModes]:
        """The same for several tests; those in which the hanger is the same are solved once."""
        made = self._as_made(theta)
        ratio = self.baseline.ratio(theta[:, : len(self.baseline.parameters)], modes)
        solved: list[tuple[PhysicalHanger, HangerModes]] = []
        answers = []
        for conditions in tests:
            physical = self._in_test(made, theta, conditions)
            found = next((modes_ for other, modes_ in solved if _same(physical, other)), None)
            if found is None:
                found = solve(physical, modes, self.places_m, shapes)
                found = replace(found, frequency_hz=found.frequency_hz * ratio)
                solved.append((physical, found))
            answers.append(found)
        return answers

    def physical(self, theta: FloatArray, conditions: Conditions) -> PhysicalHanger:
        """The hangers of `theta` (n, parameters) as physics sees them in one test."""
        return self._in_test(self._as_made(theta), theta, conditions)

    def _as_made(self, theta: FloatArray) -> PhysicalHanger:
        first = len(self.baseline.parameters)
        bar = self.baseline.physical(theta[:, :first], len(self.places_m))
        return scattered(bar, theta[:, first : first + len(DEVIATIONS)], self.hanger)

    def _in_test(
        self, physical: PhysicalHanger, theta: FloatArray, conditions: Conditions
    ) -> PhysicalHanger:
        at = len(self.baseline.parameters) + len(DEVIATIONS)
        tension_n = physical.tension_n + conditions.tension_shift_n
        physical = replace(physical, tension_n=tension_n)
        for (name, variant), count in zip(self.effects, self._counts, strict=True):
            values = theta[:, at : at + count]
            physical = EFFECTS[name].applied(physical, values, variant, conditions, self.hanger)
            at += count
        added = conditions.added_mass
        if added is None:
            return physical
        clamped_on = point_mass(self.hanger, added, len(theta))
        return replace(physical, masses=(*physical.masses, clamped_on))


def _same(one: PhysicalHanger, other: PhysicalHanger) -> bool:
    """Whether two batches are the same in all their numbers."""
    mine, others = _numbers(one), _numbers(other)
    return len(mine) == len(others) and all(map(np.array_equal, mine, others))


def _numbers(physical: PhysicalHanger) -> list[FloatArray]:
    parts = [*physical.zones, *physical.masses, *physical.springs, *physical.mode_laws]
    values = [getattr(physical, each.name) for each in fields(physical)]
    own = [value for value in values if isinstance(value, np.ndarray)]
    return own + [value for part in parts for value in vars(part).values()]


def _named_apart(
    first: Sequence[Parameter], own: Sequence[tuple[str, Parameter]]
) -> tuple[Parameter, ...]:
    used = Counter([each.name for each in first] + [each.name for _, each in own])
    named = [
        replace(each, name=f"{effect}.{each.name}") if used[each.name] > 1 else each
        for effect, each in own
    ]
    return (*first, *named)


AS_DESCRIBED = "beam1"
"""The class that takes the ends as they are described; of most hangers that is clamped."""

_LENGTH, _TENSION = "theta_L", "theta_F"
_NOWHERE = np.empty(0)
DEVIATIONS = ("section", "density", "length", "modulus")


class Baseline:
    """The model class `name` of `hanger`, its length that of the description.

    The beams are cases of the general model; beam1 is the bar on the supports of its description.
    Of the others it takes the frequencies and, for what effects change and for shapes, a bar on
    equivalent end springs. A bar that carries no tension has no parameter of it; a tension that the
    description knows (`Scatter.tension`) has a normal prior instead of the class's.
    """

    def __init__(self, name: str, hanger: Hanger):
        self.name, self.hanger = name, hanger
        if reason := MODELS[name].unfit(hanger):
            raise UsageError(
                f"model class {name} is no baseline for hanger {hanger.id}: {reason}",
                remedy=f"Take another baseline, {AS_DESCRIBED} for instance.",
            )
        self._model = MODELS[name](hanger)
        left_out = {_LENGTH} if hanger.nominal_tension_n else {_LENGTH, _TENSION}
        self.parameters = tuple(
            self._parameter(key, *both)
            for key, both in AsMade(self._model).bounds.items()
            if key in self._model.bounds and key not in left_out
        )
        self._last: tuple[bytes, int, FloatArray] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """The end springs of each plane that give way together."""
        return tuple(self._model.swaps)

    def wave_stiffness_n_m_rad(self, order: float) -> float:
        """What an end spring is stiff or soft against in mode `order`."""
        return self._model.wave_stiffness_n_m_rad(order)

    def physical(self, theta: FloatArray, sensors: int) -> PhysicalHanger:
        """The hangers of `theta` (n, parameters) before any effect, with that many sensors."""
        whole = self._whole(theta)
        tension_n = whole[:, self._model.parameter_names.index(_TENSION)]
        tension_n = tension_n * self.hanger.nominal_tension_n
        if self.name == AS_DESCRIBED:
            return PhysicalHanger.held(self.hanger, tension_n, sensors)
        clamped = PhysicalHanger.clamped(self.hanger, tension_n, sensors)
        deck_m, arch_m = _ends_m(self._model)
        bar = replace(
            clamped,
            deck_end_m=np.full(len(theta), deck_m),
            arch_end_m=np.full(len(theta), arch_m),
        )
        bar = bar.on_springs(self._model.springs_n_m_rad(whole))
        if not isinstance(self._model, Beam3):
            return bar
        hanger, one = self.hanger, np.ones(len(theta))
        turning = hanger.mass_per_length_kg_m * hanger.second_moment_m4 / hanger.area_m2
        return replace(
            bar,
            shear_compliance_1_n=one / hanger.shear_stiffness_n,
            rotary_inertia_kg_m=turning * one,
        )

    def ratio(self, theta: FloatArray, modes: int) -> FloatArray:
        """The class's frequencies over those of the general model (n, 2, modes)."""
        if isinstance(self._model, Beam):
            return np.ones((len(theta), 2, modes))
        key = theta.tobytes()
        if self._last is None or self._last[:2] != (key, modes):
            general = solve(self.physical(theta, 0), modes, _NOWHERE, shapes=False)
            found = self._model.frequencies_hz(self._whole(theta), modes)
            self._last = key, modes, found / general.frequency_hz
        return self._last[2]

    def _parameter(self, key: str, lower: float, upper: float) -> Parameter:
        known = self.hanger.scatter.tension
        if key == _TENSION and math.isfinite(known):
            reason = "the nominal tension, as exactly as the hanger's description states it"
            return Deviation(key, "1", 1 - known, 1 + known, NAN, reason)
        reason = "the prior of the hanger's description"
        if key == _TENSION:
            lower, upper = self.hanger.assumptions.tension_ratio.bounds
            return Parameter(key, "1", lower, upper, NAN, reason, spread="logarithmic")
        return Parameter(key, self._model.units.get(key, ""), lower, upper, NAN, reason)

    def _whole(self, theta: FloatArray) -> FloatArray:
        """As the class takes them, with its length at the description's."""
        columns = dict(zip(self.names, theta.T, strict=True))
        one = np.ones(len(theta))
        return np.column_stack([columns.get(key, one) for key in self._model.parameter_names])


def _ends_m(model: Model) -> tuple[float, float]:
    """Where the class's bar begins and ends: s2 has the rod between the plates alone."""
    plate = model.hanger.plate
    plate_m = plate.length_m if isinstance(model, S2) and plate is not None else 0.0
    return plate_m, model.hanger.length_m - plate_m


@dataclass(frozen=True)
class Deviation(Parameter):
    """A parameter with a normal prior: `lower` and `upper` are one standard deviation off."""

    def value(self, share: FloatArray) -> FloatArray:
        return np.asarray(self._mean + self._sd * scipy.special.ndtri(share))

    def share(self, value: FloatArray) -> FloatArray:
        away = value - self._mean
        return np.asarray(
            scipy.special.ndtr(away / self._sd) if self._sd else np.full_like(value, 0.5)
        )

    @property
    def _mean(self) -> float:
        return (self.lower + self.upper) / 2

    @property
    def _sd(self) -> float:
        return (self.upper - self.lower) / 2


def deviations_of(hanger: Hanger) -> tuple[Deviation, ...]:
    """Of section, density, length and modulus, as fractions."""
    reason = "scatter of manufacture, as the hanger's description states it"
    made = hanger.scatter
    sizes = (made.section, made.density, made.swinging_length, made.modulus)
    sds = list(zip(DEVIATIONS, sizes, strict=True))
    return tuple(Deviation(name, "fraction", -sd, sd, 0.0, reason) for name, sd in sds)


def scattered(physical: PhysicalHanger, deviations: FloatArray, hanger: Hanger) -> PhysicalHanger:
    """Hangers (n) whose section (area), density, length and modulus deviate by fractions (n, 4).

    Each is multiplied by the exponential of its fraction, so that none can vanish where an owner
    hardly knows it.
    Bending stiffness goes with the square of the area. The bar is longer at its arch end. What is
    told by factors of the bar's own, as turnbuckles are, keeps its own stiffness and mass.
    """
    section, density, length, modulus = np.exp(deviations).T
    stiffness, mass = section**2 * modulus, section * density
    return replace(
        physical,
        arch_end_m=physical.deck_end_m + physical.length_m * length,
        bending_stiffness_n_m2=physical.bending_stiffness_n_m2 * stiffness[:, None],
        mass_per_length_kg_m=physical.mass_per_length_kg_m * mass,
        zones=tuple(
            replace(
                zone,
                stiffness_factor=(zone.stiffness_factor.T / stiffness).T,
                mass_factor=zone.mass_factor / mass,
            )
            for zone in physical.zones
        ),
    )
