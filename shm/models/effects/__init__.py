"""The catalogue of physical effects; a new one is a class in `of_*.py` and a line of `_MEMBERS`.

Packages from outside add theirs by the entry points `shm.effects` (`shm.models.plug_ins`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from shm.errors import BadInput
from shm.models.classes.base import Conditions
from shm.models.effects.base import Case, Effect, Parameter, Survey, Variant
from shm.models.effects.of_ends import (
    EffectiveLength,
    RotationalEndFlexibility,
    StiffEndZones,
    SupportMotion,
    TranslationalEndFlexibility,
)
from shm.models.effects.of_mass import (
    DistributedMass,
    IntermediateSupport,
    PartialMass,
    SensorMass,
    UnknownPointMass,
)
from shm.models.effects.of_section import (
    BendingStiffness,
    SectionLoss,
    SectionSize,
    ShearAndRotaryInertia,
)
from shm.models.effects.of_sensors import (
    LoadScale,
    SensorMisalignment,
    SkewedPrincipalAxes,
    Timebase,
)
from shm.models.effects.of_tension import (
    GeometricHardening,
    JointSoftening,
    Sag,
    TemperatureTension,
)
from shm.models.plug_ins import EFFECTS_GROUP, members_with_plug_ins
from shm.values import PLANES, EffectPrior, Hanger

__all__ = [
    "EFFECTS",
    "Case",
    "Conditions",
    "Effect",
    "Parameter",
    "Survey",
    "Variant",
    "check_effect_priors",
    "parameters_of",
]


_MEMBERS: tuple[Effect, ...] = (
    RotationalEndFlexibility(),
    TranslationalEndFlexibility(),
    EffectiveLength(),
    BendingStiffness(),
    DistributedMass(),
    UnknownPointMass(),
    SectionLoss(),
    StiffEndZones(),
    ShearAndRotaryInertia(),
    Sag(),
    IntermediateSupport(),
    SupportMotion(),
    TemperatureTension(),
    GeometricHardening(),
    JointSoftening(),
    SensorMass(),
    SensorMisalignment(),
    SkewedPrincipalAxes(),
    Timebase(),
    SectionSize(),
    PartialMass(),
    LoadScale(),
)

EFFECTS: dict[str, Effect] = members_with_plug_ins(
    EFFECTS_GROUP, {effect.name: effect for effect in _MEMBERS}, Effect
)


def parameters_of(name: str, hanger: Hanger, variant: Variant) -> tuple[Parameter, ...]:
    """Return the parameters of effect `name`, within the ranges that the hanger's owner gives."""
    ranges = {prior.parameter: prior for prior in hanger.effect_priors if prior.effect == name}
    return tuple(
        _narrowed(parameter, ranges) for parameter in EFFECTS[name].parameters(hanger, variant)
    )


def _narrowed(parameter: Parameter, ranges: Mapping[str, EffectPrior]) -> Parameter:
    prior = ranges.get(parameter.name)
    return parameter if prior is None else replace(parameter, lower=prior.lower, upper=prior.upper)


def check_effect_priors(hanger: Hanger) -> None:
    """Raise BadInput where a range of the owner names nothing known or cannot be."""
    for prior in hanger.effect_priors:
        _check(prior, hanger)


def _check(prior: EffectPrior, hanger: Hanger) -> None:
    if prior.effect not in EFFECTS:
        raise BadInput(
            f"hanger {hanger.id}: [hanger.effects.{prior.effect}] is no effect of the catalogue.",
            remedy=f"Known: {', '.join(EFFECTS)}.",
        )
    known = _known(prior.effect, hanger)
    if prior.parameter not in known:
        raise BadInput(
            f"hanger {hanger.id}: [hanger.effects.{prior.effect}] has no parameter "
            f"{prior.parameter}.",
            remedy=f"Known: {', '.join(known)}.",
        )
    problem, remedy = _fault(prior, known[prior.parameter])
    if problem:
        raise BadInput(
            f"hanger {hanger.id}: [hanger.effects.{prior.effect}] {prior.parameter} = "
            f"[{prior.lower:g}, {prior.upper:g}] {problem}.",
            remedy=remedy,
        )


def _fault(prior: EffectPrior, parameter: Parameter) -> tuple[str, str]:
    """Return the fault of a range, and what to do; both empty where it is good."""
    if prior.lower >= prior.upper:
        return "does not rise", f"Give the smaller number first, in {parameter.unit}."
    if parameter.spread == "logarithmic" and prior.lower <= 0:
        sides = ", which stands for both signs" if parameter.signed else ""
        return "is not above 0", f"Its prior is logarithmic: give positive numbers{sides}."
    if prior.lower < parameter.least or prior.upper > parameter.most:
        least = 0.0 if parameter.spread == "logarithmic" else parameter.least
        remedy = f"Stay within {least:g} and {parameter.most:g} {parameter.unit}."
        return "is beyond what can be", remedy
    return "", ""


def _known(name: str, hanger: Hanger) -> dict[str, Parameter]:
    """Every parameter of an effect, whatever its variant."""
    middle_m = hanger.length_m / 2
    everything = Survey(("t1", "t2"), PLANES, (middle_m,), True, (0.0, 20.0), (0.5, 1.0), ())
    return {
        parameter.name: parameter
        for variant in EFFECTS[name].variants(hanger, everything)
        for parameter in EFFECTS[name].parameters(hanger, variant)
    }
