"""Find faults of permanent sensors: dead, saturated, swapped, turned round, without modes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from itertools import combinations

import numpy as np

from shm.monitor.limits import LIMITS
from shm.monitor.spectrum import Stretch, power_near, shape_on, stretch
from shm.values import PLANES, FloatArray, Mode, Plane
from shm.values.stream import (
    Piece,
    Stream,
    StreamChannel,
    StreamEvent,
    StreamEventKind,
    Window,
    WindowReading,
)

SEEN_BEFORE = timedelta(days=3)
"""What the windows without modes are compared with: as long as the watch learns."""
_BLIND = timedelta(days=1)  # derived: each day has traffic and wind, whatever the level is


Fault = tuple[StreamEventKind, str]
"""The kind of a fault, and what was seen."""


def broken_channels(pieces: Sequence[Piece], stream: Stream) -> dict[str, Fault]:
    """Return the channels of a window that cannot be used, and why."""
    faults = {each.name: _fault(each, _samples(pieces, each.name)) for each in stream.channels}
    return {name: fault for name, fault in faults.items() if fault}


def sensor_faults(
    pieces: Sequence[Piece], stream: Stream, known: Sequence[Mode]
) -> tuple[StreamEvent, ...]:
    """Return the faults that a window shows."""
    if not pieces:
        return ()
    broken = broken_channels(pieces, stream)
    found = [(kind, name, why) for name, (kind, why) in broken.items()]
    usable = [channel for channel in stream.channels if channel.name not in broken]
    stretches = [
        stretch(part, piece.sampling_rate_hz)
        for piece in pieces
        if all(channel.name in piece.channels for channel in usable)
        for part in [_rows(piece, usable)]
        if part.shape[1] > piece.sampling_rate_hz and np.isfinite(part).all()
    ]
    if exchange := exchanged(stretches, usable, known):
        found.append(("swapped", *exchange))
    start = min(piece.start for piece in pieces)
    end = max(
        piece.start + timedelta(seconds=piece.values.shape[1] / piece.sampling_rate_hz)
        for piece in pieces
    )
    return tuple(
        StreamEvent(stream.name, kind, start, end, detail, name) for kind, name, detail in found
    )


def sees_nothing(
    windows: Sequence[WindowReading], reported: Sequence[StreamEvent] = ()
) -> StreamEvent | None:
    """Return the event that the sensors of a stream do not see its hanger any more, if so.

    `windows` are oldest first; `reported` are earlier events of this. Unusable ones do not count.
    """
    rows = [_Row(each.window, max(_count_modes(each).values())) for each in windows]
    return _find_loss(rows, [each for each in reported if not each.channel], "the hanger", "")


def find_lost_planes(
    windows: Sequence[WindowReading], stream: Stream, reported: Sequence[StreamEvent] = ()
) -> tuple[StreamEvent, ...]:
    """Return an event for each channel whose plane lost its modes while the other has its own.

    The windows of a plane are those in which the other plane shows that the hanger moves.
    """
    counts = [_count_modes(each) for each in windows]
    found = []
    for plane, other in (PLANES, PLANES[::-1]):
        usual = _usual([each[other] for each in counts])
        rows = [
            _Row(each.window, its[plane])
            for each, its in zip(windows, counts, strict=True)
            if 2 * its[other] > usual
        ]
        for channel in stream.channels:
            if channel.plane == plane:
                earlier = [each for each in reported if each.channel == channel.name]
                what = f"the {plane} modes, while the {other} modes are seen"
                found.append(_find_loss(rows, earlier, what, channel.name))
    return tuple(each for each in found if each)


def _count_modes(reading: WindowReading) -> dict[Plane, int]:
    return {plane: sum(mode.plane == plane for mode in reading.modes) for plane in PLANES}


@dataclass(frozen=True)
class _Row:
    """A window and how many modes it showed in a plane."""

    window: Window
    n_modes: int


def _usual(counts: Sequence[int]) -> float:
    """Return how many modes a window shows that shows any."""
    seen = [each for each in counts if each]
    return float(np.median(seen)) if seen else 0.0


def _find_loss(
    rows: Sequence[_Row],
    reported: Sequence[StreamEvent],
    what: str,
    channel: str,
) -> StreamEvent | None:
    """Return the event that the modes of the last windows are lost, if one of these holds.

    For an hour, fewer than half the usual modes or none, though at this level as many are visible;
    for an hour, no mode and less motion than ever; for a day, no mode.
    """
    rows = [each for each in rows if math.isfinite(each.window.level_m_s2)]
    sound = [
        each
        for each in rows
        if not any(event.start <= each.window.start < event.end for event in reported)
    ]
    usual = _usual([each.n_modes for each in sound])
    few = _tail(rows, lambda each: 2 * each.n_modes > usual)
    if not few:
        return None
    now = few[-1].window
    end = now.start + timedelta(seconds=now.duration_s)
    if going_on := [each for each in reported if each.end > few[0].window.start]:
        return replace(going_on[-1], start=now.start, end=end)
    if not _is_lasting(few):
        return None
    none = _tail(few, lambda each: each.n_modes > 0)
    before = [each for each in sound if each.window.start < few[0].window.start]
    is_known = sum(1 for each in before if each.n_modes) >= LIMITS.least_before
    level = float(np.median([each.window.level_m_s2 for each in few]))
    lowest = min(each.window.level_m_s2 for each in before) if is_known else math.nan
    since: Sequence[_Row] = few
    if not (is_known and _are_visible(before, level, usual / 2)):
        since = none
    if since is none and not (is_known and _is_lasting(none) and _are_visible(before, level, 0.0)):
        highest = max((each.window.level_m_s2 for each in none), default=math.nan)
        fallen = _is_lasting(none) and highest < LIMITS.fallen * lowest
        if not fallen and not (none and end - none[0].window.start >= _BLIND):
            return None
    first = since[0].window
    compared = f"; the lowest before was {lowest:.2g}" if is_known else ""
    detail = (
        f"since {first.start:%Y-%m-%d %H:%M} UTC it does not see {what} (level {level:.2g} m/s^2"
        f"{compared}): check that it is fixed to the hanger and connected"
    )
    return StreamEvent(now.stream, "lost modes", first.start, end, detail, channel)


def _is_lasting(rows: Sequence[_Row], least: int = 3, hours: float = 1.0) -> bool:
    """Return True if windows are enough, and long enough, to tell a loss from a quiet quarter.

    Of a logger that records a few minutes of each hour, `least` windows are as many hours.
    """
    if len(rows) < least:
        return False
    last = rows[-1].window
    end = last.start + timedelta(seconds=last.duration_s)
    return end - rows[0].window.start >= timedelta(hours=hours)


def _are_visible(
    before: Sequence[_Row],
    level_m_s2: float,
    n_modes: float,
    enough: float = 0.95,
    visible_db: float = 10.0,
) -> bool:
    """Return True if `enough` of the earlier windows that were as quiet had more than `n_modes`.

    Where hardly any was as quiet, the quietest count whose peaks would have been `visible_db` high
    at this level.
    """
    found: list[bool] = []
    for each in sorted(before, key=lambda each: each.window.level_m_s2):
        quieter_db = 20 * math.log10(level_m_s2 / each.window.level_m_s2)
        height_db = each.window.signal_to_noise_db + quieter_db
        if quieter_db < 0 and (math.isnan(height_db) or len(found) >= LIMITS.hour):
            continue
        found.append(each.n_modes > n_modes and (quieter_db >= 0 or height_db >= visible_db))
    return len(found) >= LIMITS.hour and float(np.mean(found)) >= enough


def _tail(rows: Sequence[_Row], is_seen: Callable[[_Row], bool]) -> Sequence[_Row]:
    """Return the rows after the last one in which something is seen."""
    last = max((place for place, each in enumerate(rows) if is_seen(each)), default=-1)
    return rows[last + 1 :]


def exchanged(
    stretches: Sequence[Stretch], channels: Sequence[StreamChannel], known: Sequence[Mode]
) -> tuple[str, str] | None:
    """The channel that another one's signal is on, or that is turned round, and what was seen.

    Each known mode moves the sensors as it always did. Where most modes do so with two channels
    exchanged, or with the sign of one reversed, and else do not, that is what happened.
    """
    rows = [shape_on(channels, mode) for mode in known]
    shapes = np.array(rows).reshape(len(known), len(channels))
    reported = np.all(np.isfinite(shapes), axis=1) & np.any(shapes != 0, axis=1)
    if reported.sum() < LIMITS.least_modes or not stretches:
        return None
    hz = np.array([mode.frequency_hz for mode in known])[reported]
    seen = [power_near(stretches, each, within=LIMITS.within) for each in hz]
    shapes = shapes[reported]
    straight = _likeness(seen, hz, shapes)
    changes: list[tuple[float, str, str]] = [
        (_likeness(seen, hz, changed), name, words)
        for changed, name, words in _changes(shapes, channels)
    ]
    if not changes or max(changes)[0] < max(LIMITS.as_known, straight + LIMITS.gain):
        return None
    share, name, words = max(changes)
    return name, f"{words} (that explains {share:.2f} of the motion, else {straight:.2f})"


def _changes(
    shapes: FloatArray, channels: Sequence[StreamChannel]
) -> Iterator[tuple[FloatArray, str, str]]:
    for one, two in combinations(range(len(channels)), 2):
        order = np.arange(len(channels))
        order[[one, two]] = two, one
        names = channels[one].name, channels[two].name
        yield shapes[:, order], names[0], f"the signals of {names[0]} and {names[1]} are exchanged"
    for row, channel in enumerate(channels):
        sign = np.ones(len(channels))
        sign[row] = -1
        yield (
            shapes * sign,
            channel.name,
            f"{channel.name} has the opposite sign, against its plane",
        )


def _likeness(seen: Sequence[FloatArray], hz: FloatArray, shapes: FloatArray) -> float:
    """Median share of the motion near the modes' frequencies in the shapes of those near by."""
    shares = []
    for power, at_hz in zip(seen, hz, strict=True):
        near = shapes[np.abs(hz / at_hz - 1) < 2 * LIMITS.within]
        left, size, _ = np.linalg.svd(near.T, full_matrices=False)
        axes = left[:, size > 0.1 * size[0]]
        shares.append(np.trace(axes.T @ power @ axes) / np.trace(power))
    return float(np.median(shares))


def _fault(channel: StreamChannel, values: FloatArray) -> Fault | None:
    known = values[np.isfinite(values)]
    if not len(known):
        return "dead", "no samples"
    if np.ptp(known) == 0:
        return "dead", f"its value never changes ({known[0]:.4g} m/s^2)"
    if math.isfinite(channel.full_scale):
        share = float(np.mean(np.abs(known) >= LIMITS.at_full_scale * channel.full_scale))
        if share > LIMITS.clipped:
            return "saturated", f"{share:.1%} of its samples are at full scale"
    return None


def _samples(pieces: Sequence[Piece], name: str) -> FloatArray:
    parts = [
        np.asarray(piece.values[piece.channels.index(name)], dtype=float)
        for piece in pieces
        if name in piece.channels
    ]
    return np.concatenate(parts) if parts else np.empty(0)


def _rows(piece: Piece, channels: Sequence[StreamChannel]) -> FloatArray:
    rows = [piece.channels.index(channel.name) for channel in channels]
    found: FloatArray = np.asarray(piece.values, dtype=float)[rows]
    return found
