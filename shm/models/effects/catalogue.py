"""The registry: one line an effect, in the order of the manual."""

from __future__ import annotations

from shm.models.effects.base import Effect
from shm.models.effects.intermediate_support import IntermediateSupport
from shm.models.effects.of_ends import (
    EffectiveLength,
    RotationalEndFlexibility,
    StiffEndZones,
    SupportMotion,
    TranslationalEndFlexibility,
)
from shm.models.effects.of_mass import DistributedMass, SensorMass, UnknownPointMass
from shm.models.effects.of_section import BendingStiffness, SectionLoss, ShearAndRotaryInertia
from shm.models.effects.of_sensors import SensorMisalignment, SkewedPrincipalAxes, Timebase
from shm.models.effects.of_tension import (
    GeometricHardening,
    JointSoftening,
    Sag,
    TemperatureTension,
)

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
)

EFFECTS: dict[str, Effect] = {effect.name: effect for effect in _MEMBERS}
