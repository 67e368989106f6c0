"""A sound test of a hanger, and the same with one fault put in by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from shm.identify import IdentifyOptions
from shm.identify.contract import Finding, FoundMode, Poles
from shm.identify.measuring.setups import measure_recordings
from shm.identify.quality import Inspection, assess, tones
from shm.values import FloatArray, QualityCheck, Recording
from tests.identify.signals import hanger_modes, recording

OPTIONS = IdentifyOptions(2.0, 50.0)
SOUND = recording(hanger_modes(20.0), noise=0.02, lead_s=0.5)
SLOT = 8 * 1024
FIRST = 512


def changed(
    name: str, change: Callable[[FloatArray], object], record: Recording = SOUND
) -> Recording:
    """Return the record with a copy of one channel's values changed in place."""
    channels = []
    for channel in record.channels:
        values = channel.values.copy()
        if channel.name == name:
            change(values)
        channels.append(replace(channel, values=values))
    return replace(record, channels=tuple(channels))


def with_samples(name: str, where: slice, value: float, record: Recording = SOUND) -> Recording:
    """Return the record with some samples of a channel set to a value."""
    return changed(name, lambda values: values.__setitem__(where, value), record)


def none_found(*modes: FoundMode) -> Finding:
    """Return a finding of these modes and no pole."""
    none = np.empty(0)
    return Finding(modes, (), Poles(none, none, none, none.astype(bool)))


def inspection(record: Recording, options: IdentifyOptions = OPTIONS) -> Inspection:
    measurements = measure_recordings([record], options)
    return Inspection([record], measurements, options, tones(measurements, [record], options))


def check_of(
    name: str, record: Recording = SOUND, options: IdentifyOptions = OPTIONS
) -> QualityCheck:
    """One figure of a test of one record."""
    (found,) = [check for check in assess(inspection(record, options)) if check.name == name]
    return found


def tone(samples: int, frequency_hz: float, amplitude: float) -> FloatArray:
    return np.asarray(amplitude * np.sin(2 * np.pi * frequency_hz / 1024 * np.arange(samples)))
