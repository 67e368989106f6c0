"""The end that all formats share: header, sidecar and raw numbers become values in SI units."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from shm.errors import BadInput
from shm.read.base import Peek, PeekChannel
from shm.read.header import Header
from shm.values import NAN, Channel, FloatArray, Plane, Quantity, Recording

LEAST_SAMPLES = 16
_LARGEST = 1e9  # N or m/s^2: beyond, the bytes are not what the headers say
_SAME_RATE = 1e-4

T = TypeVar("T")


def recording(header: Header, values: FloatArray, path: Path, file_rate_hz: float) -> Recording:
    """A recording of raw `values` (channels, samples), checked; raises BadInput.

    `file_rate_hz` is the rate that the data themselves tell (a time column, an abscissa), or NaN.
    """
    rate = checked_rate(header, file_rate_hz, path)
    _refuse_short(values.shape[1], path)
    channels = tuple(
        _channel(header, name, row, path) for name, row in zip(header.channels, values, strict=True)
    )
    refuse_quantities([channel.quantity for channel in channels], path)
    return Recording(str(path), channels, rate, header.hanger, header.time, header.temperature_c)


def checked_rate(header: Header, file_rate_hz: float, path: Path) -> float:
    """The sampling rate, from header or data; raises BadInput where neither or both differ."""
    said = header.sampling_rate_hz
    if math.isnan(said) and math.isnan(file_rate_hz):
        raise BadInput(
            "the sampling rate is missing.",
            file=path,
            remedy="Add a header line `# sampling_rate_hz: 512`, or to the sidecar"
            " sampling_rate_hz = 512.",
        )
    if math.isnan(said):
        return file_rate_hz
    if abs(file_rate_hz - said) > _SAME_RATE * said:
        raise header.entries["sampling_rate_hz"].refusal(
            f"sampling_rate_hz = {said:g}, but the times in the data give {file_rate_hz:.6g} Hz.",
            "Correct the one that is wrong.",
        )
    return said


def peeked(
    header: Header,
    file_format: str,
    samples: int,
    file_rate_hz: Callable[[], float],
    path: Path,
    problems: Sequence[str] = (),
) -> Peek:
    """What a header says; faults, also those of `file_rate_hz`, become `problems`."""
    found = list(problems)
    channels = tuple(_peek_channel(header, name, found) for name in header.channels)
    rate = _attempt(lambda: checked_rate(header, file_rate_hz(), path), NAN, found)
    measured = [channel.quantity for channel in channels if channel.quantity]
    _attempt(lambda: refuse_quantities(measured, path), None, found)
    _attempt(lambda: _refuse_short(samples, path), None, found)
    return Peek(
        source=str(path),
        format=file_format,
        channels=channels,
        samples=samples,
        sampling_rate_hz=rate,
        hanger=_attempt(lambda: header.hanger, None, found),
        time=_attempt(lambda: header.time, None, found),
        temperature_c=_attempt(lambda: header.temperature_c, NAN, found),
        problems=tuple(found),
    )


def refuse_quantities(quantities: Sequence[Quantity], path: Path) -> None:
    """Raises BadInput where force or acceleration is missing."""
    if "force" not in quantities:
        raise BadInput(
            "no channel holds the hammer's force.",
            file=path,
            remedy="Record the hammer too, and name its channel force (unit N).",
        )
    if "acceleration" not in quantities:
        raise BadInput(
            "no channel holds an acceleration.",
            file=path,
            remedy="Name accelerometers acc_1, acc_2, ... (unit m/s2 or g).",
        )


def refuse_implausible(values: FloatArray, channel: str, path: Path) -> None:
    """Raises BadInput for a channel without any number, with infinite or impossible ones."""
    if np.isnan(values).all():
        raise BadInput(
            "holds no number at all (only NaN).",
            file=path,
            channel=channel,
            remedy="Check sensor and cable, or leave the channel out.",
        )
    wild = np.flatnonzero(np.abs(values) > _LARGEST)
    if len(wild):
        raise BadInput(
            f"sample {wild[0] + 1} is {values[wild[0]]:g}, which no sensor gives.",
            file=path,
            channel=channel,
            remedy="The file is damaged: export or send it again.",
        )


def _channel(header: Header, name: str, raw: FloatArray, path: Path) -> Channel:
    quantity, unit = header.quantity_and_unit(name)
    values = raw * unit.si
    refuse_implausible(values, name, path)
    return Channel(name, quantity, values, header.plane(name), header.x_m(name))


def _peek_channel(header: Header, name: str, problems: list[str]) -> PeekChannel:
    no_plane: Plane | None = None
    return PeekChannel(
        name=name,
        quantity=_attempt(lambda: header.quantity_and_unit(name)[0], None, problems),
        unit=header.unit_text(name),
        plane=_attempt(lambda: header.plane(name), no_plane, problems),
        x_m=_attempt(lambda: header.x_m(name), NAN, problems),
    )


def _attempt(verb: Callable[[], T], otherwise: T, problems: list[str]) -> T:
    """What `verb` gives; where it refuses, `otherwise`, with the refusal noted."""
    try:
        return verb()
    except BadInput as refusal:
        problems.append(str(refusal))
        return otherwise


def _refuse_short(samples: int, path: Path) -> None:
    if samples < LEAST_SAMPLES:
        raise BadInput(
            f"the record has {samples} samples; at least {LEAST_SAMPLES} are needed.",
            file=path,
            remedy="Record some seconds, from before the hit until the vibration has died away.",
        )
