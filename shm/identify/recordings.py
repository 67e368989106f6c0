"""From time records, as received, to a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from shm.errors import BadInput
from shm.identify.bandlimit import band_limited
from shm.identify.contract import Measurement
from shm.identify.frf import averaged_response
from shm.identify.hits import RINGING_SAMPLES, HitRecord
from shm.identify.options import IdentifyOptions
from shm.identify.screening import screened
from shm.values import Channel, FloatArray, FrequencyResponse, Recording, ResponsePoint


def measurement_of_recordings(
    records: Sequence[Recording], options: IdentifyOptions
) -> Measurement:
    """The measurement in the time records of one test, each with one hit or several.

    Raises BadInput where a record lacks force or accelerations or the records do not belong
    together, NotIdentifiable where no hit is left to use.
    """
    for record in records:
        _refuse_incomplete(record, options)
    for first, second in pairwise(records):
        _refuse_different(first, second)
    found = screened(records, options)
    channels = [records[0].accelerations[row] for row in found.rows]
    return replace(
        _measurement(records[0], channels, found.used, options),
        hits=found.hits,
        dropped=found.dropped,
    )


def _refuse_incomplete(record: Recording, options: IdentifyOptions) -> None:
    if record.force is None or not record.accelerations:
        missing = "force" if record.force is None else "acceleration"
        raise BadInput(
            f"no {missing} channel.",
            file=record.source,
            remedy="State the unit of each column: N for the hammer, m/s^2 for accelerometers.",
        )
    if record.sampling_rate_hz < 2 * options.band_high_hz:
        raise BadInput(
            f"sampled at {record.sampling_rate_hz:g} Hz, too slow for modes up to "
            f"{options.band_high_hz:g} Hz.",
            file=record.source,
            remedy="Sample faster, or lower band_high_hz to less than half the sampling rate.",
        )


def _refuse_different(first: Recording, second: Recording) -> None:
    """Records of one test share sensors and sampling rate."""
    layouts = [
        [(c.name, c.plane, None if np.isnan(c.x_m) else c.x_m) for c in record.accelerations]
        for record in (first, second)
    ]
    if layouts[0] != layouts[1] or first.sampling_rate_hz != second.sampling_rate_hz:
        raise BadInput(
            f"its sensors or sampling rate differ from those of {first.source}.",
            file=second.source,
            remedy="Identify records of different set-ups one by one.",
        )


def _free_decay(
    ring_down: HitRecord, sampling_rate_hz: float, options: IdentifyOptions
) -> tuple[FloatArray, float]:
    """The band-limited motion after the pulse, free of its mean, and its sampling rate."""
    begin = ring_down.pulse.end + min(RINGING_SAMPLES, int(0.002 * sampling_rate_hz) + 1)
    free = ring_down.accelerations[:, begin : ring_down.pulse.stop]
    centred = free - free.mean(axis=1, keepdims=True)
    return band_limited(centred, sampling_rate_hz, options.band_high_hz)


def _measurement(
    record: Recording,
    channels: Sequence[Channel],
    used: Sequence[HitRecord],
    options: IdentifyOptions,
) -> Measurement:
    rate = record.sampling_rate_hz
    decays = [_free_decay(ring_down, rate, options) for ring_down in used]
    average = averaged_response(used, rate, options.band_high_hz)
    points = tuple(ResponsePoint(c.name, c.plane, c.x_m) for c in channels)
    return Measurement(
        source=record.source,
        points=points,
        decays=tuple(decay for decay, _ in decays),
        sampling_rate_hz=decays[0][1],
        frequency_response=FrequencyResponse(
            source=record.source,
            points=points,
            frequency_hz=average.frequency_hz,
            accelerance=average.accelerance,
            coherence=average.coherence,
            hanger=record.hanger,
            time=record.time,
            temperature_c=record.temperature_c,
        ),
        window_time_constant_s=average.window_time_constant_s,
    )
