"""Frequencies of several Timoshenko beams on end springs at once, with their slopes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.models import tensioned_beam
from shm.values import FloatArray, Hanger

SPRINGS, SHARE = slice(2, 6), 6
"""Columns of a parameter set, after ln of the tension ratio and ln c (`shm.models.as_made`): log10
k L/EI of springs k1 to k4, and shear over that of a solid section."""


class Solver:
    """Frequencies of one parameter set (7,) of each of several bars."""

    def __init__(self, hangers: Sequence[Hanger], orders: int):
        self._orders = orders
        self._length = np.array([h.length_m for h in hangers])
        self._nominal = np.array([h.nominal_tension_n for h in hangers])
        self._stiffness = np.array([h.bending_stiffness_n_m2 for h in hangers])
        self._mass = np.array([h.mass_per_length_kg_m for h in hangers])
        self._shear = np.array([h.shear_stiffness_n for h in hangers])
        self._gyration = np.sqrt([h.second_moment_m4 / h.area_m2 for h in hangers])

    def string_tension(self, log_f: FloatArray) -> FloatArray:
        """ln of the tension ratio (bars,) by the lowest mode of each, as of a string."""
        either = np.nanmin(np.where(np.isfinite(log_f), log_f, np.inf), axis=1)
        lowest = np.isfinite(either).argmax(axis=1)
        hz = np.exp(either[np.arange(len(either)), lowest])
        pull = self._mass * (2 * self._length * hz / (lowest + 1)) ** 2
        bends = self._stiffness * ((lowest + 1) * np.pi / self._length) ** 2
        ratio = np.maximum(pull - bends, 0.1 * pull) / self._nominal
        return np.asarray(np.log(ratio.clip(0.02, 5)))

    def with_slopes(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """ln f (bars, 2 orders) and its derivatives (bars, 2 orders, 7)."""
        steps = np.array([1e-4, 1e-4, *(1e-3,) * 4, 1e-3])
        sets = np.stack([theta, *(theta + step for step in np.diag(steps))])
        found = self._log_f(sets)
        slopes = (found[1:] - found[0]) / steps[:, None, None]
        return found[0], np.moveaxis(slopes, 0, -1)

    def _log_f(self, theta: FloatArray) -> FloatArray:
        """ln f (sets, bars, 2 orders) of parameters (sets, bars, 7)."""
        stiffer = np.exp(2 * theta[..., 1])
        stiffness = self._stiffness * stiffer
        springs = 10 ** theta[..., SPRINGS] * (stiffness / self._length)[..., None]
        hz = tensioned_beam.timoshenko_frequencies_hz(
            self._length[:, None],
            (self._nominal * np.exp(theta[..., 0]))[..., None],
            stiffness[..., None],
            self._mass[:, None],
            (self._shear * stiffer / theta[..., SHARE])[..., None],
            self._gyration[:, None],
            springs[..., :2],
            springs[..., 2:],
            self._orders,
        )
        return np.asarray(np.log(hz).reshape(*theta.shape[:2], -1))
