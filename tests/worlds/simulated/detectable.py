"""How large an effect is beside what measurements show: its size in standard deviations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from shm.errors import UsageError
from shm.simulate import PlantedEffect
from shm.simulate.state import HangerState
from shm.values import PLANES, FloatArray, Hanger
from tests.worlds.simulated.campaign import CampaignPlan, CampaignTruth, noiseless
from tests.worlds.simulated.effects.registry import ranges_of
from tests.worlds.simulated.reality import GLOBAL, Deviations, SensorError, sd_factors, wave_sd

_DIFFERENCE = 1e-4  # of tension and deviations
_STEPS, _LONGEST_STEP = 4, np.array([0.3, 6.0, 6.0, 6.0, 6.0])
_BENT_STEP = np.array([3e-3, 0.3, 0.3, 0.3, 0.3])  # below, the data go linearly
_BENDING = 1 + len(GLOBAL)
_PART = 0.3  # of a standard deviation, for what is linear
_SHARES = 2**12
_NEAR = 0.02  # of the size asked for, where a campaign has a reality


def size_of(
    hanger: Hanger, state: HangerState, effects: Sequence[PlantedEffect], plan: CampaignPlan
) -> float:
    """The square root of the best attainable chi-square difference.

    Data without noise, with and without the effects; those without are fitted to them by tension
    and by the bar's deviations with their priors. What bends, such as the length's deviation, is
    followed by a few steps, each linearised (Gauss-Newton). With a reality, effects follow their
    own laws, standard deviations differ by mode, and the section's waves and the errors of sensors
    are fitted too, with their priors; what was drawn of them is not told.
    """
    plain, slopes = _baseline(hanger, state, plan)
    sds = sds_of(hanger, state, plan)
    wanted = _data(hanger, state, effects, plan, Deviations())
    place, left = np.zeros(slopes.shape[1]), np.zeros(0)
    for count in range(_STEPS):
        if count:
            there, made = _bar_at(hanger, state, place)
            plain = _data(hanger, there, (), plan, made)
        step, left = _fitted(wanted.beyond(plain, sds), place, slopes)
        if plan.reality is not None and np.all(np.abs(step[:_BENDING]) < _BENT_STEP):
            break
        step = step[:_BENDING].clip(-_LONGEST_STEP, _LONGEST_STEP)
        place[:_BENDING] += step
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
    None where the strongest is smaller. With a reality the size is right to 2 %.
    """

    def beyond(number: int) -> float:
        found = _size_at(number / _SHARES, hanger, state, effect, plan)
        return math.log(found / size) if found > 0 else -math.inf

    low, high = (0, beyond(0)), (_SHARES, beyond(_SHARES))
    if low[1] >= 0:
        return at_share(0.0, hanger, effect)
    if high[1] < 0:
        return None
    near = 0.0 if plan.reality is None else _NEAR
    while high[0] - low[0] > 1:
        number = _between(low, high)
        found = (number, beyond(number))
        if abs(found[1]) < near:
            return at_share(number / _SHARES, hanger, effect)
        low, high = (found, high) if found[1] < 0 else (low, found)
    return at_share((low[0] + high[0]) / 2 / _SHARES, hanger, effect)


def _between(low: tuple[int, float], high: tuple[int, float]) -> int:
    """Where a line through two (number, value) would be 0, but in the inner three quarters."""
    wide = high[0] - low[0]
    rise = high[1] - low[1]
    share = -low[1] / rise if 0 < rise < math.inf else 0.5
    inner = min(max(share, 0.125), 0.875) if wide > 16 else share
    return min(max(low[0] + round(inner * wide), low[0] + 1), high[0] - 1)


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
    section, density, length, modulus = (
        float(getattr(hanger.scatter, each) * sds)
        for each, sds in zip(GLOBAL, place[1:_BENDING], strict=True)
    )
    tension = state.tension_n * float(np.exp(place[0]))
    return replace(state, tension_n=tension), Deviations(section, density, length, modulus)


def _only(name: str) -> Deviations:
    section, density, length, modulus = (_DIFFERENCE * (each == name) for each in GLOBAL)
    return Deviations(section, density, length, modulus)


@dataclass(frozen=True, eq=False)
class _Data:
    """Log frequencies (frequencies,) and shapes (shapes, components), largest component 1."""

    frequency: FloatArray
    shape: FloatArray

    def beyond(self, plain: _Data, sds: _Data) -> FloatArray:
        """How far these data are from plain ones, in standard deviations, (data,).

        A shape's length and sign are nobody's data.
        """
        own = np.linalg.norm(self.shape, axis=1)
        other = np.linalg.norm(plain.shape, axis=1)
        sign = np.where(np.sum(self.shape * plain.shape, axis=1) < 0, -1.0, 1.0)
        apart = self.shape * (sign * other / own)[:, None] - plain.shape
        frequency = (self.frequency - plain.frequency) / sds.frequency
        return np.concatenate([frequency, (apart / sds.shape).ravel()])


def sds_of(hanger: Hanger, state: HangerState, plan: CampaignPlan) -> _Data:
    """Standard deviations of log frequencies (frequencies,) and of shapes (shapes, 1)."""
    planes = [PLANES.index(plane) for plane in plan.planes]
    once = sd_factors(hanger, state, plan)[planes].ravel()
    factors = np.tile(once, len(plan.tests(hanger)))
    shapes = factors if plan.shapes else factors[:0]
    return _Data(plan.frequency_sd * factors, plan.shape_sd * shapes[:, None])


@lru_cache(maxsize=64)
def _baseline(hanger: Hanger, state: HangerState, plan: CampaignPlan) -> tuple[_Data, FloatArray]:
    """Data without effects, and their change (data, 5 and more) by one tension and by one standard
    deviation of each deviation, then of the section's waves and the errors of sensors.
    """
    sds = sds_of(hanger, state, plan)
    plain = _data(hanger, state, (), plan, Deviations())

    def slope(other: _Data, difference: float) -> FloatArray:
        return np.asarray(other.beyond(plain, sds) / difference)

    tauter = replace(state, tension_n=state.tension_n * (1 + _DIFFERENCE))
    slopes = [slope(_data(hanger, tauter, (), plan, Deviations()), _DIFFERENCE)]
    for each in GLOBAL:
        scatter = float(getattr(hanger.scatter, each))
        slopes.append(slope(_data(hanger, state, (), plan, _only(each)), _DIFFERENCE) * scatter)
    for made, sensors in _nuisances(hanger, plan):
        slopes.append(slope(_data(hanger, state, (), plan, made, sensors), _PART))
    return plain, np.array(slopes).T


def _nuisances(
    hanger: Hanger, plan: CampaignPlan
) -> Iterator[tuple[Deviations, tuple[SensorError, ...]]]:
    """A part of a standard deviation of each section's wave and of each error of a sensor."""
    reality = plan.reality
    if reality is None:
        return
    for own in np.eye(reality.section_waves) * _PART * wave_sd(reality):
        yield Deviations(section_waves=tuple(float(each) for each in own)), ()
    right = tuple(SensorError(place) for place in plan.places_m(hanger))
    for index, sensor in enumerate(right if plan.shapes else ()):
        gain = 1 + _PART * reality.gain_sd
        for wrong in (
            replace(sensor, gain=(gain, 1.0)),
            replace(sensor, gain=(1.0, gain)),
            replace(sensor, off_m=_PART * reality.place_sd_m),
            replace(sensor, turn_rad=_PART * reality.turn_sd_rad),
        ):
            yield Deviations(), (*right[:index], wrong, *right[index + 1 :])


def _data(
    hanger: Hanger,
    state: HangerState,
    effects: Sequence[PlantedEffect],
    plan: CampaignPlan,
    deviations: Deviations,
    sensors: Sequence[SensorError] = (),
) -> _Data:
    planes = [PLANES.index(plane) for plane in plan.planes]
    truth = CampaignTruth(state.tension_n, deviations, tuple(effects), sensors=tuple(sensors))
    frequencies, shapes = [], []
    for test in plan.tests(hanger):
        found = noiseless(hanger, state, truth, plan, test)
        frequencies.append(np.log(found.frequency_hz[planes]).ravel())
        seen = found.shape[planes] if plan.biaxial else _own(found.shape, planes)
        shapes.append(seen.reshape(len(planes) * plan.modes, -1))
    shape = np.concatenate(shapes)
    return _Data(np.concatenate(frequencies), shape if plan.shapes else shape[:0])


def _own(shape: FloatArray, planes: Sequence[int]) -> FloatArray:
    """The components in the modes' own planes."""
    return np.stack([shape[plane, ..., plane] for plane in planes])
