"""A model class of the bar as it was made: the description is where it starts, not what it is.

Area, density, modulus and length deviate from the description, a strand's wires slip. Such a bar is
a described one of other tension and springs whose frequencies are all multiplied alike: with e, mu
and l the ratios of bending stiffness, mass per length and length to the described ones,

    f(T, k) = c f_described(T l^2/e, k l/e),    c = sqrt(e/mu) / l^2,

exactly for a uniform bar on rotational springs. (What stands at a place of its own, a turnbuckle or
a known mass, keeps its share of the length; plates are as much thicker as the rod is.) So
frequencies alone see the *apparent tension* a = T/(mu l^2) and c, and nothing tells whether mass
and length or the tension made a. That part of the uncertainty, some 1 to 2 %, no number of modes
takes away; a measured tension does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from shm.models.base import DESCRIPTION, Conditions, Model, silent
from shm.models.beam import Beam, Beam3
from shm.values import AddedMass, FloatArray, ModalTest, Plane

TENSION, LENGTH = "theta_F", "theta_L"
SECTION, DENSITY, MODULUS = "section", "density", "modulus"
BENDING, SHEAR = "bending_factor", "shear_share"

_MOST_SD = 6.0  # a normal distribution has 2e-9 beyond


class AsMade(Model):
    """The class `model` with the deviations of the bar as made among its parameters.

    They stand behind its own: `theta_F` (true over nominal tension), `theta_L` (true over described
    length; where end plates leave the effective length open, effective over described), springs in
    N m/rad, then `section`, `density` and `modulus` (logarithms of true over described area,
    density and elastic modulus) and of a strand its `bending_factor` and, in beam3, its
    `shear_share`.
    """

    priors = DESCRIPTION

    def __init__(self, model: Model):
        super().__init__(model.hanger)
        if TENSION in model.bounds and not isinstance(model, Beam):
            # A reduced basis is made for the tensions that its class considers.
            model = copy(model)
            model.bounds = {**model.bounds, TENSION: model.hanger.assumptions.tension_ratio.bounds}
        self.model = model
        self.name, self.title, self.units = model.name, model.title, model.units
        hanger = self.hanger
        deck_m, arch_m = self.stiff_ends_m
        self.swaps = model.swaps if deck_m == arch_m else ()
        own = [name for name in model.parameter_names if name not in (TENSION, LENGTH)]
        self.springs = tuple(own)
        self.length_is_open = hanger.plate is not None and isinstance(model, Beam)
        assumed = hanger.assumptions
        bounds = {TENSION: assumed.tension_ratio.bounds, LENGTH: self._length_range()}
        bounds |= {name: self.spring_range(name) for name in own}
        scatter = hanger.scatter
        deviations = {SECTION: scatter.section, DENSITY: scatter.density, MODULUS: scatter.modulus}
        bounds |= {name: (-_MOST_SD * sd, _MOST_SD * sd) for name, sd in deviations.items()}
        if self.is_strand:
            bounds[BENDING] = assumed.strand_bending_factor.bounds
            if isinstance(model, Beam3):
                bounds[SHEAR] = assumed.strand_shear_share.bounds
        self.bounds = bounds

    @property
    def expensive(self) -> bool:  # type: ignore[override]
        return self.model.expensive

    @property
    def is_strand(self) -> bool:
        """Whether the share of the solid section's stiffness that it has is a parameter."""
        return self.hanger.kind == "strand"

    def spring_range(self, name: str) -> tuple[float, float]:
        """log10 of the least and the largest stiffness of an end spring."""
        if not isinstance(self.model, Beam):
            return self.model.bounds[name]  # per node of the face: data of hanger 3's plates
        unit = self.hanger.bending_stiffness_n_m2 / self.hanger.length_m
        pinned, clamped = self.hanger.assumptions.end_restraint.bounds
        return math.log10(pinned * unit), math.log10(clamped * unit)

    def _length_range(self) -> tuple[float, float]:
        plate = self.hanger.plate
        if plate is not None and self.length_is_open:
            # Plates hold the rod somewhere between their necks and their end faces.
            return 1 - 2 * plate.length_m / self.hanger.length_m, 1.0
        most = _MOST_SD * self.hanger.scatter.swinging_length
        return max(1 - most, 0.5), 1 + most

    def stiffness_mass_length(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        section, density, modulus = (self._column(theta, n) for n in (SECTION, DENSITY, MODULUS))
        slip = np.ones(len(theta))
        if self.is_strand:
            slip = self._column(theta, BENDING) / self.hanger.bending_stiffness_factor
        stiffness = np.exp(2 * section + modulus) * slip
        return stiffness, np.exp(section + density), self._column(theta, LENGTH)

    def as_described(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The described bar's parameters (n, own), and c (n,), of parameter sets of the real one.

        A length that is open stays a parameter of its own.
        """
        stiffness, mass, length = self.stiffness_mass_length(theta)
        factor = np.sqrt(stiffness / mass) / (1.0 if self.length_is_open else length**2)
        taped = np.ones(len(theta)) if self.length_is_open else length
        springs = [self._column(theta, n) + np.log10(taped / stiffness) for n in self.springs]
        columns = {TENSION: self._column(theta, TENSION) * taped**2 / stiffness}
        columns[LENGTH] = length / taped
        columns |= dict(zip(self.springs, springs, strict=True))
        names = self.model.parameter_names
        return np.column_stack([columns[name] for name in names]), np.asarray(factor)

    def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        return self.frequencies_at(theta, modes, Conditions())

    def frequencies_at(self, theta: FloatArray, modes: int, conditions: Conditions) -> FloatArray:
        own, factor = self.as_described(theta)
        mass = conditions.added_mass
        if mass is not None:
            # What a mass weighs counts against the real bar's, which is longer, too.
            _, per_length, length = self.stiffness_mass_length(theta)
            kg: Any = mass.mass_kg / (per_length * (1.0 if self.length_is_open else length))
            conditions = replace(conditions, added_mass=AddedMass(kg, mass.x_m))
        if isinstance(self.model, Beam3) and mass is None:
            section = np.exp(self._column(theta, SECTION))
            shear = self._column(theta, SHEAR) if self.is_strand else np.ones(len(theta))
            found = self.model.frequencies_of_section(own, section, shear, modes)
        else:
            found = self.model.frequencies_at(own, modes, conditions)
        return found * factor[:, None, None]

    def conditions(self, test: ModalTest) -> Conditions:
        return self.model.conditions(test)

    def refuse(self, test: ModalTest) -> None:
        """Raises BadInput as the class itself does."""
        self.model.refuse(test)

    def prepare(self, modes: int, progress: Callable[[float], None] = silent) -> None:
        self.model.prepare(modes, progress)

    def shape(self, theta: FloatArray, plane: Plane, order: int, x_m: FloatArray) -> FloatArray:
        return self.model.shape(self.as_described(theta[None])[0][0], plane, order, x_m)

    def springs_n_m_rad(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        names = [self.parameter_names.index(n) for n in self.model.parameter_names if n != LENGTH]
        own = theta[:, names]
        if LENGTH in self.model.parameter_names:
            at = self.model.parameter_names.index(LENGTH)
            own = np.insert(own, at, self._column(theta, LENGTH), axis=1)
        return self.model.springs_n_m_rad(own)

    def _column(self, theta: FloatArray, name: str) -> FloatArray:
        return np.asarray(theta[:, self.parameter_names.index(name)])
