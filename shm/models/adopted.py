"""Adopted model classes: a baseline with effects of the catalogue, as `shm gap adopt` makes them.

Parameters are the baseline's as made and the effects' own. Those of effects have uniform priors: a
logarithmic size is uniform in its log10, and one of either sign is uniform in the value itself,
because a logarithm has no zero to cross and a sign that is set once could not follow a hanger that
changes.

Names of adopted model classes: a baseline and the effects that a hanger's owner made part of it.

    beam1+point_mass@everywhere
    beam1+rotational_end_flexibility@deck_end.transverse+bending_stiffness@everywhere
    beam1+temperature_tension@everywhere:reference_c=10:tension_per_kelvin_n_k=-1300..-900

Behind an effect stands where it acts (`Variant.key`), then what the effect needs to be predicted in
a single test: `reference_c`, the temperature at which it vanishes, and ranges of its parameters as
the diagnosis of many tests found them. So a name says all of a class that its hanger does not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np

from shm.errors import BadInput, UsageError, suggest
from shm.models.as_made import BENDING, LENGTH, SHEAR, TENSION, AsMade
from shm.models.base import DESCRIPTION, THESIS, Conditions, Model
from shm.models.effects import EFFECTS, Effect, Parameter, Survey, Variant
from shm.models.hanger import PhysicalHanger
from shm.models.hanger_with_effects import HangerWithEffects
from shm.models.registry import MODELS
from shm.values import NAN, PLANES, FloatArray, Hanger, ModalTest

_HALF_WIDTH_IN_SD = math.sqrt(3)  # of a uniform distribution
_DEVIATIONS = ("section", "density", "length", "modulus")

# What was measured: nothing but a test, and all that makes every effect visible.
_ONE_TEST = Survey(("test",), PLANES, (), False, (), (), ())
_ANYTHING = Survey((), PLANES, (), True, (0.0, 20.0), (0.5, 1.0), ())
_REFERENCE = "reference_c"
_REMEDY = "Write BASELINE+EFFECT@WHERE, such as beam1+point_mass@everywhere."


class _WithEffects(Model):
    """The methods of a class with effects, in terms of its hanger with effects."""

    expensive = True
    adopted: AdoptedHanger

    def values(self, theta: FloatArray) -> FloatArray:
        """Return parameter sets of the hanger with effects from those of the class."""
        raise TypeError(f"{type(self).__name__} does not say what its parameters stand for.")

    def conditions(self, test: ModalTest) -> Conditions:
        """Return its added mass, and its temperature and level where an effect follows them."""
        return self.adopted.conditions(test)

    def refuse(self, test: ModalTest) -> None:
        """Raise BadInput as any class, and where an effect follows a temperature not given."""
        super().refuse(test)
        if not math.isfinite(self.conditions(test).temperature_shift_k):
            raise BadInput(
                f"test {test.id} has no temperature, which model class {self.name} follows.",
                remedy="Give temperature_c, or drop the adoption with `shm gap drop`.",
            )

    def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        return self.frequencies_at(theta, modes, Conditions())

    def frequencies_at(self, theta: FloatArray, modes: int, conditions: Conditions) -> FloatArray:
        found = self.adopted.bar.modes(self.values(theta), conditions, modes, shapes=False)
        return found.frequency_hz

    def shapes(self, theta: FloatArray, modes: int, x_m: FloatArray) -> FloatArray:
        bar = self.adopted.with_sensors(tuple(map(float, x_m)))
        seen = bar.modes(self.values(theta), Conditions(), modes).shape
        return np.stack([seen[:, axis, :, :, axis] for axis in range(len(PLANES))], axis=1)

    @property
    def has_shapes(self) -> bool:
        return True

    def physical(self, theta: FloatArray, sensors: int = 0) -> PhysicalHanger:
        """Return the hangers of `theta` with their effects, at rest and at the reference."""
        return self.adopted.with_sensors((0.0,) * sensors).physical(
            self.values(theta), Conditions()
        )

    def springs_n_m_rad(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the ends' own springs and those of the effects, each (n, planes)."""
        compliance = np.einsum("nepp->nep", self.physical(theta).rotational_compliance_rad_n_m)
        with np.errstate(divide="ignore"):
            springs = 1 / compliance
        return springs[:, 0], springs[:, 1]


class AdoptedAsMade(_WithEffects, AsMade):
    """The class of one adopted name, with the priors of the hanger's description.

    Its parameters are the baseline's as made, then the effects'. Its tension is that at the
    reference temperature and at rest, where an effect changes it.
    """

    has_slopes = False

    def __init__(self, name: str, hanger: Hanger):
        self.adopted = AdoptedHanger.of(name, hanger)
        AsMade.__init__(self, self.adopted.baseline_class)
        self.name, self.title, self.swaps = name, self.adopted.title, ()
        parameters = self.adopted.effect_parameters
        bounds = dict(self.bounds)
        if math.isfinite(known := hanger.scatter.tension):  # weighed
            bounds[TENSION] = (1 - known, 1 + known)
        self.effect_names = tuple(parameters)
        self.bounds = bounds | self.adopted.effect_bounds
        self.units = {
            **self.units,
            **{each: parameter.unit for each, parameter in parameters.items()},
        }

    def values(self, theta: FloatArray) -> FloatArray:
        return self.adopted.in_plain_values(theta)


class Adopted(_WithEffects):
    """The class of one adopted name with uniform priors: that of the thesis, or as shm 1.0 had it.

    Parameters are the baseline's at the described length, logarithms of the deviations of section,
    density, length and modulus, each in the standard deviation of the hanger's scatter, and the
    effects'. The bar has neither own weight nor stiff fittings.
    """

    def __init__(self, name: str, hanger: Hanger, priors: str = THESIS):
        super().__init__(hanger)
        self.priors = priors
        self.adopted = AdoptedHanger.of(name, hanger, with_terms=False)
        self.name, self.title = name, self.adopted.title
        baseline = MODELS[self.adopted.baseline]
        known = self.adopted.bar.model.bounds if priors == DESCRIPTION else baseline.bounds
        left_out = {LENGTH} if hanger.nominal_tension_n else {LENGTH, TENSION}
        bounds = {key: known[key] for key in baseline.bounds if key not in left_out}
        weighed = hanger.scatter.tension
        if math.isfinite(weighed) and TENSION in bounds:
            bounds[TENSION] = (1 - weighed, 1 + weighed)
        sds = asdict(hanger.scatter)
        halves = {each: _HALF_WIDTH_IN_SD * sds[each] for each in _DEVIATIONS}
        bounds |= {each: (-half, half) for each, half in halves.items() if half}
        parameters = self.adopted.effect_parameters
        self.units = {**baseline.units, **{each: of.unit for each, of in parameters.items()}}
        self.bounds = bounds | self.adopted.effect_bounds

    def values(self, theta: FloatArray) -> FloatArray:
        given = dict(zip(self.parameter_names, theta.T, strict=True))
        one = np.ones(len(theta))
        given[LENGTH] = np.exp(given.get(_DEVIATIONS[2], 0 * one))
        given[BENDING] = self.hanger.bending_stiffness_factor * one
        usual = {TENSION: one, SHEAR: one}
        names = (*self.adopted.bar.model.parameter_names, *self.adopted.effect_parameters)
        columns = [given.get(name, usual.get(name, 0 * one)) for name in names]
        return self.adopted.in_plain_values(np.column_stack(columns))


@dataclass(frozen=True, eq=False)
class AdoptedHanger:
    """The hanger of an adopted name: `bar` with its effects, and their names in the class.

    `effect_bounds` are limits of uniform priors, in the class's coordinates.
    """

    baseline: str
    bar: HangerWithEffects
    reference_c: float
    effect_parameters: dict[str, Parameter]
    effect_bounds: dict[str, tuple[float, float]]

    @classmethod
    def of(cls, name: str, hanger: Hanger, with_terms: bool = True) -> AdoptedHanger:
        """Return the hanger of a name; raises UsageError where it names what is not there."""
        made = checked(name, hanger)
        model = AsMade(MODELS[made.baseline](hanger), with_terms)
        effects = [(each.effect, variant_of(each, hanger)) for each in made.effects]
        bar = HangerWithEffects(model, effects)
        parameters = {parameter_name(each): each for each in bar.effect_parameters}
        bounds = {key: bounds_of(each) for key, each in parameters.items()}
        for effect in made.effects:
            for parameter, both in effect.ranges.items():
                bounds[parameter if parameter in bounds else f"{effect.effect}.{parameter}"] = both
        reference_c = next((e.reference_c for e in made.effects if _follows(e)), math.nan)
        return cls(made.baseline, bar, reference_c, parameters, bounds)

    @property
    def baseline_class(self) -> Model:
        return self.bar.model.model

    @property
    def title(self) -> str:
        acting = " and ".join(f"{name} ({variant.at})" for name, variant in self.bar.effects)
        return f"{MODELS[self.baseline].title}, with {acting}"

    def with_sensors(self, places_m: tuple[float, ...]) -> HangerWithEffects:
        return HangerWithEffects(self.bar.model, self.bar.effects, places_m)

    def in_plain_values(self, theta: FloatArray) -> FloatArray:
        """Return `theta` with the effects' values where it has their logarithms."""
        logarithmic = [in_log(each) for each in self.effect_parameters.values()]
        plain = theta.copy()
        columns = theta.shape[1] - len(logarithmic) + np.flatnonzero(logarithmic)
        plain[:, columns] = 10.0 ** theta[:, columns]
        return plain

    def conditions(self, test: ModalTest) -> Conditions:
        """Return the conditions of a test that the effects follow, and its added mass."""
        followed = {each for name, _ in self.bar.effects for each in EFFECTS[name].follows}
        warm, hard = "temperature" in followed, "amplitude" in followed
        amplitude = test.frequencies_amplitude
        return Conditions(
            temperature_shift_k=test.temperature_c - self.reference_c if warm else 0.0,
            amplitude=amplitude if hard and math.isfinite(amplitude) else 1.0,
            added_mass=test.added_mass,
        )


def with_parameters(name: str, hanger: Hanger, names: Sequence[str], priors: str) -> Model:
    """Return the class of an adopted name that has the parameters `names`.

    Posteriors of shm 1.0, and those with the priors of the thesis, are of `Adopted`.
    """
    as_made = LENGTH in names
    return AdoptedAsMade(name, hanger) if as_made else Adopted(name, hanger, priors)


def unfit(name: str, hanger: Hanger) -> str:
    """Return why an adopted class cannot describe `hanger`; empty where it can.

    Raises UsageError where the name is malformed or names what is not there.
    """
    return MODELS[checked(name, hanger).baseline].unfit(hanger)


def checked(name: str, hanger: Hanger) -> AdoptedName:
    """Return the parts of a name; raises UsageError where it is malformed or unknown."""
    made = AdoptedName.parse(name)
    if made.baseline not in MODELS:
        raise UsageError(
            f"unknown model class {made.baseline!r} in {name!r}.",
            remedy=f"Known: {', '.join(MODELS)}.",
        )
    for each in made.effects:
        _refuse_ranges(each, variant_of(each, hanger), hanger)
    return made


def variant_of(adopted: AdoptedEffect, hanger: Hanger) -> Variant:
    """Return where an adopted effect acts; raises UsageError for what cannot be adopted."""
    effect = _effect(adopted.effect)
    if _follows(adopted) and math.isnan(adopted.reference_c):
        raise UsageError(
            f"{effect.name} follows the temperature from a reference that the name does not give.",
            remedy=f"Write {effect.name}@{adopted.key}:reference_c=10, say.",
        )
    variants = _variants(effect, hanger)
    if adopted.key not in variants:
        raise UsageError(
            f"{effect.name} of a hanger cannot act at {adopted.key!r}.",
            remedy=f"Places: {', '.join(variants)}.",
        )
    return variants[adopted.key]


def places_of(effect: str, hanger: Hanger) -> tuple[str, ...]:
    """Return the keys of where an effect may act; raises UsageError for what cannot be adopted."""
    return tuple(_variants(_effect(effect), hanger))


def missed_by_one_test(effect: str, hanger: Hanger) -> str:
    """Return why frequencies of a single test cannot show an effect; empty where they can."""
    return _effect(effect).invisible(hanger, _ONE_TEST)


def parameter_name(parameter: Parameter) -> str:
    """Return the name that a parameter of an effect has in the class."""
    effect, dot, name = parameter.name.rpartition(".")
    return f"{effect}{dot}log10_{name}" if in_log(parameter) else parameter.name


def _variants(effect: Effect, hanger: Hanger) -> dict[str, Variant]:
    return {each.key: each for each in effect.variants(hanger, _ANYTHING)}


def _effect(name: str) -> Effect:
    if name not in EFFECTS:
        adoptable = [each for each in EFFECTS if EFFECTS[each].of_the_hanger]
        remedy = f"{suggest(name, adoptable)}Known: {', '.join(adoptable)}."
        raise UsageError(f"unknown effect {name!r}.", remedy=remedy)
    if not EFFECTS[name].of_the_hanger:
        raise UsageError(
            f"{name} is one of the sensors, not of the hanger: other tests would not have it.",
            remedy="Correct the tests instead.",
        )
    return EFFECTS[name]


def _refuse_ranges(adopted: AdoptedEffect, variant: Variant, hanger: Hanger) -> None:
    known = [parameter_name(each) for each in EFFECTS[adopted.effect].parameters(hanger, variant)]
    for name in adopted.ranges:
        if name not in known:
            raise UsageError(
                f"{adopted.effect} has no parameter {name!r}.", remedy=f"It has {', '.join(known)}."
            )


def _follows(adopted: AdoptedEffect) -> bool:
    return "temperature" in _effect(adopted.effect).follows


def in_log(parameter: Parameter) -> bool:
    """Return True for a parameter of an effect that is uniform in its log10 in the class."""
    return parameter.spread == "logarithmic" and not parameter.signed


def bounds_of(parameter: Parameter) -> tuple[float, float]:
    """Limits of a parameter's uniform prior in the class, in the class's own coordinate."""
    if in_log(parameter):
        return math.log10(parameter.lower), math.log10(parameter.upper)
    return (-parameter.upper if parameter.signed else parameter.lower), parameter.upper


@dataclass(frozen=True)
class AdoptedEffect:
    """One effect of an adopted class: its name and the key of where it acts.

    `reference_c` is NaN where the effect does not follow the temperature; `ranges` replace those of
    the class's parameters.
    """

    effect: str
    key: str
    reference_c: float = NAN
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __str__(self) -> str:
        reference = (
            "" if math.isnan(self.reference_c) else f":{_REFERENCE}={_text(self.reference_c)}"
        )
        ranges = "".join(
            f":{name}={_text(low)}..{_text(high)}" for name, (low, high) in self.ranges.items()
        )
        return f"{self.effect}@{self.key}{reference}{ranges}"


@dataclass(frozen=True)
class AdoptedName:
    """A baseline with effects; as text, the name of their model class."""

    baseline: str
    effects: tuple[AdoptedEffect, ...]

    def __str__(self) -> str:
        return "+".join([self.baseline, *map(str, self.effects)])

    @classmethod
    def parse(cls, text: str) -> AdoptedName:
        """Return the parts of a name; raises UsageError where it is malformed."""
        baseline, *effects = text.split("+")
        if not baseline or not effects:
            raise _malformed(text, "it names no baseline or no effect")
        return cls(baseline, tuple(_effect_named(part, text) for part in effects))


def is_adopted(name: str) -> bool:
    """Return True for the name of a model class that is a baseline with effects."""
    return "+" in name


def _effect_named(part: str, text: str) -> AdoptedEffect:
    where, *options = part.split(":")
    effect, _, key = where.partition("@")
    if not effect or not key:
        raise _malformed(text, f"{part!r} is not EFFECT@WHERE")
    values = dict(_option(option, text) for option in options)
    (reference_c, _) = values.pop(_REFERENCE, (NAN, NAN))
    return AdoptedEffect(effect, key, reference_c, values)


def _option(option: str, text: str) -> tuple[str, tuple[float, float]]:
    """Return a name and its range; that of the reference begins and ends alike."""
    name, _, value = option.partition("=")
    low, _, high = value.partition("..")
    try:
        limits = float(low), float(high or low)
    except ValueError:
        raise _malformed(text, f"{option!r} is not NAME=LOW..HIGH") from None
    wrong = bool(high) if name == _REFERENCE else not limits[0] < limits[1]
    if wrong or not all(map(math.isfinite, limits)):
        raise _malformed(text, f"{option!r} is neither a temperature nor a rising range")
    return name, limits


def _text(value: float) -> str:
    """Return a number without the sign that joins effects."""
    return f"{value:.6g}".replace("e+", "e")


def _malformed(text: str, why: str) -> UsageError:
    return UsageError(f"{text!r} is no name of a model class: {why}.", remedy=_REMEDY)
