"""A simulated twin of a hanger, which measures what the hanger would with an effect of any size.

The twin is the hanger alone as fitted to its tests, or as described where there are none. Its data
come from the model that the diagnosis uses, so that it shows what is visible, not what nature may
do beside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import count

import numpy as np
import scipy

from shm.gap.causes.baseline import choose_baseline
from shm.gap.causes.search import fit_alone, invisible
from shm.gap.hypotheses.contract import GapOptions, Hypothesis
from shm.gap.hypotheses.data_checks import usable
from shm.gap.hypotheses.problem import GapProblem
from shm.gap.hypotheses.repeated_errors import quarter_turn
from shm.models import AS_DESCRIBED
from shm.models.effects import EFFECTS, Variant, check_effect_priors
from shm.models.one_hanger.hanger_model import TENSION
from shm.values import (
    NAN,
    PLANES,
    AddedMass,
    FloatArray,
    Hanger,
    IntArray,
    ModalTest,
    Mode,
    ShapePoint,
)

ALONE = Hypothesis()


def usual_tests(hanger: Hanger, orders: int = 8) -> tuple[ModalTest, ...]:
    """Return usual hammer tests of a hanger without any: plain, and one with a known mass.

    Both planes, two biaxial sensors, errors as the assumptions have them where none is stated.
    Frequencies and shapes only hold the place of those that the twin predicts.
    """
    assumed, length_m = hanger.assumptions, hanger.length_m
    places_m = 0.13 * length_m, 0.29 * length_m  # within reach from the deck
    modes = []
    for plane in PLANES:
        for order in range(1, orders + 1):
            values = [math.sin(order * math.pi * x / length_m) for x in places_m]
            sd = assumed.unstated_shape_sd.value
            shape = [ShapePoint(x, v, 0.0, sd) for x, v in zip(places_m, values, strict=True)]
            sd_hz = order * assumed.unstated_frequency_sd.value
            modes.append(Mode(plane, order, float(order), sd_hz, shape=tuple(shape)))
    mass = AddedMass(0.02 * hanger.mass_per_length_kg_m * length_m, 0.3 * length_m)
    plain = ModalTest("usual", tuple(modes), hanger.id, temperature_c=10.0, amplitude=1.0)
    return plain, replace(plain, id="usual with a mass", added_mass=mass)


class Twin:
    """The hanger of some tests with the baseline `baseline`, empty for the one that they prefer."""

    def __init__(self, tests: Sequence[ModalTest], hanger: Hanger, baseline: str, seed: int):
        check_effect_priors(hanger)
        self.hanger, self.is_described = hanger, not tests
        self._made_of = tuple(tests), hanger, seed
        used = usable(tests, hanger).tests if tests else usual_tests(hanger)
        self._slope_sd = np.array([m.amplitude_slope_sd for test in used for m in test.modes])
        # The twin's amplitude slopes follow from the planted effect.
        self.tests = tuple(_without_slopes(test) for test in used)
        rng = np.random.default_rng(seed)
        options = GapOptions(baseline if tests else baseline or AS_DESCRIBED)
        self._settle(choose_baseline(self.tests, hanger, options, rng))
        if tests:
            fit = fit_alone(self._problem, rng)
            self._z, self.misfit_percent = fit.z, self._problem.misfit_percent(fit)
            return
        self._z, self.misfit_percent = _as_described(self._problem), NAN
        self.tests = self._tests_of(self._predicted(ALONE, self._z), self._slope_sd)
        options = GapOptions(self.baseline)
        self._settle(choose_baseline(self.tests, hanger, options, rng))

    def __reduce__(self) -> tuple[type[Twin], tuple[object, ...]]:
        tests, hanger, seed = self._made_of
        return Twin, (tests, hanger, self.baseline, seed)  # a problem cannot be pickled

    def _settle(self, problem: GapProblem) -> None:
        """Take the problem of tests that also show small amplitudes, if slopes are known.

        Beside it the same whose modes swing in their planes, whatever was measured.
        """
        self._problem = problem = self._with_levels(problem)
        straight = replace(problem.observations, turns=None)
        self._straight = GapProblem(problem.model, problem.tests, straight, problem.described)

    def _with_levels(self, problem: GapProblem) -> GapProblem:
        found = problem.observations
        levels = {0.0, *found.design.survey.amplitudes}
        if not np.isfinite(self._slope_sd).any() or len(levels) == 1:
            return problem
        survey = replace(found.design.survey, amplitudes=tuple(sorted(levels)))
        found = replace(found, design=replace(found.design, survey=survey))
        return GapProblem(problem.model, problem.tests, found, problem.described)

    @property
    def baseline(self) -> str:
        """Return the name of the twin's model class."""
        return self._problem.model.name

    @property
    def tension_n(self) -> float:
        """Return the twin's true tension; NaN of a bar without any."""
        if not self.hanger.nominal_tension_n:
            return NAN
        return float(self._problem.tension_n(ALONE, self._z[None])[0])

    @property
    def frequency_sd(self) -> FloatArray:
        """Return the errors of the frequencies (F,) as stated or, where none is, as assumed.

        A gap of the hanger itself is no error of the measurement, so none is taken from the fit.
        """
        found = self._problem.observations
        stated = found.sd[: found.design.frequencies]
        usual = self.hanger.assumptions.unstated_frequency_sd.value
        rounding = 0.0 if found.rounding is None else found.rounding
        return np.where(np.isfinite(stated), stated, np.hypot(usual, rounding))

    def invisible(self) -> dict[str, str]:
        """Return the effects that these tests cannot show, and why."""
        return invisible(self._problem)

    def variants(self, effect: str) -> tuple[Variant, ...]:
        """Return the places where these tests could show an effect."""
        return EFFECTS[effect].variants(self.hanger, self._problem.design.survey)

    def measure(
        self, effect: str, variant: Variant, shares: FloatArray, rng: np.random.Generator
    ) -> tuple[ModalTest, ...]:
        """Return the tests of the twin with an effect at shares (p,) of its prior, or with none."""
        hypothesis = Hypothesis(((effect, variant),)) if effect else ALONE
        z = np.append(self._z, scipy.special.ndtri(shares))
        problem, frequencies = self._problem, self._problem.design.frequencies
        sd = np.append(self.frequency_sd, problem.observations.sd[frequencies:])
        errors = problem.repeated
        errors = replace(errors, sensors=errors.sensors[:, : len(errors.sensor_errors)])
        noise = sd * rng.standard_normal(len(sd))
        noise += errors.loads @ rng.standard_normal(errors.loads.shape[1])
        data = self._predicted(hypothesis, z)
        slopes = (data - self._predicted(hypothesis, z, at_rest=True))[:frequencies]
        slopes += self._slope_sd * rng.standard_normal(frequencies)
        data[frequencies:] = self._turned(data[frequencies:], rng)
        return self._tests_of(data + noise, slopes)

    def _turned(self, shapes: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return shapes (S,) in an uncertain direction, up to halfway to the other plane."""
        found = self._problem.observations
        if found.turns is None:
            return shapes
        own, *common = found.turns.T
        angle = own * rng.standard_normal(len(own)) + rng.standard_normal(len(common)) @ common
        angle = (angle + np.pi / 4) % (np.pi / 2) - np.pi / 4
        angle = np.where(found.is_turned, angle[found.design.shape_mode], 0.0)
        other, sign = quarter_turn(found.design)
        return np.asarray(np.cos(angle) * shapes + np.sin(angle) * sign * shapes[other])

    def _predicted(
        self, hypothesis: Hypothesis, z: FloatArray, at_rest: bool = False
    ) -> FloatArray:
        design = None
        if at_rest:
            design = self._problem.design
            conditions = tuple(replace(each, amplitude=0.0) for each in design.conditions)
            design = replace(design, conditions=conditions)
        return np.asarray(self._straight.predict(hypothesis, z[None], design)[0])

    def _tests_of(self, data: FloatArray, slopes: FloatArray) -> tuple[ModalTest, ...]:
        """Return modal tests of data (data,) and of amplitude slopes (F,), NaN if not known."""
        rows = count()
        return tuple(
            replace(test, modes=tuple(self._mode(next(rows), m, data, slopes) for m in test.modes))
            for test in self.tests
        )

    def _mode(self, row: int, mode: Mode, data: FloatArray, slopes: FloatArray) -> Mode:
        frequency_hz, slope = math.exp(data[row]), float(slopes[row])
        made = replace(
            mode,
            frequency_hz=frequency_hz,
            shape=self._shape(row, mode, data),
            amplitude_slope=slope,
            amplitude_slope_sd=float(self._slope_sd[row]),
            frequency_sd_hz=mode.frequency_sd_hz * frequency_hz / mode.frequency_hz,
        )
        if not made.depends_on_amplitude:
            return made
        return replace(made, frequency_hz=frequency_hz / (1 + slope))  # that of small amplitude

    def _shape(self, row: int, mode: Mode, data: FloatArray) -> tuple[ShapePoint, ...]:
        """Return the shape of a mode in `data`, as large as the measured one."""
        design, value = self._problem.design, self._problem.observations.value
        components = np.flatnonzero(design.shape_mode == row)
        if not len(components):
            return ()
        measured = [v for p in mode.shape for v in (p.value, p.cross) if math.isfinite(v)]
        rows = design.frequencies + components
        scale = np.abs(measured).max() / np.abs(value[rows]).max()
        parts = dict(zip(self._keys(components), (scale * data[rows]).tolist(), strict=True))
        plane, places_m = PLANES.index(mode.plane), np.array(design.places_m)
        points = []
        for point in mode.shape:
            place = int(np.abs(places_m - point.x_m).argmin())
            along, cross = (parts.get((place, axis), NAN) for axis in (plane, 1 - plane))
            points.append(replace(point, value=along, cross=cross))
        return tuple(points)

    def _keys(self, rows: IntArray) -> list[tuple[int, int]]:
        """Return the place and the axis of some components of shapes."""
        design = self._problem.design
        places, axes = design.shape_place[rows].tolist(), design.shape_component[rows].tolist()
        return list(zip(places, axes, strict=True))


def _as_described(problem: GapProblem) -> FloatArray:
    """Return the coordinates (d,) of the nominal tension, all else at its middle."""
    theta = problem.described.theta(np.zeros((1, problem.described.dimension)))
    theta[:, problem.described.parameters.index(TENSION)] = 1.0
    return np.asarray(problem.described.places(theta)[0])


def _without_slopes(test: ModalTest) -> ModalTest:
    """Return a test whose frequencies are those of one level."""
    modes = (replace(each, amplitude_slope=NAN, amplitude_slope_sd=NAN) for each in test.modes)
    return replace(test, modes=tuple(modes))
