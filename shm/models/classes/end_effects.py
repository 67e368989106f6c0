"""Compute how the ends of a real hanger change its frequencies: by fittings and supports.

Near an end at x = 0 a mode of a tensioned beam is

    w = cos(a) sin(q x) - sin(a) (cos(q x) - exp(-p x)),    EI p^2 q^2 = m omega^2,
    p^2 - q^2 = T/EI,    tan(a) = k q / (EI (p^2 + q^2) + k p),

where a = 0 turns freely and tan(a) = q/p is clamped. Its amplitude between the ends is 1, so that
its modal mass is m L/2, and what changes energy near an end changes the frequency by Rayleigh's
quotient, to first order and each end by itself:

- a support of compliance C moves by the reaction, V^2 = EI m omega^2 (p cos a + q sin a)^2, and
  lowers ln f by C V^2 / (m omega^2 L);
- a fitting of length h, stiffer than the bar without end, leaves no curvature: its moment stays,
  and ln f rises by EI/(m omega^2 L) times the integral of w''^2; one r times as stiff has the share
  1 - 1/r of that. Where it is clamped the moment grows with the wave that it moves outwards, by
  some 0.9 p h (found with r = 4: 0.4 with 1.5, 1.5 with 30);
- a mass M at x lowers ln f by M w(x)^2 / (m L); as much mass as the bar's again over h, by the
  integral of w^2 over L.

The bar that a hanger with turnbuckles is, in the terms of the general model.

A turnbuckle is what it is, whatever the effective length: theta_L stretches or shortens the bar
between the turnbuckles, each piece in proportion, and the turnbuckles keep their length, mass and
bending stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shm.errors import UsageError
from shm.models.hanger import PhysicalHanger
from shm.values import FloatArray, Hanger

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
"""Exact to a thousandth for fittings up to half a wave long."""

_GROWS = 0.9  # with r = 4, as above


@dataclass(frozen=True, eq=False)
class EndWaves:
    """Modes near one end: q and p in rad/m, sin and cos of a, `clamped` from 0 to 1, EI in N m2.

    All arrays broadcast together.
    """

    q: FloatArray
    p: FloatArray
    sin: FloatArray
    cos: FloatArray
    clamped: FloatArray
    bending_stiffness_n_m2: FloatArray
    length_m: FloatArray

    @classmethod
    def of(
        cls,
        frequency_hz: FloatArray,
        tension_n: FloatArray,
        bending_stiffness_n_m2: FloatArray,
        mass_per_length_kg_m: FloatArray,
        length_m: FloatArray,
        spring_n_m_rad: FloatArray,
    ) -> EndWaves:
        """Of modes with these frequencies on an end spring, from 0 to infinite."""
        stiffness = bending_stiffness_n_m2
        inertia = mass_per_length_kg_m * (2 * np.pi * frequency_hz) ** 2
        root = np.sqrt(tension_n**2 + 4 * stiffness * inertia)
        q = np.sqrt(2 * inertia / (root + tension_n))
        p = np.sqrt((root + tension_n) / (2 * stiffness))
        with np.errstate(divide="ignore"):
            clamped = 1 / (1 + root / (spring_n_m_rad * p))
        slope = q / p * clamped
        cos = 1 / np.sqrt(1 + slope**2)
        return cls(q, p, slope * cos, cos, clamped, stiffness, length_m)

    def give(self) -> FloatArray:
        """By which ln f changes per m/N of the support's compliance."""
        reaction = self.p * self.cos + self.q * self.sin
        return np.asarray(-self.bending_stiffness_n_m2 * reaction**2 / self.length_m)

    def fitting(self, fitting_m: float) -> tuple[FloatArray, FloatArray]:
        """By which ln f changes by a rigid fitting, and by as much mass again along it."""
        bent, moved = np.zeros_like(self.q), np.zeros_like(self.q)
        q2, p2 = self.q**2, self.p**2
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            x, share = fitting_m * (1 + node) / 2, fitting_m * weight / 2
            wave_sin, wave_cos = np.sin(self.q * x), np.cos(self.q * x)
            decay = np.exp(-self.p * x)
            curvature = self.sin * (q2 * wave_cos + p2 * decay) - q2 * self.cos * wave_sin
            bent += share * curvature**2
            moved += share * (self.cos * wave_sin - self.sin * (wave_cos - decay)) ** 2
        grown = 1 + _GROWS * self.clamped * self.p * fitting_m
        return grown * bent / (q2 * p2 * self.length_m), -moved / self.length_m

    def deflection(self, x_m: float) -> FloatArray:
        """w at `x_m` from the end."""
        wave = np.cos(self.q * x_m) - np.exp(-self.p * x_m)
        return np.asarray(self.cos * np.sin(self.q * x_m) - self.sin * wave)


_EQUAL = 1e-9  # rounding


def coupled_bar(hanger: Hanger, length_m: FloatArray, tension_n: FloatArray) -> PhysicalHanger:
    """Clamped bars of effective lengths `length_m` (n,) at tensions (n,).

    Raises UsageError where one is not longer than the turnbuckles together.
    """
    fixed = sum(each.length_m for each in hanger.turnbuckles)
    if np.any(length_m <= fixed):
        raise UsageError(
            f"the turnbuckles of hanger {hanger.id} are {fixed:g} m long together, no shorter than "
            f"the effective length.",
            remedy="Give a larger theta_L.",
        )
    described = PhysicalHanger.clamped(hanger, tension_n)
    stretch = (length_m - fixed) / (hanger.length_m - fixed)
    zones = []
    for turnbuckle, zone in zip(hanger.turnbuckles, described.zones, strict=True):
        below = sum(each.length_m for each in hanger.turnbuckles if each.x_m < turnbuckle.x_m)
        start = below + (turnbuckle.x_m - turnbuckle.length_m / 2 - below) * stretch
        zones.append(replace(zone, start_m=start, end_m=start + turnbuckle.length_m))
    return replace(described, arch_end_m=length_m, zones=tuple(zones))


def has_symmetric_turnbuckles(hanger: Hanger) -> bool:
    """Return True where the turnbuckles look the same from the arch end as from the deck end."""
    if not hanger.turnbuckles:
        return True
    rows = np.array(
        [(t.x_m, t.length_m, t.mass_kg, t.bending_stiffness_n_m2) for t in hanger.turnbuckles]
    ).reshape(-1, 4)
    turned = rows * [-1, 1, 1, 1] + [hanger.length_m, 0, 0, 0]
    order, back = rows[:, 0].argsort(), turned[:, 0].argsort()
    return bool(np.allclose(rows[order], turned[back], rtol=_EQUAL))
