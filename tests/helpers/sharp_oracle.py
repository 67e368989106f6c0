"""Frequencies known to 3e-5, and the log evidence of beam2 from them by quadrature.

Orders 2 to 6 of an exact beam in both planes with normal errors of 3e-5, as
`tests/benchmarks/sharp_evidence.py` makes them (its case 0), rounded. The posterior has thin ridges
along springs that are nearly rigid, and four copies, as the springs of a plane can be exchanged.

Given theta_F, theta_L and sigma the planes separate, as in `evidence_oracle`. Their springs are too
sharp for a fixed grid: the square of two springs is cut into cells until the likelihood hardly
changes within each, and cells that hold none of it are left out. (theta_F, theta_L) has a sharp
ridge with a long tail in theta_L: across the ridge its lattice is even in arcsinh. sigma is
integrated over panels. As in the package's likelihood, sigma is never below 1e-4: all of its prior
below counts as 1e-4.

    python -m tests.helpers.sharp_oracle        computes `ORACLE` anew
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from scipy.special import logsumexp

from shm.models import THESIS, build
from shm.values import PLANES, FloatArray, ModalTest, Mode, Plane
from tests.helpers.evidence_oracle import neighbours
from tests.helpers.hangers import HANGER_3

SHARP: dict[Plane, list[float]] = {
    "transverse": [13.170983, 23.872056, 38.003624, 55.699437, 77.017861],
    "longitudinal": [13.115154, 23.80171, 37.932737, 55.631885, 76.959682],
}
"""Orders 2 to 6 in Hz."""

SD = 3e-5
LEAST_SIGMA = 1e-4

ORACLE: dict[int, float] = {1: 5.553, 10: 420.841}
"""Log evidence by N_D, right to 0.02: so much a coarser lattice and coarser cells differ."""

_THETA_BOX, _SPRING_BOX = 4.5 * 1.0, 7.0**2
"""Volumes of the prior: of theta_F and theta_L, and of the two springs of one plane."""

_SOFTEST, _STIFFEST = 5.0, 12.0
_NEGLIGIBLE = 14.0

# Fitted to the ridge: its peak, how theta_L falls along theta_F, and how wide it is in each.
_PEAK = np.array([1.368, 0.9866])
_FALL, _FALLS_WITHIN = 5.5e-4, 0.085
_WIDTH = {1: np.array([0.03, 6e-5]), 10: np.array([0.0044, 3e-5])}


def sharp_test() -> ModalTest:
    """The test of hanger 3 with these frequencies."""
    modes = tuple(
        Mode(plane, order, frequency, SD * frequency)
        for plane, values in SHARP.items()
        for order, frequency in enumerate(values, start=2)
    )
    return ModalTest("sharp", modes, hanger=HANGER_3.id)


@dataclass(frozen=True)
class Resolution:
    """How fine: step of the lattice, nodes and largest change of the log likelihood in a cell."""

    step: float = 0.35
    nodes: int = 4
    change: float = 6.0


class SharpEvidence:
    """The quadrature for one N_D."""

    def __init__(self, repeat: int, resolution: Resolution | None = None):
        self._model = build("beam2", HANGER_3, THESIS)
        self._measured = np.array([SHARP[plane] for plane in PLANES])
        self._repeat, self._resolution = repeat, resolution or Resolution()
        self._log_sigma, self._log_prior = _sigma_nodes()
        self._variance = np.exp(2 * self._log_sigma) + SD**2
        # Below that by so much, a spring's square has no share even if all of it were as likely.
        self._cut = {1: 17.0, 10: 25.0}[repeat]

    def log_evidence(self) -> float:
        """On a lattice of (theta_F, theta_L) that grows from its peak until nothing is left."""
        values: dict[tuple[int, int], float] = {}
        border = {(0, 0)}
        while border:
            values |= {cell: self._weighted(*cell) for cell in border}
            least = max(values.values()) - _NEGLIGIBLE
            grown = [cell for cell in border if values[cell] > least]
            border = {near for cell in grown for near in neighbours(cell)} - values.keys()
        constant = self._measured.size / 2 * np.log(2 * np.pi) + np.log(self._measured).sum()
        box = np.log(_THETA_BOX) + 2 * np.log(_SPRING_BOX)
        return float(logsumexp(list(values.values())) - self._repeat * constant - box)

    def _weighted(self, i: int, j: int) -> float:
        """Log of the likelihood at a lattice point, with the area that it stands for."""
        x, y = self._resolution.step * i, self._resolution.step * j
        width = _WIDTH[self._repeat]
        along = width[0] * x
        ridge = _PEAK[1] + _FALL * np.expm1(-along / _FALLS_WITHIN)
        area = self._resolution.step**2 * width.prod() * np.cosh(y)
        density = self.log_density(_PEAK[0] + along, ridge + width[1] * np.sinh(y))
        return density + float(np.log(area))

    def log_density(self, theta_f: float, theta_l: float) -> float:
        """Log of the integral over springs and sigma, without the constant factors."""
        planes = [self._plane(theta_f, theta_l, own) for own in self._measured]
        return float(logsumexp(np.sum(planes, axis=0) + self._log_prior))

    def _plane(self, theta_f: float, theta_l: float, own: FloatArray) -> FloatArray:
        """Log of the integral over the two springs of a plane, for each sigma."""
        square, volume = self._springs(np.array([theta_f, theta_l]), own)
        power = self._repeat / 2
        if not len(square):
            return np.full(len(self._variance), -np.inf)
        least = square.min()
        terms = np.exp(-power * np.outer(1 / self._variance, square - least)) @ volume
        scale = least / self._variance + len(own) * np.log(self._variance)
        return np.asarray(np.log(terms) - power * scale)

    def _springs(self, theta: FloatArray, own: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Squared misfits at the nodes of all cells that matter, and their volumes."""
        node, weight = legendre.leggauss(self._resolution.nodes)
        weights = np.outer(weight, weight) / 4
        low, side, copies = _first_cells()
        least = self._variance.min()
        squares, volumes = [np.empty(0)], [np.empty(0)]
        while len(low):
            misfit = self._misfit(theta, own, low[:, :, None] + side[:, :, None] * (1 + node) / 2)
            square = (misfit**2).sum(axis=-1)
            held = self._loss(_lower_bound(misfit) / len(own), least, len(own)) < self._cut
            lowest, highest = square.min(axis=(1, 2)), square.max(axis=(1, 2))
            # The other plane may hold sigma at half of what this one alone would choose.
            variance = np.maximum(lowest / (4 * len(own)), least)
            flat = self._repeat * (highest - lowest) / 2 < self._resolution.change * variance
            done, more = held & flat, held & ~flat
            squares.append(square[done].ravel())
            area = copies[done] * side[done].prod(axis=1)
            volumes.append((weights * area[:, None, None]).ravel())
            low, side, copies = _halved(low[more], side[more], copies[more], square[more])
        return np.concatenate(squares), np.concatenate(volumes)

    def _misfit(self, theta: FloatArray, own: FloatArray, springs: FloatArray) -> FloatArray:
        """Fractional misfits (cells, nodes, nodes, modes) at the springs (cells, 2, nodes)."""
        one, other = np.broadcast_arrays(springs[:, 0, :, None], springs[:, 1, None, :])
        shape, one, other = one.shape, one.ravel(), other.ravel()
        given = np.broadcast_to(theta, (len(one), 2))
        asked = np.column_stack([given, one, one, other, other])
        # From the second order on, as no impact test gave the first.
        found = self._model.frequencies_hz(asked, len(own) + 1)[:, 0, 1:]
        return np.asarray((found / own - 1).reshape(*shape, len(own)))

    def _loss(self, mean_square: FloatArray, least: float, count: int) -> FloatArray:
        """How far below a perfect fit the log likelihood is at least, whatever sigma is."""
        variance = np.maximum(mean_square, least)
        terms = np.log(variance / least) + mean_square / variance
        return np.asarray(self._repeat * count / 2 * terms)


def _lower_bound(misfit: FloatArray) -> FloatArray:
    """Less than the squared misfit anywhere in a cell, walls included, from that at its nodes."""
    highest, lowest = misfit.max(axis=(1, 2)), misfit.min(axis=(1, 2))
    beyond_nodes = 0.3 * (highest - lowest)
    return np.asarray((np.maximum(lowest, -highest) - beyond_nodes).clip(0) ** 2).sum(axis=1)


def _first_cells() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Corners (cells, 2), sides (cells, 2) and copies: the springs of a plane can be exchanged."""
    count = 16
    side = (_STIFFEST - _SOFTEST) / count
    one, other = np.tril_indices(count)
    low = _SOFTEST + side * np.column_stack([one, other])
    return low, np.full(low.shape, side), np.where(one == other, 1.0, 2.0)


def _halved(
    low: FloatArray, side: FloatArray, copies: FloatArray, square: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Each cell cut in two along the spring in which its squared misfit changes more."""
    changes = [np.ptp(square, axis=axis).max(axis=1, initial=0.0) for axis in (1, 2)]
    cut = np.eye(2)[np.argmax(changes, axis=0)] if len(low) else np.empty((0, 2))
    side = side * (1 - cut / 2)
    upper = low + cut * side
    return np.concatenate([low, upper]), np.concatenate([side, side]), np.tile(copies, 2)


def _sigma_nodes() -> tuple[FloatArray, FloatArray]:
    """Nodes of log sigma and the log of each one's share of the prior, finer towards the least."""
    least = np.log(LEAST_SIGMA)
    edges = least + np.array([0, 0.01, 0.03, 0.07, 0.15, 0.3, 0.6, 1.2, 2.4, 4.8, -least])
    node, weight = legendre.leggauss(6)
    half = np.diff(edges)[:, None] / 2
    nodes = (edges[:-1, None] + half * (1 + node)).ravel()
    shares = np.log(half * weight).ravel() + nodes
    return np.append(nodes, least), np.append(shares, least)


def main() -> None:
    """Prints `ORACLE` computed anew."""
    for repeat in ORACLE:
        print(repeat, round(SharpEvidence(repeat).log_evidence(), 4), flush=True)


if __name__ == "__main__":
    main()
