"""One hanger made of terms: what its class says of the ends, what is uncertain of any bar, effects.

The description is where a bar starts, not what it is: area, density, modulus and length deviate
from it, a strand's wires slip. Without effects such a bar is a described one of other tension and
springs whose frequencies are all multiplied alike: with e, mu and l the ratios of bending
stiffness, mass per length and length to the described ones,

    f(T, k) = c f_described(T l^2/e, k l/e),    c = sqrt(e/mu) / l^2,

exactly for a uniform bar on rotational springs. (Fittings, turnbuckles and known masses, which turn
as if they were as much longer, keep their part of the length; plates are as much thicker as the rod
is.) So frequencies alone see the *apparent tension* a = T/(mu l^2) and c, and nothing tells whether
mass and length or the tension made a. That part of the uncertainty, some 1 to 2 %, no number of
modes takes away; a measured tension does.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import fields, replace
from functools import lru_cache
from typing import Any

import numpy as np

from shm.models.classes.base import DESCRIPTION, Conditions, Model, point_mass, silent
from shm.models.classes.beam import Beam, Beam1, Beam2, Beam3
from shm.models.classes.solid import S2
from shm.models.effects import EFFECTS, Case, Parameter, Variant, parameters_of
from shm.models.hanger import HangerModes, Modes, PhysicalHanger, PointMass, ReducedBar, Zone, solve
from shm.models.hanger.bar import stiffness_ratio
from shm.models.one_hanger.terms import (
    FITTING_MASS,
    FITTING_STIFFNESS,
    INCLINATION,
    MOST_SD,
    SAG_SHAPE,
    SAG_STIFFNESS,
    TURNBUCKLE_MASS,
    TURNBUCKLE_STIFFNESS,
    terms_of,
)
from shm.values import PLANES, AddedMass, FloatArray, Hanger, ModalTest

TENSION, LENGTH = "theta_F", "theta_L"
SECTION, DENSITY, MODULUS = "section", "density", "modulus"
BENDING, SHEAR = "bending_factor", "shear_share"
GRAVITY_M_S2 = 9.81

Effects = Sequence[tuple[str, Variant]]

_REST = Conditions()
_LEAST_FLEXIBLE = 0.03  # of the theory's: less flexibility moves a strand's frequencies by 2e-5
_HALF_HELD = 6.0  # k L/EI of an end half way from a hinge's buckling load to a clamp's
_SNAPSHOTS = 60
_STIFF_SNAPSHOTS = (-2.0, 4.0)
"""log10 of k L/EI of the springs that a reduced basis is made for."""


class HangerModel(Model):
    """The class `model` of one hanger with all that is uncertain of the bar, and with effects.

    Parameters stand in this order: `theta_F` (true over nominal tension), `theta_L` (true over
    described length; where end plates leave the effective length open, effective over described),
    the class's springs in N m/rad, then `section`, `density` and `modulus` (logarithms of true over
    described area, density and elastic modulus) and of a strand its `bending_factor` and, in beam3,
    its `shear_share`; of a beam its terms (`shm.models.one_hanger.terms`), unless it is
    `with_terms` false; at last those of the effects. Where two have one name, the effect's name
    stands before its own: `point_mass.x_m`. The effects act in their order.
    """

    priors = DESCRIPTION
    is_rough = False

    def __init__(self, model: Model, with_terms: bool = True):
        super().__init__(model.hanger)
        hanger, assumed, scatter = self.hanger, self.hanger.assumptions, self.hanger.scatter
        if TENSION in model.bounds and not isinstance(model, Beam):
            # A reduced basis is made for the tensions that its class considers.
            model = copy(model)
            model.bounds = {**model.bounds, TENSION: assumed.tension_ratio.bounds}
        self.model, self.name, self.title = model, model.name, model.title
        deck_m, arch_m = self.fittings_m = super().stiff_ends_m
        self.swaps = model.swaps if deck_m == arch_m else ()
        is_beam = isinstance(model, Beam)
        self.has_terms = with_terms and is_beam and hanger.as_hanger
        self.length_is_open = hanger.plate is not None and is_beam
        self.springs = tuple(n for n in model.parameter_names if n not in (TENSION, LENGTH))
        terms = terms_of(hanger, self.fittings_m) if self.has_terms else []
        self.terms = {term.name: term for term in terms}
        bounds = {TENSION: assumed.tension_ratio.bounds, LENGTH: self._length_range()}
        bounds |= {name: self._spring_range(name) for name in self.springs}
        deviations = {SECTION: scatter.section, DENSITY: scatter.density, MODULUS: scatter.modulus}
        bounds |= {name: (-MOST_SD * sd, MOST_SD * sd) for name, sd in deviations.items()}
        if self.is_strand:
            bounds[BENDING] = assumed.strand_bending_factor.bounds
            if self._shears:
                bounds[SHEAR] = assumed.strand_shear_share.bounds
        self.bounds = bounds | {name: term.bounds for name, term in self.terms.items()}
        self.units = {**model.units, **{term.name: term.unit for term in terms}}
        self._columns = {name: index for index, name in enumerate(self.bounds)}
        self._take((), ())

    # ------------------------------------------------ effects

    def with_effects(self, effects: Effects, places_m: Sequence[float] = ()) -> HangerModel:
        """Return the same hanger with effects (name, where), and sensors at `places_m`.

        Parameters of effects have their values, not their logarithms.
        """
        found = copy(self)
        found._take(effects, places_m)
        found.bounds = {name: self.bounds[name] for name in self._columns}
        found.bounds |= {each.name: (each.lower, each.upper) for each in found.effect_parameters}
        return found

    def _take(self, effects: Effects, places_m: Sequence[float]) -> None:
        self.effects = tuple(effects)
        self.places_m = np.asarray(places_m, dtype=float)
        of_effects = [(name, parameters_of(name, self.hanger, at)) for name, at in self.effects]
        self._counts = [len(parameters) for _, parameters in of_effects]
        pairs = [(name, each) for name, parameters in of_effects for each in parameters]
        self.effect_parameters = _name_apart(tuple(self._columns), pairs)
        self._last: tuple[bytes, int, FloatArray] | None = None

    @property
    def effect_names(self) -> tuple[str, ...]:
        """Return the parameters of effects, which stand last."""
        return self.parameter_names[len(self._columns) :]

    # ------------------------------------------------ parameters

    @property
    def stiff_ends_m(self) -> tuple[float, float]:
        """Lengths of fittings that the class has no term for."""
        return (0.0, 0.0) if self.has_terms else self.fittings_m

    def usual(self, name: str) -> float:
        return float(self.terms[name].value(np.zeros(1))[0])

    @property
    def has_slopes(self) -> bool:
        """Return True where `modes_at` and `modes_near` apply."""
        return self.has_terms and not self.effects

    @property
    def expensive(self) -> bool:  # type: ignore[override]
        return self.model.expensive or bool(self.effects)

    @property
    def is_strand(self) -> bool:
        """Return True where its share of the solid section's stiffness is a parameter."""
        return self.hanger.kind == "strand"

    @property
    def _shears(self) -> bool:
        return isinstance(self.model, Beam3)

    def _spring_range(self, name: str) -> tuple[float, float]:
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
        most = MOST_SD * self.hanger.scatter.swinging_length
        return max(1 - most, 0.5), 1 + most

    def _column(self, theta: FloatArray, name: str, usual: float = 1.0) -> FloatArray:
        """Return one parameter (n,) of parameter sets; `usual` of one that the hanger has not."""
        at = self._columns.get(name)
        return np.full(len(theta), usual) if at is None else np.asarray(theta[:, at])

    def _plain(self, theta: FloatArray) -> FloatArray:
        """Return parameter sets with the effects' values where theta has something else of them."""
        return theta

    def stiffness_mass_length(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        section, density, modulus = (self._column(theta, n) for n in (SECTION, DENSITY, MODULUS))
        stiffness = np.exp(2 * section + modulus)
        if self.is_strand:
            stiffness *= self._column(theta, BENDING) / self.hanger.bending_stiffness_factor
        return stiffness, np.exp(section + density), self._column(theta, LENGTH)

    def springs_n_m_rad(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the class's springs; with effects, what these leave of them."""
        if not self.effects:
            columns = [self._column(theta, name) for name in self.model.parameter_names]
            return self.model.springs_n_m_rad(np.column_stack(columns))
        compliance = np.einsum("nepp->nep", self.physical(theta).rotational_compliance_rad_n_m)
        with np.errstate(divide="ignore"):
            springs = 1 / compliance
        return springs[:, 0], springs[:, 1]

    # ------------------------------------------------ frequencies and shapes

    def conditions(self, test: ModalTest) -> Conditions:
        return self.model.conditions(test)

    def refuse(self, test: ModalTest) -> None:
        """Raise BadInput as the class itself does."""
        self.model.refuse(test)

    def prepare(self, modes: int, progress: Callable[[float], None] = silent) -> None:
        self.model.prepare(modes, progress)

    def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        return self.frequencies_at(theta, modes, _REST)

    def frequencies_at(self, theta: FloatArray, modes: int, conditions: Conditions) -> FloatArray:
        if self.effects:
            return self.modes(theta, conditions, modes, shapes=False).frequency_hz
        mass = conditions.added_mass
        if self.has_terms:
            bars = self._made(theta)
            if mass is not None:
                bars = replace(bars, masses=(_clamped_on(self.hanger, mass, bars),))
            return self._reduced(modes, mass).frequencies_hz(bars)
        stiffness, per_length, length = self.stiffness_mass_length(theta)
        if mass is not None:
            # What a mass weighs counts against the real bar's, which is longer, too.
            kg: Any = mass.mass_kg / (per_length * length)
            conditions = replace(conditions, added_mass=replace(mass, mass_kg=kg))
        factor = np.sqrt(stiffness / per_length) / length**2
        found = self.model.frequencies_at(self._as_described(theta), modes, conditions)
        return found * factor[:, None, None]

    def _as_described(self, theta: FloatArray) -> FloatArray:
        """Return parameters (n, own) of the described bar with frequencies 1/c times these."""
        stiffness, _, length = self.stiffness_mass_length(theta)
        known = {TENSION: self._column(theta, TENSION) * length**2 / stiffness}
        known[LENGTH] = np.ones(len(theta))
        for name in self.springs:
            known[name] = self._column(theta, name) + np.log10(length / stiffness)
        return np.column_stack([known[name] for name in self.model.parameter_names])

    def modes_at(self, theta: FloatArray, modes: int, x_m: FloatArray) -> Modes:
        """Return the modes of parameter sets (n, parameters), their frequencies in Hz.

        Only where the hanger `has_slopes`, as `modes_near`.
        """
        return self.modes_near(theta, (), modes, x_m)[0]

    def modes_near(
        self, theta: FloatArray, others: Sequence[FloatArray], modes: int, x_m: FloatArray
    ) -> tuple[Modes, list[Modes]]:
        """Return the same and, to first order, the modes of near parameter sets (n, parameters)."""
        x = self._places_of_described(theta, x_m) / self.hanger.length_m
        near = [self._made(each) for each in others]
        return self._reduced(modes).modes_about(self._made(theta), near, x)

    @property
    def has_shapes(self) -> bool:
        return self.model.has_shapes or bool(self.effects)

    def shapes(self, theta: FloatArray, modes: int, x_m: FloatArray) -> FloatArray:
        if self.effects:
            there = copy(self)
            there.places_m = x_m
            seen = there.modes(theta, _REST, modes).shape
            return np.stack([seen[:, axis, :, :, axis] for axis in range(len(PLANES))], axis=1)
        if self.has_terms:
            return self.modes_at(theta, modes, x_m).deflection
        described_m = self._places_of_described(theta, x_m)
        return self.model.shapes(self._as_described(theta), modes, described_m)

    def _places_of_described(self, theta: FloatArray, x_m: FloatArray) -> FloatArray:
        """Return places (points,) of the described bar that the real ones have at `x_m`.

        By the mean length of all parameter sets: lengths differ by less than a place is known to.
        """
        return np.asarray(x_m / self._column(theta, LENGTH).mean())

    def modes(
        self, theta: FloatArray, conditions: Conditions, modes: int, shapes: bool = True
    ) -> HangerModes:
        """Return the modes that the logger would report in one test, as its sensors see them."""
        return self.modes_of_tests(theta, [conditions], modes, shapes)[0]

    def modes_of_tests(
        self, theta: FloatArray, tests: Sequence[Conditions], modes: int, shapes: bool = True
    ) -> list[HangerModes]:
        """Return the same for several tests; those with the same hanger are solved once."""
        theta = self._plain(theta)
        made, ratio = self._made(theta), self._ratio(theta, modes)
        solved: list[tuple[PhysicalHanger, HangerModes]] = []
        results = []
        for conditions in tests:
            physical = self._in_test(made, theta, conditions)
            found = next((modes_ for other, modes_ in solved if _are_equal(physical, other)), None)
            if found is None:
                found = solve(physical, modes, self.places_m, shapes)
                found = replace(found, frequency_hz=found.frequency_hz * ratio)
                solved.append((physical, found))
            results.append(found)
        return results

    def _ratio(self, theta: FloatArray, modes: int) -> FloatArray:
        """Return the class's frequencies over the general model's (n, 2, modes); 1 of a beam."""
        if isinstance(self.model, Beam):
            return np.ones((len(theta), 2, modes))
        key = theta[:, : len(self._columns)].tobytes()
        if self._last is None or self._last[:2] != (key, modes):
            general = solve(self._made(theta), modes, np.empty(0), shapes=False)
            quick = self.with_effects(()).frequencies_hz(theta, modes)
            self._last = key, modes, quick / general.frequency_hz
        return self._last[2]

    # ------------------------------------------------ the bar

    def physical(self, theta: FloatArray, conditions: Conditions = _REST) -> PhysicalHanger:
        """Return the bars (n) of parameter sets with their effects in one test.

        A solid is a bar on equivalent end springs.
        """
        theta = self._plain(theta)
        return self._in_test(self._made(theta), theta, conditions)

    def _made(self, theta: FloatArray) -> PhysicalHanger:
        """Return the bars (n) without effects, at rest.

        Fittings and turnbuckles keep their part of the length, and their stiffness and mass over
        the bar's. Where end plates leave the length open, the bar is in the middle of the described
        one; else it begins at the deck end.
        """
        hanger = self.hanger
        stiffness, mass, length = self.stiffness_mass_length(theta)
        tension_n = self._column(theta, TENSION) * hanger.nominal_tension_n
        held = isinstance(self.model, Beam1) and not self.has_terms
        build = PhysicalHanger.held if held else PhysicalHanger.clamped
        bar = build(hanger, tension_n, len(self.places_m))
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
        bar = replace(bar, zones=(*self._fittings(bar, theta), *self._turnbuckles(bar, theta)))
        if not held:
            columns = [self._column(theta, name) for name in self.model.parameter_names]
            bar = bar.on_springs(self.model.springs_n_m_rad(np.column_stack(columns)))
        if self._shears:
            bar = self._sheared(bar, theta)
        return self._weighed(bar, theta) if self.has_terms else bar

    @property
    def _ends_m(self) -> tuple[float, float]:
        """Return where the class's bar begins and ends: s2 has the rod between plates alone."""
        plate = self.hanger.plate
        plate_m = plate.length_m if isinstance(self.model, S2) and plate is not None else 0.0
        return plate_m, self.hanger.length_m - plate_m

    def _fittings(self, bar: PhysicalHanger, theta: FloatArray) -> Iterator[Zone]:
        if not self.has_terms:
            return
        stiffness = np.stack([self._column(theta, name) for name in FITTING_STIFFNESS], axis=1)
        mass = self._column(theta, FITTING_MASS)
        reaches = [
            share * bar.length_m for share in np.array(self.fittings_m) / self.hanger.length_m
        ]
        if self.fittings_m[0] > 0:
            yield Zone(bar.deck_end_m, bar.deck_end_m + reaches[0], stiffness, mass)
        if self.fittings_m[1] > 0:
            yield Zone(bar.arch_end_m - reaches[1], bar.arch_end_m, stiffness, mass)

    def _turnbuckles(self, bar: PhysicalHanger, theta: FloatArray) -> Iterator[Zone]:
        deck_m, arch_m = self._ends_m
        ratio = bar.length_m / (arch_m - deck_m)
        for zone in bar.zones:
            yield Zone(
                bar.deck_end_m + (zone.start_m - deck_m) * ratio,
                bar.deck_end_m + (zone.end_m - deck_m) * ratio,
                zone.stiffness_factor * self._column(theta, TURNBUCKLE_STIFFNESS),
                zone.mass_factor * self._column(theta, TURNBUCKLE_MASS),
            )

    def _sheared(self, bar: PhysicalHanger, theta: FloatArray) -> PhysicalHanger:
        """Return bars that shear and whose sections resist turning."""
        hanger, stiffness = self.hanger, self.stiffness_mass_length(theta)[0]
        section = np.exp(self._column(theta, SECTION))
        flexible = self._column(theta, SHEAR) if self.has_terms else np.ones(len(theta))
        flexible = (flexible * section).clip(min=_LEAST_FLEXIBLE)
        turning = hanger.second_moment_m4 / hanger.area_m2 * section
        return replace(
            bar,
            shear_compliance_1_n=flexible / stiffness / hanger.shear_stiffness_n,
            rotary_inertia_kg_m=turning * bar.mass_per_length_kg_m,
        )

    def _weighed(self, bar: PhysicalHanger, theta: FloatArray) -> PhysicalHanger:
        """Return bars that bear their weight, with its tension's gradient and sag.

        The load q across is carried by the tension, and by bending as if the bar had the mean
        curvature all along: y'' = q/(T + c EI/L2), c = 9.87 between hinges and 39.5 between clamps
        (the buckling loads). One that was made crooked hangs more like a cable, y'' = q/T. So sag's
        stiffness is EA L4/EI (y'')^2.
        """
        hanger = self.hanger
        unit_n = hanger.bending_stiffness_n_m2 / hanger.length_m**2
        weight = hanger.mass_per_length_kg_m * hanger.length_m * GRAVITY_M_S2 / unit_n
        lean = np.radians(90 - self._column(theta, INCLINATION))
        tension = stiffness_ratio(bar)[:, 1]
        # The lower end of a hanger is pulled, or not at all: it does not push its support.
        gradient = np.minimum(weight * np.cos(lean), 2 * tension)
        compliance = bar.rotational_compliance_rad_n_m[:, :, 1, 1]
        soft = compliance * (bar.bending_stiffness_n_m2[:, 1] / bar.length_m)[:, None]
        held = (1 / (1 + _HALF_HELD * soft)).mean(axis=1)
        buckling = np.pi**2 * (1 + 3 * held)
        held_up = (tension / (tension + buckling)) ** (1 - self._column(theta, SAG_SHAPE))
        curvature = weight * np.sin(lean) / tension * held_up
        axial = hanger.elastic_modulus_pa * hanger.area_m2 / unit_n
        sag = axial * self._column(theta, SAG_STIFFNESS) * curvature**2 / tension
        to_newtons = bar.bending_stiffness_n_m2[:, 0] / bar.length_m**2
        return replace(
            bar,
            tension_gradient_n=gradient * to_newtons,
            sag_parameter=np.stack([0 * sag, sag], axis=1),
        )

    def _in_test(
        self, made: PhysicalHanger, theta: FloatArray, conditions: Conditions
    ) -> PhysicalHanger:
        """Return the bars in one test: its tension, its effects and its known mass."""
        physical = replace(made, tension_n=made.tension_n + conditions.tension_shift_n)
        at = len(self._columns)
        for (name, variant), count in zip(self.effects, self._counts, strict=True):
            case = Case(self.hanger, variant, conditions)
            physical = EFFECTS[name].act(physical, theta[:, at : at + count], case)
            at += count
        if self.has_terms and not np.array_equal(physical.tension_n, made.tension_n):
            physical = self._with_sag(physical, made, theta)
        added = conditions.added_mass
        if added is None:
            return physical
        clamped_on = point_mass(self.hanger, added, len(theta))
        return replace(physical, masses=(*physical.masses, clamped_on))

    def _with_sag(
        self, physical: PhysicalHanger, made: PhysicalHanger, theta: FloatArray
    ) -> PhysicalHanger:
        """Return hangers that sag as their tension lets them, which tests and effects change."""
        least_n = self.bounds[TENSION][0] * self.hanger.nominal_tension_n
        now = self._weighed(replace(made, tension_n=physical.tension_n.clip(least_n)), theta)
        return replace(
            physical,
            sag_parameter=physical.sag_parameter + now.sag_parameter - made.sag_parameter,
            tension_gradient_n=now.tension_gradient_n,
        )

    # ------------------------------------------------ the reduced basis

    @property
    def rough(self) -> HangerModel:
        """Return the same hanger for a search: a fraction of the time, 1e-4 of a frequency off.

        One without terms is its own.
        """
        if not self.has_slopes:
            return self
        found = copy(self)
        found.is_rough = True
        return found

    def _reduced(self, modes: int, mass: AddedMass | None = None) -> ReducedBar:
        place = None if mass is None else replace(mass, mass_kg=1.0)
        found = _reduced_bar(self.hanger, self._shears, modes, place)
        return found.rough if self.is_rough else found

    def snapshots(self, mass: AddedMass | None = None) -> PhysicalHanger:
        """Return bars spread over all that is assumed of them, with a known mass of any weight."""
        hanger, rng, n = self.hanger, np.random.default_rng(0), _SNAPSHOTS
        low, high = np.log(hanger.assumptions.tension_ratio.bounds)
        # Every other one near the nominal tension, the others anywhere.
        log_ratio = np.where(np.arange(n) % 2, rng.uniform(low, high, n), rng.normal(0, 0.4, n))
        springs = rng.uniform(*_STIFF_SNAPSHOTS, (len(self.springs), n))
        springs += math.log10(hanger.bending_stiffness_n_m2 / hanger.length_m)
        # A strand's wires leave the shear open, down to next to none.
        most_flexible = hanger.assumptions.strand_shear_share.bounds[1]
        spread = {
            TENSION: np.exp(log_ratio),
            LENGTH: rng.uniform(self.bounds[LENGTH][0] if self.length_is_open else 1.0, 1.0, n),
            **dict(zip(self.springs, springs, strict=True)),
            SECTION: hanger.scatter.section * rng.standard_normal(n),
            BENDING: np.full(n, hanger.bending_stiffness_factor),
            SHEAR: np.exp(rng.uniform(math.log(_LEAST_FLEXIBLE), math.log(most_flexible), n)),
            FITTING_STIFFNESS[0]: np.exp(rng.normal(1.3, 1.0, n)),
            FITTING_STIFFNESS[1]: np.exp(rng.normal(1.3, 1.0, n)),
            FITTING_MASS: np.exp(rng.normal(0.8, 0.5, n)),
            TURNBUCKLE_STIFFNESS: np.exp(rng.normal(0, 0.4, n)),
            TURNBUCKLE_MASS: np.exp(rng.normal(0, 0.3, n)),
            INCLINATION: 90 - np.degrees(rng.uniform(0, 0.5, n)),
            SAG_SHAPE: rng.random(n),
            SAG_STIFFNESS: np.ones(n),
        }
        bars = self._made(
            np.column_stack([spread.get(name, np.zeros(n)) for name in self._columns])
        )
        if mass is None:
            return bars
        clamped_on = _clamped_on(hanger, mass, bars)
        bar_kg = bars.mass_per_length_kg_m * bars.length_m
        return replace(bars, masses=(replace(clamped_on, mass_kg=bar_kg * rng.uniform(0, 0.2, n)),))


@lru_cache(maxsize=64)
def _reduced_bar(hanger: Hanger, shears: bool, modes: int, mass: AddedMass | None) -> ReducedBar:
    """Return the reduced basis of the bars of a hanger, which is made once."""
    model = HangerModel((Beam3 if shears else Beam2)(hanger))
    return ReducedBar(model.snapshots(mass), modes)


def _clamped_on(hanger: Hanger, mass: AddedMass, bars: PhysicalHanger) -> PointMass:
    """Return a known mass that keeps its part of the length, and turns as if it were as long."""
    found = point_mass(hanger, mass, len(bars.tension_n))
    length, radius = bars.length_m / hanger.length_m, found.radius_of_gyration_m
    return replace(
        found,
        x_m=bars.deck_end_m + found.x_m * length,
        radius_of_gyration_m=None if radius is None else radius * length,
    )


def _are_equal(one: PhysicalHanger, other: PhysicalHanger) -> bool:
    """Return True where two batches are the same in all their numbers."""
    mine, others = _numbers(one), _numbers(other)
    return len(mine) == len(others) and all(map(np.array_equal, mine, others))


def _numbers(physical: PhysicalHanger) -> list[FloatArray]:
    parts = [*physical.zones, *physical.masses, *physical.springs]
    parts += physical.mode_laws
    values = [getattr(physical, each.name) for each in fields(physical)]
    arrays = [value for value in values if isinstance(value, np.ndarray)]
    return arrays + [value for part in parts for value in vars(part).values()]


def _name_apart(
    names: Sequence[str], of_effects: Sequence[tuple[str, Parameter]]
) -> tuple[Parameter, ...]:
    """Return the effects' parameters, renamed where another parameter has the name."""
    used = Counter([*names, *(each.name for _, each in of_effects)])
    return tuple(
        replace(each, name=f"{effect}.{each.name}") if used[each.name] > 1 else each
        for effect, each in of_effects
    )
