"""The solid model classes: s1, s2 (plain rods), solid0, solid1, solid2 (thesis chapter 3, 5.2)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from copy import copy
from typing import ClassVar

import numpy as np

from shm.errors import BadInput
from shm.models.classes.base import RATIOS, Model, silent
from shm.models.classes.solid.basis import Description, transverse_basis
from shm.models.classes.solid.geometry import (
    ALL_SPRINGS,
    AXIAL,
    AXIAL_SPRINGS,
    FIXED,
    Fineness,
    Geometry,
    Material,
    Support,
    face_springs_n_m_rad,
)
from shm.values import PLANES, FloatArray, Hanger, ModalTest, Plane

_SPRING_BOUNDS = (5.0, 12.0)  # thesis 5.2
_BLOCK = 500  # technical: matrices of some 10 MB at once

# The two plates are alike but for a quarter turn. Seen from the arch end and with the planes
# exchanged, the hanger is the same, so that one basis serves both planes.
_MIRRORED = {
    "log10_k1": "log10_k4",
    "log10_k2": "log10_k3",
    "log10_k3": "log10_k2",
    "log10_k4": "log10_k1",
    "log10_krx": "log10_kly",
    "log10_klx": "log10_kry",
}


class SolidModel(Model):
    """A three-dimensional finite element model; members say what is modelled and how it is held.

    `frequencies_hz` uses a reduced basis, right to 0.02 % of the full model over the prior box;
    `reference_frequencies_hz` solves the full model.

    The hanger is described as it hangs, stretched already; the thesis draws it without tension and
    lets the nominal one stretch it (3.1.1, step 1): `is_unstressed`.
    """

    expensive = True
    is_unstressed = False
    support: ClassVar[Support] = FIXED
    with_plates: ClassVar[bool] = True

    def of_the_thesis(self) -> SolidModel:
        return self._described(is_unstressed=True)

    def as_it_hangs(self) -> SolidModel:
        return self._described(is_unstressed=False)

    def _described(self, is_unstressed: bool) -> SolidModel:
        other = copy(self)
        other.is_unstressed = is_unstressed
        return other

    @classmethod
    def unfit(cls, hanger: Hanger) -> str:
        return _not_a_round_rod(hanger) or (
            "it needs the end plates' dimensions: give a [hanger.plate] table."
            if hanger.plate is None
            else ""
        )

    def prepare(self, modes: int, progress: Callable[[float], None] = silent) -> None:
        """Make the reduced basis for that many modes a plane, where it is not there yet."""
        transverse_basis(self.description(), modes, progress)

    def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        projected = transverse_basis(self.description(), modes, silent).projected
        frequencies = np.empty((len(theta), 2, modes))
        for start in range(0, len(theta), _BLOCK):
            block = slice(start, start + _BLOCK)
            for index, plane in enumerate(PLANES):
                points = self._points(theta[block], plane)
                frequencies[block, index] = projected.frequencies_hz(points, modes)
        return frequencies

    def reference_frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        points = np.vstack([self._points(theta, plane) for plane in PLANES])
        found = self.description().full_frequencies_hz(points, modes)
        return np.stack(np.split(found, 2), axis=1)

    def convergence_hz(self, rods: tuple[int, ...], modes: int) -> Iterator[tuple[int, FloatArray]]:
        """Unknowns and frequencies (modes,) of held ends at nominal tension, by cells along it."""
        from shm.models.classes.solid.reduction import natural_modes

        for rod in rods:
            system = self.description().meshed("transverse", rod)
            found = natural_modes(system, self.hanger.nominal_tension_n, np.zeros(0), modes)
            yield system.unknowns, found.frequencies_hz

    def shapes(self, theta: FloatArray, modes: int, x_m: FloatArray) -> FloatArray:
        # Slow to import, and seldom needed.
        from scipy.interpolate import CubicSpline

        basis = transverse_basis(self.description(), modes, silent)
        along = CubicSpline(basis.axis_m, basis.deflections)
        deck_m, arch_m = self._ends_m()
        inside = (x_m >= deck_m) & (x_m <= arch_m)
        found = np.empty((len(theta), 2, modes, len(x_m)))
        for index, depth_m in enumerate((x_m - deck_m, arch_m - x_m)):
            table = along(depth_m) * inside[:, None]
            vectors = basis.projected.modes(self._points(theta, PLANES[index]), modes)
            found[:, index] = np.swapaxes(table @ vectors, 1, 2)
        return found

    def springs_n_m_rad(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        plate = self.hanger.plate
        if plate is None or not self.support.axial_springs:
            return super().springs_n_m_rad(theta)
        values = {name: 10 ** theta[:, self.parameter_names.index(name)] for name in AXIAL}
        deck = face_springs_n_m_rad(plate, values["log10_k1"], values["log10_k2"])
        arch = face_springs_n_m_rad(plate, values["log10_k4"], values["log10_k3"])
        # The deck-end plate is thin across the bridge, the arch-end plate along it.
        return np.stack(deck, axis=1), np.stack(arch[::-1], axis=1)

    def description(self) -> Description:
        """Return what the basis depends on."""
        lower, upper = self.prior.lower.copy(), self.prior.upper.copy()
        lower[0] *= self.hanger.nominal_tension_n
        upper[0] *= self.hanger.nominal_tension_n
        columns = [0, *(self.parameter_names.index(n) for n in self._slots("transverse"))]
        geometry = Geometry(
            length_m=float(np.diff(self._ends_m())[0]),
            diameter_m=self.hanger.diameter_m,
            plate=self.hanger.plate if self.with_plates else None,
            fineness=Fineness(),
        )
        material = Material(
            self.hanger.elastic_modulus_pa,
            self.hanger.poissons_ratio,
            self.hanger.mass_per_length_kg_m / self.hanger.area_m2,
            self.is_unstressed,
        )
        return Description(
            geometry, material, self.support, tuple(lower[columns]), tuple(upper[columns])
        )

    def _ends_m(self) -> tuple[float, float]:
        """Return where the model begins and ends along the hanger."""
        return 0.0, self.hanger.length_m

    def _points(self, theta: FloatArray, plane: Plane) -> FloatArray:
        """Tension in N and log10 k as the transverse system takes them, (n, 1 + springs)."""
        columns = [self.parameter_names.index(name) for name in self._slots(plane)]
        tension = theta[:, :1] * self.hanger.nominal_tension_n
        return np.hstack([tension, theta[:, columns]])

    def _slots(self, plane: Plane) -> list[str]:
        """Return the parameters that stand for the springs of the transverse system."""
        slots = self.support.springs("transverse")
        return list(slots) if plane == "transverse" else [_MIRRORED[name] for name in slots]


def _not_a_round_rod(hanger: Hanger) -> str:
    """Return why the hanger is not the uniform round rod that is meshed; empty where it is."""
    if math.isnan(hanger.diameter_m):
        return "it models a round rod: give diameter_m."
    disc = math.pi * hanger.diameter_m**2 / 4
    if abs(hanger.area_m2 / disc - 1) > hanger.assumptions.section_sd.value:
        return (
            f"it models a solid round rod, and area_m2 is not that of diameter_m ({disc:.4g} m2)."
        )
    if hanger.bending_stiffness_factor != 1:
        return "it models a solid rod, not a strand (bending_stiffness_factor is not 1)."
    return "it does not model turnbuckles." if hanger.turnbuckles else ""


class S1(SolidModel):
    """A plain rod of the whole length, clamped."""

    name = "s1"
    title = "Solid s1: plain rod of the whole length, fixed ends"
    bounds: Mapping[str, tuple[float, float]] = {"theta_F": (0.2, 2.0)}
    with_plates = False

    @classmethod
    def unfit(cls, hanger: Hanger) -> str:
        return _not_a_round_rod(hanger)


class S2(SolidModel):
    """A plain rod between the end plates, clamped."""

    name = "s2"
    title = "Solid s2: plain rod between the end plates, fixed ends"
    bounds: Mapping[str, tuple[float, float]] = {"theta_F": (0.2, 2.0)}
    with_plates = False

    def refuse(self, test: ModalTest) -> None:
        """Raise BadInput for a known mass: its place counts along the whole hanger."""
        if test.added_mass is not None:
            raise BadInput(
                f"test {test.id} has a known mass clamped on, which model class s2 does not have.",
                remedy="Leave this test out for this model class.",
            )

    def _ends_m(self) -> tuple[float, float]:
        plate_m = self.hanger.plate.length_m if self.hanger.plate else 0.0
        return plate_m, self.hanger.length_m - plate_m


class Solid0(SolidModel):
    """The hanger with its end plates, end faces fixed."""

    name = "solid0"
    title = "Solid 0: with end plates, faces fixed"
    bounds: Mapping[str, tuple[float, float]] = {"theta_F": (0.2, 2.0)}


class Solid1(SolidModel):
    """The end faces on springs along the hanger's axis and in the faces' planes."""

    name = "solid1"
    title = "Solid 1: with end plates, springs in x, y and z"
    bounds: Mapping[str, tuple[float, float]] = {
        "theta_F": (0.5, 5.0),
        **dict.fromkeys(
            (*AXIAL, "log10_klx", "log10_kly", "log10_krx", "log10_kry"),
            _SPRING_BOUNDS,
        ),
    }
    units: Mapping[str, str] = {
        **RATIOS,
        **dict.fromkeys((*AXIAL, "log10_klx", "log10_kly", "log10_krx", "log10_kry"), "N/m"),
    }
    support = ALL_SPRINGS


class Solid2(SolidModel):
    """The end faces on springs along the hanger's axis, held in the faces' planes."""

    name = "solid2"
    title = "Solid 2: with end plates, springs in z"
    bounds: Mapping[str, tuple[float, float]] = {
        "theta_F": (0.5, 5.0),
        **dict.fromkeys(AXIAL, _SPRING_BOUNDS),
    }
    units: Mapping[str, str] = {**RATIOS, **dict.fromkeys(AXIAL, "N/m")}
    support = AXIAL_SPRINGS
