"""The later part of ring-downs, of a hanger that at first does not ring as a bar does.

A guide with play knocks, a joint slips through, a crack opens: in the first seconds energy wanders
between the modes and no frequency is one. Once the swing has died away below what that takes, the
same hanger rings freely, and its frequencies are those of small amplitude.

Where it knocks little, modes are found all the same, but they do not ring down as modes do: in a
linear hanger a ring-down is y = sum of c exp(lambda t) from its beginning to its end. So poles
and amplitudes fitted to the later part foretell the beginning, whatever the law of what acts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.identify.contract import LEAST_HITS, Measurement, place_of, poles_of_modes
from shm.values import ComplexArray, FloatArray, Mode

LEFT_OUT = (1 / 4, 1 / 2, 3 / 4)
"""Shares of the ring-downs. Technical: each costs an identification; beyond, noise is left."""
_LOUDNESS = 0.05  # technical: share of a ring-down over which its level is taken
_PARTS, _FITTED_FROM = 8, 2
"""A ring-down in eighths, the first two of which are foretold from the others. Technical."""
_MIN_UNPREDICTED, _MAX_UNPREDICTED, _GROWTH = 0.05, 1.5, 12.0
"""Of the swing in the first eighth, what is not foretold, and how often that is what the later part
leaves. Of 97 awkward records with three hits and more (tests/worlds/recordings.py, seeds 7000 to
7006) one was astray, with sidebands; of bars of tests/benchmarks/gap_dynamics.py with a guide that
show modes at full level five of six (seeds 400 to 407, 500 to 507), of three sound ones none. Above
`_MOST_ASTRAY` the extrapolation fails, as it did of the sixth."""
_CALM = 2.0  # judgement: of what the later part leaves; noise alone scatters by less
_UNSURE = 0.3  # judgement: of a damping without standard deviation


def late_parts(measurements: Sequence[Measurement], left_out: float) -> tuple[Measurement, ...]:
    """Return the measurements without the beginnings of their ring-downs.

    Those of the same sensors count together, since what the force says of them went with the
    beginning.
    """
    whole = list(measurements)
    if len({tuple(place_of(point) for point in each.points) for each in measurements}) == 1:
        decays = tuple(decay for each in measurements for decay in each.decays)
        hits = tuple(hit for each in measurements for hit in each.hits)
        whole = [replace(measurements[0], decays=decays, hits=hits)]
    return tuple(
        replace(each, decays=tuple(_later(decay, left_out) for decay in each.decays), driven=())
        for each in whole
    )


def late_part_level(measurements: Sequence[Measurement], left_out: float) -> float:
    """Return the median fraction of its level that a ring-down has at its later part."""
    decays = [decay for each in measurements for decay in each.decays]
    left = [_loudness(_later(decay, left_out)) / _loudness(decay) for decay in decays]
    return float(np.median(left))


def _later(decay: FloatArray, left_out: float) -> FloatArray:
    return decay[:, int(left_out * decay.shape[1]) :]


def _loudness(decay: FloatArray) -> float:
    samples = max(1, int(_LOUDNESS * decay.shape[1]))
    return float(np.sqrt(np.mean(decay[:, :samples] ** 2))) or np.finfo(float).tiny


def linear_below_level(measurements: Sequence[Measurement], modes: Sequence[Mode]) -> float:
    """Return the median fraction of level below which a ring-down is a sum of `modes`.

    1 where it is one from its beginning on, and where fewer than three hits show it.
    """
    hit = [each for each in measurements if each.driven]
    known = all(mode.damping_ratio > 0 and mode.frequency_sd_hz > 0 for mode in modes)
    if not known or sum(len(each.decays) for each in hit) < LEAST_HITS:
        return 1.0
    for refine in (False, True):
        found = [_unpredicted(each, modes, refine) for each in hit]
        unpredicted, level = (np.concatenate(each) for each in zip(*found, strict=True))
        least = unpredicted[:, _FITTED_FROM:].min(axis=1)
        first, growth = np.median(unpredicted[:, 0]), np.median(unpredicted[:, 0] / least)
        if not first > _MIN_UNPREDICTED:
            return 1.0
    if not (first < _MAX_UNPREDICTED and growth > _GROWTH):
        return 1.0
    calm = np.median(unpredicted, axis=0) < _CALM * np.median(least)
    return float(np.median(level, axis=0)[calm.argmax()])


def _unpredicted(
    measurement: Measurement, modes: Sequence[Mode], refine: bool
) -> tuple[FloatArray, FloatArray]:
    """Return the unpredicted fraction of each part's swing, and its size over the first part's.

    The later part predicts the others; both are (decays, parts). Swings are displacements: they
    close a gap.
    """
    rate = measurement.sampling_rate_hz
    omega = 2 * np.pi * np.array([mode.frequency_hz for mode in modes])
    damping = np.array([mode.damping_ratio for mode in modes])
    poles = poles_of_modes(modes) - 1 / measurement.decay_time_constant_s
    if refine:
        real = np.array([(mode.damping_sd, mode.frequency_sd_hz) for mode in modes])
        decay_sd = omega * np.where(real[:, 0] > 0, real[:, 0], _UNSURE * damping)
        sd = np.concatenate([decay_sd, 2 * np.pi * real[:, 1]])
        poles = poles + _correction(measurement.decays, poles, sd, rate)
    rows = [_swings(decay, poles, rate) for decay in measurement.decays]
    rest, whole = (np.array(each) for each in zip(*rows, strict=True))
    return rest / whole, whole / whole[:, :1]


def _swings(decay: FloatArray, poles: ComplexArray, rate: float) -> tuple[FloatArray, FloatArray]:
    """Return the unpredicted and the full swing of each part, both (parts,)."""
    size = decay.shape[1] // _PARTS
    later = slice(_FITTED_FROM * size, None)
    columns = _columns(decay.shape[1], poles, rate, _FITTED_FROM * size)
    rest = decay - (columns @ np.linalg.lstsq(columns[later], decay[:, later].T, 1e-8)[0]).T
    heard = np.exp(-1j * np.outer(poles.imag, np.arange(size) / rate)) * np.hanning(size)
    heard = heard / poles.imag[:, None] ** 2
    parts = [slice(part * size, (part + 1) * size) for part in range(_PARTS)]
    return (
        np.array([np.linalg.norm(heard @ rest[:, part].T) for part in parts]),
        np.array([np.linalg.norm(heard @ decay[:, part].T) for part in parts]),
    )


def _columns(samples: int, poles: ComplexArray, rate: float, zero: int) -> FloatArray:
    wave = np.exp(np.outer((np.arange(samples) - zero) / rate, poles))
    return np.hstack([wave.real, -wave.imag])


def _correction(
    decays: Sequence[FloatArray], poles: ComplexArray, sd: FloatArray, rate: float
) -> ComplexArray:
    """Return one Gauss-Newton step towards the poles of the later parts.

    `sd` (2 poles,) are the standard deviations of their real and imaginary parts as identified.
    """
    count = len(poles)
    square, right, left, free = np.zeros((2 * count, 2 * count)), np.zeros(2 * count), 0.0, 0
    for decay in decays:
        zero = _FITTED_FROM * (decay.shape[1] // _PARTS)
        later = decay[:, zero:]
        wave = _columns(later.shape[1], poles, rate, 0)
        base, size, _ = np.linalg.svd(wave / np.linalg.norm(wave, axis=0), full_matrices=False)
        base = base[:, size > 1e-6 * size[0]]
        found = np.linalg.lstsq(wave, later.T, 1e-8)[0]
        rest = later.T - wave @ found
        left, free = left + float(np.sum(rest**2)), free + rest.size
        grown = (wave[:, :count] - 1j * wave[:, count:]) * np.arange(len(wave))[:, None] / rate
        for channel in range(len(decay)):
            slope = grown * (found[:count, channel] + 1j * found[count:, channel])
            real = np.hstack([slope.real, -slope.imag])
            real = real - base @ (base.T @ real)
            square += real.T @ real
            right += real.T @ rest[:, channel]
    step = np.linalg.solve(square / (left / free) + np.diag(sd**-2.0), right / (left / free))
    return np.asarray(step[:count] + 1j * step[count:])
