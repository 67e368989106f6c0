"""From records of a hanger that wind and traffic move, without a hammer, to a measurement.

The covariances of such motion ring down as free decays do (James, Carne and Lauffer 1995). The
records are cut into parts, which an identifier takes as it takes ring-downs: it sums their Hankel
matrices, and leaves out one part at a time for the standard deviations.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.errors import NotIdentifiable
from shm.identify.contract import Dropped, Measurement, point_of
from shm.identify.measuring.band import band_limited, least_seconds
from shm.identify.options import IdentifyOptions
from shm.values import BoolArray, Channel, FloatArray, Recording

# Student's 95 % quantile is 1.05 times the normal one with 20 parts, 1.15 with 8: more parts would
# only be shorter, fewer leave the standard deviations vague
MOST_PARTS = 20
LEAST_PARTS = 8
LOUDER = 5.0
"""judgement: gusts move parts of one record by up to three, trucks and hits by ten."""
LOUD = "louder than the rest: a truck or a hit"
LEAST_PERIODS = 10
"""Of the lowest frequency of the band, in one part."""


def ambient_measurement(records: Sequence[Recording], options: IdentifyOptions) -> Measurement:
    """Return the measurement of one set-up without hits; gaps and trucks are cut out.

    Raises NotIdentifiable where no channel can be used or the records are too short.
    """
    rows, dropped = _usable_channels(records)
    rate, high_hz = records[0].sampling_rate_hz, options.band_high_hz
    least = _least_part_seconds(options)
    pieces = [
        band_limited(piece, rate, high_hz)
        for record in records
        for piece in _between_gaps(record, rows)
        if piece.shape[1] > least * rate
    ]
    parts = _parts(pieces, least)
    if len(parts) < LEAST_PARTS:
        raise _too_short(records, least)
    parts, loud = set_apart(parts)
    return Measurement(
        source=records[0].source,
        points=tuple(point_of(records[0].accelerations[row]) for row in rows),
        decays=tuple(part / loudness(part) for part in parts),
        sampling_rate_hz=pieces[0][1],
        frequency_response=None,
        dropped=(*dropped, *([Dropped("parts of the record", loud, LOUD)] if loud else [])),
    )


def set_apart(parts: Sequence[FloatArray]) -> tuple[list[FloatArray], int]:
    """Return the parts without trucks and hits, as long as enough are left, and their number.

    What moves the structure for seconds is no noise, and its modes are those under the load.
    """
    level = np.array([loudness(part) for part in parts])
    quiet = [p for p, each in zip(parts, level, strict=True) if each <= LOUDER * np.median(level)]
    if len(quiet) < LEAST_PARTS:
        return list(parts), 0
    return quiet, len(parts) - len(quiet)


def loudness(part: FloatArray) -> float:
    """Return the root mean square of differences from sample to sample: drift does not count.

    Parts are divided by it, so that no gust outweighs the rest: on records with trucks 90 % of
    the intervals of frequencies held the truth in 96 instead of 88 %
    (tests/worlds/recordings.py).
    """
    return float(np.sqrt(np.mean(np.diff(part, axis=1) ** 2))) or 1.0


def _least_part_seconds(options: IdentifyOptions) -> float:
    periods = LEAST_PERIODS / options.band_low_hz if options.band_low_hz > 0 else 0.0
    return max(least_seconds(options.band_high_hz), periods)


def _usable_channels(
    records: Sequence[Recording],
) -> tuple[list[int], tuple[Dropped, ...]]:
    """Return the rows of usable accelerations, and the dropped ones with the reason."""
    channels = records[0].accelerations
    stated = any(channel.plane for channel in channels)
    rows, dropped = [], []
    for row, channel in enumerate(channels):
        values = np.concatenate([record.accelerations[row].values for record in records])
        reason = _fault(channel, values, stated)
        if reason:
            dropped.append(Dropped(f"channel {channel.name}", 1, reason))
        else:
            rows.append(row)
    if not rows:
        listed = ", ".join(f"{entry.what} ({entry.reason})" for entry in dropped)
        raise NotIdentifiable(
            f"no acceleration channel can be used: {listed}.",
            file=records[0].source,
            remedy="Check the sensor cables, and measure again.",
        )
    return rows, tuple(dropped)


def _fault(channel: Channel, values: FloatArray, stated: bool) -> str:
    good = values[np.isfinite(values)]
    if 2 * len(good) < len(values):
        return "not-a-number samples in more than half of the record"
    if not len(good) or np.ptp(good) == 0:
        return "its value never changes: dead sensor or cable"
    if stated and channel.plane is None:
        return "its plane is not stated, those of others are"
    return ""


def _between_gaps(record: Recording, rows: Sequence[int]) -> list[FloatArray]:
    """Return stretches (channels, samples) in which all channels are known, without mean."""
    signals = np.array([record.accelerations[row].values for row in rows])
    known: BoolArray = np.all(np.isfinite(signals), axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], known, [False]))))
    stretches = [signals[:, begin:end] for begin, end in edges.reshape(-1, 2)]
    return [stretch - stretch.mean(axis=1, keepdims=True) for stretch in stretches]


def _parts(pieces: Sequence[tuple[FloatArray, float]], least_seconds: float) -> list[FloatArray]:
    """Cut the pieces into parts of about equal length, at most 20 of them."""
    total = sum(signals.shape[1] / rate for signals, rate in pieces)
    wanted = max(least_seconds, total / MOST_PARTS)
    return [
        part
        for signals, rate in pieces
        for part in np.array_split(signals, max(1, int(signals.shape[1] / rate / wanted)), axis=1)
    ]


def _too_short(records: Sequence[Recording], least_seconds: float) -> NotIdentifiable:
    return NotIdentifiable(
        "too short without a hammer: less than "
        f"{LEAST_PARTS} undisturbed parts of {least_seconds:.3g} s.",
        file=records[0].source,
        remedy=f"Measure for {10 * LEAST_PARTS * least_seconds / 60:.0f} minutes or more, "
        "or hit the hanger.",
    )
