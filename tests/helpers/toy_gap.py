"""A linear toy of a gap problem, whose posteriors are exact, and small campaigns of tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shm.gap.hypotheses.contract import Design, Fit, Hypothesis, Observations
from shm.gap.hypotheses.repeated_errors import Repeated
from shm.inference.sampler.likelihood import Covariance
from shm.models.effects import Conditions, Parameter, Survey
from shm.values import NAN, PLANES, AddedMass, FloatArray, Hanger
from tests.helpers.hangers import HANGER_3

Slopes = Callable[[Design], FloatArray]
BASELINE = Hypothesis()
SD = 1e-3


@dataclass(frozen=True)
class ToyCoordinates:
    """All parameters are the baseline's."""

    baseline: int
    effects: tuple[Parameter, ...] = ()


class ToyProblem:
    """Every hypothesis predicts `slopes(design) @ z`, with slopes (data, d)."""

    def __init__(self, observations: Observations, slopes: Mapping[Hypothesis, Slopes]):
        self.observations = observations
        self.slopes = slopes
        self.hanger: Hanger = HANGER_3

    @property
    def design(self) -> Design:
        return self.observations.design

    def predict(
        self, hypothesis: Hypothesis, z: FloatArray, design: Design | None = None
    ) -> FloatArray:
        return z @ self.slopes[hypothesis](design or self.observations.design).T

    @property
    def repeated(self) -> Repeated:
        return Repeated.none(self.observations.design)

    def repeated_with(self, effects: object) -> Repeated:
        return self.repeated

    def left(self, fit: Fit) -> FloatArray:
        return (self.observations.value - fit.predicted)[: self.design.frequencies]

    def section_of(self, design: Design) -> FloatArray:
        return Repeated.none(design).section

    def tensions_of(self, design: Design) -> FloatArray:
        return Repeated.none(design).tensions

    def masses_of(self, design: Design) -> FloatArray:
        return Repeated.none(design).masses

    def sensors_of(self, design: Design) -> FloatArray:
        return Repeated.none(design).sensors

    def coordinates(self, hypothesis: Hypothesis) -> ToyCoordinates:
        return ToyCoordinates(self.slopes[hypothesis](self.observations.design).shape[1])

    def fit(self, hypothesis: Hypothesis = BASELINE, model_error: float = 0.0) -> Fit:
        """The exact posterior."""
        design, sd = self.observations.design, self.observations.sd
        f = design.frequencies
        frequency = np.diag(sd[:f] ** 2) + model_error**2 * repeated(design)
        noise = Covariance(frequency, sd[f:] ** 2, np.zeros((len(sd) - f, 0)))
        precision = np.zeros((design.size, design.size))
        precision[:f, :f] = np.linalg.inv(noise.frequency)
        precision[f:, f:] = np.diag(1 / noise.shape)
        slopes = self.slopes[hypothesis](design)
        inverse = np.eye(slopes.shape[1]) + slopes.T @ precision @ slopes
        covariance: FloatArray = np.linalg.inv(inverse).astype(np.float64)
        z = covariance @ slopes.T @ precision @ self.observations.value
        return Fit(
            hypothesis=hypothesis,
            z=z,
            covariance=covariance,
            predicted=slopes @ z,
            slopes=slopes,
            noise=noise,
            model_error=model_error,
            draws=z[None],
            log_fit=0.0,
            log_evidence=0.0,
            log_evidence_sd=NAN,
            method="normal",
        )


def repeated(design: Design) -> FloatArray:
    """Return how a model's errors go together: half of the variance within an octave of orders."""
    log = np.log(design.frequency_order)
    same_plane = np.equal.outer(design.frequency_plane, design.frequency_plane)
    near = np.exp(-((np.subtract.outer(log, log) / 0.7) ** 2) / 2) * np.where(same_plane, 1, 0.5)
    return np.asarray((same_plane & np.equal.outer(log, log)) / 2 + near / 2)


def design_of(
    conditions: Sequence[Conditions],
    modes: Sequence[tuple[int, int]],
    places_m: tuple[float, ...] = (),
    biaxial: bool = False,
) -> Design:
    """Every mode (plane, order) in every test; a place sees the mode's plane alone, or both."""
    rows = [(t, plane, order) for t in range(len(conditions)) for plane, order in modes]
    test, plane, order = np.array(rows).T
    shapes = [
        (mode, place, component)
        for mode in range(len(rows))
        for place in range(len(places_m))
        for component in ((0, 1) if biaxial else (plane[mode],))
    ]
    mode, place, component = np.array(shapes, dtype=np.int64).reshape(-1, 3).T
    masses = {each.added_mass for each in conditions if each.added_mass is not None}
    survey = Survey(
        tests=tuple(each.test for each in conditions),
        planes=tuple(PLANES[plane] for plane in sorted({plane for plane, _ in modes})),
        sensor_places_m=places_m,
        biaxial=biaxial,
        temperatures_c=tuple(sorted({each.temperature_shift_k for each in conditions})),
        amplitudes=tuple(sorted({each.amplitude for each in conditions})),
        added_masses=tuple(sorted(masses, key=lambda mass: (mass.x_m, mass.mass_kg))),
    )
    return Design(survey, tuple(conditions), places_m, test, plane, order, mode, place, component)


def campaign(known_mass: AddedMass | None = None) -> tuple[Conditions, ...]:
    """Three temperatures, three levels, and a test with a known mass if one is given."""
    plain = tuple(
        Conditions(f"t{i + 1}", shift_k, level)
        for i, (shift_k, level) in enumerate([(-10, 1), (0, 1), (10, 1), (0, 0.5), (0, 2)])
    )
    return plain + ((Conditions("t6", added_mass=known_mass),) if known_mass else ())


def tension(design: Design) -> FloatArray:
    """One parameter that moves all logarithms of frequencies alike, and no shape."""
    return np.repeat([[0.1], [0.0]], [design.frequencies, len(design.shape_mode)], axis=0)
