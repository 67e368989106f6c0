"""Exact frequencies and shapes of a tensioned beam whose section changes in steps.

Its segments are uniform, under the common tension, and joined end to end by Gaussian elimination
of their dynamic stiffness. How many natural frequencies lie below a trial frequency is known
exactly (W. H. Wittrick and F. W. Williams, Quarterly Journal of Mechanics and Applied Mathematics
24, 1971): it is the number of negative pivots and, for each segment, of the frequencies that it
would have with both ends clamped. So none is missed or doubled. Rounding costs a frequency about
1e-16 (EI / T h^2) (L / h), for a stiff segment of length h in a beam of length L: about 1e-12 for
a turnbuckle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.models.stepped.dynamic_stiffness import Segment, off_zero, segment, wave_numbers
from shm.models.stepped.roots import ordered_roots
from shm.values import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class SteppedBeam:
    """Beams held against deflection at both ends; their segments from the deck end up.

    `length_m`, `bending_stiffness_n_m2` and `mass_per_length_kg_m` have shape (segments, beams);
    `tension_n` and the rotational end springs (inf for clamped) have shape (beams,).
    """

    length_m: FloatArray
    bending_stiffness_n_m2: FloatArray
    mass_per_length_kg_m: FloatArray
    tension_n: FloatArray
    k_deck_n_m_rad: FloatArray
    k_arch_n_m_rad: FloatArray

    def frequencies_hz(self, modes: int) -> FloatArray:
        """Natural frequencies, shape (beams, modes)."""
        order = np.arange(1, modes + 1)
        low, high = self._bounds(order)
        beam = np.repeat(np.arange(len(low)), modes)
        omega = ordered_roots(
            lambda omega, which: self._trial(omega, beam[which]),
            low.ravel(),
            high.ravel(),
            np.tile(order, len(low)),
        )
        return np.asarray(omega.reshape(low.shape) / (2 * np.pi))

    def _bounds(self, order: IntArray) -> tuple[FloatArray, FloatArray]:
        """Bounds of omega, (beams, modes).

        A uniform beam of the least bending stiffness and the most mass, pinned, lies below; one of
        the most stiffness and the least mass lies above, even at a wave number of (n + 1) pi / L.
        """
        length, tension = self.length_m.sum(axis=0)[:, None], self.tension_n[:, None]
        stiffness, mass = self.bending_stiffness_n_m2, self.mass_per_length_kg_m
        soft, stiff = stiffness.min(axis=0)[:, None], stiffness.max(axis=0)[:, None]
        light, heavy = mass.min(axis=0)[:, None], mass.max(axis=0)[:, None]
        short, long = order * np.pi / length, (order + 1) * np.pi / length
        low = short * np.sqrt((tension + soft * short**2) / heavy)
        high = long * np.sqrt((tension + stiff * long**2) / light)
        return low * (1 - 1e-9), high * (1 + 1e-9)

    def _trial(self, omega: FloatArray, beam: IntArray) -> tuple[IntArray, FloatArray]:
        """How many frequencies of the beams `beam` (tried,) lie below `omega` (tried,).

        And a function of omega that changes sign at each of them, scaled at will.
        """
        tension, length = self.tension_n[beam], self.length_m[:, beam]
        stiffness, mass = self.bending_stiffness_n_m2[:, beam], self.mass_per_length_kg_m[:, beam]
        p, q = wave_numbers(length, tension, stiffness, mass, omega)
        # All stiffness is divided by the tension, which keeps long products in range.
        rows = segment(length, stiffness / tension, p, q)
        chain = _Chain.begin(rows[0], self.k_deck_n_m_rad[beam] / tension)
        for row in range(1, len(length)):
            chain = chain.joined(rows[row])
        return chain.ended(self.k_arch_n_m_rad[beam] / tension)


@dataclass(frozen=True, eq=False)
class _Chain:
    """Segments joined so far: the stiffness `ww`, `wr`, `rr` of the free end, all else eliminated.

    `below` counts natural frequencies below the trial with that end clamped; `value` changes sign
    at each of them.
    """

    ww: FloatArray
    wr: FloatArray
    rr: FloatArray
    below: IntArray
    value: FloatArray

    @classmethod
    def begin(cls, first: Segment, spring: FloatArray) -> _Chain:
        """The first segment, its deck end held by a rotational spring."""
        stiff, flexible = shares(spring)
        pivot = first.rr * flexible + stiff
        slope = flexible / off_zero(pivot)
        return cls(
            first.ww - slope * first.cross_wr**2,
            -first.wr + slope * first.cross_wr * first.cross_rr,
            first.rr - slope * first.cross_rr**2,
            first.clamped_below + (pivot < 0),
            first.clamped * pivot,
        )

    def joined(self, following: Segment) -> _Chain:
        """One segment more: deflection and slope of the joint are eliminated."""
        ww, wr, rr = self.ww + following.ww, self.wr + following.wr, self.rr + following.rr
        determinant = off_zero(ww * rr - wr**2)
        a, b, c = following.cross_ww, following.cross_wr, following.cross_rr
        # Deflection and slope of the joint for a deflection, then for a slope of the free end.
        w_by_w, r_by_w = (rr * a + wr * b) / determinant, (-ww * b - wr * a) / determinant
        w_by_r, r_by_r = (rr * b - wr * c) / determinant, (ww * c - wr * b) / determinant
        negative = np.where(determinant < 0, 1, np.where(ww < 0, 2, 0))
        return _Chain(
            following.ww - a * w_by_w + b * r_by_w,
            -following.wr - a * w_by_r + b * r_by_r,
            following.rr - b * w_by_r - c * r_by_r,
            self.below + following.clamped_below + negative,
            self.value * following.clamped * determinant,
        )

    def ended(self, spring: FloatArray) -> tuple[IntArray, FloatArray]:
        """The arch end held by a rotational spring: the count and the function of `_trial`."""
        stiff, flexible = shares(spring)
        pivot = self.rr * flexible + stiff
        return self.below + (pivot < 0), self.value * pivot


def shares(spring: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A spring from 0 to inf as stiffness over flexibility, both bounded."""
    with np.errstate(divide="ignore"):
        return np.where(spring > 1, 1.0, spring), np.where(spring > 1, 1 / spring, 1.0)
