"""How large an effect is beside what measurements show: its size in standard deviations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np

from shm.errors import UsageError
from shm.simulate.campaign import CampaignPlan, noiseless
from shm.simulate.effects import PlantedEffect, ranges_of
from shm.simulate.planted import Deviations
from shm.simulate.state import HangerState
from shm.values import PLANES, FloatArray, Hanger

_DIFFERENCE = 1e-4  # of tension and deviations
_STEPS, _LONGEST_STEP = 4, np.array([0.3, 6.0, 6.0, 6.0, 6.0])
_BISECTIONS = 12


def size_of(
    hanger: Hanger, state: HangerState, effects: Sequence[PlantedEffect], plan: CampaignPlan
) -> float:
    """The square root of the best attainable chi-square difference.

    Data without noise, with and without the effects; those without are fitted to them by tension
    and by the bar's deviations with their priors. What bends, such as the length's deviation, is
    followed by a few steps, each linearised (Gauss-Newton).
    """
    plain, slopes = _baseline(hanger, state, plan)
    wanted = _data(hanger, state, effects, plan, Deviations())
    place, left = np.zeros(slopes.shape[1]), np.zeros(0)
    for count in range(_STEPS):
        if count:
            there, made = _bar_at(hanger, state, place)
            plain = _data(hanger, there, (), plan, made)
        step, left = _fitted(wanted.beyond(plain, plan), place, slopes)
        place = place + step.clip(-_LONGEST_STEP, _LONGEST_STEP)
    return float(np.linalg.norm(left))


def scaled_to(
    size: float,
    hanger: Hanger,
    state: HangerState,
    effect: PlantedEffect,
    plan: CampaignPlan,
) -> PlantedEffect | None:
    """The effect with its size parameters scaled so that `size_of` it is `size`.

    Where there are several (the springs of both planes) they go together through their ranges. A
    signed parameter keeps its sign. Where the weakest physical value is larger already, it is that;
    None where the strongest is smaller.
    """
    low, high = 0.0, 1.0
    if _size_at(low, hanger, state, effect, plan) >= size:
        return at_share(low, hanger, effect)
    if _size_at(high, hanger, state, effect, plan) < size:
        return None
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        if _size_at(middle, hanger, state, effect, plan) < size:
            low = middle
        else:
            high = middle
    return at_share((low + high) / 2, hanger, effect)


def at_share(share: float, hanger: Hanger, effect: PlantedEffect) -> PlantedEffect:
    """The effect with its sizes at a share of their ranges, 0 the weakest and 1 the strongest."""
    values = dict(effect.values)
    for name, known in ranges_of(effect, hanger).items():
        if known.is_size:
            sign = math.copysign(1.0, values[name]) if known.signed else 1.0
            values[name] = sign * known.value(share)
    return replace(effect, values=values)


def _size_at(
    share: float, hanger: Hanger, state: HangerState, effect: PlantedEffect, plan: CampaignPlan
) -> float:
    try:
        return size_of(hanger, state, (at_share(share, hanger, effect),), plan)
    except UsageError:
        return math.inf  # so large that the bar buckles


def _fitted(
    moved: FloatArray, place: FloatArray, slopes: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The step from `place` by least squares, and what it leaves of data and priors.

    `place` (parameters,) is the logarithm of the tension's factor, then deviations in their
    standard deviations.
    """
    prior = np.eye(len(place))
    prior[0, 0] = 0.0  # nobody knows the tension
    both = np.vstack([slopes, prior])
    wanted = np.concatenate([moved, -prior @ place])
    step = np.linalg.lstsq(both, wanted, rcond=None)[0]
    return np.asarray(step), np.asarray(wanted - both @ step)


def _bar_at(
    hanger: Hanger, state: HangerState, place: FloatArray
) -> tuple[HangerState, Deviations]:
    """The state with the tension, and the bar with the deviations, of a place."""
    own = {
        each.name: float(getattr(hanger.scatter, each.name) * sds)
        for each, sds in zip(fields(Deviations), place[1:], strict=True)
    }
    tension = state.tension_n * float(np.exp(place[0]))
    return replace(state, tension_n=tension), Deviations(**own)


@dataclass(frozen=True, eq=False)
class _Data:
    """Log frequencies (frequencies,) and shapes (shapes, components), largest component 1."""

    frequency: FloatArray
    shape: FloatArray

    def beyond(self, plain: _Data, plan: CampaignPlan) -> FloatArray:
        """How far these data are from plain ones, in standard deviations, (data,).

        A shape's length and sign are nobody's data.
        """
        own = np.linalg.norm(self.shape, axis=1)
        other = np.linalg.norm(plain.shape, axis=1)
        sign = np.where(np.sum(self.shape * plain.shape, axis=1) < 0, -1.0, 1.0)
        apart = self.shape * (sign * other / own)[:, None] - plain.shape
        frequency = (self.frequency - plain.frequency) / plan.frequency_sd
        return np.concatenate([frequency, apart.ravel() / plan.shape_sd])


@lru_cache(maxsize=64)
def _baseline(hanger: Hanger, state: HangerState, plan: CampaignPlan) -> tuple[_Data, FloatArray]:
    """Data without effects, and their change (data, 5) by one tension and by one standard
    deviation of each deviation.
    """
    plain = _data(hanger, state, (), plan, Deviations())
    tauter = replace(state, tension_n=state.tension_n * (1 + _DIFFERENCE))
    slopes = [_data(hanger, tauter, (), plan, Deviations()).beyond(plain, plan) / _DIFFERENCE]
    for each in fields(Deviations):
        other = _data(hanger, state, (), plan, Deviations(**{each.name: _DIFFERENCE}))
        scatter = float(getattr(hanger.scatter, each.name))
        slopes.append(other.beyond(plain, plan) / _DIFFERENCE * scatter)
    return plain, np.array(slopes).T


def _data(
    hanger: Hanger,
    state: HangerState,
    effects: Sequence[PlantedEffect],
    plan: CampaignPlan,
    deviations: Deviations,
) -> _Data:
    planes = [PLANES.index(plane) for plane in plan.planes]
    frequencies, shapes = [], []
    for test in plan.tests(hanger):
        found = noiseless(hanger, state, effects, plan, test, deviations)
        frequencies.append(np.log(found.frequency_hz[planes]).ravel())
        seen = found.shape[planes] if plan.biaxial else _own(found.shape, planes)
        shapes.append(seen.reshape(len(planes) * plan.modes, -1))
    shape = np.concatenate(shapes)
    return _Data(np.concatenate(frequencies), shape if plan.shapes else shape[:0])


def _own(shape: FloatArray, planes: Sequence[int]) -> FloatArray:
    """The components in the modes' own planes."""
    return np.stack([shape[plane, ..., plane] for plane in planes])
