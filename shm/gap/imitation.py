"""How freely each pair of effects imitates what is not in the catalogue.

Some effects can act anywhere and take many forms: a mass and a loss of section together come near
to almost anything. Others can do one thing only. So of what passes for a pair, a few pairs have
the most: each as the product of what its effects were seen to do in blind trials.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import cache
from itertools import combinations

LED_FALSELY = {
    "point_mass": 45,
    "section_loss": 42,
    "intermediate_support": 38,
    "stiff_end_zones": 31,
    "effective_length": 27,
    "rotational_end_flexibility": 27,
    "sag": 16,
    "support_motion": 16,
    "bending_stiffness": 12,
    "shear_and_rotary_inertia": 12,
    "translational_end_flexibility": 10,
    "distributed_mass": 8,
    "timebase": 6,
    "skewed_principal_axes": 1,
    "temperature_tension": 1,
}
"""In how many of 146 pairs that led in blind trials each effect was, where the true effect had been
taken out of the catalogue."""

SENSORS = "sensor_misalignment"
LED_WITH_TURNED_SENSORS = {
    "rotational_end_flexibility": 19 / 168,
    "stiff_end_zones": 2 / 168,
    "translational_end_flexibility": 1 / 168,
}
"""Principal axes that are skewed do what turned sensors and ends that yield in one plane do: of all
such cases, in how many turned sensors led with each."""

EVEN = 0.2
"""So much is shared evenly by all pairs: what is unknown need not resemble the catalogue's effects,
from which the counts are."""


def imitation(effects: Collection[str], catalogue: Collection[str]) -> float:
    """How often something unknown passes for this pair, to the mean over pairs of `catalogue`."""
    pair, names = frozenset(effects), frozenset(catalogue)
    if (freedoms := _sum_of_freedoms(names)) == 0:
        return 1.0
    pairs = len(names) * (len(names) - 1) / 2
    turned = _with_turned_sensors(names)
    known = (1 - sum(turned.values())) * _freedom(pair) / freedoms + turned.get(pair, 0.0)
    return EVEN + (1 - EVEN) * known * pairs


def _with_turned_sensors(names: frozenset[str]) -> dict[frozenset[str], float]:
    pairs = {frozenset((SENSORS, end)): led for end, led in LED_WITH_TURNED_SENSORS.items()}
    return {pair: led for pair, led in pairs.items() if pair <= names}


def _freedom(pair: Collection[str]) -> int:
    one, other = pair
    return LED_FALSELY.get(one, 0) * LED_FALSELY.get(other, 0)


@cache
def _sum_of_freedoms(names: frozenset[str]) -> int:
    return sum(_freedom(pair) for pair in combinations(names, 2))
