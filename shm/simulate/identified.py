"""Modes of one test as identification reports them: with noise and what it says of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.simulate.plan import CampaignPlan
from shm.simulate.planted import PlantedModes
from shm.values import NAN, PLANES, FloatArray, Hanger, Mode, ShapePoint


@dataclass(frozen=True, eq=False)
class _Stated:
    """Standard deviations that are stated, (planes, modes): frequencies' in Hz."""

    frequency_hz: FloatArray
    shape: FloatArray


def identified(
    true: PlantedModes,
    sd_factors: FloatArray,
    hanger: Hanger,
    plan: CampaignPlan,
    rng: np.random.Generator,
) -> tuple[Mode, ...]:
    """Modes of one test with noise; draws are made for both planes whatever is measured.

    `sd_factors` (planes, modes) are the standard deviations' over the plan's.
    """
    scatter = rng.standard_normal((2, *true.frequency_hz.shape))
    along = rng.standard_normal(true.shape.shape)
    if plan.reality is not None:
        rho = plan.reality.correlation(true.frequency_hz)
        scatter[0, 1] = rho * scatter[0, 0] + np.sqrt(1 - rho**2) * scatter[0, 1]
    noisy = PlantedModes(
        true.frequency_hz * (1 + plan.frequency_sd * sd_factors * scatter[0]),
        true.shape + plan.shape_sd * sd_factors[..., None, None] * along,
        true.damping_ratio * np.exp(plan.damping_sd * scatter[1]),
    )
    stated = _stated(noisy, sd_factors, plan, rng)
    places = plan.places_m(hanger)
    return tuple(
        _mode(noisy, stated, PLANES.index(plane), order, places, plan)
        for plane in plan.planes
        for order in range(plan.modes)
    )


def _stated(
    noisy: PlantedModes, sd_factors: FloatArray, plan: CampaignPlan, rng: np.random.Generator
) -> _Stated:
    """What the scatter of few hits says, where there is a reality; else the truth."""
    guess = np.ones((2, *sd_factors.shape))
    if plan.reality is not None:
        freedom = plan.reality.sd_freedom
        guess = np.sqrt(rng.chisquare(freedom, guess.shape) / freedom)
    return _Stated(
        plan.frequency_sd * sd_factors * guess[0] * noisy.frequency_hz,
        plan.shape_sd * sd_factors * guess[1],
    )


def _mode(
    noisy: PlantedModes,
    stated: _Stated,
    plane: int,
    order: int,
    places: Sequence[float],
    plan: CampaignPlan,
) -> Mode:
    damping = float(noisy.damping_ratio[plane, order])
    seen, sd = noisy.shape[plane, order], float(stated.shape[plane, order])
    return Mode(
        PLANES[plane],
        order + 1,
        float(noisy.frequency_hz[plane, order]),
        float(stated.frequency_hz[plane, order]) or NAN,
        damping,
        plan.damping_sd * damping or NAN,
        _shape(seen, plane, places, plan.biaxial, sd) if plan.shapes else (),
    )


def _shape(
    seen: FloatArray, plane: int, places: Sequence[float], biaxial: bool, sd: float
) -> tuple[ShapePoint, ...]:
    return tuple(
        ShapePoint(place, float(own[plane]), float(own[1 - plane]) if biaxial else NAN, sd or NAN)
        for place, own in zip(places, seen, strict=True)
    )
