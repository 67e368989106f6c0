"""The end that all formats share: header, sidecar and raw numbers become values in SI units, of
time records and of frequency responses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from shm.errors import BadInput
from shm.read.base import Peek, PeekChannel
from shm.read.header import OF_TEST, Header
from shm.read.limits import limits, refuse_many_samples
from shm.read.logger_words import ACCELERANCE
from shm.values import (
    NAN,
    Channel,
    ComplexArray,
    FloatArray,
    FrequencyResponse,
    Plane,
    Quantity,
    Recording,
    ResponsePoint,
)

# judgement: no ring-down can be seen in fewer; identification asks for far more
LEAST_SAMPLES = 16
LARGEST = 1e9  # N or m/s^2: beyond, the bytes are not what the headers say
_SAME_RATE = 1e-4
_NAME_THEM = (
    "Name accelerometers acc_1, acc_2, ..., or give in NAME.toml a table [channel.NAME] with"
    ' unit = "m/s2" for each; `shm import FILE` asks and keeps it for all files of this logger.'
)
_LEAVE_OUT = "Leave the others out: [channel.NAME] with leave_out = true in NAME.toml."

T = TypeVar("T")


def recording(header: Header, values: FloatArray, path: Path, file_rate_hz: float) -> Recording:
    """A recording of raw `values` (channels, samples), checked; raises BadInput.

    `file_rate_hz` is the rate that the data themselves tell (a time column, an abscissa), or NaN.
    """
    rate = checked_rate(header, file_rate_hz, path)
    _refuse_short(values.shape[1], path)
    refuse_many_samples(values.shape[1], path)
    channels = tuple(
        _channel(header, name, row, path)
        for name, row in zip(header.channels, values, strict=True)
        if not header.leaves_out(name)
    )
    refuse_quantities([channel.quantity for channel in channels], path)
    return Recording(str(path), channels, rate, **header.of_test)


def checked_rate(header: Header, file_rate_hz: float, path: Path) -> float:
    """The sampling rate, from header or data; raises BadInput where neither or both differ."""
    said = header.sampling_rate_hz
    if math.isnan(said) and math.isnan(file_rate_hz):
        raise BadInput(
            "the sampling rate is missing.",
            file=path,
            remedy="Add a header line `# sampling_rate_hz: 512`, or to the sidecar"
            " sampling_rate_hz = 512, or say it once for this logger: `shm import FILE`.",
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
    left_out: Sequence[str] = (),
) -> Peek:
    """What a header says of a time record; faults, also of `file_rate_hz`, become `problems`."""
    found = list(problems)
    out = [name for name in header.channels if _is_left_out(header, name, found)]
    used = [name for name in header.channels if name not in out]
    channels = tuple(_peek_channel(header, name, found) for name in used)
    rate = attempt(lambda: checked_rate(header, file_rate_hz(), path), NAN, found)
    measured = [channel.quantity for channel in channels if channel.quantity]
    attempt(lambda: refuse_quantities(measured, path), None, found)
    if channels:
        attempt(lambda: _refuse_short(samples, path), None, found)
        attempt(lambda: refuse_many_samples(samples, path), None, found)
    return Peek(
        source=str(path),
        format=file_format,
        channels=channels,
        samples=samples,
        sampling_rate_hz=rate,
        **read_of_test(header, found),
        problems=tuple(found),
        left_out=(*left_out, *out),
    )


def refuse_quantities(quantities: Sequence[Quantity], path: Path) -> None:
    """Raises BadInput for too many or no accelerations, and for more than one force."""
    forces, accelerations = quantities.count("force"), quantities.count("acceleration")
    if accelerations == 0:
        raise BadInput("no channel holds an acceleration.", file=path, remedy=_NAME_THEM)
    if accelerations > limits().max_channels:
        raise BadInput(
            f"{accelerations} accelerations; at most {limits().max_channels} are read.",
            file=path,
            remedy=_LEAVE_OUT,
        )
    if forces > 1:
        raise BadInput(
            f"{forces} channels hold a force, where one hammer hits.", file=path, remedy=_LEAVE_OUT
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
    wild = np.flatnonzero(np.abs(values) > LARGEST)
    if len(wild):
        raise BadInput(
            f"sample {wild[0] + 1} is {values[wild[0]]:g}, which no sensor gives.",
            file=path,
            channel=channel,
            remedy="The file is damaged: export or send it again.",
        )


def _channel(header: Header, name: str, raw: FloatArray, path: Path) -> Channel:
    quantity, unit = header.quantity_and_unit(name)
    calibration = header.calibration(name)
    with np.errstate(invalid="ignore"):
        values = raw * (unit.si if math.isnan(calibration) else unit.si * calibration)
    refuse_implausible(values, name, path)
    full_scale = header.full_scale(name) * unit.si
    return Channel(
        name, quantity, values, header.plane(name), header.x_m(name), full_scale,
        header.says(name, "unit"),
    )  # fmt: skip


def _peek_channel(header: Header, name: str, problems: list[str]) -> PeekChannel:
    no_plane: Plane | None = None
    return PeekChannel(
        name=name,
        quantity=attempt(lambda: header.quantity_and_unit(name)[0], None, problems),
        unit=header.unit_text(name),
        plane=attempt(lambda: header.plane(name), no_plane, problems),
        x_m=attempt(lambda: header.x_m(name), NAN, problems),
        calibration=attempt(lambda: header.calibration(name), NAN, problems),
        full_scale=attempt(lambda: header.full_scale(name), NAN, problems),
    )


def read_of_test(header: Header, problems: list[str]) -> dict[str, Any]:
    """Return what a header says of the complete test; None and NaN where that is faulty.

    Each fault is added to `problems`.
    """
    unknown = dict.fromkeys(OF_TEST) | {"temperature_c": NAN}
    return {
        key: attempt(partial(getattr, header, key), nothing, problems)
        for key, nothing in unknown.items()
    }


def _is_left_out(header: Header, name: str, problems: list[str]) -> bool:
    return attempt(lambda: header.leaves_out(name), False, problems)


def attempt(verb: Callable[[], T], otherwise: T, problems: list[str]) -> T:
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


_OFF_GRID = 0.05  # steps: analysers round the frequencies that they list
_LEAST_LINES = 16


def frequency_response(
    header: Header,
    listed_hz: FloatArray,
    values: ComplexArray,
    coherence: FloatArray | None,
    path: Path,
) -> FrequencyResponse:
    """Accelerances (points, lines) at `listed_hz` (lines,), with lines from 0 added as NaN.

    The points are the header's channels. Raises BadInput for an uneven grid and faulty values.
    """
    skipped, frequency = grid(listed_hz, path)
    used = [row for row, name in enumerate(header.channels) if not header.leaves_out(name)]
    names = [list(header.channels)[row] for row in used]
    rows = [_scaled(header, n, values[row], path) for row, n in zip(used, names, strict=True)]
    return FrequencyResponse(
        str(path),
        tuple(ResponsePoint(n, header.plane(n), header.x_m(n)) for n in names),
        frequency,
        _from_zero(np.array(rows), skipped),
        None if coherence is None else _from_zero(_checked(coherence[used], path), skipped),
        **header.of_test,
    )


def grid(listed_hz: FloatArray, path: Path) -> tuple[int, FloatArray]:
    """How many lines the file leaves out below its first, and all frequencies from 0 in Hz."""
    _refuse_few(len(listed_hz), path)
    if not np.isfinite(listed_hz).all():
        raise _uneven(path)
    step = float(listed_hz[-1] - listed_hz[0]) / (len(listed_hz) - 1)
    first = listed_hz[0] / step if step > 0 else NAN
    if not 0 <= first + _OFF_GRID < limits().values_at_once:
        raise _uneven(path)
    skipped = round(float(first))
    refuse_many_samples(skipped + len(listed_hz), path)
    step = float(listed_hz[-1]) / (skipped + len(listed_hz) - 1)
    frequency = step * np.arange(skipped + len(listed_hz), dtype=float)
    if not np.abs(listed_hz - frequency[skipped:]).max() < _OFF_GRID * step:
        raise _uneven(path)
    return skipped, frequency


def peeked_response(
    header: Header,
    file_format: str,
    listed_hz: FloatArray,
    path: Path,
    left_out: Sequence[str] = (),
) -> Peek:
    """What the headers of frequency responses say; faults become `problems`."""
    problems: list[str] = []
    channels = tuple(peek_point(header, name, problems) for name in header.channels)
    frequency = attempt(lambda: grid(listed_hz, path)[1], np.zeros(0), problems)
    return Peek(
        source=str(path),
        format=file_format,
        channels=channels,
        samples=0,
        **read_of_test(header, problems),
        problems=tuple(problems),
        lines=len(frequency),
        frequency_step_hz=float(frequency[1]) if len(frequency) else NAN,
        left_out=tuple(left_out),
    )


def peek_point(header: Header, name: str, problems: list[str]) -> PeekChannel:
    """Return a point of frequency responses as its header describes it; faults are `problems`."""
    attempt(lambda: header.accelerance_si(name), NAN, problems)
    return PeekChannel(
        name=name,
        quantity="acceleration",
        unit=header.unit_text(name) or ACCELERANCE,
        plane=attempt(lambda: header.plane(name), None, problems),
        x_m=attempt(lambda: header.x_m(name), NAN, problems),
    )


def _scaled(header: Header, name: str, raw: ComplexArray, path: Path) -> ComplexArray:
    values: ComplexArray = raw * complex(header.accelerance_si(name))
    refuse_implausible(np.abs(values), name, path)
    return values


def _checked(coherence: FloatArray, path: Path) -> FloatArray:
    """Coherences; estimates of few averages may stand a little off 0 to 1."""
    with np.errstate(invalid="ignore"):
        if (np.abs(coherence - 0.5) > 1.5).any():
            raise BadInput(
                "a coherence lies far outside 0 to 1.",
                file=path,
                remedy="Export the coherence anew, or leave it out.",
            )
    return coherence


def _from_zero(rows: np.ndarray, skipped: int) -> np.ndarray:
    return np.pad(rows, ((0, 0), (skipped, 0)), constant_values=np.nan)


def _refuse_few(lines: int, path: Path) -> None:
    if lines < _LEAST_LINES:
        raise BadInput(
            f"{lines} lines; at least {_LEAST_LINES} are needed.",
            file=path,
            remedy="Export the frequency response over its whole band.",
        )


def _uneven(path: Path) -> BadInput:
    return BadInput(
        "its frequencies do not lie on an even grid from 0.",
        file=path,
        remedy="Export lines at whole multiples of one step.",
    )
