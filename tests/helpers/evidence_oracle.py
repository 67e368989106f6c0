"""Log evidences of beam1 and beam2 by quadrature, right to 1e-3: what the sampler is judged by.

Beam1 has two parameters and sigma, which an incomplete gamma function integrates out. For beam2,
given theta_F, theta_L and sigma the two planes separate, so that its evidence is an integral over
these three of the product of two integrals over the two springs of a plane,

    I(sigma) = int int exp(-N_D S / (2 sigma^2)) dlog10_ka dlog10_kb / 49,

S the sum of squared fractional misfits of that plane. The frequencies of one plane are smooth and
symmetric in its springs: they are interpolated from Chebyshev nodes to a fine Gauss-Legendre grid
over half the square. The other integrands are bells, which the trapezoidal rule integrates to many
digits. Data without standard deviations (sd = 0), as the thesis has them.

    python -m tests.helpers.evidence_oracle        computes `ORACLE` anew, in about two minutes
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev, legendre
from scipy.special import gammaincc, gammaln, logsumexp

from shm.models import THESIS, Model, build
from shm.values import PLANES, FloatArray, ModalTest, Mode, Plane
from tests.helpers.hangers import HANGER_3

TABLES: dict[str, dict[Plane, list[float]]] = {
    "1.1": {
        "transverse": [5.82, 13.85, 26.17, 40.47, 59.3, 81.3],
        "longitudinal": [6.09, 14.8, 27.0, 41.8, 61.5, 83.68],
    },
    "A.4": {
        "transverse": [5.82, 13.85, 26.17, 40.47, 59.3, 81.63],
        "longitudinal": [6.09, 14.86, 27.07, 41.8, 61.5, 85.68],
    },
}
"""The measured frequencies (Hz) of hanger 3, as tables 1.1 and A.4 of the thesis print them."""

ORACLE: dict[tuple[str, str, int], float] = {
    ("1.1", "beam1", 1): -23.3947,
    ("1.1", "beam1", 10): -132.5817,
    ("A.4", "beam1", 1): -24.0957,
    ("A.4", "beam1", 10): -141.4267,
    ("1.1", "beam2", 1): -20.3526,
    ("1.1", "beam2", 10): -56.4703,
    ("A.4", "beam2", 1): -20.2681,
    ("A.4", "beam2", 10): -53.6548,
}
"""Log evidence by (table, class, N_D)."""

_NEGLIGIBLE = 16.0
_BINS_PER_FOLD = 300
_WIDTH = np.array([4.5, 1.0])
_LEAST_SIGMA, _MOST_SIGMA = 0.002, 0.4
_PEAK = np.array([1.18, 0.962])
_STEP = {1: np.array([0.07, 0.0042]), 10: np.array([0.0105, 0.00095])}


@dataclass(frozen=True)
class Resolution:
    """How fine: theta steps (1: 0.6 standard deviations), springs' nodes, step of log sigma."""

    theta_step: float = 0.7
    nodes: int = 40
    springs: int = 320
    sigma_step_in_sd: float = 0.8


def modal_test(frequencies: Mapping[Plane, list[float]], sd_hz: float = np.nan) -> ModalTest:
    """A test of hanger 3 with these frequencies."""
    modes = tuple(
        Mode(plane, order, frequency, sd_hz)
        for plane, values in frequencies.items()
        for order, frequency in enumerate(values, start=1)
    )
    return ModalTest("t1", modes, hanger=3)


def log_marginal(square_misfit: FloatArray, frequencies: FloatArray, repeat: int = 1) -> FloatArray:
    """Log of the likelihood with sigma integrated over its prior, uniform on [0, 1], sd = 0.

    int_0^1 sigma^-N exp(-S / 2 sigma^2) dsigma is an incomplete gamma function.
    """
    half = (frequencies.size * repeat - 1) / 2
    square = square_misfit * repeat
    integral = gammaln(half) + np.log(gammaincc(half, square / 2)) - np.log(2)
    return np.asarray(integral + half * np.log(2 / square) + _constant(frequencies, repeat))


def beam1_log_evidence(table: str, repeat: int, cells: int = 1000) -> float:
    """Beam1 by the midpoint rule with `cells` along each of theta_F and theta_L."""
    model, measured = build("beam1", HANGER_3, THESIS), np.array([TABLES[table][p] for p in PLANES])
    theta_f, theta_l = _midpoints(0.5, 5.0, cells), _midpoints(0.5, 1.5, cells)
    values = []
    for chosen in theta_f[theta_f < 3]:
        theta = np.column_stack([np.full(cells, chosen), theta_l])
        misfit = model.frequencies_hz(theta, measured.shape[1]) / measured - 1
        values.append(log_marginal((misfit**2).sum(axis=(1, 2)), measured, repeat))
    return float(logsumexp(values) - 2 * np.log(cells))


def beam2_log_evidence(table: str, repeat: int, resolution: Resolution | None = None) -> float:
    """Beam2 on a lattice of (theta_F, theta_L) that grows from its peak until nothing is left."""
    resolution = resolution or Resolution()
    integrand = _Beam2(np.array([TABLES[table][p] for p in PLANES]), repeat, resolution)
    step = resolution.theta_step * _STEP[repeat]
    values: dict[tuple[int, int], float] = {}
    border = {(0, 0)}
    while border:
        values |= {cell: integrand.log_density(*(_PEAK + step * cell)) for cell in border}
        least = max(values.values()) - _NEGLIGIBLE
        grown = [cell for cell in border if values[cell] > least]
        border = {near for cell in grown for near in neighbours(cell)} - values.keys()
    return float(logsumexp(list(values.values())) + np.log(step / _WIDTH).sum())


def neighbours(cell: tuple[int, int]) -> list[tuple[int, int]]:
    """The cell of a lattice and the eight around it."""
    return [(cell[0] + i, cell[1] + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]


class _Beam2:
    """The likelihood of (theta_F, theta_L) for `measured` (2, modes): the rest integrated out."""

    def __init__(self, measured: FloatArray, repeat: int, resolution: Resolution):
        self._model: Model = build("beam2", HANGER_3, THESIS)
        self._measured, self._repeat = measured, repeat
        self._nodes = chebyshev.chebpts1(resolution.nodes)
        fine, weights = legendre.leggauss(resolution.springs)
        basis = chebyshev.chebvander(self._nodes, resolution.nodes - 1)
        self._to_fine = chebyshev.chebvander(fine, resolution.nodes - 1) @ np.linalg.inv(basis)
        self._half = np.tril_indices(resolution.springs)
        pair = np.outer(weights, weights) / 4
        self._weights = (2 * pair - np.diag(np.diag(pair)))[self._half]
        step = resolution.sigma_step_in_sd / np.sqrt(2 * measured.size * repeat)
        self._log_sigma = np.arange(np.log(_LEAST_SIGMA), np.log(_MOST_SIGMA), step)

    def log_density(self, theta_f: float, theta_l: float) -> float:
        """Log of the likelihood with springs and sigma integrated over their priors."""
        plane = self._plane_frequencies(theta_f, theta_l)
        precision = self._repeat / (2 * np.exp(2 * self._log_sigma))
        count = self._measured.size * self._repeat
        total = (1 - count) * self._log_sigma + _constant(self._measured, self._repeat)
        for own in self._measured:
            square, weight = self._binned(((plane / own[:, None] - 1) ** 2).sum(axis=0))
            terms = np.exp(-np.outer(precision, square - square[0])) @ weight
            total = total + np.log(terms) - precision * square[0]
        return float(logsumexp(total) + np.log(self._log_sigma[1] - self._log_sigma[0]))

    def _plane_frequencies(self, theta_f: float, theta_l: float) -> FloatArray:
        """Frequencies (modes, pairs) of one plane for all pairs of springs of the fine grid."""
        springs = 8.5 + 3.5 * self._nodes
        one, other = np.tril_indices(len(springs))
        theta = np.column_stack(
            [
                np.full(len(one), theta_f),
                np.full(len(one), theta_l),
                *(springs[i] for i in (one, one, other, other)),
            ]
        )
        found = self._model.frequencies_hz(theta, self._measured.shape[1])[:, 0]
        square = np.empty((self._measured.shape[1], len(springs), len(springs)))
        square[:, one, other] = square[:, other, one] = found.T
        fine = self._to_fine @ square @ self._to_fine.T
        return fine[:, self._half[0], self._half[1]]

    def _binned(self, square: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Squares and their weights, gathered into bins narrow against what exp can tell."""
        low = square.min()
        place = (np.log(square / low) * _BINS_PER_FOLD).astype(int)
        weight = np.bincount(place, self._weights)
        mean = np.bincount(place, self._weights * square)
        full = weight > 0
        return mean[full] / weight[full], weight[full]


def _constant(frequencies: FloatArray, repeat: int) -> float:
    """Log of the factors of the likelihood that hold neither misfit nor sigma."""
    own = frequencies.size / 2 * np.log(2 * np.pi) + np.log(frequencies).sum()
    return float(-repeat * own)


def _midpoints(low: float, high: float, cells: int) -> FloatArray:
    return low + (high - low) * (np.arange(cells) + 0.5) / cells


def main() -> None:
    """Prints `ORACLE` computed anew."""
    for table in TABLES:
        for repeat in (1, 10):
            print((table, "beam1", repeat), round(beam1_log_evidence(table, repeat), 4))
            print((table, "beam2", repeat), round(beam2_log_evidence(table, repeat), 4))


if __name__ == "__main__":
    main()
