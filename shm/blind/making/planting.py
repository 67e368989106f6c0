"""What is planted in a case: effects at places where its data can show them, at a wanted size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.blind.making.mix import Draft
from shm.errors import UsageError
from shm.simulate import (
    CampaignPlan,
    HangerState,
    PlantedEffect,
    at_share,
    choices,
    drawn,
    scaled_to,
    size_of,
)
from shm.values import Hanger

_SIZES, _SIZES_OF_A_PAIR = (1.0, 1000.0), (8.0, 100.0)
"""Up to what real hangers show: a few percent of frequencies that are known to 1e-4."""
_DRAWS = 5
_ABOUT = 1.1
_WEAK = 0.02, 0.2
_OF_SENSORS = ("sensor_mass", "sensor_misalignment", "skewed_principal_axes")
"""Not planted without shapes: then nobody knows where the sensors sit or what they see across."""
_OF_LEVELS = ("geometric_hardening", "joint_softening")
"""Not planted where all hits are alike: they are then a tension and a spring for good."""


@dataclass(frozen=True)
class Site:
    """A hanger, its state, and how it is measured."""

    hanger: Hanger
    state: HangerState
    plan: CampaignPlan

    def size(self, effects: Sequence[PlantedEffect]) -> float:
        """The size of effects together; 0 of none, infinite where the bar could not stand them."""
        if not effects:
            return 0.0
        try:
            return size_of(self.hanger, self.state, effects, self.plan)
        except UsageError:
            return math.inf


def planted_effects(
    draft: Draft, site: Site, rng: np.random.Generator
) -> tuple[PlantedEffect, ...]:
    """The effects of a case; raises UsageError where none can be seen in its data."""
    if draft.kind == "none":
        return ()
    names = [name for name in draft.effects if _may_be_called_so(name, site.plan)]
    found = _pair(names, site, rng) if draft.kind == "two" else _single(draft, names, site, rng)
    if not found:
        raise UsageError(
            f"nothing can be planted that the data of {draft.case} show.",
            remedy="Make the trial with another seed.",
        )
    return found


def _may_be_called_so(name: str, plan: CampaignPlan) -> bool:
    """Whether the data can hold what makes the effect the one of its name."""
    if name in _OF_SENSORS:
        return plan.shapes
    return name not in _OF_LEVELS or len(plan.amplitudes) > 1


def _single(
    draft: Draft, names: Sequence[str], site: Site, rng: np.random.Generator
) -> tuple[PlantedEffect, ...]:
    """The first effect that can have the size; where none can, that of half the logarithm."""
    for share in (draft.share, draft.share / 2, draft.share / 4):
        for name in names:
            found = _of_size(name, _log_uniform(_SIZES, share), site, rng)
            if found is not None:
                return (found,)
    return ()


def _pair(names: Sequence[str], site: Site, rng: np.random.Generator) -> tuple[PlantedEffect, ...]:
    """Two effects, each to be seen by itself, that do not undo each other."""
    first: PlantedEffect | None = None
    for name in names:
        found = _of_size(name, _log_uniform(_SIZES_OF_A_PAIR, rng.uniform()), site, rng)
        if first is None or found is None:
            first = first or found
        elif _SIZES_OF_A_PAIR[0] <= site.size((first, found)) < math.inf:
            return first, found
    return ()


def _of_size(name: str, size: float, site: Site, rng: np.random.Generator) -> PlantedEffect | None:
    """An effect of a size at a place drawn anew until it can have it.

    Where its weakest is larger everywhere, it is drawn from the weak end of its range. None where
    these data cannot show it.
    """
    hanger, plan = site.hanger, site.plan
    places = choices(name, plan.places_m(hanger), [test.id for test in plan.tests(hanger)])
    weak: PlantedEffect | None = None
    for _ in range(_DRAWS):
        effect = drawn(name, str(rng.choice(places)), hanger, rng)
        scaled = scaled_to(size, hanger, site.state, effect, plan)
        if scaled is not None and site.size((scaled,)) < _ABOUT * size:
            return scaled
        if scaled is not None and weak is None:
            weak = at_share(float(rng.uniform(*_WEAK)), hanger, effect)
    return weak if weak is not None and math.isfinite(site.size((weak,))) else None


def _log_uniform(bounds: tuple[float, float], share: float) -> float:
    return float(bounds[0] * (bounds[1] / bounds[0]) ** share)
