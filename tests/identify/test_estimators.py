"""H1, H2 and Hv of a single mode whose accelerance is known in closed form.

Noise with a share q of the signal's power multiplies H1 by 1/(1 + q) where it is in the force, and
H2 by 1 + q where it is in the response (Ewins 2000, section 3.6). With q in both, Hv is unbiased.
"""

from __future__ import annotations

import numpy as np
import pytest

from shm.identify.measuring.frf import response_of
from shm.values import ComplexArray

HITS = 4000
SHARE = 0.3
FREQUENCY_HZ = np.linspace(8.0, 12.0, 60)
RNG = np.random.default_rng(4)


def _accelerance() -> ComplexArray:
    """-w^2 / (w0^2 - w^2 + 2 i zeta w0 w) at 10 Hz, 1 % damping, for a mass of 1 kg."""
    omega, natural = 2 * np.pi * FREQUENCY_HZ, 2 * np.pi * 10.0
    return np.asarray(-(omega**2) / (natural**2 - omega**2 + 0.02j * natural * omega))


def _noise() -> ComplexArray:
    parts = RNG.standard_normal((2, HITS, len(FREQUENCY_HZ)))
    return np.asarray((parts[0] + 1j * parts[1]) * np.sqrt(SHARE / 2))


def _spectra(in_force: bool, in_response: bool) -> ComplexArray:
    """Hits of unit power; the noise has 0.3 of each signal's power on every line."""
    phase = RNG.uniform(0, 2 * np.pi, (HITS, len(FREQUENCY_HZ)))
    force = np.exp(1j * phase)
    response = force * _accelerance() + in_response * _noise() * np.abs(_accelerance())
    return np.stack([force + in_force * _noise(), response], axis=1)


@pytest.mark.parametrize(
    ("estimator", "in_force", "in_response", "bias"),
    [
        ("h1", False, True, 1.0),
        ("h1", True, False, 1 / (1 + SHARE)),
        ("h2", True, False, 1.0),
        ("h2", False, True, 1 + SHARE),
        ("hv", True, True, 1.0),
        ("hv", True, False, 1 / np.sqrt(1 + SHARE)),
        ("hv", False, True, np.sqrt(1 + SHARE)),
    ],
)
def test_each_estimator_is_biased_as_theory_says(
    estimator: str, in_force: bool, in_response: bool, bias: float
) -> None:
    found, _ = response_of(_spectra(in_force, in_response), estimator)
    ratio = found[0] / _accelerance()
    np.testing.assert_allclose(ratio, bias, atol=0.06)
    assert np.mean(ratio) == pytest.approx(bias, abs=0.004)


def test_hv_is_the_total_least_squares_solution() -> None:
    """The ratio in the eigenvector of the smallest eigenvalue of the scaled spectral matrix."""
    spectra = _spectra(True, True)[:5]
    found, _ = response_of(spectra, "hv")
    for line in range(0, len(FREQUENCY_HZ), 7):
        signals = spectra[:, :, line]
        scale = np.linalg.norm(signals, axis=0)
        _, _, vectors = np.linalg.svd(signals / scale)
        smallest = vectors[-1].conj()
        ratio = -smallest[0] / smallest[1] * scale[1] / scale[0]
        assert found[0, line] == pytest.approx(ratio)
