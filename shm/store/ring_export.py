"""Samples of the ring as one recording, for a file or an identification."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

from shm.documents import format_time
from shm.errors import BadInput, NothingThere, UsageError
from shm.values import NAN, Channel, Recording, outdoor_c
from shm.values.stream import Piece, Stream

if TYPE_CHECKING:
    from shm.store.ring import Ring


def recording_of(
    ring: Ring, stream: Stream, start: datetime, end: datetime, most_samples: int
) -> Recording:
    """The samples of a stream within a time; raises NothingThere, UsageError or BadInput."""
    if (end - start).total_seconds() * stream.sampling_rate_hz > most_samples:
        longest = timedelta(seconds=most_samples // stream.sampling_rate_hz)
        raise UsageError(
            f"that is more than the {most_samples} samples of a recording.",
            remedy=f"Take {longest} at most, or raise the setting max_samples.",
        )
    pieces = ring.read(stream.name, start, end)
    if not pieces:
        raise NothingThere(
            f"the ring has no sample of stream {stream.name} from {format_time(start)} to "
            f"{format_time(end)}.",
            remedy="See `shm stream` for what there is.",
        )
    layouts = {(piece.sampling_rate_hz, piece.channels) for piece in pieces}
    if len(layouts) > 1:
        first = pieces[0].sampling_rate_hz, pieces[0].channels
        other = next(each for each in pieces if (each.sampling_rate_hz, each.channels) != first)
        raise BadInput(
            f"stream {stream.name} was sampled in {len(layouts)} ways in that time: at "
            f"{first[0]:.10g} Hz, from {format_time(other.start)} on at "
            f"{other.sampling_rate_hz:.10g} Hz with the channels {', '.join(other.channels)}.",
            remedy="Export each of both times alone.",
        )
    return _joined(pieces, stream)


def _joined(pieces: Sequence[Piece], stream: Stream) -> Recording:
    first, rate = pieces[0], pieces[0].sampling_rate_hz
    begins = [round((piece.start - first.start).total_seconds() * rate) for piece in pieces]
    samples = max(b + p.values.shape[1] for b, p in zip(begins, pieces, strict=True))
    values = np.full((len(first.channels), samples), NAN)
    for begin, piece in zip(begins, pieces, strict=True):
        values[:, begin : begin + piece.values.shape[1]] = piece.values
    described = {channel.name: channel for channel in stream.channels}
    channels = []
    for name, row in zip(first.channels, values, strict=True):
        known = described.get(name)
        place = (known.plane, known.x_m, known.full_scale) if known else ()
        channels.append(Channel(name, "acceleration", row, *place))
    temperatures = [p.temperature_c for p in pieces if not math.isnan(outdoor_c(p.temperature_c))]
    mean_c = float(np.mean(temperatures)) if temperatures else NAN
    return Recording(stream.name, tuple(channels), rate, stream.hanger, first.start, mean_c)
