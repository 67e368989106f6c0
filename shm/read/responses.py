"""The end that frequency responses of all formats share, as `assemble` is for time records."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shm.errors import BadInput
from shm.read import assemble
from shm.read.base import Peek, PeekChannel
from shm.read.header import Header
from shm.read.limits import limits, refuse_many_samples
from shm.read.units import ACCELERANCE
from shm.values import NAN, ComplexArray, FloatArray, FrequencyResponse, ResponsePoint

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
        header.hanger,
        header.time,
        header.temperature_c,
        header.added_mass,
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


def peeked(
    header: Header,
    file_format: str,
    listed_hz: FloatArray,
    path: Path,
    left_out: Sequence[str] = (),
) -> Peek:
    """What the headers of frequency responses say; faults become `problems`."""
    problems: list[str] = []
    channels = tuple(_peek_point(header, name, problems) for name in header.channels)
    frequency = assemble.attempt(lambda: grid(listed_hz, path)[1], np.zeros(0), problems)
    return Peek(
        source=str(path),
        format=file_format,
        channels=channels,
        samples=0,
        hanger=assemble.attempt(lambda: header.hanger, None, problems),
        time=assemble.attempt(lambda: header.time, None, problems),
        temperature_c=assemble.attempt(lambda: header.temperature_c, NAN, problems),
        added_mass=assemble.attempt(lambda: header.added_mass, None, problems),
        problems=tuple(problems),
        lines=len(frequency),
        frequency_step_hz=float(frequency[1]) if len(frequency) else NAN,
        left_out=tuple(left_out),
    )


def _peek_point(header: Header, name: str, problems: list[str]) -> PeekChannel:
    assemble.attempt(lambda: header.accelerance_si(name), NAN, problems)
    return PeekChannel(
        name=name,
        quantity="acceleration",
        unit=header.unit_text(name) or ACCELERANCE,
        plane=assemble.attempt(lambda: header.plane(name), None, problems),
        x_m=assemble.attempt(lambda: header.x_m(name), NAN, problems),
    )


def _scaled(header: Header, name: str, raw: ComplexArray, path: Path) -> ComplexArray:
    values: ComplexArray = raw * complex(header.accelerance_si(name))
    assemble.refuse_implausible(np.abs(values), name, path)
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
