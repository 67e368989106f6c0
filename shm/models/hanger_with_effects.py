"""A hanger of a model class, as made, with effects of the catalogue."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from shm.models.as_made import TENSION, AsMade
from shm.models.base import Conditions, point_mass
from shm.models.beam import Beam
from shm.models.effects import EFFECTS, Case, Parameter, Variant, parameters_of
from shm.models.hanger import HangerModes, PhysicalHanger, solve
from shm.values import FloatArray


class HangerWithEffects:
    """The hanger of `model` with `effects` (name and variant), which act in that order.

    `places_m` are those of the sensors. Parameter sets theta (n, parameters) hold the model's
    parameters, then `effect_parameters`; where two have one name, the effect's name stands before
    its own: `point_mass.x_m`.
    """

    def __init__(
        self,
        model: AsMade,
        effects: Sequence[tuple[str, Variant]],
        places_m: Sequence[float] = (),
    ):
        self.model, self.hanger = model, model.hanger
        self.effects = tuple(effects)
        self.places_m = np.asarray(places_m, dtype=float)
        of_effects = [(name, parameters_of(name, model.hanger, at)) for name, at in self.effects]
        self._counts = [len(parameters) for _, parameters in of_effects]
        pairs = [(name, each) for name, parameters in of_effects for each in parameters]
        self.effect_parameters = _name_apart(model.parameter_names, pairs)
        self._first = len(model.parameter_names)
        self._last: tuple[bytes, int, FloatArray] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.model.parameter_names, *(each.name for each in self.effect_parameters))

    def modes(
        self, theta: FloatArray, conditions: Conditions, modes: int, shapes: bool = True
    ) -> HangerModes:
        """Return the modes that the logger would report of `theta` in one test."""
        return self.modes_of_tests(theta, [conditions], modes, shapes)[0]

    def modes_of_tests(
        self, theta: FloatArray, tests: Sequence[Conditions], modes: int, shapes: bool = True
    ) -> list[HangerModes]:
        """Return the same for several tests; those with the same hanger are solved once."""
        made = self.model.physical(theta[:, : self._first], len(self.places_m))
        ratio = self._ratio(theta[:, : self._first], modes)
        solved: list[tuple[PhysicalHanger, HangerModes]] = []
        results = []
        for conditions in tests:
            physical = self._in_test(made, theta, conditions)
            found = next((modes_ for other, modes_ in solved if _are_equal(physical, other)), None)
            if found is None:
                found = solve(physical, modes, self.places_m, shapes)
                found = replace(found, frequency_hz=found.frequency_hz * ratio)
                solved.append((physical, found))
            results.append(found)
        return results

    def physical(self, theta: FloatArray, conditions: Conditions) -> PhysicalHanger:
        """Return the hangers of `theta` as physics sees them in one test."""
        made = self.model.physical(theta[:, : self._first], len(self.places_m))
        return self._in_test(made, theta, conditions)

    def _in_test(
        self, made: PhysicalHanger, theta: FloatArray, conditions: Conditions
    ) -> PhysicalHanger:
        physical = replace(made, tension_n=made.tension_n + conditions.tension_shift_n)
        at = self._first
        for (name, variant), count in zip(self.effects, self._counts, strict=True):
            values = theta[:, at : at + count]
            case = Case(self.hanger, variant, conditions)
            physical = EFFECTS[name].act(physical, values, case)
            at += count
        physical = self._with_sag(physical, made, theta)
        added = conditions.added_mass
        if added is None:
            return physical
        clamped_on = point_mass(self.hanger, added, len(theta))
        return replace(physical, masses=(*physical.masses, clamped_on))

    def _with_sag(
        self, physical: PhysicalHanger, made: PhysicalHanger, theta: FloatArray
    ) -> PhysicalHanger:
        """Return hangers that sag as their tension lets them, which tests and effects change."""
        if not self.model.has_terms or np.array_equal(physical.tension_n, made.tension_n):
            return physical
        tensioned = theta[:, : self._first].copy()
        ratio = physical.tension_n / self.hanger.nominal_tension_n
        column = self.model.parameter_names.index(TENSION)
        tensioned[:, column] = ratio.clip(self.model.bounds[TENSION][0])
        now = self.model.physical(tensioned)
        return replace(
            physical,
            sag_parameter=physical.sag_parameter + now.sag_parameter - made.sag_parameter,
            tension_gradient_n=now.tension_gradient_n,
        )

    def _ratio(self, theta: FloatArray, modes: int) -> FloatArray:
        """Return the class's frequencies over the general model's (n, 2, modes); 1 of a beam."""
        if isinstance(self.model.model, Beam):
            return np.ones((len(theta), 2, modes))
        key = theta.tobytes()
        if self._last is None or self._last[:2] != (key, modes):
            general = solve(self.model.physical(theta), modes, np.empty(0), shapes=False)
            ratio = self.model.frequencies_hz(theta, modes) / general.frequency_hz
            self._last = key, modes, ratio
        return self._last[2]


def _are_equal(one: PhysicalHanger, other: PhysicalHanger) -> bool:
    """Return True where two batches are the same in all their numbers."""
    mine, others = _numbers(one), _numbers(other)
    return len(mine) == len(others) and all(map(np.array_equal, mine, others))


def _numbers(physical: PhysicalHanger) -> list[FloatArray]:
    parts = [*physical.zones, *physical.masses, *physical.springs, *physical.support_modes]
    parts += physical.mode_laws
    values = [getattr(physical, each.name) for each in fields(physical)]
    arrays = [value for value in values if isinstance(value, np.ndarray)]
    return arrays + [value for part in parts for value in vars(part).values()]


def _name_apart(
    names: Sequence[str], of_effects: Sequence[tuple[str, Parameter]]
) -> tuple[Parameter, ...]:
    """Return the effects' parameters, renamed where another parameter has the name."""
    used = Counter([*names, *(each.name for _, each in of_effects)])
    return tuple(
        replace(each, name=f"{effect}.{each.name}") if used[each.name] > 1 else each
        for effect, each in of_effects
    )
