"""Baseline, deviations of manufacture and effects as one map from parameters to modes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from shm.models.composed.baseline import DEVIATIONS, Baseline, deviations_of, scattered
from shm.models.effects import EFFECTS, Conditions, Parameter, Variant, parameters_of
from shm.models.hanger import HangerModes, PhysicalHanger, PointMass, solve
from shm.values import AddedMass, FloatArray, Hanger


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
        return _clamped_on(physical, conditions.added_mass)


def _clamped_on(physical: PhysicalHanger, added: AddedMass | None) -> PhysicalHanger:
    if added is None:
        return physical
    one = np.ones(len(physical.tension_n))
    mass = PointMass(added.x_m * one, added.mass_kg * one)
    return replace(physical, masses=(*physical.masses, mass))


def _same(one: PhysicalHanger, other: PhysicalHanger) -> bool:
    """Whether two batches are the same in all their numbers."""
    mine, others = _numbers(one), _numbers(other)
    return len(mine) == len(others) and all(map(np.array_equal, mine, others))


def _numbers(physical: PhysicalHanger) -> list[FloatArray]:
    parts = [*physical.zones, *physical.masses, *physical.springs]
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
