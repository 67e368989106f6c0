"""Frequencies of a bar on which something acts for a part of each mode's time only."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from shm.simulate.bar.description import Bar
from shm.simulate.bar.parts import Beyond, Ringing
from shm.simulate.bar.shapes import BarModes
from shm.values import FloatArray

_MEAN_RINGING = 0.757  # of n/(n + 1) for n from 1 to 8
_BEND_OVER = 1e-3  # of the length: the second difference of a shape


def alternatives(bar: Bar) -> Iterator[Bar]:
    """The bar without what acts part-time, then with each of these for good."""
    plain = replace(bar, part_time=())
    yield plain
    for each in bar.part_time:
        yield replace(
            plain,
            tension_n=bar.tension_n * (1 + each.tension_change),
            stretches=bar.stretches + each.stretches,
            springs=bar.springs + each.springs,
        )


def with_part_time(
    bar: Bar, own: tuple[BarModes, BarModes], others: Sequence[tuple[BarModes, BarModes]]
) -> tuple[BarModes, BarModes]:
    """The bar's own modes, each period moved towards that with what acts part-time."""
    transverse, longitudinal = (
        _moved(bar, own[plane], plane, [other[plane] for other in others]) for plane in (0, 1)
    )
    return transverse, longitudinal


def _moved(bar: Bar, own: BarModes, plane: int, others: Sequence[BarModes]) -> BarModes:
    period = 1 / own.angular_frequency_rad_s
    added = np.zeros_like(period)
    for each, other in zip(bar.part_time, others, strict=True):
        part = _ringing(own) if isinstance(each.when, Ringing) else _beyond(own, plane, each.when)
        added += part * (1 / other.angular_frequency_rad_s - period)
    return replace(own, angular_frequency_rad_s=1 / (period + added))


def _ringing(own: BarModes) -> FloatArray:
    """As in `Ringing`, (modes,)."""
    frequency = own.angular_frequency_rad_s
    return np.asarray(frequency / (frequency + frequency[0]) / _MEAN_RINGING)


def _beyond(own: BarModes, plane: int, when: Beyond) -> FloatArray:
    """As in `Beyond`, (modes,)."""
    step = _BEND_OVER * (own.nodes_m[-1] - own.nodes_m[0])
    before, here, after = own.at((when.x_m - step, when.x_m, when.x_m + step))[:, plane]
    moved = np.abs((before - 2 * here + after) / step**2 if when.curvature else here)
    most = moved / own.angular_frequency_rad_s
    reach = np.maximum(most / most.max(), 1e-9) if most.max() > 0 else np.full_like(most, 1e-9)
    part = np.arccos(np.minimum(1.0, when.threshold / reach)) / np.pi
    return np.asarray(2 * part if when.both_sides else part)
