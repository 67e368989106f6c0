"""Accelerance and coherence from the spectra of several hits: H1, H2 and Hv."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shm.values import ComplexArray, FloatArray

_TINY = np.finfo(float).tiny


def response_of(spectra: ComplexArray, estimator: str) -> tuple[ComplexArray, FloatArray]:
    """Accelerance in m/s^2/N and coherence, each (points, lines); 0 where nothing is known.

    `spectra` (hits, 1 + points, lines), the force first. `estimator` is `h1`, true where the noise
    is in the responses; `h2`, where it is in the force; `hv`, where both have the same share of it
    (Ewins 2000, section 3.6; Rocklin, Crowley and Vold 1985).
    """
    force, response = spectra[:, :1], spectra[:, 1:]
    cross = np.sum(force.conj() * response, axis=0)
    force_power = np.sum(np.abs(force) ** 2, axis=0)
    response_power = np.sum(np.abs(response) ** 2, axis=0)
    coherence = np.abs(cross) ** 2 / np.maximum(force_power * response_power, _TINY)
    return _ESTIMATORS[estimator](cross, force_power, response_power), coherence


def _h1(cross: ComplexArray, force: FloatArray, response: FloatArray) -> ComplexArray:
    return np.asarray(cross / np.maximum(force, _TINY))


def _h2(cross: ComplexArray, force: FloatArray, response: FloatArray) -> ComplexArray:
    return np.asarray(response * cross / np.maximum(np.abs(cross) ** 2, _TINY))


def _hv(cross: ComplexArray, force: FloatArray, response: FloatArray) -> ComplexArray:
    """Total least squares of each response and the force, each scaled to unit power.

    Scaled so, the matrix of their spectral densities is [[1, c*], [c, 1]] and the vector of its
    smallest eigenvalue gives a ratio of absolute value 1 and the phase of c: the result does not
    depend on units, and is the geometric mean of H1 and H2.
    """
    ratio = np.sqrt(response / np.maximum(force, _TINY))
    return np.asarray(ratio * cross / np.maximum(np.abs(cross), _TINY))


_ESTIMATORS: dict[str, Callable[[ComplexArray, FloatArray, FloatArray], ComplexArray]] = {
    "h1": _h1,
    "h2": _h2,
    "hv": _hv,
}
