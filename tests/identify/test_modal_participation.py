"""Amplitudes and residues of modes that are planted with unit modal mass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify import IdentifyOptions
from shm.identify.contract import FoundMode, Measurement
from shm.identify.measuring.setups import measure_recordings
from shm.identify.setup_merging.modal_participation import levels, ringing
from shm.values import FloatArray
from tests.identify.signals import PULSE_S, Planted, hanger_modes, recording

OPTIONS = IdentifyOptions(2.0, 50.0)
PLANTED = hanger_modes(10.0)
RECORD = recording(PLANTED, hits=4, seconds=5.0)


def _modes(planted: list[Planted]) -> list[FoundMode]:
    nothing = np.empty(0)
    return [FoundMode(m.frequency_hz, 0.0, m.damping_ratio, 0.0, nothing, nothing) for m in planted]


def _residues(planted: list[Planted]) -> FloatArray:
    return np.array([m.drive * np.array(m.shape) for m in planted]).T


def _with_unused(measurement: Measurement, number: int) -> Measurement:
    """Return the measurement with one hit left out."""

    def rest(parts: tuple[FloatArray, ...]) -> tuple[FloatArray, ...]:
        return parts[:number] + parts[number + 1 :]

    hits = list(measurement.hits)
    hits[number] = replace(hits[number], used=False)
    return replace(
        measurement,
        hits=tuple(hits),
        decays=rest(measurement.decays),
        driven=rest(measurement.driven),
    )


def test_residues_are_shape_at_the_sensor_times_shape_at_the_hammer() -> None:
    """Each of four hits says so, though the one before still rings with up to 0.7 of its level."""
    found = ringing(measure_recordings([RECORD], OPTIONS)[0], _modes(PLANTED)).residue
    expected = np.broadcast_to(_residues(PLANTED), found.shape)
    np.testing.assert_allclose(found, expected, atol=0.02)


def test_after_a_hit_that_is_not_used_the_next_says_nothing() -> None:
    measurement = _with_unused(measure_recordings([RECORD], OPTIONS)[0], 1)
    found = ringing(measurement, _modes(PLANTED)).residue
    assert np.isnan(found).all(axis=(1, 2)).tolist() == [False, True, False]
    np.testing.assert_allclose(found[2], _residues(PLANTED), atol=0.02)


def test_where_every_used_hit_follows_another_rest_is_assumed() -> None:
    measurement = measure_recordings([recording(PLANTED, hits=2)], OPTIONS)[0]
    found = ringing(_with_unused(measurement, 0), _modes(PLANTED)).residue
    assert np.all(np.isfinite(found))


def test_the_level_is_the_amplitude_right_after_the_hit() -> None:
    """Compare with the transform of the pulse.

    A half sine of impulse I gives a mode of frequency w the velocity I, so w I cos(w T / 2) /
    (1 - (w T / pi)^2) of acceleration.
    """
    mode = Planted(13.5, 0.001, (0.5, -0.8), 0.7)
    record = recording([mode], hits=1)
    (hit,) = (m := measure_recordings([record], OPTIONS)[0]).hits
    omega = 2 * np.pi * mode.frequency_hz
    impulse = hit.peak_force_n * 2 * PULSE_S / np.pi
    shape = np.cos(omega * PULSE_S / 2) / (1 - (omega * PULSE_S / np.pi) ** 2)
    expected = 0.8 * 0.7 * omega * impulse * shape
    # Four samples of a half sine miss its crest.
    assert levels([ringing(m, _modes([mode]))])[0] == pytest.approx(expected, rel=0.09)


def test_the_level_is_that_of_the_median_hit_and_of_the_set_up_that_moves_most() -> None:
    (ring,) = [ringing(measure_recordings([RECORD], OPTIONS)[0], _modes(PLANTED))]
    median = np.median(ring.amplitude_m_s2.max(axis=1), axis=0)
    np.testing.assert_allclose(levels([ring]), median, rtol=0.1)
    louder = replace(ring, amplitude_m_s2=2 * ring.amplitude_m_s2)
    np.testing.assert_allclose(levels([ring, louder]), 2 * levels([ring]))
