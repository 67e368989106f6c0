"""The noise of the field: what a measured frequency of a real hanger is off by, in three parts.

- The identification's error, as stated to within a factor phi, and an error of each mode that
  repeats in all tests, of unknown size tau (`shm.inference.problem.noise`). Tests of one mode that
  repeat teach phi.
- What physics says of errors that tests share (`shm.inference.problem.systematic_errors`): a mean
  and loads U. The covariance is phi^2 S + tau^2 R + U U' with S = diag(s^2).
- A measured tension errs by its own standard deviation and by what frequencies do not see of the
  bar's mass and length; or, seldom, by anything.

Mode shapes have their own errors (`shm.inference.problem.shapes`).

Both unknowns are integrated out on a grid: tau in steps of 1.6 standard deviations of what the data
can tell, phi at equally probable values.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from shm.assumptions import Assumptions
from shm.inference.problem.measured import MeasuredFrequencies, conditions_of, predicted_hz
from shm.inference.problem.noise import (
    UNFELT,
    correlate_model_errors,
    grid_model_errors,
    grid_sd_factors,
)
from shm.inference.problem.priors import errors_of_reading
from shm.inference.problem.shapes import SHAPES, MeasuredShapes
from shm.inference.problem.systematic_errors import (
    errors_of_sensors,
    felt_by,
    loads_of_ends,
    loads_of_radii,
    loads_of_section,
    mean_of_ends,
)
from shm.inference.sampler.likelihood import Covariance, Likelihood, NoiseNode
from shm.models import AsMade, Model
from shm.models.hanger.reduced import Modes
from shm.models.one_hanger.hanger_model import TENSION
from shm.values import NAN, PLANES, FloatArray, IntArray, ModalTest, Mode


class FieldLikelihood(MeasuredFrequencies):
    """Measured frequencies, one mode in all tests of like conditions together; their likelihood.

    `frequency_hz` (data,) are weighted means over tests; `identification_error` (data,) their
    fractional standard deviations as stated. With a `reading` (tension in N, its fractional sd) the
    next datum is that tension. Behind them are the misfits of `shapes`, in standard deviations.
    Raises BadInput where the tests hold no mode.
    """

    # Numerical: the trapezoidal rule of a bell in steps of h sd is off by 2 exp(-2 pi^2/h^2), 9e-4;
    # a draw is spread over its step, which adds h^2/12 to the variance, 1 %.
    steps = (1.6, 0.4)

    def __init__(
        self, tests: Sequence[ModalTest], model: Model, reading: tuple[float, float] | None = None
    ):
        super().__init__(tests)
        self._assumed = model.hanger.assumptions
        self.sigma_range = (
            self._assumed.model_error.lower,
            self._assumed.largest_model_error.value,
        )
        conditions = conditions_of(tests, model)
        keys = [(m.plane, m.order, c) for m, c in zip(self.modes, conditions, strict=True)]
        distinct = list(dict.fromkeys(keys))
        self.of_mode: IntArray = np.array([distinct.index(key) for key in keys])
        self._plane = np.array([PLANES.index(plane) for plane, _, _ in distinct])
        self._order = np.array([order - 1 for _, order, _ in distinct])
        self._conditions = [each for _, _, each in distinct]
        value, sd = _values(self.modes, self.of_mode, self._assumed)
        weight = 1 / sd**2
        total = np.bincount(self.of_mode, weight)
        mean = np.bincount(self.of_mode, weight * value) / total
        scatter = float((weight * (value - mean[self.of_mode]) ** 2).sum())
        self.frequencies = len(distinct)
        self.has_reading = reading is not None
        tension, tension_sd = reading or (NAN, NAN)
        self.frequency_hz: FloatArray = np.append(np.exp(mean), [tension] * self.has_reading)
        self.identification_error: FloatArray = np.append(
            total**-0.5, [tension_sd] * self.has_reading
        )
        repeated = len(keys) - len(distinct)
        self._phi, self._log_phi = grid_sd_factors(self._assumed, scatter, repeated)
        jacobian = -float(value.sum()) - repeated / 2 * np.log(2 * np.pi)
        of_means = np.log(total**-0.5).sum() - np.log(sd).sum()
        self._constant = jacobian + float(of_means)
        if reading is not None:
            self._constant -= np.log(tension)
        self.shapes = MeasuredShapes(tests if model.has_shapes else (), model.hanger)
        self._shapes_factor = SHAPES.loose
        # Of no shape there are no places, and none costs anything.
        self._places_m = self.shapes.places_m if self.shapes.size else np.empty(0)
        # One more for what is `renumbered`, which so has the same reduced basis.
        self._modes = 1 + max(self.highest_order, self.shapes.highest_order)
        self._tension = model.parameter_names.index(TENSION)
        self._together = self._correlate()
        self._shift, self._loads = self._systematic(model, self._typical(model))

    def predict(self, model: Model, theta: FloatArray) -> FloatArray:
        """Return predictions of all data (n, data).

        Frequencies in Hz with ends as they usually are, a tension that was read in N, and misfits
        of shapes.
        """
        if isinstance(model, AsMade) and model.has_slopes and self.has_equal_conditions:
            return self._predicted(model, theta, model.modes_at(theta, self._modes, self._places_m))
        bare = predicted_hz(model, theta, self._conditions, self._plane, self._order)
        return self._with_ends(model, theta, bare, self.shapes.misfits(model, theta))

    def _predicted(self, model: AsMade, theta: FloatArray, modes: Modes) -> FloatArray:
        """Return predictions (n, data) by modes that are known."""
        bare = modes.frequency[:, self._plane, self._order]
        return self._with_ends(model, theta, bare, self.shapes.misfits_of(modes.deflection))

    def _with_ends(
        self, model: Model, theta: FloatArray, bare: FloatArray, misfits: FloatArray
    ) -> FloatArray:
        """Return predictions (n, data) by frequencies between ends that neither move nor weigh."""
        ends = model.end_waves(theta, bare, self._plane)
        found = bare * np.exp(mean_of_ends(ends, model.stiff_ends_m, self._assumed))
        read = theta[:, [self._tension] * self.has_reading] * model.hanger.nominal_tension_n
        return np.hstack([found, read, misfits])

    @property
    def has_equal_conditions(self) -> bool:
        """Return True where no test has conditions that change the bar."""
        return len(set(self._conditions)) == 1 and self._conditions[0].added_mass is None

    def changes(
        self, model: AsMade, theta: FloatArray, others: Sequence[FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """Return predictions (n, data), and changes (n, data, others) of misfits to near ones.

        These to first order, and those of supports and sensors left out.
        """
        found, near = model.modes_near(theta, others, self._modes, self._places_m)
        here, column = self.shapes.misfits_of(found.deflection), [self._tension] * self.has_reading
        changes = []
        with np.errstate(divide="ignore", invalid="ignore"):
            for other, modes in zip(others, near, strict=True):
                ratio = (modes.frequency / found.frequency)[:, self._plane, self._order]
                read = other[:, column] / theta[:, column]
                moved = self.shapes.misfits_of(modes.deflection) - here
                changes.append(np.hstack([np.log(np.hstack([ratio, read])), moved]))
        predicted = self._predicted(model, theta, found)
        none = np.empty((*predicted.shape, 0))
        return predicted, np.stack(changes, axis=2) if changes else none

    def renumbered(self, by: int, model: Model, theta: FloatArray) -> FieldLikelihood:
        """Return the same with all orders higher `by` 1, or -1, settled at `theta` (d,)."""
        found = copy(self)
        found._order, found.shapes = self._order + by, self.shapes.renumbered(by)
        found._together = found._correlate()
        found.settle(model, theta)
        return found

    def settle(self, model: Model, theta: FloatArray) -> None:
        super().settle(model, theta)
        self._shift, self._loads = self._systematic(model, theta)
        self._shapes_factor = self.shapes.factor(self.shapes.misfits(model, theta[None]))

    def _typical(self, model: Model) -> FloatArray:
        """Parameters (parameters,) in the middle of the prior, a tension as of a string."""
        hanger, theta = model.hanger, np.add(model.prior.lower, model.prior.upper) / 2
        if not hanger.nominal_tension_n:
            return np.asarray(theta)
        first = self._order.argmin()
        speed_m_s = 2 * hanger.length_m * self.frequency_hz[first] / (self._order[first] + 1)
        ratio = hanger.mass_per_length_kg_m * speed_m_s**2 / hanger.nominal_tension_n
        theta[model.parameter_names.index(TENSION)] = np.clip(ratio, *model.bounds[TENSION])
        return np.asarray(theta)

    def _systematic(self, model: Model, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The mean (data,) and those loads (frequencies, k) that are felt."""
        measured = self.frequency_hz[None, : self.frequencies]
        ends = model.end_waves(theta[None], measured, self._plane)
        places = tuple(sorted({point.x_m for mode in self.modes for point in mode.shape}))
        mean, sensors = errors_of_sensors(model.hanger, felt_by(ends[0]), places)
        section = loads_of_section(model.hanger, self._order + 1)
        of_ends = loads_of_ends(ends, model.stiff_ends_m, self._plane, self._order, self._assumed)
        masses = [each.added_mass for each in self._conditions]
        of_masses = loads_of_radii(masses, self._log_with_radius(model, theta), self._assumed)
        loads = np.hstack([sensors, section, of_ends, of_masses])
        smallest = self._assumed.model_error.lower
        least = max(self.identification_error[: self.frequencies].min(), smallest)
        left, size, _ = np.linalg.svd(loads, full_matrices=False)
        felt = size > UNFELT * least
        return np.append(mean, np.zeros(int(self.has_reading))), left[:, felt] * size[felt]

    def _log_with_radius(self, model: Model, theta: FloatArray) -> Callable[[float], FloatArray]:
        """Return what says ln f (frequencies,) of `theta` (parameters,) for a radius in m.

        It is that of known masses that state no radius of gyration.
        """

        def log_frequency(radius_m: float) -> FloatArray:
            conditions = [each.with_usual_radius(radius_m) for each in self._conditions]
            found = predicted_hz(model, theta[None], conditions, self._plane, self._order)
            return np.asarray(np.log(found[0]))

        return log_frequency

    @property
    def fit_error(self) -> FloatArray:
        """Fractional standard deviations (data,) of all errors but tau."""
        error = self.identification_error.copy()
        shared = (self._loads**2).sum(axis=1)
        error[: self.frequencies] = np.sqrt(error[: self.frequencies] ** 2 + shared)
        return np.append(error, np.full(self.shapes.size, self._shapes_factor))

    def misfit(self, predicted: FloatArray) -> FloatArray:
        """Misfits (n, data): logarithms of predictions, with mean errors of the bar, over
        measurements, and those of shapes as they are.
        """
        scalars, shapes = np.split(predicted, [len(self.frequency_hz)], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.hstack([np.log(scalars / self.frequency_hz) + self._shift, shapes])

    def frequency_nodes(self, step_in_sd: float) -> list[NoiseNode]:
        part = slice(self.frequencies)
        independent, together, always = np.zeros(
            (3, len(self.frequency_hz), len(self.frequency_hz))
        )
        independent[part, part] = np.diag(self.identification_error[part] ** 2)
        together[part, part] = self._together
        always[part, part] = self._loads @ self._loads.T
        reading = np.zeros_like(always)
        reading[-1:, -1:] = 1.0
        return [
            NoiseNode(
                Covariance.of_frequencies(
                    phi**2 * independent + tau**2 * together + always + sd**2 * reading
                ),
                float(self._constant + share + log_phi + log_gross),
                float(tau),
            )
            for tau, share in zip(*self.sigma_grid(step_in_sd), strict=True)
            for phi, log_phi in zip(self._phi, self._log_phi, strict=True)
            for sd, log_gross in self._errors_of_reading()
        ]

    def _errors_of_reading(self) -> Sequence[tuple[float, float]]:
        """Return the sds that a reading may have, each with the log of its probability."""
        if not self.has_reading:
            return [(0.0, 0.0)]
        return errors_of_reading(float(self.identification_error[-1]), self._assumed)

    @cached_property
    def likelihood(self) -> Likelihood:
        return Likelihood(self._nodes()) if self.shapes.size else self._coarse

    def _nodes(self) -> list[NoiseNode]:
        """Return the possible errors of frequencies and shapes."""
        return [
            replace(
                node,
                covariance=replace(
                    node.covariance,
                    shape=np.full(self.shapes.size, factor**2),
                    shape_loads=np.empty((self.shapes.size, 0)),
                ),
                log_weight=node.log_weight + log_weight,
            )
            for node in self.frequency_nodes(self.steps[0])
            for factor, log_weight in self.shapes.factors
        ]

    def log_shapes(self, misfit: FloatArray) -> FloatArray:
        return self.shapes.log_likelihood(misfit[:, len(self.frequency_hz) :])

    def explained(self, predicted: FloatArray) -> FloatArray:
        """Predictions (n, frequencies) from those of the data (n, data), with the sensors,
        supports, fittings and section that the data most probably had, by their normal posterior at
        the mean prediction."""
        middle = predicted.mean(axis=0)[None]
        independent = self.identification_error[: self.frequencies] ** 2
        repeats = self.most_likely_sigma(middle)[0] ** 2 * self._together
        shared = self._loads @ self._loads.T
        off = -self.misfit(middle)[0, : self.frequencies]
        found = self._shift[: self.frequencies] + shared @ np.linalg.solve(
            np.diag(independent) + repeats + shared, off
        )
        return np.asarray(predicted[:, : self.frequencies] * np.exp(found))

    def by_mode(self, predicted: FloatArray) -> FloatArray:
        """Predictions (n, modes) of every mode of every test, `explained`."""
        return self.explained(predicted)[:, self.of_mode]

    def _correlate(self) -> FloatArray:
        """Return the correlation (F, F) of the errors that repeat."""
        modes = self._plane, self._order + 1
        return correlate_model_errors(modes, modes, self._assumed)

    def sigma_grid(self, step_in_sd: float) -> tuple[FloatArray, FloatArray]:
        least_sd = float(self.identification_error[: self.frequencies].min())
        step = step_in_sd / np.sqrt(2 * self.frequencies)
        return grid_model_errors(least_sd, step, self._assumed, beyond_usual=True)


def _values(
    modes: Sequence[Mode], of_mode: IntArray, assumed: Assumptions
) -> tuple[FloatArray, FloatArray]:
    """Logarithms of frequencies (modes,) and their fractional standard deviations.

    Where none is stated, the scatter between tests of one mode stands in, if there are several.
    """
    value = np.log([mode.frequency_hz for mode in modes])
    sd = np.array([mode.frequency_sd_hz / mode.frequency_hz for mode in modes])
    known = np.isfinite(sd) & (sd > 0)
    if known.all():
        return value, sd
    count = np.bincount(of_mode)
    mean = np.bincount(of_mode, value) / count
    free = len(modes) - len(count)
    unstated = assumed.unstated_frequency_sd.value
    scatter = np.sqrt(((value - mean[of_mode]) ** 2).sum() / free) if free > 1 else unstated
    return value, np.where(known, sd, max(float(scatter), assumed.model_error.lower))
