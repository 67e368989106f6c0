"""What the writers of `logger_files` share: what a file holds, and numbers as text."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from tests.worlds.recordings import Channel, Recording

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Held:
    """What a perfect reader gets out of the file, and nothing that it cannot know.

    `values` is (samples, channels) in the file's unit and the file's order, NaN where the file has
    no number; `tolerance` (channels,) is how far the file's digits are from them.
    """

    names: tuple[str, ...]
    units: tuple[str | None, ...]  # as the file spells them; None where it does not say
    rate_hz: float | None
    start: datetime | None  # naive where the file says no time zone
    values: Array
    tolerance: Array
    rate_within: float = 1e-9  # relative: a column of rounded times tells no more


def held(
    record: Recording,
    *,
    names: Sequence[str] | None = None,
    units: Sequence[str | None] | None = None,
    rate_hz: float | None = None,
    start: datetime | None = None,
    values: Array | None = None,
    tolerance: float | Array = 0.0,
    rate_within: float = 1e-9,
) -> Held:
    kept = record.data if values is None else values
    return Held(
        tuple(record.names if names is None else names),
        tuple(record.units if units is None else units),
        rate_hz,
        start,
        kept,
        np.broadcast_to(np.asarray(tolerance, float), (kept.shape[1],)).copy(),
        rate_within,
    )


def relative(values: Array, digits: int) -> Array:
    """The tolerance of `digits` significant digits, by the largest value of each channel."""
    return np.asarray(np.nanmax(np.abs(values), axis=0) * 10.0 ** (1 - digits))


def rows(columns: Array, formats: Sequence[str], separator: str, missing: str) -> list[str]:
    """Lines of numbers; where one is NaN stands `missing`."""
    plain = separator.join(formats)
    lines = []
    for row in columns.tolist():
        if any(v != v for v in row):
            cells = [missing if v != v else f % v for f, v in zip(formats, row, strict=True)]
            lines.append(separator.join(cells))
        else:
            lines.append(plain % tuple(row))
    return lines


def with_comma(lines: Sequence[str]) -> list[str]:
    """A decimal comma; the separator must be another."""
    return [line.replace(".", ",") for line in lines]


def stamps(record: Recording) -> list[datetime]:
    """The time of each sample, to the microsecond."""
    step = 1e6 / record.rate_hz
    return [record.start + timedelta(microseconds=round(i * step)) for i in range(len(record.data))]


def spelt(channel: Channel, acceleration: str = "m/s²") -> str:
    """The unit as most loggers print it."""
    return acceleration if channel.unit == "m/s2" else channel.unit


def placed(channel: Channel) -> str:
    """A name in which the crew has put place and direction, as crews do."""
    if channel.place_m is None:
        return channel.name
    direction = {"transverse": "quer", "longitudinal": "längs"}.get(channel.plane or "", "")
    return f"{channel.name} {direction} x={channel.place_m:.2f}m".replace("  ", " ")
