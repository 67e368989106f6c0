"""Predict a hanger's tests by a hypothesis, and what errors that repeat do to these."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from shm.gap.hypotheses.contract import Design, Fit, Hypothesis, Observations
from shm.gap.hypotheses.coordinates import Coordinates, cut
from shm.gap.hypotheses.noise import flexible_nodes, nodes
from shm.gap.hypotheses.repeated_errors import (
    STRETCHES,
    Repeated,
    ShapeScaling,
    section_loads,
    sensor_loads,
    turn_loads,
)
from shm.gap.hypotheses.sampling import Sampling
from shm.inference.options import silent
from shm.inference.problem.described import DescribedCoordinates
from shm.inference.problem.hanger_problem import Problem
from shm.inference.problem.systematic_errors import (
    Ends,
    errors_of_sensors,
    felt_by,
    loads_of_ends,
    loads_of_radii,
    mean_of_ends,
)
from shm.inference.sampler.density import Peak
from shm.inference.sampler.likelihood import Likelihood
from shm.models import AsMade
from shm.models.classes.beam import Beam3
from shm.models.effects import EFFECTS, Conditions, Variant, parameters_of
from shm.models.hanger import HangerModes
from shm.models.one_hanger.hanger_model import BENDING
from shm.values import NAN, BoolArray, FloatArray, IntArray, ModalTest

Effects = tuple[tuple[str, Variant], ...]

# Numerical: an eighth of the prior's standard deviation apart, over 98 % of the prior.
_TENSIONS = np.linspace(-2.5, 2.5, 41)
_STEP_SD = 0.01  # numerical: of a reading's standard deviation; frequencies are linear over it
_AT_REST = Conditions(amplitude=0.0)
MOST_REPEATED = 3.0
"""Standard deviations: what is larger is no error that repeats."""
_STRAIGHT = 0.1
"""Numerical: standard deviations of a datum by which a prediction may be off its slope where a
parameter still counts as linear."""


class GapProblem:
    """The tests of one hanger as made, and what hypotheses about it predict of them.

    `smallest` holds, for an effect and where it acts, the share of its sizes' ranges that cannot be
    seen in these data and that their priors therefore leave out (see `shm.gap.causes.scan`).
    `sampling` and `alone` keep the posterior without effects; `rivals` are the problems of all
    model classes of note, itself among them, with their probabilities.
    """

    def __init__(
        self,
        model: AsMade,
        tests: Sequence[ModalTest],
        observations: Observations,
        described: DescribedCoordinates | None = None,
    ):
        self.model, self.hanger = model, model.hanger
        self.tests, self.observations = tuple(tests), observations
        self.smallest: dict[tuple[str, Variant], float] = {}
        order = observations.design.frequency_order
        wave_n_m = model.wave_stiffness_n_m_rad((1 + order.max()) / 2)
        known = self.hanger.scatter.tension
        self._is_part = described is not None
        # Of readings only differences between tests count (see `shm.gap.hypotheses.observations`).
        self.described = described or DescribedCoordinates(
            model, _without_readings(tests), wave_n_m, known_tension_sd=known
        )
        self._linear = self.described.always_linear
        self.sampling: Sampling | None = None
        self.alone: Fit | None = None
        self.rivals: list[tuple[float, GapProblem]] = []
        self._hangers: dict[Effects, AsMade] = {}
        self._likelihoods: dict[tuple[Effects, bool], Likelihood] = {}
        self._thermometers: dict[Effects, FloatArray] = {}
        self._scaling = ShapeScaling.measured(observations)

    def as_update(self) -> Problem | None:
        """Return the update of the same hanger by the same tests; None where that is another one.

        It is where some frequencies are left out, and where the tension is known.
        """
        if self._is_part or math.isfinite(self.hanger.scatter.tension):
            return None
        return Problem.of(_without_readings(self.tests), self.model, silent)

    # ------------------------------------------------ what the posterior of a hypothesis asks for

    @property
    def value(self) -> FloatArray:
        return self.observations.value

    def linear(self, hypothesis: Hypothesis) -> IntArray:
        """Return the columns in which logarithms of frequencies are nearly linear."""
        return self._linear

    def dimension(self, hypothesis: Hypothesis) -> int:
        return self.coordinates(hypothesis).dimension

    def settle(self, peak: Peak) -> None:
        """Take as linear the terms of the hanger whose influence is so about its peak.

        Over one standard deviation, by the second difference against the likeliest errors.
        """
        sd = np.sqrt(np.diag(peak.covariance))
        candidates = self.described.nearly_linear
        if not len(candidates):
            return
        steps = np.zeros((len(candidates), len(peak.z)))
        steps[np.arange(len(candidates)), candidates] = sd[candidates]
        alone = Hypothesis()
        there, back = (self.predict(alone, peak.z + way * steps) for way in (1, -1))
        bent = (there + back) / 2 - self.predict(alone, peak.z[None])
        residual = self.value - self.predict(alone, peak.z[None])
        node = int(self.likelihood(alone).by_node(residual)[0].argmax())
        square = self.likelihood(alone).squares(np.nan_to_num(bent, nan=np.inf, posinf=1e3))
        straight = candidates[square[:, node] < _STRAIGHT**2]
        self._linear = np.union1d(self.described.always_linear, straight)

    def settle_temperatures(self, hypothesis: Hypothesis, z: FloatArray) -> bool:
        """Take from z (d,) what an error of the steel's temperature in each test does by effects.

        Return False where no effect of the hypothesis follows the temperature, or it was taken.
        """
        effects, design = hypothesis.effects, self.design
        if effects in self._thermometers or not any(
            "temperature" in EFFECTS[name].follows for name, _ in effects
        ):
            return False
        moved = tuple(
            replace(each, temperature_shift_k=each.temperature_shift_k + each.temperature_sd_k)
            for each in design.conditions
        )
        here, there = (
            self.predict(hypothesis, z[None], each)[0, : design.frequencies]
            for each in (design, replace(design, conditions=moved))
        )
        self._thermometers[effects] = of_each_test(design, there - here)
        return True

    # ------------------------------------------------ coordinates and predictions

    def coordinates(self, hypothesis: Hypothesis, whole: bool = False) -> Coordinates:
        """Return the coordinates of a hypothesis, the priors `whole` or as `smallest` cuts them."""
        parameters = list(self._hanger_with(hypothesis.effects).effect_parameters)
        first = 0
        for effect in hypothesis.effects if not whole else ():
            last = first + len(parameters_of(effect[0], self.hanger, effect[1]))
            share = self.smallest.get(effect, 0.0)
            parameters[first:last] = [cut(each, share) for each in parameters[first:last]]
            first = last
        return Coordinates(self.described, parameters)

    @property
    def end_columns(self) -> slice:
        """Return the columns of the ends' scores."""
        return self.described.ends_at

    @property
    def has_itself(self) -> tuple[str, ...]:
        """Return the effects of the catalogue that the hanger has as parameters of its own."""
        included = {
            "rotational_end_flexibility": bool(self.model.springs),
            "shear_and_rotary_inertia": isinstance(self.model.model, Beam3),
            "sag": self.model.has_terms,
            "bending_stiffness": BENDING in self.described.names,
        }
        return tuple(name for name, has in included.items() if has)

    def predict(
        self, hypothesis: Hypothesis, z: FloatArray, design: Design | None = None
    ) -> FloatArray:
        """Return the data (n, data) that z (n, d) predict, of the tests made or of another design.

        Shapes have the scale and sign of those measured; in another design unit length, and the
        sign of the sine that a string would show. The places of another design begin with those
        of the survey.
        """
        theta = self.coordinates(hypothesis).theta(z)
        if design is None:
            found = self._predicted(hypothesis.effects, theta, self.design, self._scaling)
            return found + self._usual
        scaling = ShapeScaling.of(design, self.hanger.length_m)
        found = self._predicted(hypothesis.effects, theta, design, scaling)
        return found + self.usual_of(design)

    def predict_with_effect(
        self, hypothesis: Hypothesis, z: FloatArray, effect: FloatArray
    ) -> FloatArray:
        """Return the data (n, data) with values (n, p) of the last effect, all else at z.

        That is one point (d,) or one for each (n, d).
        """
        before = Hypothesis(hypothesis.effects[:-1])
        theta = self.coordinates(before).theta(np.atleast_2d(z))
        theta = np.broadcast_to(theta, (len(effect), theta.shape[1]))
        whole = np.hstack([theta, effect])
        found = self._predicted(hypothesis.effects, whole, self.design, self._scaling)
        return found + self._usual

    def tension_n(
        self, hypothesis: Hypothesis, z: FloatArray, rng: np.random.Generator | None = None
    ) -> FloatArray:
        """Return the tension (n,) of the hanger at rest that z (n, d) stand for.

        What frequencies never tell of mass and length is drawn with `rng`, else at its middle.
        """
        coordinates = self.coordinates(hypothesis)
        theta = coordinates.theta(z) if rng is None else coordinates.drawn(z, rng)
        composed = self._hanger_with(hypothesis.effects)
        return np.asarray(composed.physical(theta, _AT_REST).tension_n)

    def likelihood(self, hypothesis: Hypothesis) -> Likelihood:
        """Return the likelihood of residuals; with something unknown if the hypothesis has it."""
        repeated = self.repeated_with(hypothesis.effects)
        key = (hypothesis.effects if repeated is not self.repeated else (), hypothesis.flexible)
        if key not in self._likelihoods:
            make = flexible_nodes if hypothesis.flexible else nodes
            self._likelihoods[key] = Likelihood(make(self.observations, repeated))
        return self._likelihoods[key]

    def repeated_with(self, effects: Effects) -> Repeated:
        """Return what repeats; where effects follow the temperature, its errors are among it."""
        loads = self._thermometers.get(effects)
        if loads is None:
            return self.repeated
        return replace(self.repeated, tensions=np.hstack([self.repeated.tensions, loads]))

    @cached_property
    def repeated(self) -> Repeated:
        """Return what errors that repeat do to the data, from the baseline near the data."""
        sensors, errors = sensor_loads(self.observations, self._predicted_near, self.hanger)
        shapes = np.hstack([sensors, turn_loads(self.observations)])
        design = self.design
        tensions, masses = self.tensions_of(design), self.masses_of(design)
        return Repeated(self.section_of(design), tensions, masses, shapes, errors)

    @property
    def place_loads(self) -> FloatArray:
        """Return loads (S, places) of an error of each sensor's place; 0 where none is felt."""
        found = np.zeros((len(self.design.shape_mode), len(self.design.places_m)))
        for (kind, place, _), load in zip(
            self.repeated.sensor_errors, self.repeated.sensors.T, strict=False
        ):
            if kind == "place":
                found[:, place] = load
        return found

    def tensions_of(self, design: Design) -> FloatArray:
        """Return loads (F, tests): what one standard deviation of each test's tension does.

        None of a lone test without a reading.

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
        return of_each_test(design, change)

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
        """Return loads (F, k) on the frequencies of a design, the same k of every design.

        They are of the section along the bar, the sensors' mass and the supports' give.
        """
        theta = self.described.theta(self.near)
        copies = self.model.physical(np.repeat(theta, STRETCHES + 2, axis=0))
        section = section_loads(design, copies, self.hanger)
        if not self.hanger.as_hanger:
            return section
        ends = self._ends_of(design)
        _, sensors = errors_of_sensors(self.hanger, felt_by(ends[0]), _sensor_places_m(self.design))
        survey = np.column_stack([self.design.frequency_plane, self.design.frequency_order])
        supports = loads_of_ends(
            ends,
            self.model.stiff_ends_m,
            design.frequency_plane,
            design.frequency_order,
            self.hanger.assumptions,
            np.unique(survey, axis=0),
        )
        return np.hstack([section, sensors, supports])

    @cached_property
    def _usual(self) -> FloatArray:
        found = self.usual_of(self.design)
        if self.observations.misplaced is not None:
            found[self.design.frequencies :] -= self.observations.misplaced
        return found

    def usual_of(self, design: Design) -> FloatArray:
        """Return what usual sensors and supports do to the data of a design (data,)."""
        found = np.zeros(design.size)
        if not self.hanger.as_hanger:
            return found
        ends = self._ends_of(design)
        sensors, _ = errors_of_sensors(self.hanger, felt_by(ends[0]), _sensor_places_m(design))
        supports = mean_of_ends(ends, self.model.stiff_ends_m, self.hanger.assumptions)[0]
        found[: design.frequencies] = sensors + supports
        return found

    def _ends_of(self, design: Design) -> Ends:
        """Return the waves at the ends in the modes of a design, of the baseline near the data."""
        theta, scaling = (
            self.described.theta(self.near),
            ShapeScaling.of(design, self.hanger.length_m),
        )
        frequency_hz = np.exp(self._predicted((), theta, design, scaling)[:, : design.frequencies])
        return self.model.end_waves(theta, frequency_hz, design.frequency_plane)

    def sensors_of(self, design: Design) -> FloatArray:
        """Return the loads (S, k) of errors of sensors on the shapes of a new design."""
        near = self._predicted_near(design)
        as_if = Observations(design, near, np.ones_like(near))
        return sensor_loads(as_if, self._predicted_near, self.hanger)[0]

    def _predicted_near(self, design: Design) -> FloatArray:
        """Return the data (data,) that the baseline near the measured ones predicts of a design."""
        return np.asarray(self.predict(Hypothesis(), self.near, design)[0])

    def left(self, fit: Fit) -> FloatArray:
        """Return what a fit leaves of the frequencies' logarithms (F,).

        Without what sensors, supports, section and tension most probably do alike in all of them:
        each by three of its standard deviations at most, for what is larger is no such error.
        """
        residual = (self.value - fit.predicted)[: self.design.frequencies]
        loads = self.repeated_with(fit.hypothesis.effects).of_frequencies
        size = loads.T @ np.linalg.solve(fit.noise.frequency, residual)
        return np.asarray(residual - loads @ size.clip(-MOST_REPEATED, MOST_REPEATED))

    def misfit_percent(self, fit: Fit) -> float:
        """Return by how much a fit misses the frequencies, root mean square."""
        return 100 * float(np.sqrt(np.mean(self.left(fit) ** 2)))

    @property
    def stated_error_percent(self) -> float:
        """Return the errors stated of frequencies, root mean square; NaN where one has none."""
        sd = self.observations.sd[: self.design.frequencies]
        return 100 * float(np.sqrt(np.mean(sd**2)))

    @property
    def near_misfit(self) -> float:
        """Return by how much the baseline near the data misses the frequencies (rms)."""
        return self._nearest[1]

    @property
    def near(self) -> FloatArray:
        """Return a point z (1, d) of the baseline at the tension that fits the frequencies best."""
        return self._nearest[0]

    @cached_property
    def _nearest(self) -> tuple[FloatArray, float]:
        z = np.zeros((len(_TENSIONS), self.described.dimension))
        z[:, 0] = _TENSIONS
        count = self.design.frequencies
        theta = self.described.theta(z)
        predicted = self._predicted((), theta, self.design, self._scaling)
        apart = (predicted - self.observations.value)[:, :count]
        misfit = np.sqrt(np.mean(apart**2, axis=1))
        return z[[int(misfit.argmin())]], float(misfit.min())

    def part(self, rows: BoolArray | IntArray) -> GapProblem:
        """Return the same problem on some of the frequencies, each with the shape of its mode.

        `rows` are theirs, as indices or as a choice (F,). Priors are those of the whole.
        """
        frequencies = np.arange(self.design.frequencies)[rows]
        shapes = np.flatnonzero(np.isin(self.design.shape_mode, frequencies))
        return self._with(frequencies, shapes)

    def without_shape(self, row: int) -> GapProblem:
        """Return the problem without the shape of the mode `row`; itself where it has none."""
        components = np.flatnonzero(self.design.shape_mode != row)
        if len(components) == len(self.design.shape_mode):
            return self
        return self._with(np.arange(self.design.frequencies), components)

    def _with(self, frequencies: IntArray, components: IntArray) -> GapProblem:
        part = self.observations.part(frequencies, components)
        problem = GapProblem(self.model, self.tests, part, self.described)
        problem.smallest, problem._hangers = self.smallest, self._hangers
        problem._thermometers = {
            effects: loads[frequencies] for effects, loads in self._thermometers.items()
        }
        return problem

    @property
    def design(self) -> Design:
        return self.observations.design

    def _hanger_with(self, effects: Effects) -> AsMade:
        if effects not in self._hangers:
            self._hangers[effects] = self.model.with_effects(effects, self.design.places_m)
        return self._hangers[effects]

    def _predicted(
        self, effects: Effects, theta: FloatArray, design: Design, scaling: ShapeScaling
    ) -> FloatArray:
        try:
            return self._solved(effects, theta, design, scaling)
        except np.linalg.LinAlgError:
            # Of hangers so odd that rounding leaves them no modes: not a number, the others as is.
            if len(theta) == 1:
                return np.full((1, design.size), NAN)
            halves = np.array_split(theta, 2)
            return np.vstack([self._predicted(effects, h, design, scaling) for h in halves])

    def _solved(
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
        """Return each test that holds data, with the modes of theta (n, d) in it."""
        if design.places_m == self.design.places_m:
            composed = self._hanger_with(effects)
        else:
            composed = self.model.with_effects(effects, design.places_m)
        tests = [int(test) for test in np.unique(design.frequency_test)]
        conditions = [design.conditions[test] for test in tests]
        orders, shapes = int(design.frequency_order.max()), len(design.shape_mode) > 0
        return zip(tests, composed.modes_of_tests(theta, conditions, orders, shapes), strict=True)


def _without_readings(tests: Sequence[ModalTest]) -> list[ModalTest]:
    """Return the tests without the tensions that were read in them."""
    return [replace(test, tension_read_n=NAN, tension_read_sd_n=NAN) for test in tests]


def of_each_test(design: Design, change: FloatArray) -> FloatArray:
    """Return a change of the frequencies (F,) as loads (F, tests), of each test by itself."""
    names = np.array([each.test for each in design.conditions])[design.frequency_test]
    return np.where(names[:, None] == np.unique(names), change[:, None], 0.0)


def _sensor_places_m(design: Design) -> tuple[float, ...]:
    return tuple(design.places_m[place] for place in np.unique(design.shape_place))
