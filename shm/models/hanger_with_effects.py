"""The hanger as made with effects of the catalogue, under the conditions of a test."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from shm.models.as_made import AsMade
from shm.models.base import point_mass
from shm.models.effects import EFFECTS, Conditions, Parameter, Variant, parameters_of
from shm.models.hanger import HangerModes, PhysicalHanger, solve
from shm.values import FloatArray


class HangerWithEffects:
    """The hanger of `model` with `effects` (name and variant), in that order.

    `places_m` are those of the sensors. Values theta (n, parameters) are the model's, then the
    effects' own, the `effect_parameters`; where two effects have one name for a parameter, the
    effect's name stands before it: `point_mass.x_m`.
    """

    def __init__(
        self, model: AsMade, effects: Sequence[tuple[str, Variant]], places_m: Sequence[float]
    ):
        self.model, self.hanger = model, model.hanger
        self.effects = tuple(effects)
        self.places_m = np.asarray(places_m, dtype=float)
        own = [(name, parameters_of(name, self.hanger, variant)) for name, variant in self.effects]
        self._counts = [len(parameters) for _, parameters in own]
        known = Counter(model.parameter_names)
        known.update(each.name for _, parameters in own for each in parameters)
        self.effect_parameters: tuple[Parameter, ...] = tuple(
            replace(each, name=f"{name}.{each.name}") if known[each.name] > 1 else each
            for name, parameters in own
            for each in parameters
        )

    def modes(
        self, theta: FloatArray, conditions: Conditions, modes: int, shapes: bool = True
    ) -> HangerModes:
        """Return what the logger would report of `theta` (n, parameters) in one test."""
        return self.modes_of_tests(theta, [conditions], modes, shapes)[0]

    def modes_of_tests(
        self, theta: FloatArray, tests: Sequence[Conditions], modes: int, shapes: bool = True
    ) -> list[HangerModes]:
        """Return the same for several tests; those in which the hanger is the same count once."""
        made = self._made(theta)
        ratio = self.model.ratio_to_general(theta[:, : self._first], modes)
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
        """Return the hangers of `theta` (n, parameters) as physics sees them in one test."""
        return self._in_test(self._made(theta), theta, conditions)

    @property
    def _first(self) -> int:
        return len(self.model.parameter_names)

    def _made(self, theta: FloatArray) -> PhysicalHanger:
        return self.model.physical(theta[:, : self._first], len(self.places_m))

    def _in_test(
        self, physical: PhysicalHanger, theta: FloatArray, conditions: Conditions
    ) -> PhysicalHanger:
        at = self._first
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
    """Return True where two batches are the same in all their numbers."""
    mine, others = _numbers(one), _numbers(other)
    return len(mine) == len(others) and all(map(np.array_equal, mine, others))


def _numbers(physical: PhysicalHanger) -> list[FloatArray]:
    parts = [*physical.zones, *physical.masses, *physical.springs, *physical.mode_laws]
    values = [getattr(physical, each.name) for each in fields(physical)]
    own = [value for value in values if isinstance(value, np.ndarray)]
    return own + [value for part in parts for value in vars(part).values()]
