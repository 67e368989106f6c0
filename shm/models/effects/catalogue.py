"""The registry: one line an effect, in the order of the manual."""

from __future__ import annotations

from shm.models.effects.base import Effect
from shm.models.effects.bending_stiffness import BendingStiffness
from shm.models.effects.distributed_mass import DistributedMass
from shm.models.effects.effective_length import EffectiveLength
from shm.models.effects.geometric_hardening import GeometricHardening
from shm.models.effects.intermediate_support import IntermediateSupport
from shm.models.effects.joint_softening import JointSoftening
from shm.models.effects.point_mass import UnknownPointMass
from shm.models.effects.rotational_end_flexibility import RotationalEndFlexibility
from shm.models.effects.sag import Sag
from shm.models.effects.section_loss import SectionLoss
from shm.models.effects.sensor_mass import SensorMass
from shm.models.effects.sensor_misalignment import SensorMisalignment
from shm.models.effects.shear_and_rotary_inertia import ShearAndRotaryInertia
from shm.models.effects.skewed_principal_axes import SkewedPrincipalAxes
from shm.models.effects.stiff_end_zones import StiffEndZones
from shm.models.effects.support_motion import SupportMotion
from shm.models.effects.temperature_tension import TemperatureTension
from shm.models.effects.timebase import Timebase
from shm.models.effects.translational_end_flexibility import TranslationalEndFlexibility

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
