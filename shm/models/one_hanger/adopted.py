"""Name hangers with effects that their owner adopted, as `shm gap adopt` makes them.

Parameters of adopted effects have uniform priors: a logarithmic size is uniform in its log10, and
one of either sign is uniform in the value itself, because a logarithm has no zero to cross and a
sign that is set once could not follow a hanger that changes. Their names:

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
from shm.models.classes.base import DESCRIPTION, THESIS, Conditions, Model
from shm.models.classes.registry import MODELS
from shm.models.effects import EFFECTS, Effect, Parameter, Survey, Variant
from shm.models.one_hanger.hanger_model import BENDING, LENGTH, SHEAR, TENSION, HangerModel
from shm.values import NAN, PLANES, FloatArray, Hanger, ModalTest

_HALF_WIDTH_IN_SD = math.sqrt(3)  # of a uniform distribution
_DEVIATIONS = ("section", "density", "length", "modulus")

# What was measured: nothing but a test, and all that makes every effect visible.
_ONE_TEST = Survey(("test",), PLANES, (), False, (), (), ())
_ANYTHING = Survey((), PLANES, (), True, (0.0, 20.0), (0.5, 1.0), ())
_REFERENCE = "reference_c"
_REMEDY = "Write BASELINE+EFFECT@WHERE, such as beam1+point_mass@everywhere."


class Adopted(HangerModel):
    """The hanger of one adopted name, with the priors of its description.

    Its parameters are the baseline's, then the effects', in the coordinates of their priors. Its
    tension is that at the reference temperature and at rest, where an effect changes it.
    """

    def __init__(self, name: str, hanger: Hanger, with_terms: bool = True):
        made = checked(name, hanger)
        super().__init__(MODELS[made.baseline](hanger), with_terms)
        self._take([(each.effect, variant_of(each, hanger)) for each in made.effects], ())
        acting = " and ".join(f"{effect} ({at.at})" for effect, at in self.effects)
        self.title = f"{self.title}, with {acting}"
        self.baseline, self.name, self.swaps = made.baseline, name, ()
        self.reference_c = next((e.reference_c for e in made.effects if _follows(e)), math.nan)
        by_name = {parameter_name(each): each for each in self.effect_parameters}
        effect_bounds = {key: bounds_of(each) for key, each in by_name.items()}
        for effect in made.effects:
            for key, both in effect.ranges.items():
                effect_bounds[key if key in by_name else f"{effect.effect}.{key}"] = both
        bounds = dict(self.bounds)
        if math.isfinite(known := hanger.scatter.tension):  # weighed
            bounds[TENSION] = (1 - known, 1 + known)
        self.bounds = bounds | effect_bounds
        self.units = {**self.units, **{key: each.unit for key, each in by_name.items()}}

    def _plain(self, theta: FloatArray) -> FloatArray:
        logarithmic = [in_log(each) for each in self.effect_parameters]
        plain = theta.copy()
        columns = theta.shape[1] - len(logarithmic) + np.flatnonzero(logarithmic)
        plain[:, columns] = 10.0 ** theta[:, columns]
        return plain

    def conditions(self, test: ModalTest) -> Conditions:
        """Return its added mass, and its temperature and level where an effect follows them."""
        followed = {each for name, _ in self.effects for each in EFFECTS[name].follows}
        warm, hard = "temperature" in followed, "amplitude" in followed
        amplitude = test.frequencies_amplitude
        return Conditions(
            temperature_shift_k=test.temperature_c - self.reference_c if warm else 0.0,
            amplitude=amplitude if hard and math.isfinite(amplitude) else 1.0,
            added_mass=test.added_mass,
        )

    def refuse(self, test: ModalTest) -> None:
        """Raise BadInput as any class, and where an effect follows a temperature not given."""
        super().refuse(test)
        if not math.isfinite(self.conditions(test).temperature_shift_k):
            raise BadInput(
                f"test {test.id} has no temperature, which model class {self.name} follows.",
                remedy="Give temperature_c, or drop the adoption with `shm gap drop`.",
            )


class AdoptedOfThesis(Model):
    """The class of one adopted name with uniform priors: that of the thesis, or as shm 1.0 had it.

    Parameters are the baseline's at the described length, the deviations of section, density,
    length and modulus within sqrt(3) standard deviations of the hanger's scatter, and the effects'.
    The bar has neither own weight nor stiff fittings.
    """

    expensive = True

    def __init__(self, name: str, hanger: Hanger, priors: str = THESIS):
        super().__init__(hanger)
        self.priors, self.bar = priors, Adopted(name, hanger, with_terms=False)
        self.name, self.title = name, self.bar.title
        baseline = MODELS[self.bar.baseline]
        known = self.bar.bounds if priors == DESCRIPTION else baseline.bounds
        left_out = {LENGTH} if hanger.nominal_tension_n else {LENGTH, TENSION}
        bounds = {key: known[key] for key in baseline.bounds if key not in left_out}
        weighed = hanger.scatter.tension
        if math.isfinite(weighed) and TENSION in bounds:
            bounds[TENSION] = (1 - weighed, 1 + weighed)
        sds = asdict(hanger.scatter)
        halves = {each: _HALF_WIDTH_IN_SD * sds[each] for each in _DEVIATIONS}
        bounds |= {each: (-half, half) for each, half in halves.items() if half}
        self.bounds = bounds | {key: self.bar.bounds[key] for key in self.bar.effect_names}
        self.units = {
            **baseline.units,
            **{each: self.bar.units[each] for each in self.bar.effect_names},
        }

    def _of_bar(self, theta: FloatArray) -> FloatArray:
        """Return the same parameter sets as those of the bar."""
        given = dict(zip(self.parameter_names, theta.T, strict=True))
        one = np.ones(len(theta))
        given[LENGTH] = np.exp(given.get(_DEVIATIONS[2], 0 * one))
        given[BENDING] = self.hanger.bending_stiffness_factor * one
        usual = {TENSION: one, SHEAR: one}
        names = self.bar.parameter_names
        return np.column_stack([given.get(name, usual.get(name, 0 * one)) for name in names])

    def conditions(self, test: ModalTest) -> Conditions:
        return self.bar.conditions(test)

    def refuse(self, test: ModalTest) -> None:
        """Raise BadInput as the bar does."""
        self.bar.refuse(test)

    def frequencies_hz(self, theta: FloatArray, modes: int) -> FloatArray:
        return self.bar.frequencies_hz(self._of_bar(theta), modes)

    def frequencies_at(self, theta: FloatArray, modes: int, conditions: Conditions) -> FloatArray:
        return self.bar.frequencies_at(self._of_bar(theta), modes, conditions)

    def shapes(self, theta: FloatArray, modes: int, x_m: FloatArray) -> FloatArray:
        return self.bar.shapes(self._of_bar(theta), modes, x_m)

    def springs_n_m_rad(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self.bar.springs_n_m_rad(self._of_bar(theta))


def with_parameters(name: str, hanger: Hanger, names: Sequence[str], priors: str) -> Model:
    """Return the class of an adopted name that has the parameters `names`.

    Posteriors of shm 1.0, and those with the priors of the thesis, are of `AdoptedOfThesis`.
    """
    as_made = LENGTH in names
    return Adopted(name, hanger) if as_made else AdoptedOfThesis(name, hanger, priors)


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
