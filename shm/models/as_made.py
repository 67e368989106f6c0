"""A model class of the bar as it was made: the description is where it starts, not what it is.

Area, density, modulus and length deviate from the description, a strand's wires slip. Such a bar is
a described one of other tension and springs whose frequencies are all multiplied alike: with e, mu
and l the ratios of bending stiffness, mass per length and length to the described ones,

    f(T, k) = c f_described(T l^2/e, k l/e),    c = sqrt(e/mu) / l^2,

exactly for a uniform bar on rotational springs. (Fittings, turnbuckles and known masses, which turn
as if they were as much longer, keep their part of the length; plates are as much thicker as the rod
is.) So
frequencies alone see the *apparent tension* a = T/(mu l^2) and c, and nothing tells whether mass
and length or the tension made a. That part of the uncertainty, some 1 to 2 %, no number of modes
takes away; a measured tension does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from shm.assumptions import Assumption, Assumptions
from shm.models.bar_of_terms import BarOfTerms, BarValues, bar_of_terms
from shm.models.base import DESCRIPTION, Conditions, Model, radius_m, silent
from shm.models.beam import Beam, Beam1, Beam3
from shm.models.hanger import PhysicalHanger, Zone
from shm.models.reduced_bar import Modes
from shm.models.solid import S2
from shm.values import PLANES, FloatArray, Hanger, ModalTest

TENSION, LENGTH = "theta_F", "theta_L"
SECTION, DENSITY, MODULUS = "section", "density", "modulus"
BENDING, SHEAR = "bending_factor", "shear_share"
FITTING_STIFFNESS = ("fitting_stiffness_transverse", "fitting_stiffness_longitudinal")
FITTING_MASS = "fitting_mass"
TURNBUCKLE_STIFFNESS, TURNBUCKLE_MASS = "turnbuckle_stiffness", "turnbuckle_mass"
INCLINATION, SAG_SHAPE, SAG_STIFFNESS = "inclination", "sag_shape", "sag_stiffness"
FLATTEST_DEG = 10.0

_MOST_SD = 6.0  # a normal distribution has 2e-9 beyond


class AsMade(Model):
    """The class `model` with the deviations of the bar as made among its parameters.

    They stand behind its own: `theta_F` (true over nominal tension), `theta_L` (true over described
    length; where end plates leave the effective length open, effective over described), springs in
    N m/rad, then `section`, `density` and `modulus` (logarithms of true over described area,
    density and elastic modulus) and of a strand its `bending_factor` and, in beam3, its
    `shear_share`. A beam has stiffness and mass of its fittings and turnbuckles, if any (over the
    bar's, a turnbuckle's over the described ones), its `inclination` in degrees from the
    horizontal, `sag_shape` (0 held up by bending, 1 like a cable) and, where the inclination is
    stated, `sag_stiffness`, that against sag over EA/L. Without terms it has none of these.
    """

    priors = DESCRIPTION
    effect_names: tuple[str, ...] = ()
    """Parameters of effects of the catalogue, which stand last and have uniform priors."""
    is_rough = False

    def __init__(self, model: Model, with_terms: bool = True):
        super().__init__(model.hanger)
        if TENSION in model.bounds and not isinstance(model, Beam):
            # A reduced basis is made for the tensions that its class considers.
            model = copy(model)
            model.bounds = {**model.bounds, TENSION: model.hanger.assumptions.tension_ratio.bounds}
        self.model = model
        self.name, self.title, self.units = model.name, model.title, model.units
        hanger = self.hanger
        deck_m, arch_m = self.fittings_m = super().stiff_ends_m
        self.swaps = model.swaps if deck_m == arch_m else ()
        self.has_terms = with_terms and isinstance(model, Beam) and hanger.as_hanger
        springs = [name for name in model.parameter_names if name not in (TENSION, LENGTH)]
        self.springs = tuple(springs)
        self.length_is_open = hanger.plate is not None and isinstance(model, Beam)
        assumed = hanger.assumptions
        bounds = {TENSION: assumed.tension_ratio.bounds, LENGTH: self._length_range()}
        bounds |= {name: self.spring_range(name) for name in springs}
        scatter = hanger.scatter
        deviations = {SECTION: scatter.section, DENSITY: scatter.density, MODULUS: scatter.modulus}
        bounds |= {name: (-_MOST_SD * sd, _MOST_SD * sd) for name, sd in deviations.items()}
        if self.is_strand:
            bounds[BENDING] = assumed.strand_bending_factor.bounds
            if isinstance(model, Beam3):
                bounds[SHEAR] = assumed.strand_shear_share.bounds
        self.terms = {term.name: term for term in terms_of(hanger, self.fittings_m)}
        self.terms = self.terms if self.has_terms else {}
        bounds |= {name: term.bounds for name, term in self.terms.items()}
        self.units = {**model.units, **{name: term.unit for name, term in self.terms.items()}}
        self.bounds = bounds

    @property
    def stiff_ends_m(self) -> tuple[float, float]:
        """Lengths of fittings that the class has no term for."""
        return (0.0, 0.0) if self.has_terms else self.fittings_m

    def usual(self, name: str) -> float:
        return float(self.terms[name].value(np.zeros(1))[0])

    @property
    def has_slopes(self) -> bool:
        """Return True where `modes_at` and `modes_near` apply."""
        return self.has_terms

    @property
    def expensive(self) -> bool:  # type: ignore[override]
        return self.model.expensive

    @property
    def is_strand(self) -> bool:
        """Return True where its share of the solid section's stiffness is a parameter."""
        return self.hanger.kind == "strand"

    def spring_range(self, name: str) -> tuple[float, float]:
        """Return log10 of the least and the largest stiffness of an end spring."""
        if not isinstance(self.model, Beam):
            return self.model.bounds[name]  # per node of the face: data of hanger 3's plates
        hanger = self.hanger
        pinned, clamped = hanger.assumptions.end_restraint.bounds
        unit = hanger.bending_stiffness_n_m2 / hanger.length_m
        # A taut bar resists an end's rotation with sqrt(EI T), not with EI/L.
        taut = math.sqrt(hanger.bending_stiffness_n_m2 * hanger.nominal_tension_n)
        return math.log10(pinned * unit), math.log10(clamped * (unit + taut))

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
        """Return the described bar's parameters (n, own), and c (n,), of those of the real one."""
        stiffness, _, length = self.stiffness_mass_length(theta)
        springs = [self._column(theta, n) + np.log10(length / stiffness) for n in self.springs]
        columns = {TENSION: self._column(theta, TENSION) * length**2 / stiffness}
        columns |= {LENGTH: np.ones(len(theta)), **dict(zip(self.springs, springs, strict=True))}
        names = self.model.parameter_names
        return np.column_stack([columns[name] for name in names]), self._factor(theta)

    def _factor(self, theta: FloatArray) -> FloatArray:
        """Return c (n,), the frequencies' ratio to the described bar's."""
        stiffness, mass, length = self.stiffness_mass_length(theta)
        return np.asarray(np.sqrt(stiffness / mass) / length**2)

    def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        return self.frequencies_at(theta, modes, Conditions())

    def frequencies_at(self, theta: FloatArray, modes: int, conditions: Conditions) -> FloatArray:
        mass = conditions.added_mass
        if mass is not None:
            # What a mass weighs counts against the real bar's, which is longer, too.
            _, per_length, length = self.stiffness_mass_length(theta)
            kg: Any = mass.mass_kg / (per_length * length)
            conditions = replace(conditions, added_mass=replace(mass, mass_kg=kg))
        if not self.has_terms:
            described, factor = self.as_described(theta)
            return self.model.frequencies_at(described, modes, conditions) * factor[:, None, None]
        places = () if mass is None else (mass.x_m,)
        radii = () if mass is None else (radius_m(self.hanger, mass),)
        bar = self._bar(modes, places, radii)
        kilograms = None if mass is None else np.asarray(kg)[:, None]
        found = bar.frequencies_hz(self._values(theta), kilograms)
        return found * self._factor(theta)[:, None, None]

    def modes_at(self, theta: FloatArray, modes: int, x_m: FloatArray) -> Modes:
        """Return the modes of parameter sets (n, parameters), their frequencies in Hz.

        Only for a class with terms, as `modes_near`.
        """
        bar = self._bar(modes)
        found = bar.modes_at(self._values(theta), self._places_of_described(theta, x_m))
        return self._of_real(theta, found)

    def modes_near(
        self, theta: FloatArray, others: Sequence[FloatArray], modes: int, x_m: FloatArray
    ) -> tuple[Modes, list[Modes]]:
        """Return the same and, to first order, the modes of near parameter sets (n, parameters)."""
        bar = self._bar(modes)
        found, near = bar.modes_about(
            self._values(theta),
            [self._values(each) for each in others],
            self._places_of_described(theta, x_m),
        )
        moved = [self._of_real(*each) for each in zip(others, near, strict=True)]
        return self._of_real(theta, found), moved

    @property
    def rough(self) -> AsMade:
        """Return the same class for a search: a fraction of the time, 1e-4 of a frequency off.

        A class without terms is its own.
        """
        if not self.has_terms:
            return self
        found = copy(self)
        found.is_rough = True
        return found

    def _bar(
        self, modes: int, places_m: tuple[float, ...] = (), radii_m: tuple[float, ...] = ()
    ) -> BarOfTerms:
        hanger = self.hanger
        bar = bar_of_terms(hanger, self.fittings_m, self._shears, modes, places_m, radii_m)
        return bar.rough if self.is_rough else bar

    def _of_real(self, theta: FloatArray, described: Modes) -> Modes:
        """Return the modes of the real bars from those of the described ones."""
        factor = self._factor(theta)[:, None, None]
        return replace(described, frequency=described.frequency * factor)

    def physical(self, theta: FloatArray, sensors: int = 0) -> PhysicalHanger:
        """Return the real bars (n) of `theta`, as the general model takes them.

        Fittings and turnbuckles keep their part of the length, and their stiffness and mass over
        the bar's. Where end plates leave the length open, the bar is in the middle of the described
        one; else it begins at the deck end. A solid is a bar on equivalent end springs.
        """
        hanger = self.hanger
        stiffness, mass, length = self.stiffness_mass_length(theta)
        tension_n = self._column(theta, TENSION) * hanger.nominal_tension_n
        held = isinstance(self.model, Beam1) and not self.has_terms
        build = PhysicalHanger.held if held else PhysicalHanger.clamped
        bar = build(hanger, tension_n, sensors)
        deck_m, arch_m = self._ends_m
        over_m = (1 - length) * hanger.length_m / 2 if self.length_is_open else 0.0
        deck_end_m = deck_m + over_m + np.zeros(len(theta))
        bar = replace(
            bar,
            deck_end_m=deck_end_m,
            arch_end_m=deck_end_m + (arch_m - deck_m) * length,
            bending_stiffness_n_m2=bar.bending_stiffness_n_m2 * stiffness[:, None],
            mass_per_length_kg_m=bar.mass_per_length_kg_m * mass,
        )
        bar = replace(bar, zones=tuple(self._stretched(zone, bar) for zone in bar.zones))
        if not held:
            bar = bar.on_springs(self.springs_n_m_rad(theta))
        if self._shears:
            section = np.exp(self._column(theta, SECTION))
            has_shear = SHEAR in self.bounds and self.has_terms
            flexible = self._column(theta, SHEAR) if has_shear else np.ones(len(theta))
            turning = hanger.second_moment_m4 / hanger.area_m2 * section
            bar = replace(
                bar,
                shear_compliance_1_n=flexible * section / stiffness / hanger.shear_stiffness_n,
                rotary_inertia_kg_m=turning * bar.mass_per_length_kg_m,
            )
        return self._with_terms(bar, theta) if self.has_terms else bar

    def _with_terms(self, bar: PhysicalHanger, theta: FloatArray) -> PhysicalHanger:
        """Return bars with fittings, turnbuckles, the tension's gradient and sag."""
        of = bar_of_terms(self.hanger, self.fittings_m, self._shears, modes=1)
        terms = of.terms(self._values(theta))
        length_m = bar.length_m
        zones = tuple(
            Zone(
                bar.deck_end_m + start * length_m,
                bar.deck_end_m + end * length_m,
                terms.stiffness[:, index],
                terms.mass[:, index],
            )
            for index, (start, end) in enumerate(of.zones)
        )
        return replace(
            bar,
            zones=zones,
            tension_gradient_n=terms.gradient * bar.bending_stiffness_n_m2[:, 0] / length_m**2,
            sag_parameter=np.stack([0 * terms.sag, terms.sag / terms.tension], axis=1),
        )

    def _stretched(self, zone: Zone, bar: PhysicalHanger) -> Zone:
        """Return a zone of the described bar where it is on `bar`."""
        deck_m, arch_m = self._ends_m
        ratio = bar.length_m / (arch_m - deck_m)
        start_m, end_m = (
            bar.deck_end_m + (each - deck_m) * ratio for each in (zone.start_m, zone.end_m)
        )
        return replace(zone, start_m=start_m, end_m=end_m)

    @property
    def _ends_m(self) -> tuple[float, float]:
        """Return where the class's bar begins and ends: s2 has the rod between plates alone."""
        plate = self.hanger.plate
        plate_m = plate.length_m if isinstance(self.model, S2) and plate is not None else 0.0
        return plate_m, self.hanger.length_m - plate_m

    @property
    def _shears(self) -> bool:
        return isinstance(self.model, Beam3)

    def _values(self, theta: FloatArray) -> BarValues:
        """Return what the described bar with these frequencies is, but for the factor."""
        stiffness, _, length = self.stiffness_mass_length(theta)
        one = np.ones(len(theta))
        terms = {name: self._column(theta, name) for name in self.terms}
        fittings = [terms.get(name, one) for name in FITTING_STIFFNESS]
        tension = self._column(theta, TENSION) * length**2 / stiffness
        unit = self.hanger.bending_stiffness_n_m2 / self.hanger.length_m
        springs = np.stack(self.springs_n_m_rad(theta), axis=1)
        return BarValues(
            tension_n=tension * self.hanger.nominal_tension_n,
            springs=springs * (length / stiffness)[:, None, None] / unit,
            fitting_stiffness=np.stack(fittings, axis=1),
            fitting_mass=terms.get(FITTING_MASS, one),
            turnbuckle_stiffness=terms.get(TURNBUCKLE_STIFFNESS, one),
            turnbuckle_mass=terms.get(TURNBUCKLE_MASS, one),
            lean=np.radians(90 - terms[INCLINATION]),
            sag_shape=terms[SAG_SHAPE],
            axial=terms.get(SAG_STIFFNESS, one),
            section=np.exp(self._column(theta, SECTION)) / length**2,
            shear=self._column(theta, SHEAR) if SHEAR in self.bounds else one,
        )

    def conditions(self, test: ModalTest) -> Conditions:
        return self.model.conditions(test)

    def refuse(self, test: ModalTest) -> None:
        """Raise BadInput as the class itself does."""
        self.model.refuse(test)

    def prepare(self, modes: int, progress: Callable[[float], None] = silent) -> None:
        self.model.prepare(modes, progress)

    def shapes(self, theta: FloatArray, modes: int, x_m: FloatArray) -> FloatArray:
        if self.has_terms:
            return self.modes_at(theta, modes, x_m).deflection
        described_m = self._places_of_described(theta, x_m)
        return self.model.shapes(self.as_described(theta)[0], modes, described_m)

    def _places_of_described(self, theta: FloatArray, x_m: FloatArray) -> FloatArray:
        """Return places (points,) of the described bar that the real ones have at `x_m`.

        By the mean length of all parameter sets: lengths differ by less than a place is known to.
        """
        return np.asarray(x_m / self.stiffness_mass_length(theta)[2].mean())

    @property
    def has_shapes(self) -> bool:
        return self.model.has_shapes

    def springs_n_m_rad(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        names = [self.parameter_names.index(n) for n in self.model.parameter_names if n != LENGTH]
        values = theta[:, names]
        if LENGTH in self.model.parameter_names:
            at = self.model.parameter_names.index(LENGTH)
            values = np.insert(values, at, self._column(theta, LENGTH), axis=1)
        return self.model.springs_n_m_rad(values)

    def _column(self, theta: FloatArray, name: str) -> FloatArray:
        return np.asarray(theta[:, self.parameter_names.index(name)])


@dataclass(frozen=True)
class Term:
    """One uncertain quantity of the bar: `value` of its normal scores (n,), and their inverse.

    `plane` is where it is felt, "" in both.
    """

    name: str
    unit: str
    value: Callable[[FloatArray], FloatArray]
    score: Callable[[FloatArray], FloatArray]
    plane: str = ""

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the least and the largest value."""
        low, high = self.value(np.array([-_MOST_SD, _MOST_SD]))
        return float(min(low, high)), float(max(low, high))


def terms_of(hanger: Hanger, fittings_m: tuple[float, float]) -> list[Term]:
    """Return the terms of a described hanger with fittings of these lengths."""
    assumed, found = hanger.assumptions, []
    if any(fittings_m):
        stiffness, mass = fittings_of(hanger.end_kind, assumed)
        for name, plane in zip(FITTING_STIFFNESS, PLANES, strict=True):
            found.append(_log_normal(name, stiffness.value, stiffness.sd, plane))
        found.append(_log_normal(FITTING_MASS, mass.value, mass.sd))
    if hanger.turnbuckles:
        stiff, heavy = assumed.turnbuckle_stiffness_log_sd, assumed.turnbuckle_mass_log_sd
        found.append(_log_normal(TURNBUCKLE_STIFFNESS, 0.0, stiff.value))
        found.append(_log_normal(TURNBUCKLE_MASS, 0.0, heavy.value))
    found += [_inclination(hanger), Term(SAG_SHAPE, "1", scipy.special.ndtr, quantile, PLANES[1])]
    if math.isfinite(hanger.inclination_deg):  # else what leans is open by as much
        sag = assumed.sag_stiffness_log
        found.append(_log_normal(SAG_STIFFNESS, sag.value, sag.sd, PLANES[1]))
    return found


def quantile(share: FloatArray) -> FloatArray:
    """Return normal scores (n,) of a uniform quantity."""
    return np.asarray(scipy.special.ndtri(share.clip(_LEAST_SHARE, 1 - _LEAST_SHARE)))


def _log_normal(name: str, mean: float, sd: float, plane: str = "") -> Term:
    return Term(
        name,
        "1",
        lambda score: np.exp(mean + sd * score.clip(-_MOST_SD, _MOST_SD)),
        lambda value: (np.log(value) - mean) / sd,
        plane,
    )


def _inclination(hanger: Hanger) -> Term:
    """Return the inclination: a stated one, or that of a hanger that leans a little at most."""
    lean_deg, most = 90 - hanger.inclination_deg, 90 - FLATTEST_DEG
    sd = hanger.assumptions.inclination_sd_deg.value
    if lean_deg > _LEANS * sd:
        return Term(
            INCLINATION,
            "deg",
            lambda score: 90 - (lean_deg + sd * score).clip(0, most),
            lambda value: (90 - value - lean_deg) / sd,
            PLANES[1],
        )
    if math.isfinite(lean_deg):
        usual = math.hypot(sd, lean_deg)
        sign = 2.0
    else:
        usual, sign = hanger.assumptions.usual_lean_deg.value, 1.0
    # Exponential with the usual lean as median; of half that where it is stated vertical.
    scale = usual / sign / math.log(2)
    return Term(
        INCLINATION,
        "deg",
        lambda score: 90 - (-scale * scipy.special.log_ndtr(-score)).clip(0, most),
        lambda value: -scipy.special.ndtri_exp(-((90 - value).clip(_UPRIGHT, most)) / scale),
        PLANES[1],
    )


_LEANS = 3.0  # standard deviations, from which a stated lean is known to be one
_UPRIGHT, _LEAST_SHARE = 1e-6, 1e-9


def fittings_of(kind: str, assumed: Assumptions) -> tuple[Assumption, Assumption]:
    """Return ln of the stiffness and of the mass of fittings of one kind of end."""
    return {
        "socket": (assumed.socket_stiffness_log, assumed.socket_mass_log),
        "welded": (assumed.welded_stiffness_log, assumed.welded_mass_log),
        "plate": (assumed.plate_stiffness_log, assumed.plate_mass_log),
        "threaded": (assumed.threaded_stiffness_log, assumed.threaded_mass_log),
        "fork": (assumed.fork_stiffness_log, assumed.fork_mass_log),
        "unstated": (assumed.unstated_stiffness_log, assumed.unstated_mass_log),
    }[kind]
