"""The one layout in which we write named arrays, whatever the format.

    force, acc_1, ...                     time records, N and m/s^2, float64 (samples,)
    frequency_hz                          of frequency responses, float64 (lines,)
    NAME, NAME_coherence                  accelerance, m/s^2/N, complex128; coherence, float64
    hanger, time, temperature_c, sampling_rate_hz     of the whole, as far as they are known
    unit, plane, x_m, full_scale          of each channel, as far as they are known

HDF5 and TDMS keep what belongs to the whole or to a channel as attributes (properties); NumPy and
MATLAB files as further arrays, NAME_unit and so on.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from shm.documents import format_time
from shm.errors import UsageError
from shm.read.base import names_in
from shm.read.header import CHANNEL_KEYS, KEYS, mass_entries
from shm.read.units import ACCELERANCE, SI
from shm.values import (
    Channel,
    ComplexArray,
    FloatArray,
    FrequencyResponse,
    Recording,
    ResponsePoint,
)

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,40}")
_FREQUENCY = "frequency_hz"
_COHERENCE = "_coherence"


@dataclass(frozen=True, eq=False)
class NamedArray:
    """An array to be written, with what is said about it."""

    name: str
    values: FloatArray | ComplexArray
    attributes: Mapping[str, str | float]


@dataclass(frozen=True, eq=False)
class Layout:
    """The arrays of a file to be written, and what is said about the whole."""

    arrays: tuple[NamedArray, ...]
    attributes: Mapping[str, str | float]

    @property
    def flat(self) -> dict[str, FloatArray | ComplexArray | str | float]:
        """All by name: what belongs to a channel becomes NAME_unit and so on."""
        found: dict[str, FloatArray | ComplexArray | str | float] = dict(self.attributes)
        for array in self.arrays:
            found[array.name] = array.values
            found.update({f"{array.name}_{key}": v for key, v in array.attributes.items()})
        return found


def layout_of(described: Recording | FrequencyResponse) -> Layout:
    """The arrays of a recording or of frequency responses.

    Raises UsageError for names that some program could not take or take apart.
    """
    for name in names_in(described):
        reserved = name in (*KEYS, _FREQUENCY) or name.endswith(_suffixes())
        if reserved or not _NAME.fullmatch(name):
            raise UsageError(
                f"the channel name {name!r} cannot name an array.",
                remedy="Begin with a letter and use letters, digits and underscores, as in acc_1.",
            )
    known = {
        "hanger": described.hanger,
        "time": format_time(described.time),
        "temperature_c": described.temperature_c,
        **mass_entries(described.added_mass),
    }
    if isinstance(described, FrequencyResponse):
        return Layout(_response(described), _known(known))
    known["sampling_rate_hz"] = described.sampling_rate_hz
    return Layout(tuple(map(_channel, described.channels)), _known(known))


def _suffixes() -> tuple[str, ...]:
    return tuple(f"_{key}" for key in CHANNEL_KEYS)


def _channel(channel: Channel) -> NamedArray:
    said = {"unit": SI[channel.quantity], **_place(channel), "full_scale": channel.full_scale}
    return NamedArray(channel.name, channel.values, _known(said))


def _response(response: FrequencyResponse) -> tuple[NamedArray, ...]:
    arrays = [NamedArray(_FREQUENCY, response.frequency_hz, {"unit": "Hz"})]
    for row, point in enumerate(response.points):
        said = _known({"unit": ACCELERANCE, **_place(point)})
        arrays.append(NamedArray(point.name, response.accelerance[row], said))
        if response.coherence is not None:
            arrays.append(NamedArray(f"{point.name}{_COHERENCE}", response.coherence[row], {}))
    return tuple(arrays)


def _place(point: Channel | ResponsePoint) -> dict[str, str | float | None]:
    return {"plane": point.plane, "x_m": point.x_m}


def _known(said: Mapping[str, str | float | None]) -> dict[str, str | float]:
    return {
        key: value
        for key, value in said.items()
        if value is not None and not (isinstance(value, float) and math.isnan(value))
    }
