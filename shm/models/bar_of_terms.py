"""Frequencies of a described bar with its ends, fittings, turnbuckles and own weight.

Bending, tension and its gradient, end springs, fittings and turnbuckles as zones with a stiffness
and a mass of their own, shear, and the sag of its own weight. All is relative to the described bar:
lengths to its length, stiffness to its EI, mass to its m.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from shm.models.reduced_bar import STIFFEST, BarTerms, Modes, ReducedBar
from shm.values import FloatArray, Hanger

GRAVITY_M_S2 = 9.81

_SNAPSHOTS = 60
_STIFF_SNAPSHOTS = (-2.0, 4.0)
"""log10 of k L/EI of the springs that the basis is made for."""


@dataclass(frozen=True, eq=False)
class BarValues:
    """Values of `n` bars, each (n,) over that of the described bar unless stated.

    `tension_n` is in N; `springs` (n, 2 ends, 2 planes) are k L/EI; `fitting_stiffness` (n, 2
    planes); `lean` is the angle from the vertical in rad; `sag_shape` 0 of a bar whose sag its
    bending holds up, and 1 of one that hangs like a cable; `axial` the stiffness against sag over
    EA/L; `section` the area over the squared length, which changes shear and rotary inertia, and
    `shear` the flexibility in shear over the theory's.
    """

    tension_n: FloatArray
    springs: FloatArray
    fitting_stiffness: FloatArray
    fitting_mass: FloatArray
    turnbuckle_stiffness: FloatArray
    turnbuckle_mass: FloatArray
    lean: FloatArray
    sag_shape: FloatArray
    axial: FloatArray
    section: FloatArray
    shear: FloatArray


class BarOfTerms:
    """The frequencies of bars like `hanger`, with or without shear, for `modes` modes a plane.

    `fittings_m` are the lengths of the deck's and the arch's fitting, `radii_m` the radii of
    gyration of known masses at `masses_at_m`. `zones` are where fittings and turnbuckles begin and
    end, from 0 to 1.
    """

    def __init__(
        self,
        hanger: Hanger,
        fittings_m: tuple[float, float],
        shears: bool,
        modes: int,
        masses_at_m: Sequence[float] = (),
        radii_m: Sequence[float] = (),
    ):
        self.hanger, self.shears, self.modes = hanger, shears, modes
        length = hanger.length_m
        self._fittings = sum(1 for each in fittings_m if each > 0)
        self.zones = [(0.0, fittings_m[0] / length)] if fittings_m[0] > 0 else []
        self.zones += [(1 - fittings_m[1] / length, 1.0)] if fittings_m[1] > 0 else []
        for each in hanger.turnbuckles:
            middle, half = each.x_m / length, each.length_m / length / 2
            self.zones.append((middle - half, middle + half))
        self._unit_hz = math.sqrt(hanger.bending_stiffness_n_m2 / hanger.mass_per_length_kg_m)
        self._unit_hz /= 2 * math.pi * length**2
        self._places = [each / length for each in masses_at_m]
        self._radii = [each / length for each in radii_m]

    @cached_property
    def _bar(self) -> ReducedBar:
        usual = self._snapshots(len(self._places))
        return ReducedBar(self.zones, usual, self.modes, self._places, self._radii)

    @cached_property
    def rough(self) -> BarOfTerms:
        """Return the same with fewer functions: a fraction of the time, 1e-4 of a frequency off."""
        found = copy(self)
        found._bar = self._bar.rough
        return found

    def frequencies_hz(self, values: BarValues, masses_kg: FloatArray | None = None) -> FloatArray:
        """Return frequencies (n, 2, modes), with known masses (n, places) on the bar."""
        return self._unit_hz * self._bar.frequencies(self.terms(values, masses_kg))

    def modes_at(self, values: BarValues, x_m: FloatArray) -> Modes:
        """Return the modes, their frequencies in Hz, with deflections at `x_m`."""
        return self._in_hz(self._bar.modes_at(self.terms(values), x_m / self.hanger.length_m))

    def modes_about(
        self, values: BarValues, near: Sequence[BarValues], x_m: FloatArray
    ) -> tuple[Modes, list[Modes]]:
        """Return the same, and to first order the modes of near bars."""
        terms, others = self.terms(values), [self.terms(each) for each in near]
        found, moved = self._bar.modes_about(terms, others, x_m / self.hanger.length_m)
        return self._in_hz(found), [self._in_hz(each) for each in moved]

    def _in_hz(self, modes: Modes) -> Modes:
        return replace(modes, frequency=self._unit_hz * modes.frequency)

    def terms(self, values: BarValues, masses_kg: FloatArray | None = None) -> BarTerms:
        """Return the factors of the matrices, in units of each bar's own length and stiffness."""
        hanger = self.hanger
        stiffness_n_m2, length_m = hanger.bending_stiffness_n_m2, hanger.length_m
        mass_kg = hanger.mass_per_length_kg_m * length_m
        one = np.ones(len(values.tension_n))
        tension = values.tension_n * length_m**2 / stiffness_n_m2
        weight = mass_kg * GRAVITY_M_S2 * length_m**2 / stiffness_n_m2
        fittings = values.fitting_stiffness[:, None, :].repeat(self._fittings, axis=1)
        ratios = [each.bending_stiffness_n_m2 / stiffness_n_m2 for each in hanger.turnbuckles]
        couplers = values.turnbuckle_stiffness[:, None] * np.array(ratios)
        heavier = [each.mass_kg / hanger.mass_per_length_kg_m / each.length_m
                   for each in hanger.turnbuckles]  # fmt: skip
        masses = [values.fitting_mass[:, None].repeat(self._fittings, axis=1)]
        masses.append(values.turnbuckle_mass[:, None] * np.array(heavier))
        shear = np.full(len(one), np.nan)
        if self.shears:
            flexible = (values.section * values.shear).clip(min=_LEAST_FLEXIBLE)
            shear = hanger.shear_stiffness_n * length_m**2 / stiffness_n_m2 / flexible
        return BarTerms(
            tension=tension,
            # The lower end of a hanger is pulled, or not at all: it does not push its support.
            gradient=np.minimum(weight * np.cos(values.lean), 2 * tension),
            springs=values.springs.clip(max=STIFFEST),
            stiffness=np.concatenate([fittings, couplers[..., None].repeat(2, axis=2)], axis=1),
            mass=np.hstack(masses),
            sag=self._sag(tension, weight * np.sin(values.lean), values),
            shear=shear,
            turning=hanger.second_moment_m4 / hanger.area_m2 / length_m**2 * values.section,
            point_masses=np.empty((len(one), 0)) if masses_kg is None else masses_kg / mass_kg,
        )

    def _sag(self, tension: FloatArray, across: FloatArray, values: BarValues) -> FloatArray:
        """Return the stiffness of sag, EA L4/EI (y'')^2, of the bar's static curvature y''.

        The load q across is carried by the tension, and by bending as if the bar had the mean
        curvature all along: y'' = q/(T + c EI/L2), c = 9.87 between hinges and 39.5 between clamps
        (the buckling loads). One that was made crooked hangs more like a cable, y'' = q/T.
        """
        hanger = self.hanger
        springs = values.springs[:, :, 1].clip(max=STIFFEST)
        held = (springs / (springs + _HALF_HELD)).mean(axis=1)
        buckling = np.pi**2 * (1 + 3 * held)
        held_up = (tension / (tension + buckling)) ** (1 - values.sag_shape)
        curvature = across / tension * held_up
        slender = hanger.elastic_modulus_pa * hanger.area_m2 * hanger.length_m**2
        slender /= hanger.bending_stiffness_n_m2
        return np.asarray(slender * values.axial * curvature**2)

    def _snapshots(self, places: int) -> BarTerms:
        """Return bars spread over all that is assumed of them."""
        hanger, rng = self.hanger, np.random.default_rng(0)
        low, high = np.log(hanger.assumptions.tension_ratio.bounds)
        n = _SNAPSHOTS
        # Every other one near the nominal tension, the others anywhere.
        log_ratio = np.where(np.arange(n) % 2, rng.uniform(low, high, n), rng.normal(0, 0.4, n))
        # Plates leave the length open, a strand's wires the shear, down to next to none.
        plate_m = 0.0 if hanger.plate is None else hanger.plate.length_m
        most_flexible = hanger.assumptions.strand_shear_share.bounds[1]
        flexible = (_LEAST_FLEXIBLE, most_flexible) if hanger.kind == "strand" else (1.0, 1.0)
        values = BarValues(
            tension_n=np.exp(log_ratio) * hanger.nominal_tension_n,
            springs=10 ** rng.uniform(*_STIFF_SNAPSHOTS, (n, 2, 2)),
            fitting_stiffness=np.exp(rng.normal(1.3, 1.0, (n, 2))),
            fitting_mass=np.exp(rng.normal(0.8, 0.5, n)),
            turnbuckle_stiffness=np.exp(rng.normal(0, 0.4, n)),
            turnbuckle_mass=np.exp(rng.normal(0, 0.3, n)),
            lean=rng.uniform(0, 0.5, n),
            sag_shape=rng.random(n),
            axial=np.ones(n),
            section=np.ones(n),
            shear=np.ones(n),
        )
        mass_kg = hanger.mass_per_length_kg_m * hanger.length_m
        masses_kg = mass_kg * rng.uniform(0, 0.2, (n, places))
        shorter = rng.uniform(1 - 2 * plate_m / hanger.length_m, 1.0, n)
        values = replace(
            values,
            shear=np.exp(rng.uniform(math.log(flexible[0]), math.log(flexible[1]), n)),
            section=np.exp(hanger.scatter.section * rng.standard_normal(n)) / shorter**2,
        )
        return self.terms(values, masses_kg)


@lru_cache(maxsize=32)
def bar_of_terms(
    hanger: Hanger,
    fittings_m: tuple[float, float],
    shears: bool,
    modes: int,
    masses_at_m: tuple[float, ...] = (),
    radii_m: tuple[float, ...] = (),
) -> BarOfTerms:
    """Return the bar of a hanger; its reduced basis is made once."""
    return BarOfTerms(hanger, fittings_m, shears, modes, masses_at_m, radii_m)


_LEAST_FLEXIBLE = 0.03  # of the theory's: less flexibility moves a strand's frequencies by 2e-5
_HALF_HELD = 6.0  # k L/EI of an end half way from a hinge's buckling load to a clamp's
