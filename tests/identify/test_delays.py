"""Channels that are late by tau turn the phases of a mode's real shape by -2 pi f tau."""

from __future__ import annotations

import numpy as np
import pytest

from shm.identify import IdentifyOptions, identify
from shm.identify.estimation.delays import delays_s, remove_delays
from shm.identify.estimation.poles import Candidate, Pole, PoleSet
from shm.identify.estimation.shapes import collinearity
from shm.values import Channel, FloatArray, Hanger, Recording

OPTIONS = IdentifyOptions(2.0, 100.0)
LATE_S = np.array([0.0, 1e-3, 2e-3, 3e-3])
"""Of a converter that goes through four channels at 250 Hz."""
FREQUENCIES_HZ = np.array([6.0, 13.0, 21.0, 34.0, 47.0, 62.0, 78.0, 95.0])


def _candidates(late_s: FloatArray, noise: float = 0.0, modes: int = 8) -> list[Candidate]:
    rng = np.random.default_rng(3)
    found = []
    for hz in FREQUENCIES_HZ[:modes]:
        shape = rng.standard_normal(len(late_s)) * np.exp(-2j * np.pi * hz * late_s)
        shape = shape + noise * (rng.standard_normal((2, len(late_s))).T @ [1, 1j])
        track = (Pole(20, float(hz), 0.002, shape / np.linalg.norm(shape)),)
        found.append(Candidate(track, track))
    return found


def test_delays_are_found_and_taken_off() -> None:
    candidates = _candidates(LATE_S, noise=0.01)
    found = delays_s(candidates, OPTIONS)
    assert found is not None
    assert found - found[0] == pytest.approx(LATE_S, abs=1e-4)
    assert min(collinearity(each.poles[-1].shape) for each in candidates) < 0.5
    shapes = np.array([each.poles[-1].shape for each in candidates]).T
    real = remove_delays(PoleSet(20, FREQUENCIES_HZ, 0 * FREQUENCIES_HZ, shapes), found)
    assert collinearity(real.shapes.T).min() > 0.99


SHAPES = np.sin(np.outer(np.arange(1, 9), [0.3, 0.6, 0.9, 1.2]))


def _late_record(late_s: FloatArray) -> Recording:
    """Return three hits at 256 Hz on a structure of eight modes, each channel late."""
    rate_hz, slot_s, hits = 256.0, 5.0, 3
    rng = np.random.default_rng(4)
    t = np.arange(int(hits * slot_s * rate_hz)) / rate_hz
    motion = 1e-3 * rng.standard_normal((4, len(t)))
    force = 0.1 * rng.standard_normal(len(t))
    for begin_s in 0.4 + slot_s * np.arange(hits):
        first = int(begin_s * rate_hz)
        force[first : first + 2] += 1000.0
        for channel, delay_s in enumerate(late_s):
            since = np.maximum(t - begin_s - delay_s, 0)
            for hz, shape in zip(FREQUENCIES_HZ, SHAPES, strict=True):
                ring = np.exp(-2 * np.pi * hz * 0.004 * since) * np.sin(2 * np.pi * hz * since)
                motion[channel] += shape[channel] * ring
    channels = [Channel("force", "force", force, None, 1.0)] + [
        Channel(f"acc_{row}", "acceleration", values, "transverse", 1.0 + row)
        for row, values in enumerate(motion)
    ]
    return Recording("late.csv", tuple(channels), rate_hz)


def _notes(late_s: FloatArray) -> str:
    record = _late_record(late_s)
    found = identify([record], OPTIONS, test_id="t", hanger=Hanger.without_model(1))
    return " ".join(found.notes)


def test_a_channel_that_is_late_by_more_than_a_sample_is_named() -> None:
    assert "acc_2 is 4.5 ms late" in _notes(np.array([0.0, 0.0, 4.5e-3, 0.0]))
    assert " late, " not in _notes(LATE_S)


def test_modes_of_late_channels_are_not_dropped_and_keep_their_shapes() -> None:
    """Three of the eight would have shapes that are not real."""
    record, structure = _late_record(LATE_S), Hanger.without_model(1)
    found = identify([record], OPTIONS, test_id="t", hanger=structure).test.modes
    assert np.array([m.frequency_hz for m in found]) == pytest.approx(FREQUENCIES_HZ, rel=1e-3)
    for mode, shape in zip(found, SHAPES, strict=True):
        values = np.array([point.value for point in mode.shape])
        assert (values @ shape) ** 2 / (values @ values) / (shape @ shape) > 0.99
