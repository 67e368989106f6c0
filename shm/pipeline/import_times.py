"""Find the column of times in an imported file, and the sampling rate.

The picture of a channel over time that an import shows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shm.errors import BadInput
from shm.read import logger_words as words
from shm.read.base import Survey
from shm.read.sidecar import Described
from shm.read.time_axis import REMEDY, rate_of
from shm.values import NAN, FloatArray


def with_times(described: dict[str, Any], found: Survey) -> dict[str, Any]:
    """A column that is named as times in s, which its format's reader does not take for such."""
    if not math.isnan(found.sampling_rate_hz) or "sampling_rate_hz" in described:
        return described
    if any(table.get("unit") == "s" for table in described.get("channel", {}).values()):
        return described
    for column in found.columns:
        if column.quantity is None and words.means_time(column.name) and not column.unit:
            tables = {**described.get("channel", {}), column.name: {"unit": "s"}}
            return {**described, "channel": tables}
    return described


def rate_told(found: Survey, described: Described) -> tuple[float, str]:
    """The sampling rate, in Hz: as said, else by the column in s; and why that has none.

    NaN where nothing tells it.
    """
    said = float(described.get("sampling_rate_hz", found.sampling_rate_hz))
    tables = described.get("channel", {})
    for column in found.columns:
        table = tables.get(column.name, {})
        if math.isnan(said) and table.get("unit") == "s" and column.values is not None:
            try:
                return rate_of(column.values, _uneven(found, column.name)), ""
            except BadInput as error:
                return NAN, str(error)
    return said, ""


def _uneven(found: Survey, channel: str) -> Callable[[int, str], BadInput]:
    return lambda row, what: BadInput(
        f"{what} at sample {row + 1}.", file=Path(found.source), channel=channel, remedy=REMEDY
    )


OUTLINE_BINS = 32
"""Into how many parts of equal length the picture of a channel divides it."""


def outline(values: FloatArray | None) -> tuple[float, ...]:
    """The largest departure from the middle in each part, as a share of the largest of all."""
    if values is None or len(values) < OUTLINE_BINS or not np.isfinite(values).any():
        return ()
    middle = float(np.nanmedian(values))
    away = np.nan_to_num(np.abs(values - middle), posinf=0.0)
    parts = np.array([part.max() for part in np.array_split(away, OUTLINE_BINS)])
    top = float(parts.max())
    return tuple(float(part) for part in (parts / top if top > 0 else parts))
