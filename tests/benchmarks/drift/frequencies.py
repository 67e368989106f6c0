"""Finite-element frequencies of one hanger as a polynomial of its tension and its modulus.

A hanger is tested more than a hundred times a scenario, at tensions and temperatures that always
differ. The logarithms of its frequencies are smooth in those of tension and modulus, so that a
few exact solutions hold them all; `error` compares others with exact ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shm.simulate import Deviations, HangerState, PlantedEffect, TestConditions, planted_modes
from shm.values import FloatArray, Hanger

_SHEAR = PlantedEffect("shear_and_rotary_inertia", "everywhere", {"share": 1.0})
_FAR, _NEAR, _UP, _MODULUS = -0.22, -0.11, 0.11, 0.01
_NODES = np.array(
    [
        (0.0, 0.0), (_FAR, 0.0), (_NEAR, 0.0), (_UP, 0.0),
        (0.0, _MODULUS), (0.0, -_MODULUS), (_FAR, -_MODULUS), (_UP, -_MODULUS),
    ]
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Surface:
    """Log frequencies as a polynomial: `coefficients` (terms, planes, modes)."""

    coefficients: FloatArray

    def log_frequency(self, log_tension: FloatArray, log_modulus: FloatArray) -> FloatArray:
        """At logarithms (n,) of tension and modulus over the reference's: (n, planes, modes)."""
        terms = _terms(log_tension, log_modulus)
        return np.asarray(np.tensordot(terms, self.coefficients, axes=1))


def surface(hanger: Hanger, state: HangerState, deviations: Deviations, modes: int) -> Surface:
    """The polynomial through the exact frequencies at eight tensions and moduli."""
    exact = exactly(hanger, state, deviations, modes)
    values = np.array([exact(float(t), float(e)) for t, e in _NODES])
    terms = _terms(*_NODES.T)
    solved = np.linalg.solve(terms, values.reshape(len(_NODES), -1))
    return Surface(solved.reshape(values.shape))


def exactly(
    hanger: Hanger, state: HangerState, deviations: Deviations, modes: int
) -> Callable[[float, float], FloatArray]:
    """Log frequencies (planes, modes) by finite elements of a bar as made, with shear."""

    def solved(log_tension: float, log_modulus: float) -> FloatArray:
        now = replace(state, tension_n=state.tension_n * float(np.exp(log_tension)))
        modulus = (1 + deviations.modulus) * float(np.exp(log_modulus)) - 1
        made = replace(deviations, modulus=modulus)
        found = planted_modes(hanger, now, [_SHEAR], TestConditions(), modes, (), deviations=made)
        return np.log(found.frequency_hz)

    return solved


def error(
    hanger: Hanger, state: HangerState, deviations: Deviations, modes: int, rng: np.random.Generator
) -> float:
    """The largest error of a frequency, as a fraction, at five places between the nodes."""
    exact = exactly(hanger, state, deviations, modes)
    tension, modulus = rng.uniform(_FAR, _UP, 5), rng.uniform(-_MODULUS, _MODULUS, 5)
    found = surface(hanger, state, deviations, modes).log_frequency(tension, modulus)
    true = np.array([exact(float(t), float(e)) for t, e in zip(tension, modulus, strict=True)])
    return float(np.abs(found - true).max())


def _terms(log_tension: FloatArray, log_modulus: FloatArray) -> FloatArray:
    t, e = log_tension, log_modulus
    return np.stack([np.ones_like(t), t, t**2, t**3, e, e**2, t * e, t**2 * e], axis=-1)
