"""What goes wrong with the hammer: the blows themselves, and when the record begins and ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.simulate.disturbances.base import Planted, Scene
from shm.simulate.response import Schedule, Strike

_LEAST_GAP_S = 0.6  # blows closer than half a second are one swing of the hammer


def double_hit(made: Schedule, scene: Scene, rng: np.random.Generator) -> tuple[Schedule, Planted]:
    """A second, lighter blow 15 to 200 ms after one hit."""
    hit = int(rng.integers(len(made.strikes)))
    bounced = replace(
        made.strikes[hit], rebound_s=rng.uniform(0.015, 0.2), rebound_share=rng.uniform(0.1, 0.6)
    )
    return _with(made, hit, bounced), Planted("double_hit", (hit,))


def soft_hit(made: Schedule, scene: Scene, rng: np.random.Generator) -> tuple[Schedule, Planted]:
    """All blows through a soft tip: 20 to 30 ms long, so their force ends below 75 Hz."""
    seconds = rng.uniform(0.020, 0.030)
    strikes = tuple(replace(strike, seconds=seconds) for strike in made.strikes)
    return replace(made, strikes=strikes), Planted("soft_hit", tuple(range(len(strikes))))


def outlier_hit(made: Schedule, scene: Scene, rng: np.random.Generator) -> tuple[Schedule, Planted]:
    """One hit elsewhere, in another direction, or while somebody holds the hanger."""
    hit = int(rng.integers(len(made.strikes)))
    odd = (_elsewhere, _aslant, _held)[int(rng.integers(3))](made.strikes[hit], scene, rng)
    return _with(made, hit, odd), Planted("outlier_hit", (hit,))


def _elsewhere(strike: Strike, scene: Scene, rng: np.random.Generator) -> Strike:
    length_m = scene.state.effective_length_m(scene.hanger)
    upward = strike.x_m < 0.4 * length_m
    moved = rng.uniform(0.15, 0.3) * length_m
    return replace(strike, x_m=strike.x_m + moved if upward else strike.x_m - moved)


def _aslant(strike: Strike, scene: Scene, rng: np.random.Generator) -> Strike:
    return replace(strike, angle_deg=strike.angle_deg + rng.uniform(60.0, 120.0))


def _held(strike: Strike, scene: Scene, rng: np.random.Generator) -> Strike:
    return replace(strike, damping_ratio=scene.state.damping_ratio + rng.uniform(0.01, 0.03))


def no_pre_trigger(
    made: Schedule, scene: Scene, rng: np.random.Generator
) -> tuple[Schedule, Planted]:
    """The record begins within the pulse of its first hit."""
    first = made.strikes[0]
    begin_s = first.start_s + rng.uniform(0.2, 0.7) * first.seconds
    return replace(made, begin_s=begin_s), Planted("no_pre_trigger", (0,))


def cut_off(made: Schedule, scene: Scene, rng: np.random.Generator) -> tuple[Schedule, Planted]:
    """The record ends too early after the last hit, or the next hit comes too soon."""
    gap_s = max(_LEAST_GAP_S, rng.uniform(0.03, 0.12) * scene.plan.seconds_per_hit)
    last = len(made.strikes) - 1
    if last == 0 or rng.random() < 0.5:
        end_s = made.strikes[last].start_s + gap_s
        return replace(made, end_s=min(end_s, made.end_s)), Planted("cut_off", (last,))
    hit = int(rng.integers(last))
    hurried = replace(made.strikes[hit + 1], start_s=made.strikes[hit].start_s + gap_s)
    return _with(made, hit + 1, hurried), Planted("cut_off", (hit,))


def noise_only(made: Schedule, scene: Scene, rng: np.random.Generator) -> tuple[Schedule, Planted]:
    """Nobody hit."""
    return replace(made, strikes=()), Planted("noise_only")


def _with(made: Schedule, hit: int, strike: Strike) -> Schedule:
    strikes = (*made.strikes[:hit], strike, *made.strikes[hit + 1 :])
    return replace(made, strikes=strikes)
