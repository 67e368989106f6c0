"""Tests whose frequencies are those of a model class, and baselines about a known state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from shm.models import described
from shm.models.classes.base import Conditions
from shm.values import PLANES, FloatArray, Hanger, ModalTest, Mode, Plane, Posterior
from shm.watch.engine.quantities import common_stiffness
from tests.helpers.hangers import HANGER_3

WHEN = datetime(2026, 5, 1, tzinfo=UTC)
SD, ALLOWANCE = 5e-4, 1e-4
MODEL_ERROR = np.random.default_rng(7).normal(0.0, 0.005, (2, 6))
EVERYTHING: list[tuple[Plane, int]] = [(plane, order) for plane in PLANES for order in range(1, 7)]


def posterior(theta: Sequence[float], model: str = "beam2", hanger: Hanger = HANGER_3) -> Posterior:
    made, rng = described(model, hanger), np.random.default_rng(1)
    samples = np.tile(np.array(theta), (300, 1)) + 0.05 * rng.standard_normal((300, len(theta)))
    samples = np.clip(samples, made.prior.lower, made.prior.upper)
    return Posterior(
        model=model,
        hanger=3,
        names=made.parameter_names,
        units=tuple(made.units[name] for name in made.parameter_names),
        samples=samples,
        log_likelihood=np.zeros(300),
        most_probable=np.array(theta),
        nominal_tension_n=hanger.nominal_tension_n,
        log_evidence=0.0,
        log_evidence_sd=0.01,
        effective_sample_size=300,
        r_hat=1.0,
        evaluations=1,
        predicted=(),
        tests=("b",),
        seed=1,
        seconds=0.0,
    )


def frequencies(
    theta: Sequence[float],
    model: str = "beam2",
    hanger: Hanger = HANGER_3,
    conditions: Conditions | None = None,
) -> FloatArray:
    """Of the model class (2, 6), with an error that all tests share."""
    made = described(model, hanger)
    found = made.frequencies_at(np.array([theta]), 6, conditions or Conditions())[0]
    return np.asarray(found * np.exp(MODEL_ERROR))


def measured(
    frequency_hz: FloatArray,
    modes: Sequence[tuple[Plane, int]] = EVERYTHING,
    sd: float = SD,
    rng: np.random.Generator | None = None,
    **conditions: object,
) -> ModalTest:
    """A test of frequencies (2, 6), noisy where there is an `rng`."""
    if rng is not None:
        noise = np.hypot(sd, ALLOWANCE) * rng.standard_normal(frequency_hz.shape)
        frequency_hz = frequency_hz * np.exp(noise)
    found = [(each, float(frequency_hz[PLANES.index(each[0]), each[1] - 1])) for each in modes]
    identified = tuple(Mode(*each, frequency, sd * frequency) for each, frequency in found)
    return ModalTest("t", identified, time=WHEN, **conditions)  # type: ignore[arg-type]


def common_of(log10_k: Sequence[float]) -> float:
    """log10 of the stiffness of springs alike that give as much."""
    return float(common_stiffness(np.array([log10_k]))[0])


def misnamed(test: ModalTest, plane: Plane, order: int) -> ModalTest:
    """With the mode above instead of that of `order`."""
    known = {(mode.plane, mode.order): mode.frequency_hz for mode in test.modes}
    modes = tuple(
        replace(mode, frequency_hz=known[plane, order + 1])
        if (mode.plane, mode.order) == (plane, order)
        else mode
        for mode in test.modes
    )
    return replace(test, modes=modes)
