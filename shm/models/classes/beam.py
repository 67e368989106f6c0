"""Beam 1 (clamped ends) and Beam 2 (rotational end springs), thesis 2.4 and 5.1; Beam 3 (shear)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from shm.models.classes import tensioned_beam
from shm.models.classes.base import RATIOS, Model
from shm.models.classes.end_effects import coupled_bar, has_symmetric_turnbuckles
from shm.models.hanger import PhysicalHanger, solve
from shm.values import PLANES, FloatArray, Hanger


class Beam(Model):
    """A tensioned Euler-Bernoulli beam; members say which rotational springs hold its ends, if any.

    With turnbuckles it is a case of the general model (`shm.models.classes.end_effects`), and its
    ends can be exchanged only where the turnbuckles lie alike from both.
    """

    def __init__(self, hanger: Hanger):
        super().__init__(hanger)
        if not has_symmetric_turnbuckles(hanger):
            self.swaps = ()

    @classmethod
    def unfit(cls, hanger: Hanger) -> str:
        together = sum(turnbuckle.length_m for turnbuckle in hanger.turnbuckles)
        shortest = cls.bounds.get("theta_L", (1.0, 1.0))[0] * hanger.length_m
        if together < shortest:
            return ""
        return (
            f"its turnbuckles are {together:g} m long together, as long as the shortest effective "
            f"length that it considers ({shortest:g} m)."
        )

    def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        if self.hanger.turnbuckles:
            bar = self._coupled(theta)
            return solve(bar, modes, np.empty(0), shapes=False).frequency_hz
        deck, arch = self.springs_n_m_rad(theta)
        return tensioned_beam.frequencies_hz(
            self._length_m(theta)[:, None],
            self._tension_n(theta)[:, None],
            np.asarray(self.hanger.bending_stiffness_n_m2),
            np.asarray(self.hanger.mass_per_length_kg_m),
            deck,
            arch,
            modes,
            np.asarray(self.shear_compliance_1_n),
            np.asarray(self.gyration_m),
        )

    @property
    def shear_compliance_1_n(self) -> float:
        """Return 1/(kappa G A), 0 for a bar that does not shear."""
        return 0.0

    @property
    def gyration_m(self) -> float:
        """Return the radius of gyration of the section, 0 where it does not resist turning."""
        return 0.0

    def _coupled(self, theta: FloatArray) -> PhysicalHanger:
        bar = coupled_bar(self.hanger, self._length_m(theta), self._tension_n(theta))
        return bar.on_springs(self.springs_n_m_rad(theta))

    def shapes(self, theta: FloatArray, modes: int, x_m: FloatArray) -> FloatArray:
        if self.hanger.turnbuckles:
            seen = solve(self._coupled(theta), modes, x_m).shape
            return np.stack([seen[:, axis, :, :, axis] for axis in range(len(PLANES))], axis=1)
        length = self._length_m(theta)[:, None]
        slenderness = length / self.hanger.bending_stiffness_n_m2
        deck, arch = (springs * slenderness for springs in self.springs_n_m_rad(theta))
        waves = tensioned_beam.waves(
            self._tension_n(theta)[:, None] * length * slenderness,
            deck,
            arch,
            modes,
            self.shear_compliance_1_n / (length * slenderness),
            (self.gyration_m / length) ** 2,
        )
        return tensioned_beam.shapes(waves, deck[..., None], x_m / length[..., None, None])

    def _length_m(self, theta: FloatArray) -> FloatArray:
        return self.stiffness_mass_length(theta)[2] * self.hanger.length_m

    def _tension_n(self, theta: FloatArray) -> FloatArray:
        return theta[:, self.parameter_names.index("theta_F")] * self.hanger.nominal_tension_n


class Beam1(Beam):
    """Both ends clamped: the two planes have the same frequencies."""

    name = "beam1"
    title = "Beam 1: clamped ends"
    bounds = {"theta_F": (0.5, 5.0), "theta_L": (0.5, 1.5)}  # noqa: RUF012


class Beam2(Beam):
    """A rotational spring at each end and plane: k1, k3 transverse, k2, k4 longitudinal."""

    name = "beam2"
    title = "Beam 2: rotational end springs"
    bounds = {  # noqa: RUF012
        "theta_F": (0.5, 5.0),
        "theta_L": (0.5, 1.5),
        "log10_k1": (5.0, 12.0),
        "log10_k2": (5.0, 12.0),
        "log10_k3": (5.0, 12.0),
        "log10_k4": (5.0, 12.0),
    }
    swaps = (("log10_k1", "log10_k3"), ("log10_k2", "log10_k4"))
    units: Mapping[str, str] = {
        **RATIOS,
        **dict.fromkeys(("log10_k1", "log10_k2", "log10_k3", "log10_k4"), "N m/rad"),
    }

    def springs_n_m_rad(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        springs = 10 ** theta[:, 2:]
        return springs[:, :2], springs[:, 2:]


class Beam3(Beam2):
    """Beam 2 that shears and whose sections resist turning: Timoshenko's beam.

    Shear stiffness is kappa G A with Cowper's kappa of a round section, solid or hollow.
    """

    name = "beam3"
    title = "Beam 3: rotational end springs, shear and rotary inertia"

    @property
    def shear_compliance_1_n(self) -> float:
        return 1 / self.hanger.shear_stiffness_n

    @property
    def gyration_m(self) -> float:
        return float(np.sqrt(self.hanger.second_moment_m4 / self.hanger.area_m2))

    def _coupled(self, theta: FloatArray) -> PhysicalHanger:
        """Return the same with shear, in turnbuckles the bar's, and rotary inertia of the mass."""
        one = np.ones(len(theta))
        return replace(
            super()._coupled(theta),
            shear_compliance_1_n=self.shear_compliance_1_n * one,
            rotary_inertia_kg_m=self.hanger.mass_per_length_kg_m * self.gyration_m**2 * one,
        )
