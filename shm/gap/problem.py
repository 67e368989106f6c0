"""What a hypothesis predicts of a hanger's tests, and what errors that repeat do to these."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from shm.gap.contract import Design, Fit, Hypothesis, Observations
from shm.gap.coordinates import DEVIATIONS, Coordinates, Pair, Straight, cut
from shm.gap.likelihood import Likelihood
from shm.gap.noise import flexible_nodes, nodes
from shm.gap.repeated_errors import (
    STRETCHES,
    Repeated,
    ShapeScaling,
    section_loads,
    sensor_loads,
    turn_loads,
)
from shm.inference.systematic_errors import loads_of_radii, shared_loads
from shm.models.composed import Baseline, ComposedHanger
from shm.models.effects import Conditions, Variant, parameters_of
from shm.models.hanger import HangerModes
from shm.values import BoolArray, FloatArray, Hanger, IntArray

Effects = tuple[tuple[str, Variant], ...]

# Technical: an eighth of the prior's standard deviation apart, over 93 % of the prior.
_TENSIONS = tuple(float(each) for each in np.linspace(-2.5, 1.5, 33))
_STEP_SD = 0.01  # technical: of a reading's standard deviation; frequencies are linear over it
_AT_REST = Conditions(amplitude=0.0)


class GapProblem:
    """The measurements of one hanger, and what hypotheses about it predict of them.

    `smallest` holds, for an effect and where it acts, the share of its sizes' ranges that cannot
    be seen in these data and that their priors therefore leave out (see `shm.gap.detectability`).
    `fits` keeps the fits that others start from; `evaluations` counts the hangers solved, each
    under one set of conditions.
    """

    def __init__(self, hanger: Hanger, baseline: str, observations: Observations):
        self.hanger = hanger
        self.baseline = baseline
        self.observations = observations
        self.smallest: dict[tuple[str, Variant], float] = {}
        self.fits: dict[Hypothesis, Fit] = {}
        self.evaluations = 0
        self._baseline = Baseline(baseline, hanger)
        self._composed: dict[Effects, ComposedHanger] = {}
        self._likelihoods: dict[bool, Likelihood] = {}
        self._scaling = ShapeScaling.measured(observations)

    def names(self, hypothesis: Hypothesis) -> tuple[str, ...]:
        """The parameters' names: the baseline's, the four deviations of the bar, the effects'."""
        return self.coordinates(hypothesis).names

    def theta(self, hypothesis: Hypothesis, z: FloatArray) -> FloatArray:
        """Parameters (n, d) in their units at z (n, d)."""
        return self.coordinates(hypothesis).theta(z)

    def coordinates(self, hypothesis: Hypothesis, whole: bool = False) -> Coordinates:
        """The coordinates of a hypothesis, with the priors `whole` or as `smallest` cuts them."""
        parameters = list(self._hanger_with(hypothesis.effects).parameters)
        baseline = len(self._baseline.names)
        first = baseline + DEVIATIONS
        for effect in hypothesis.effects if not whole else ():
            last = first + len(parameters_of(effect[0], self.hanger, effect[1]))
            share = self.smallest.get(effect, 0.0)
            parameters[first:last] = [cut(each, share) for each in parameters[first:last]]
            first = last
        return Coordinates(parameters, baseline, self.hanger.scatter)

    def straight(self, coordinates: Coordinates) -> Straight:
        """What straightens the posterior of the baseline's end springs among `other` columns."""
        own = math.log10(
            self._baseline.wave_stiffness_n_m_rad((1 + self.design.frequency_order.max()) / 2)
        )
        other = [coordinates.parameters[column] for column in coordinates.other]
        at = {parameter.name: index for index, parameter in enumerate(other)}
        return Straight(
            [
                Pair(at[one], at[two], other[at[one]].lower, other[at[one]].upper, own)
                for one, two in self._baseline.pairs
            ]
        )

    def predict(
        self, hypothesis: Hypothesis, z: FloatArray, design: Design | None = None
    ) -> FloatArray:
        """The data (n, data) that z (n, d) predict, of the tests made or of another design.

        Shapes have the scale and sign of those measured; in another design unit length, and the
        sign of the sine that a string would show. The places of another design begin with those
        of the survey.
        """
        theta = self.theta(hypothesis, z)
        if design is None:
            return self.predict_at(hypothesis, theta)
        return self._predicted(
            hypothesis.effects, theta, design, ShapeScaling.of(design, self.hanger.length_m)
        )

    def predict_at(self, hypothesis: Hypothesis, theta: FloatArray) -> FloatArray:
        """The data (n, data) that parameters theta (n, d) predict of the tests made."""
        return self._predicted(hypothesis.effects, theta, self.design, self._scaling)

    def predicted_with(self, fit: Fit, kept: Sequence[int]) -> FloatArray:
        """The data (data,) that a fit predicts with only those of its effects, by their indices."""
        effects = fit.hypothesis.effects
        ends = [
            self.coordinates(Hypothesis(effects[:count])).dimension
            for count in range(len(effects) + 1)
        ]
        z = [fit.z[: ends[0]], *(fit.z[ends[index] : ends[index + 1]] for index in kept)]
        hypothesis = Hypothesis(tuple(effects[index] for index in kept))
        return np.asarray(self.predict(hypothesis, np.concatenate(z)[None])[0])

    def tension_n(self, hypothesis: Hypothesis, z: FloatArray) -> FloatArray:
        """The true tension (n,) that z (n, d) stand for, of the hanger at rest."""
        composed = self._hanger_with(hypothesis.effects)
        return np.asarray(composed.physical(self.theta(hypothesis, z), _AT_REST).tension_n)

    def likelihood(self, hypothesis: Hypothesis) -> Likelihood:
        """The likelihood of residuals, with a flexible remainder where the hypothesis has one."""
        flexible = hypothesis.flexible
        if flexible not in self._likelihoods:
            make = flexible_nodes if flexible else nodes
            self._likelihoods[flexible] = Likelihood(make(self.observations, self.repeated))
        return self._likelihoods[flexible]

    @cached_property
    def repeated(self) -> Repeated:
        """What the errors that repeat do to the data, from the baseline near the data."""
        sensors, errors = sensor_loads(self.observations, self._predicted_near, self.hanger)
        shapes = np.hstack([sensors, turn_loads(self.observations)])
        design = self.design
        tensions, masses = self.tensions_of(design), self.masses_of(design)
        return Repeated(self.section_of(design), tensions, masses, shapes, errors)

    def tensions_of(self, design: Design) -> FloatArray:
        """Return what one standard deviation of each test's tension does to the frequencies of a
        design: loads (F, tests), none of a lone test without a reading.

        It differs a little from test to test, and one that was read errs by its reading. All modes
        of a test move together, those of other tests do not.
        """
        names = [each.test for each in design.conditions]
        unread_n = self.hanger.assumptions.tension_between_tests.value
        unread_n *= self.hanger.nominal_tension_n if len(set(names)) > 1 else 0.0
        sd_n = np.array([c.tension_shift_sd_n or unread_n for c in design.conditions])
        if not sd_n.any():
            return np.zeros((design.frequencies, 0))
        moved = tuple(
            replace(each, tension_shift_n=each.tension_shift_n + _STEP_SD * float(sd))
            for each, sd in zip(design.conditions, sd_n, strict=True)
        )
        there = self._predicted_near(replace(design, conditions=moved))
        change = (there - self._predicted_near(design))[: design.frequencies] / _STEP_SD
        of_test = np.array(names)[design.frequency_test, None] == list(dict.fromkeys(names))
        return np.where(of_test, change[:, None], 0.0)

    def masses_of(self, design: Design) -> FloatArray:
        """Return what unstated radii of gyration do to the frequencies of a design: loads (F, k).

        Each known mass that states none by itself, one standard deviation more than usual.
        """

        def log_frequency(radius_m: float) -> FloatArray:
            conditions = tuple(each.with_usual_radius(radius_m) for each in design.conditions)
            near = self._predicted_near(replace(design, conditions=conditions))
            return near[: design.frequencies]

        masses = [design.conditions[test].added_mass for test in design.frequency_test]
        return loads_of_radii(masses, log_frequency, self.hanger.assumptions)

    def section_of(self, design: Design) -> FloatArray:
        """What the section along the bar, the sensors' mass and the supports' give do to the
        frequencies of a design: loads (F, k), the same k of every design.
        """
        theta = self.theta(Hypothesis(), self.near)[:, : len(self._baseline.names)]
        alike = self._baseline.physical(np.repeat(theta, STRETCHES + 1, axis=0), 0)
        section = section_loads(design, alike, self.hanger)
        if not self.hanger.as_hanger:
            return section
        frequency_hz = np.exp(self._predicted_near(design)[: design.frequencies])
        shared = shared_loads(
            self.hanger, design.frequency_plane, design.frequency_order, frequency_hz
        )
        return np.hstack([section, shared])

    def sensors_of(self, design: Design) -> FloatArray:
        """What errors of sensors do to the shapes of a new design: loads (S, k)."""
        near = self._predicted_near(design)
        as_if = Observations(design, near, np.ones_like(near))
        return sensor_loads(as_if, self._predicted_near, self.hanger)[0]

    def _predicted_near(self, design: Design) -> FloatArray:
        """The data (data,) that the baseline near the measured ones predicts of a design."""
        return np.asarray(self.predict(Hypothesis(), self.near, design)[0])

    def misfit_percent(self, fit: Fit) -> float:
        """Return by how much a fit misses the frequencies, root mean square."""
        apart = (self.observations.value - fit.predicted)[: self.design.frequencies]
        return 100 * float(np.sqrt(np.mean(apart**2)))

    @property
    def stated_error_percent(self) -> float:
        """Return the errors stated of frequencies, root mean square; NaN where one has none."""
        sd = self.observations.sd[: self.design.frequencies]
        return 100 * float(np.sqrt(np.mean(sd**2)))

    @property
    def near_misfit(self) -> float:
        """By how much the baseline near the data misses the frequencies, root mean square."""
        return self._nearest[1]

    @property
    def near(self) -> FloatArray:
        """A point z (1, d) of the baseline at the tension that fits the frequencies best."""
        return self._nearest[0]

    @cached_property
    def _nearest(self) -> tuple[FloatArray, float]:
        coordinates = self.coordinates(Hypothesis())
        z = np.zeros((len(_TENSIONS), coordinates.dimension))
        z[:, coordinates.tension] = np.array(_TENSIONS)[:, None]
        count = self.design.frequencies
        apart = (self.predict(Hypothesis(), z) - self.observations.value)[:, :count]
        misfit = np.sqrt(np.mean(apart**2, axis=1))
        return z[[int(misfit.argmin())]], float(misfit.min())

    def part(self, rows: BoolArray | IntArray) -> GapProblem:
        """The same problem on some of the frequencies; a mode's shape goes with its frequency.

        `rows` are theirs, as indices or as a choice (F,). Priors are those of the whole.
        """
        kept = np.arange(self.design.frequencies)[rows]
        shapes = np.flatnonzero(np.isin(self.design.shape_mode, kept))
        return self._with(self.observations.part(kept, shapes))

    def without_shape(self, row: int) -> GapProblem:
        """The same problem without the shape of the mode `row`; itself where it has none."""
        kept = np.flatnonzero(self.design.shape_mode != row)
        if len(kept) == len(self.design.shape_mode):
            return self
        return self._with(self.observations.part(np.arange(self.design.frequencies), kept))

    def _with(self, part: Observations) -> GapProblem:
        problem = GapProblem(self.hanger, self.baseline, part)
        problem.smallest, problem._composed = self.smallest, self._composed
        return problem

    @property
    def design(self) -> Design:
        return self.observations.design

    def _hanger_with(self, effects: Effects) -> ComposedHanger:
        if effects not in self._composed:
            self._composed[effects] = ComposedHanger(
                self.hanger, self.baseline, effects, self.design.places_m
            )
        return self._composed[effects]

    def _predicted(
        self, effects: Effects, theta: FloatArray, design: Design, scaling: ShapeScaling
    ) -> FloatArray:
        plane, order = design.frequency_plane, design.frequency_order - 1
        mode, place, component = design.shape_mode, design.shape_place, design.shape_component
        frequency = np.empty((len(theta), design.frequencies))
        shape = np.empty((len(theta), len(mode)))
        for test, modes in self._modes(effects, theta, design):
            rows = np.flatnonzero(design.frequency_test == test)
            parts = np.flatnonzero(design.frequency_test[mode] == test)
            frequency[:, rows] = np.log(modes.frequency_hz[:, plane[rows], order[rows]])
            if len(parts):
                of = mode[parts]
                shape[:, parts] = modes.shape[
                    :, plane[of], order[of], place[parts], component[parts]
                ]
        return np.concatenate([frequency, scaling.scaled(shape)], axis=1)

    def _modes(
        self, effects: Effects, theta: FloatArray, design: Design
    ) -> Iterator[tuple[int, HangerModes]]:
        """Each test that holds data with the modes of theta (n, d) in it."""
        if design.places_m == self.design.places_m:
            composed = self._hanger_with(effects)
        else:
            composed = ComposedHanger(self.hanger, self.baseline, effects, design.places_m)
        tests = [int(test) for test in np.unique(design.frequency_test)]
        conditions = [design.conditions[test] for test in tests]
        orders, shapes = int(design.frequency_order.max()), len(design.shape_mode) > 0
        answers = composed.modes_of_tests(theta, conditions, orders, shapes)
        self.evaluations += len(theta) * len({id(modes) for modes in answers})
        return zip(tests, answers, strict=True)
