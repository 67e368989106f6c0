"""Define what the steps of a diagnosis hand to each other, and its options.

All data of a hanger are one vector: first the logarithms of the measured frequencies, then the
components of the measured shapes, each shape scaled to length 1 over its own components and turned
to the sign of the measured one. So every residual is a plain difference and every covariance a
matrix.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from shm.assumptions import DEFAULTS, Assumptions
from shm.inference.sampler.density import Peak
from shm.inference.sampler.likelihood import Covariance
from shm.models.effects import Conditions, Survey, Variant
from shm.values import BoolArray, FloatArray, IntArray
from shm.values.diagnosis import joined

Method: TypeAlias = Literal["screened", "normal", "sampled", "emcee"]
"""How far a hypothesis was taken: linearised, by Laplace's method, by importance sampling, by a
Markov chain."""


@dataclass(frozen=True, eq=False)
class Design:
    """Describe what is measured under which conditions, without its values.

    Of the F frequencies `frequency_test`, `frequency_plane` and `frequency_order` (F,) say of which
    test, plane (0, 1) and order (from 1) they are. Of the S components of shapes `shape_mode` (S,)
    names the frequency they belong to, `shape_place` (S,) the index of `places_m` and
    `shape_component` (S,) the axis (0 transverse, 1 longitudinal).
    """

    survey: Survey
    conditions: tuple[Conditions, ...]
    places_m: tuple[float, ...]
    frequency_test: IntArray
    frequency_plane: IntArray
    frequency_order: IntArray
    shape_mode: IntArray
    shape_place: IntArray
    shape_component: IntArray

    @property
    def frequencies(self) -> int:
        return len(self.frequency_test)

    @property
    def size(self) -> int:
        """Return the number of data: F + S."""
        return self.frequencies + len(self.shape_mode)

    @property
    def mode(self) -> IntArray:
        """Return a number (F,) for each plane and order."""
        orders = self.frequency_order.max() + 1
        return np.asarray(self.frequency_plane * orders + self.frequency_order)

    @property
    def planes_and_orders(self) -> tuple[IntArray, IntArray]:
        """Return the plane and the order of each frequency, both (F,)."""
        return self.frequency_plane, self.frequency_order

    @property
    def amplitude(self) -> FloatArray:
        """At which each frequency (F,) was measured."""
        return np.array([each.amplitude for each in self.conditions])[self.frequency_test]

    @property
    def temperature_shift_k(self) -> FloatArray:
        """At which each frequency (F,) was measured."""
        return np.array([each.temperature_shift_k for each in self.conditions])[self.frequency_test]

    @property
    def kinds(self) -> IntArray:
        """Return mass, plane, order, place and axis of each datum (5, F + S); -1 for none."""
        masses = [each.added_mass for each in self.conditions]
        mass = np.array([masses.index(each) for each in masses])[self.frequency_test]
        mode = np.concatenate([np.arange(self.frequencies), self.shape_mode])
        none = np.full(self.frequencies, -1)
        place, axis = (
            np.concatenate([none, each]) for each in (self.shape_place, self.shape_component)
        )
        return np.stack(
            [mass[mode], self.frequency_plane[mode], self.frequency_order[mode], place, axis]
        )


@dataclass(frozen=True, eq=False)
class Observations:
    """The data vector of a design: `value` and `sd` (data,).

    `sd` of a frequency is fractional (of its logarithm); NaN where nobody gave one. `turns`
    (F, 3), None where nothing turns, are standard deviations in radians of the direction in which a
    mode swings: of its own, and of two causes that turn all modes at once.
    `known_damping` (F, 2) holds the logarithm of each mode's damping ratio and its standard
    deviation; NaN where unknown. `rounding` (F,), None for none, is the standard deviation that
    rounding adds to frequencies.
    `misplaced` (S,), None for none, is what moving sensors from their stated places to those of the
    design does to shapes, to first order.
    `assumed` is what the hanger's description assumes of errors.
    """

    design: Design
    value: FloatArray
    sd: FloatArray
    turns: FloatArray | None = None
    known_damping: FloatArray | None = None
    rounding: FloatArray | None = None
    assumed: Assumptions = DEFAULTS
    misplaced: FloatArray | None = None

    @property
    def is_turned(self) -> BoolArray:
        """Return True for components (S,) of shapes whose direction is uncertain."""
        mode = self.design.shape_mode
        if self.turns is None:
            return np.zeros(len(mode), dtype=bool)
        return np.asarray(np.any(self.turns[mode], axis=1))

    @property
    def damping(self) -> FloatArray:
        if self.known_damping is None:
            return np.full((self.design.frequencies, 2), np.nan)
        return self.known_damping

    def part(self, frequencies: IntArray, shapes: IntArray) -> Observations:
        """Return some frequencies and some components of their shapes, by index in their order."""
        design = self.design
        part = replace(
            design,
            frequency_test=design.frequency_test[frequencies],
            frequency_plane=design.frequency_plane[frequencies],
            frequency_order=design.frequency_order[frequencies],
            shape_mode=np.searchsorted(frequencies, design.shape_mode[shapes]),
            shape_place=design.shape_place[shapes],
            shape_component=design.shape_component[shapes],
        )
        data = np.concatenate([frequencies, design.frequencies + shapes])
        turns = None if self.turns is None else self.turns[frequencies]
        rounding = None if self.rounding is None else self.rounding[frequencies]
        damping = self.damping[frequencies]
        misplaced = None if self.misplaced is None else self.misplaced[shapes]
        return Observations(
            part,
            self.value[data],
            self.sd[data],
            turns,
            damping,
            rounding,
            self.assumed,
            misplaced,
        )


@dataclass(frozen=True)
class Hypothesis:
    """The baseline with no, one or two effects, each with where it acts.

    `flexible` adds a deliberately flexible remainder that stands for what is not in the catalogue.
    """

    effects: tuple[tuple[str, Variant], ...] = ()
    flexible: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Return the effects' names; none for the baseline."""
        return tuple(name for name, _ in self.effects)

    @property
    def name(self) -> str:
        """Return the effects' names as one; empty for the baseline."""
        return joined(self.names)

    @property
    def at(self) -> str:
        """Return where the effects act, as one text."""
        return joined(variant.at for _, variant in self.effects)


@dataclass(frozen=True, eq=False)
class Fit:
    """A hypothesis given the observations, in coordinates z (d) with standard normal priors.

    `z` is the most probable point, `covariance` (d, d) that of a normal distribution there;
    `predicted` (data,) and `slopes` (data, d) are the prediction there and its derivatives by z.
    `noise` is the covariance of the data about the prediction at its most probable size, with a
    model error of `model_error` (a fraction). `draws` (n, d) are equal draws of the posterior, of
    which `effective` count. `log_fit` is the log likelihood at z, `log_evidence` the log evidence.
    `peaks` are all probable points, the best first.
    """

    hypothesis: Hypothesis
    z: FloatArray
    covariance: FloatArray
    predicted: FloatArray
    slopes: FloatArray
    noise: Covariance
    model_error: float
    draws: FloatArray
    log_fit: float
    log_evidence: float
    log_evidence_sd: float
    method: Method
    peaks: tuple[Peak, ...] = ()
    effective: float = float("nan")


@dataclass(frozen=True)
class GapOptions:
    """`baseline` is the model class whose gap is diagnosed; empty: the beam that these data prefer.

    `without` are effects taken out of the catalogue; `hold_out` what the held-out misfit leaves out
    of the fit: ids of tests, or orders of modes such as `4`; empty: every order and every test in
    turn. `draws` are kept of each posterior.
    """

    baseline: str = ""
    without: tuple[str, ...] = ()
    hold_out: tuple[str, ...] = ()
    draws: int = 1000
    seed: int = 1
