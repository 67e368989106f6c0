"""How a simulated campaign departs from the textbook, so that nobody inverts his own model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from shm.simulate.bar import bar_modes, bar_of
from shm.simulate.state import HangerState
from shm.values import FloatArray, Hanger

if TYPE_CHECKING:
    from shm.simulate.plan import CampaignPlan

_HIT = 0.16  # of the length, where a hammer reaches
_LEAST_SD, _MOST_SD = 0.5, 4.0
_MERGED = 0.004  # of the frequency: peaks so close overlap, twice the bandwidth at 0.1 % damping


@dataclass(frozen=True)
class Reality:
    """What no description of a hanger and no textbook effect holds.

    - `own_laws`: effects follow laws of their own (`shm.simulate.effects.laws`), not the
      catalogue's, with parameters that mean the same.
    - `section_sd`: the bar's area varies along it, rms as a fraction: hot-rolled rounds of 100 mm
      may be off by 1.3 mm of diameter (EN 10060), mostly the same all along a bar; 0.1 % of the
      area is 0.05 mm of diameter. It is a sum of `section_waves` cosines along the bar.
    - `gain_sd`: calibration of each channel, constant in a campaign: accelerometers are calibrated
      to 1 % with a coverage of 2 standard deviations (ISO 16063-21).
    - `place_sd_m`: along the bar, of each sensor: what a tape and a magnet's width give.
    - `turn_sd_deg`: about the bar's axis, of each sensor: what a bubble level on a round bar gives.
    - `sd_freedom`: identification estimates its standard deviations with so many degrees of
      freedom, those of some five hits in four channels.
    - `plane_correlation`: of the errors of two planes' frequencies that coincide, whose peaks
      overlap in both axes of each sensor; less the farther they are apart.

    Standard deviations differ by mode, larger where hammer or sensors sit near a node.
    """

    own_laws: bool = True
    section_sd: float = 0.001
    section_waves: int = 4
    gain_sd: float = 0.005
    place_sd_m: float = 0.003
    turn_sd_deg: float = 0.3
    sd_freedom: int = 20
    plane_correlation: float = 0.3

    @property
    def turn_sd_rad(self) -> float:
        return math.radians(self.turn_sd_deg)

    def correlation(self, frequency_hz: FloatArray) -> FloatArray:
        """Of the errors of both planes' frequencies (planes, modes), (modes,)."""
        apart = (frequency_hz[0] - frequency_hz[1]) / (_MERGED * frequency_hz.mean(axis=0))
        return np.asarray(self.plane_correlation / (1 + apart**2))


@lru_cache(maxsize=64)
def sd_factors(hanger: Hanger, state: HangerState, plan: CampaignPlan) -> FloatArray:
    """Each mode's standard deviations over the plan's, (planes, modes); all 1 without a reality.

    The median is about 1: in proportion to what the modes of the bar as described move at the
    hammer and, in the root mean square, at the sensors.
    """
    if plan.reality is None:
        return np.ones((2, plan.modes))
    length = state.effective_length_m(hanger)
    places = (_HIT * length, *(place for place in plan.places_m(hanger) if place < length))
    found = bar_modes(bar_of(hanger, state), plan.modes, places)
    moved = np.array([own.at(places)[:, plane] for plane, own in enumerate(found)])
    seen = np.abs(moved[:, 0]) * np.sqrt(np.mean(moved[:, 1:] ** 2, axis=1))
    least = np.median(seen) / _MOST_SD
    factors = np.median(seen) / np.maximum(seen, least)
    return np.asarray(np.clip(factors, _LEAST_SD, _MOST_SD))
