"""Errors that repeat in every mode and test, of sensors, of the section along the bar and of known
masses; scale, sign and direction of mode shapes.

A sensor's gain is a little off, it sits some millimetres from where it should, is turned a little
and reads some of one axis in the other; a rolled bar is here and there a little thicker than on
average; a known mass is a body, a little longer or shorter than usual. None of these is a gap, yet
no repetition averages them out. They are normal and small, so that what one standard deviation of
each does to the data (its load) is all there is to know of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
import scipy

from shm.gap.hypotheses.contract import Design, Observations
from shm.models.hanger import PhysicalHanger, Zone, solve
from shm.values import BoolArray, FloatArray, Hanger, IntArray

# Technical: four stretches within the reach of 1 m at 12 m; differences where all is linear; loads
# that no datum feels, and ways that hold less than 1e-4 of the variance, are left out.
STRETCHES = 48
_STRETCH_CHANGE, _STEP_SHARE, _LEAST_LOAD, _LEAST_SHARE = 0.01, 1e-4, 1e-9, 1e-4
_NOWHERE = np.empty(0)

Predict = Callable[[Design], FloatArray]
"""The data (data,) that the baseline, near the measured ones, predicts of another design."""


SensorError: TypeAlias = tuple[Literal["gain", "place", "turn", "cross"], int, int]
"""What a sensor errs in, the index of its place, and the component (of a gain; else 0)."""


@dataclass(frozen=True, eq=False)
class Repeated:
    """Loads of what repeats.

    `section` (F, k) is that of the section along the bar, `tensions` (F, tests) that of each test's
    tension and `masses` (F, k) that of known masses whose radius of gyration nobody states, all of
    frequencies; `sensors` (S, l) is that of shapes, with those of
    modes that may be turned, which do not repeat (`turn_loads`); its first are those of
    `sensor_errors`.
    """

    section: FloatArray
    tensions: FloatArray
    masses: FloatArray
    sensors: FloatArray
    sensor_errors: tuple[SensorError, ...] = ()

    @classmethod
    def none(cls, design: Design) -> Repeated:
        nothing = np.zeros((design.frequencies, 0))
        return cls(nothing, nothing, nothing, np.zeros((len(design.shape_mode), 0)))

    @property
    def loads(self) -> FloatArray:
        """Of all data (data, k): sensors move no frequency, the others no shape."""
        return np.asarray(scipy.linalg.block_diag(self.of_frequencies, self.sensors))

    @property
    def frequency(self) -> FloatArray:
        """Covariance (F, F) of the frequencies' logarithms."""
        return np.asarray(self.of_frequencies @ self.of_frequencies.T)

    @property
    def of_frequencies(self) -> FloatArray:
        """Return the loads (F, k) of frequencies."""
        return np.hstack([self.section, self.tensions, self.masses])


def section_loads(design: Design, physical: PhysicalHanger, hanger: Hanger) -> FloatArray:
    """Return loads (F, k) of a section that varies along the bar and is not quite round.

    It varies about its mean. `physical` holds `STRETCHES + 2` hangers alike. Mass goes with the
    section, bending stiffness with its square; what one plane gains by a section that is not round,
    the other loses.
    """
    edges_m = np.linspace(0.0, hanger.length_m, STRETCHES + 1)
    influence = _influence(physical, edges_m, int(design.frequency_order.max()))
    influence = influence[design.frequency_plane, design.frequency_order - 1]
    reach_m = hanger.assumptions.section_reach_m.value
    ways = section_ways(hanger.length_m, hanger.scatter.along, reach_m)
    side = np.array([1.0, -1.0])[design.frequency_plane]
    oval = hanger.assumptions.out_of_round_sd.value * side * influence[:, -1]
    return np.column_stack([influence[:, :-1] @ ways, oval])


def section_ways(length_m: float, sd: float, reach_m: float) -> FloatArray:
    """The independent ways (STRETCHES, k) in which a section varies, as fractions of its mean.

    One standard deviation of each (Karhunen and Loeve); `sd` is that of all together, the root mean
    square along the bar. `reach_m` is the standard deviation of the distance, in which the
    covariance is normal. The mean is one of the bar's deviations and no business of this.
    """
    place_m = np.arange(STRETCHES) * length_m / STRETCHES
    apart = np.subtract.outer(place_m, place_m) / reach_m
    centring = np.eye(STRETCHES) - 1 / STRETCHES
    covariance = centring @ np.exp(-(apart**2) / 2) @ centring
    variance, ways = np.linalg.eigh(covariance * STRETCHES / np.trace(covariance))
    significant = variance > _LEAST_SHARE * variance.sum()
    return np.asarray(sd * ways[:, significant] * np.sqrt(variance[significant]))


def _influence(physical: PhysicalHanger, edges_m: FloatArray, orders: int) -> FloatArray:
    """Return changes (planes, orders, stretches + 1) of log frequencies by each stretch's section.

    The last is that by the bending stiffness of the whole bar.
    """
    start_m, end_m = np.append(edges_m[:-1], [0.0, 0.0]), np.append(edges_m[1:], edges_m[[-1, 0]])
    larger, stretches = 1 + _STRETCH_CHANGE, len(edges_m) - 1
    bending = np.append(np.full(stretches, larger**2), [larger, 1.0])
    mass = np.append(np.full(stretches, larger), [1.0, 1.0])
    thick = Zone(start_m, end_m, bending, mass)
    found = solve(replace(physical, zones=(*physical.zones, thick)), orders, _NOWHERE, shapes=False)
    log = np.log(found.frequency_hz)
    return np.asarray(np.moveaxis(log[:-1] - log[-1], 0, 2) / _STRETCH_CHANGE)


def sensor_loads(
    observations: Observations, predict: Predict, hanger: Hanger
) -> tuple[FloatArray, tuple[SensorError, ...]]:
    """Loads (S, k) of every channel's gain, every sensor's place, and every biaxial sensor's turn
    and cross-axis sensitivity, and which they are.

    Two axes' cross sensitivities are their mean and half their difference, which is a turn.
    Measured shapes say what all but a place do to them, the shapes that the baseline predicts what
    that does. All are taken along the shapes' scaling, which hides a part of them.
    """
    design, usual = observations.design, hanger.scatter
    place, component = design.shape_place, design.shape_component
    if not len(place):
        return np.zeros((0, 0)), ()
    value = observations.value[design.frequencies :]
    channel, sensor = np.unique(2 * place + component), np.unique(place)
    of_channel = (2 * place + component)[:, None] == channel
    of_sensor = place[:, None] == sensor
    slopes = _slopes(observations, predict, hanger.length_m)
    other, sign = quarter_turn(design)
    turned = -usual.sensor_turn * sign * value[other]
    cross = np.abs(sign) * value[other]
    raw = np.column_stack(
        [
            usual.sensor_gain * value[:, None] * of_channel,
            usual.sensor_place_m * slopes[:, None] * of_sensor,
            turned[:, None] * of_sensor,
            usual.sensor_cross_mean * cross[:, None] * of_sensor,
        ]
    )
    names: list[SensorError] = [("gain", each // 2, each % 2) for each in channel.tolist()]
    names += [("place", each, 0) for each in sensor.tolist()]
    names += [("turn", each, 0) for each in sensor.tolist()]
    names += [("cross", each, 0) for each in sensor.tolist()]
    loads = _remove_scaling(observations, raw)
    felt = np.abs(loads).max(axis=0) > _LEAST_LOAD
    return np.asarray(loads[:, felt]), tuple(n for n, f in zip(names, felt, strict=True) if f)


def _slopes(observations: Observations, predict: Predict, length_m: float) -> FloatArray:
    """Return slopes (S,) of the baseline's shapes along the bar, at the size of those measured.

    0 of a shape that has nodes at all its places: what is measured there is noise.
    """
    design = observations.design
    count = len(design.places_m)
    step_m = np.where(np.array(design.places_m) < length_m / 2, 1.0, -1.0) * _STEP_SHARE * length_m
    extended = replace(
        design,
        places_m=(*design.places_m, *(np.array(design.places_m) + step_m).tolist()),
        shape_mode=np.repeat(design.shape_mode, 2),
        shape_place=np.stack([design.shape_place, design.shape_place + count], axis=1).ravel(),
        shape_component=np.repeat(design.shape_component, 2),
    )
    here, there = predict(extended)[design.frequencies :].reshape(-1, 2).T
    scaling = ShapeScaling.measured(observations)
    value = observations.value[design.frequencies :]
    along, size = (
        np.bincount(scaling.shape, scaling.weight * here * each)[scaling.shape]
        for each in (value, here)
    )
    is_seen = size > _LEAST_LOAD
    scale = np.divide(along, size, out=np.zeros_like(size), where=is_seen)
    return np.asarray((there - here) / step_m[design.shape_place] * scale)


def _remove_scaling(observations: Observations, raw: FloatArray) -> FloatArray:
    """Changes (S, k) of shapes without what scaling to unit length takes back."""
    scaling = ShapeScaling.measured(observations)
    value = observations.value[observations.design.frequencies :]
    shapes = int(scaling.shape.max()) + 1
    weighted = (scaling.shape == np.arange(shapes)[:, None]) * (scaling.weight * value)
    length = weighted @ value
    return np.asarray(raw - value[:, None] * ((weighted @ raw) / length[:, None])[scaling.shape])


@dataclass(frozen=True, eq=False)
class ShapeScaling:
    """Scale the shapes of a design and turn them. All fields are (S,).

    `shape` counts the shapes from 0 and goes up, `weight` is that of a component in its shape's
    length, `reference` is what a component is compared with for the sign. Shapes that are
    `is_turned` swing in a direction of their own, by the quarter turn `across`.
    """

    shape: IntArray
    weight: FloatArray
    reference: FloatArray
    across: tuple[IntArray, FloatArray]
    is_turned: BoolArray

    @classmethod
    def measured(cls, observations: Observations) -> ShapeScaling:
        """To lengths weighted by certainty, as measured ones have, and to their signs."""
        design = observations.design
        shape = _counted(design)
        precision = 1 / observations.sd[design.frequencies :] ** 2
        mean = np.bincount(shape, precision) / np.bincount(shape)
        value = observations.value[design.frequencies :]
        weight, turned = precision / mean[shape], observations.is_turned
        return cls(shape, weight, weight * value, quarter_turn(design), turned)

    @classmethod
    def of(cls, design: Design, length_m: float) -> ShapeScaling:
        """To unit length, and to the sign of sin(order pi x/L) in the mode's plane."""
        mode, axis = design.shape_mode, design.shape_component
        x_m = np.array(design.places_m)[design.shape_place]
        sine = np.sin(design.frequency_order[mode] * np.pi * x_m / length_m)
        reference = np.where(design.frequency_plane[mode] == axis, sine, 0.0)
        none = np.zeros(len(mode), dtype=bool)
        return cls(_counted(design), np.ones(len(mode)), reference, quarter_turn(design), none)

    def scaled(self, raw: FloatArray) -> FloatArray:
        """Return shapes (n, S) scaled; those that turn also in the reference's direction.

        From these the turn is subtracted as an arc. So what is left of a measured shape is its
        angle to the plane, however large, times what a small turn adds to it (`turn_loads`).
        """
        if raw.shape[1] == 0:
            return raw
        length = np.sqrt(self._sum(raw**2 * self.weight))
        factor = np.where(self._sum(raw * self.reference) < 0, -1.0, 1.0)
        shape = raw * (factor / np.maximum(length, np.finfo(float).tiny))[:, self.shape]
        if not self.is_turned.any():
            return np.asarray(shape)
        other, sign = self.across
        across = sign * shape[:, other]
        angle = np.arctan2(self._sum(across * self.reference), self._sum(shape * self.reference))
        angle = np.where(self.is_turned, angle[:, self.shape], 0.0)
        arc = angle * sign * (self.reference / self.weight)[other]
        return np.asarray(np.cos(angle) * shape + np.sin(angle) * across - arc)

    def _sum(self, values: FloatArray) -> FloatArray:
        """Return the sums (n, shapes) of values (n, S) over the components of each shape."""
        begins = np.flatnonzero(np.diff(self.shape, prepend=-1))
        return np.asarray(np.add.reduceat(values, begins, axis=1))


def quarter_turn(design: Design) -> tuple[IntArray, FloatArray]:
    """Return the other component at each component's place, and its sign in a quarter turn.

    A turn is from the transverse axis to the longitudinal one. Both are (S,); 0 for the sign where
    only one axis is measured. A small turn adds as much by the radian.
    """
    keys = list(zip(design.shape_mode.tolist(), design.shape_place.tolist(), strict=True))
    axes = design.shape_component
    at = {(key, axis): row for row, (key, axis) in enumerate(zip(keys, axes.tolist(), strict=True))}
    rows = [at.get((key, 1 - axis), -1) for key, axis in zip(keys, axes.tolist(), strict=True)]
    other = np.array(rows, dtype=np.int64)
    return other, np.where(other < 0, 0.0, np.where(axes == 0, -1.0, 1.0))


def turn_loads(observations: Observations) -> FloatArray:
    """Return loads (S, k) of turns: one of each mode that turns by itself, two of all modes."""
    design, turned = observations.design, observations.is_turned
    if observations.turns is None or not turned.any():
        return np.zeros((len(turned), 0))
    mode, value = design.shape_mode, observations.value[design.frequencies :]
    other, sign = quarter_turn(design)
    own, *common = np.where(turned, sign * value[other] * observations.turns[mode].T, 0.0)
    each = mode[:, None] == np.unique(mode[turned])
    return np.column_stack([own[:, None] * each, *common])


def _counted(design: Design) -> IntArray:
    """The shapes' numbers (S,) from 0; components of a shape stand together in a design."""
    return np.asarray(np.unique(design.shape_mode, return_inverse=True)[1])
