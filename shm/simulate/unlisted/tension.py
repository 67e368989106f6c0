"""Tension that is not the same in all that a campaign measures."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import replace

from shm.simulate.bar.description import Bar
from shm.simulate.effects.base import Range, Scene, Where
from shm.values import Hanger

Values = Mapping[str, float]


def between_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"tension_change": Range(1e-5, 0.1, 0.0, logarithmic=True, signed=True)}


def between(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Traffic came or went between the hits along and across the bridge."""
    own = bar.tension_share
    return replace(bar, tension_share=(own[0], own[1] * (1 + values["tension_change"])))


def wandering_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {
        "tension_scatter": Range(1e-5, 0.1, 0.0, logarithmic=True),
        "phase": Range(0.0, 1.0),
    }


def wandering(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Each test finds another load on the bridge, whatever its temperature and level.

    The tests' names and `phase` decide where in a sine of `tension_scatter` root mean square each
    falls, so that the same campaign is the same again.
    """
    named = zlib.crc32(scene.conditions.test.encode()) / 2**32
    load = math.sqrt(2) * math.sin(2 * math.pi * (named + values["phase"]))
    return replace(bar, tension_n=bar.tension_n * (1 + values["tension_scatter"] * load))
