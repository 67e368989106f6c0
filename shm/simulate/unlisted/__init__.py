"""What may be wrong with a hanger and stands in no catalogue: the diagnosis should not know it.

A new one is a function with its ranges and one line of `UNLISTED`. They are planted as any other,
but never drawn among `PLANTED`.
"""

from __future__ import annotations

from shm.simulate.effects.base import Plantable
from shm.simulate.unlisted import beside, crack, guide, inertia, tension

_EVERYWHERE = ("everywhere",)
_BY_PLANE = (*_EVERYWHERE, "everywhere, transverse", "everywhere, longitudinal")
_ALL = (
    Plantable("breathing_crack", _BY_PLANE, crack.ranges, crack.apply),
    Plantable("loose_guide", _BY_PLANE, guide.ranges, guide.apply),
    Plantable("coupled_pair", _EVERYWHERE, beside.pair_ranges, beside.pair),
    Plantable("tuned_damper", _BY_PLANE, beside.damper_ranges, beside.damper),
    Plantable("rotary_coupling", _EVERYWHERE, inertia.ranges, inertia.apply),
    Plantable("tension_between_planes", _EVERYWHERE, tension.between_ranges, tension.between),
    Plantable("wandering_tension", _EVERYWHERE, tension.wandering_ranges, tension.wandering),
)
UNLISTED = {each.name: each for each in _ALL}
