"""Recordings and frequency responses as the text of a CSV file."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.documents import format_time
from shm.read.header import mass_entries
from shm.read.units import ACCELERANCE, SI
from shm.values import Channel, FloatArray, FrequencyResponse, Recording, ResponsePoint


def recording_text(recording: Recording) -> str:
    """Rows of nine digits, one more than a 24-bit converter gives."""
    channels = recording.channels
    known = {
        "sampling_rate_hz": _number(recording.sampling_rate_hz),
        **_places(channels),
        "unit": ", ".join(SI[channel.quantity] for channel in channels),
        "full_scale": _list([channel.full_scale for channel in channels]),
    }
    names = [channel.name for channel in channels]
    rows = np.column_stack([channel.values for channel in channels])
    return _heading(recording, known, names) + _body(rows, "%.9g")


def response_text(response: FrequencyResponse) -> str:
    """A column of frequencies, then of each point real and imaginary part and coherence."""
    names, columns = ["frequency"], [response.frequency_hz]
    for row, point in enumerate(response.points):
        parts = {
            "real": response.accelerance[row].real,
            "imaginary": response.accelerance[row].imag,
        }
        if response.coherence is not None:
            parts["coherence"] = response.coherence[row]
        names += [f"{point.name}_{part}" for part in parts]
        columns += list(parts.values())
    unit = ", ".join([ACCELERANCE] * len(response.points))
    known = {**_places(response.points), "unit": unit}
    return _heading(response, known, names) + _body(np.column_stack(columns), "%.15g")


def _heading(
    described: Recording | FrequencyResponse, more: dict[str, str], names: Sequence[str]
) -> str:
    known = {
        "hanger": described.hanger,
        "time": format_time(described.time),
        "temperature_c": _number(described.temperature_c),
        **{key: _number(value) for key, value in mass_entries(described.added_mass).items()},
        **more,
    }
    lines = [f"# {key}: {value}" for key, value in known.items() if value not in (None, "")]
    return "\n".join([*lines, ",".join(names)]) + "\n"


def _places(points: Sequence[Channel] | Sequence[ResponsePoint]) -> dict[str, str]:
    planes = [point.plane or "" for point in points]
    return {
        "plane": ", ".join(planes) if any(planes) else "",
        "x_m": _list([point.x_m for point in points]),
    }


def _list(values: Sequence[float]) -> str:
    """One value a column; nothing where none is known."""
    return "" if all(map(math.isnan, values)) else ", ".join(map(_number, values))


def _number(value: float) -> str:
    return "" if math.isnan(value) else repr(float(value))


def _body(rows: FloatArray, digits: str) -> str:
    row = ",".join([digits] * rows.shape[1]) + "\n"
    return (row * len(rows)) % tuple(rows.ravel().tolist())
