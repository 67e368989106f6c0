"""A described table becomes a recording, frequency responses, or a look at what they will be.

Every check is written once: reading raises the first refusal, a look lists all of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from shm.errors import BadInput
from shm.read.base import Peek, PeekChannel
from shm.read.header import Header
from shm.read.limits import limits, refuse_large, refuse_many_samples
from shm.read.logger_words import ACCELERANCE, seconds_of
from shm.read.sidecar import sidecar_path
from shm.read.table import Column, Description, Table, is_raw
from shm.read.time_axis import on_even_grid, rate_of
from shm.values import (
    NAN,
    TEST_CONDITIONS,
    Channel,
    FloatArray,
    FrequencyResponse,
    Recording,
    ResponsePoint,
)

# judgement: no ring-down can be seen in fewer; identification asks for far more
_LEAST_SAMPLES = 16
_LARGEST = 1e9  # N or m/s^2: beyond, the bytes are not what the headers say
_SAME_RATE = 1e-4
_ROUNDED = 1e-3  # judgement: of the rate that the file says; so small a difference moves no tension
_OFF_GRID = 0.05  # steps: analysers round the frequencies that they list
_NAME_THEM = (
    "Name accelerometers acc_1, acc_2, ..., or give in NAME.toml a table [channel.NAME] with"
    ' unit = "m/s2" for each; `shm import FILE` asks and keeps it for all files of this logger.'
)
_ONE_GRID = "Export all channels of one recording with one length and rate."
_LEAVE_OUT = "Leave the others out: [channel.NAME] with leave_out = true in NAME.toml."

Attempt = Callable[[Callable[[], Any], Any], Any]
"""Runs a check; the second argument stands for one that fails where faults are noted."""


def strictly(check: Callable[[], Any], _: Any) -> Any:
    """Run a check; its refusal is raised."""
    return check()


def collecting(problems: list[str]) -> Attempt:
    """Return the attempt that notes a refusal among `problems`."""

    def attempt(check: Callable[[], Any], otherwise: Any) -> Any:
        try:
            return check()
        except BadInput as refusal:
            if str(refusal) not in problems:
                problems.append(str(refusal))
            return otherwise

    return attempt


# ---------------------------------------------------------------- a table


def assemble(found: Description) -> Recording | FrequencyResponse:
    """Return the values of a table in SI units, described by file and sidecar; raises BadInput."""
    return _response(found) if found.is_response else _recording(found)


def look_at(found: Description, file_format: str, attempt: Attempt) -> Peek:
    """Return what is said of a table, without its values; faults are the attempt's."""
    kind = _look_at_response if found.is_response else _look_at_record
    look = kind(found, file_format, attempt)
    possible = () if look.time else _possible_times(found.table)
    return replace(look, left_out=found.left_out, possible_times=possible)


def _possible_times(table: Table) -> tuple[datetime, ...]:
    return tuple(dict.fromkeys(each.time for each in table.possible_times))


def read_of_test(header: Header, attempt: Attempt) -> dict[str, Any]:
    """Return what a header says of the complete test; None and NaN where that is faulty."""
    unknown = dict.fromkeys(TEST_CONDITIONS) | {"temperature_c": NAN, "operator": ""}
    return {key: attempt(partial(getattr, header, key), none) for key, none in unknown.items()}


# ---------------------------------------------------------------- time records


def _look_at_record(found: Description, file_format: str, attempt: Attempt) -> Peek:
    header, path = found.header, found.table.path
    for column in found.used or found.table.columns:
        attempt(partial(_refuse_raw, column, header, path), None)
    samples = attempt(partial(_samples, found), 0)
    channels = tuple(_peek_channel(header, name, attempt) for name in header.channels)
    rate = attempt(partial(sampling_rate, found), NAN)
    if channels:
        attempt(partial(_refuse_few, samples, "the record has {} samples", path), None)
    attempt(partial(_refuse_quantities, found, [each.quantity for each in channels]), None)
    return Peek(
        found.table.source, file_format, channels, samples, rate, **read_of_test(header, attempt)
    )


def _recording(found: Description) -> Recording:
    table, path = found.table, found.table.path
    for column in found.used or table.columns:
        _refuse_raw(column, found.header, path)
    if not found.used:
        _refuse_quantities(found, ())
    _samples(found)
    values = _rows(found.used, path)
    if found.times is not None:
        values, _ = on_even_grid(_seconds(found), values, table.uneven(found.times))
        refuse_many_samples(values.shape[1], path)
    look = _look_at_record(found, "", strictly)
    channels = tuple(
        _channel(found.header, each, row, path)
        for each, row in zip(look.channels, values, strict=True)
    )
    made = Recording(table.source, channels, look.sampling_rate_hz, **found.header.of_test)
    return made if made.time else replace(made, possible_times=_possible_times(table))


def _samples(found: Description) -> int:
    """Return the length of all channels; raises BadInput where they differ or are too long."""
    path, first = found.table.path, next(iter(found.used or found.table.choosable), None)
    if first is None:
        return 0
    refuse_many_samples(first.size, path)
    for column in found.used:
        if column.size != first.size:
            raise BadInput(
                f"has {column.size} values, {first.name} {first.size}.",
                file=path,
                channel=column.name,
                remedy=_ONE_GRID,
            )
    return first.size


def _rows(used: Sequence[Column], path: Path) -> FloatArray:
    if sum(column.size for column in used) > limits().values_at_once:
        refuse_large((len(used), used[0].size), 8, "", path)
    return np.array([column.load() for column in used], dtype=np.float64)


def sampling_rate(found: Description) -> float:
    """Return the sampling rate; raises BadInput where nothing tells it, or two do and differ.

    A column of times is rounded to its last digit, and the rate that the same file states is the
    one that was set: there the statement counts.
    """
    _refuse_different_rates(found)
    path, stated_hz = found.table.path, found.header.sampling_rate_hz
    shown = found.used or found.table.choosable
    rate = next((c.rate_hz for c in shown if not math.isnan(c.rate_hz)), NAN)
    if found.times is not None:
        rate = rate_of(_seconds(found), found.table.uneven(found.times), stated_hz)
        _refuse_other_times(found, found.times)
    if math.isnan(stated_hz) and math.isnan(rate):
        raise BadInput(
            "the sampling rate is missing.",
            file=path,
            remedy="Add a header line `# sampling_rate_hz: 512`, or to the sidecar"
            " sampling_rate_hz = 512, or say it once for this logger: `shm import FILE`.",
        )
    if math.isnan(stated_hz):
        return rate
    entry = found.header.entries["sampling_rate_hz"]
    if abs(rate - stated_hz) > (_ROUNDED if entry.file == path else _SAME_RATE) * stated_hz:
        raise entry.refusal(
            f"sampling_rate_hz = {stated_hz:g}, but the times in the data give {rate:.6g} Hz.",
            "Correct the one that is wrong.",
        )
    return stated_hz


def _seconds(found: Description) -> FloatArray:
    assert found.times is not None
    return found.seconds * np.asarray(found.times.load(), float)


def _refuse_other_times(found: Description, times: Column) -> None:
    """Raise BadInput for a further column of times that is not the first one's, from its start.

    It may count more coarsely, as a clock of whole seconds does.
    """
    for column in found.more_times if times.size > 1 else ():
        seconds = _seconds(found) - _seconds(found)[0]
        other = (seconds_of(column.unit) or 1.0) * np.asarray(column.load(), float)
        steps = np.diff(other)
        coarse = np.min(steps[steps > 0], initial=np.inf)
        half_step = seconds[-1] / (len(seconds) - 1) / 2
        away = np.abs(other - other[0] - seconds)
        wrong = np.flatnonzero(~(away <= max(half_step, 1.5 * coarse if not steps.all() else 0)))
        if len(wrong):
            raise BadInput(
                f"its times are not those of {times.name}.",
                file=found.table.path,
                channel=column.name,
                line=found.table.line_of(int(wrong[0])),
                remedy=_ONE_GRID,
            )


def _refuse_different_rates(found: Description) -> None:
    path, stated_rate = found.table.path, found.header.entries.get("sampling_rate_hz")
    first = found.used[0] if found.used else None
    for column in found.used:
        if first is not None and str(column.rate_hz) != str(first.rate_hz):
            raise BadInput(
                f"{column.label} has {column.size} samples every {_step_s(column):g} s,"
                f" {first.label} {first.size} every {_step_s(first):g} s.",
                file=path,
                remedy=_ONE_GRID,
            )
    silent = [column for column in found.used if math.isnan(column.rate_hz)]
    stated = [column.facts.get("sampling_rate_hz") for column in silent]
    rates = {entry.text if entry is not None else "" for entry in stated}
    if len(rates) > 1 and (stated_rate is None or stated_rate.file == path):
        raise BadInput(
            f"the channels have different sampling rates ({', '.join(sorted(rates))}).",
            file=path,
            remedy=_ONE_GRID,
        )


def _step_s(column: Column) -> float:
    return 0.0 if math.isnan(column.rate_hz) else 1 / column.rate_hz


def _refuse_raw(column: Column, header: Header, path: Path) -> None:
    """Raise BadInput for a channel in counts, or of nothing known, that nobody gives a worth."""
    if is_raw(column, header):
        raise BadInput(
            f"holds {column.unit}, and nobody says what one is worth.",
            file=path,
            channel=column.name,
            remedy=f"Write into {sidecar_path(path).name}, or for all files of a stream into its "
            f'stream.toml: [channel.{column.name}] with unit = "m/s2" and calibration = the m/s2 '
            "of one of them (1 / the recorder's sensitivity).",
        )


def _refuse_quantities(found: Description, quantities: Sequence[str | None]) -> None:
    """Raise BadInput for too many or no accelerations, and for more than one force."""
    forces, accelerations = quantities.count("force"), quantities.count("acceleration")
    path, most, remedy = found.table.path, limits().max_channels, _LEAVE_OUT
    if accelerations == 0 and not found.used:
        held = ", ".join(found.left_out[:20]) or "nothing that is read"
        example = found.left_out[0] if found.left_out else "acc_1"
        what = f"no channel holds an acceleration. The file holds {held}."
        remedy = (
            f'Say in NAME.toml what each is: [channel."{example}"] with unit = "m/s2";'
            " `shm import FILE` asks and keeps it for all files of this logger."
        )
    elif accelerations == 0:
        what, remedy = "no channel holds an acceleration.", _NAME_THEM
    elif accelerations > most:
        what = f"{accelerations} accelerations; at most {most} are read."
    elif forces > 1:
        what = f"{forces} channels hold a force, where one hammer hits."
    else:
        return
    raise BadInput(what, file=path, remedy=remedy)


def _refuse_implausible(values: FloatArray, channel: str, path: Path) -> None:
    """Raise BadInput for a channel without any number, with infinite or impossible ones."""
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


def _without_error_values(values: FloatArray) -> FloatArray:
    """Return values with NaN for -9999 and the like, by which loggers mark a missing one."""
    for worst in (np.nanmin(values, initial=0.0), np.nanmax(values, initial=0.0)):
        digits = f"{abs(worst):.9g}".replace(".", "")
        rest = values[(values != worst) & ~np.isnan(values)]
        is_nines = len(digits) > 2 and set(digits) == {"9"} and len(rest) > 0
        if worst > 0 and np.sum(values == worst) == 1:
            continue  # the force of one hit may be any number
        # A signal that is clipped there comes nearer to its limit than three times its range.
        if is_nines and np.abs(worst - rest).min() > 3 * np.ptp(rest):
            values = np.where(values == worst, NAN, values)
    return values


def _refuse_few(count: int, what: str, path: Path) -> None:
    if count < _LEAST_SAMPLES:
        raise BadInput(
            f"{what.format(count)}; at least {_LEAST_SAMPLES} are needed.",
            file=path,
            remedy="Export the frequency response over its whole band."
            if "lines" in what
            else "Record some seconds, from before the hit until the vibration has died away.",
        )


def _channel(header: Header, described: PeekChannel, raw: FloatArray, path: Path) -> Channel:
    quantity, unit = header.quantity_and_unit(described.name)
    calibration = 1.0 if math.isnan(described.calibration) else described.calibration
    with np.errstate(invalid="ignore"):
        values = _without_error_values(raw) * (unit.si * calibration)
    _refuse_implausible(values, described.name, path)
    scale, states_unit = described.full_scale * unit.si, header.has_entry(described.name, "unit")
    return Channel(
        described.name, quantity, values, described.plane, described.x_m, scale, states_unit
    )


def _peek_channel(header: Header, name: str, attempt: Attempt) -> PeekChannel:
    return PeekChannel(
        name=name,
        quantity=attempt(lambda: header.quantity_and_unit(name)[0], None),
        unit=header.unit_text(name),
        plane=attempt(partial(header.plane, name), None),
        x_m=attempt(partial(header.number, "x_m", name), NAN),
        calibration=attempt(partial(header.number, "calibration", name), NAN),
        full_scale=attempt(partial(header.number, "full_scale", name), NAN),
    )


# ---------------------------------------------------------------- frequency responses


def _look_at_response(found: Description, file_format: str, attempt: Attempt) -> Peek:
    header, path = found.header, found.table.path
    channels = []
    for name in header.channels:
        attempt(partial(header.accelerance_si, name), NAN)
        plane = attempt(partial(header.plane, name), None)
        x_m = attempt(partial(header.number, "x_m", name), NAN)
        unit = header.unit_text(name) or ACCELERANCE
        channels.append(PeekChannel(name, "acceleration", unit, plane, x_m))
    frequency = attempt(lambda: _grid(_listed_hz(found), path)[1], np.zeros(0))
    return Peek(
        found.table.source, file_format, tuple(channels), 0, **read_of_test(header, attempt),
        lines=len(frequency), frequency_step_hz=float(frequency[1]) if len(frequency) else NAN,
    )  # fmt: skip


def _response(found: Description) -> FrequencyResponse:
    """Return accelerances over all lines, those from 0 that the file leaves out as NaN."""
    header, path = found.header, found.table.path
    values = np.array([column.load() for column in found.used], dtype=np.complex128)
    skipped, frequency = _grid(_listed_hz(found), path)
    coherence, look = _coherence(found), _look_at_response(found, "", strictly)
    for row, name in zip(values, header.channels, strict=True):
        row *= header.accelerance_si(name)
        _refuse_implausible(np.abs(row), name, path)
    # estimates of few averages may stand a little off 0 to 1
    if coherence is not None and (np.abs(coherence - 0.5) > 1.5).any():
        raise BadInput(
            "a coherence lies far outside 0 to 1.",
            file=path,
            remedy="Export the coherence again, or leave it out.",
        )
    return FrequencyResponse(
        found.table.source,
        tuple(ResponsePoint(each.name, each.plane, each.x_m) for each in look.channels),
        frequency,
        _from_zero(values, skipped),
        None if coherence is None else _from_zero(coherence, skipped),
        **header.of_test,
    )


def _listed_hz(found: Description) -> FloatArray:
    if found.frequencies is None:
        lines = found.used[0].size if found.used else 0
        raise BadInput(
            f"no array holds the frequencies of its {lines} lines.",
            file=found.table.path,
            remedy='Name the array frequency_hz, or give it unit = "Hz" in NAME.toml.',
        )
    return np.asarray(found.frequencies.load(), float)


def _coherence(found: Description) -> FloatArray | None:
    """Return coherences (points, lines) where there is one for each response, else None."""
    known = {c.name: c for c in found.table.columns if not c.is_complex}
    wanted = []
    for name, stated in found.header.channels.items():
        wanted.append(
            known.get(stated["coherence"].text if "coherence" in stated else f"{name}_coherence")
        )
    rows = [c for c in wanted if c is not None and c.size == found.used[0].size]
    whole = rows and len(rows) == len(wanted)
    return _rows(rows, found.table.path) if whole else None


def _grid(listed_hz: FloatArray, path: Path) -> tuple[int, FloatArray]:
    """Return how many lines a file leaves out below its first, and all frequencies from 0 in Hz."""
    _refuse_few(len(listed_hz), "{} lines", path)
    step = float(listed_hz[-1] - listed_hz[0]) / (len(listed_hz) - 1)
    first = listed_hz[0] / step if step > 0 else NAN
    if 0 <= first + _OFF_GRID < limits().values_at_once:
        skipped = round(float(first))
        refuse_many_samples(skipped + len(listed_hz), path)
        step = float(listed_hz[-1]) / (skipped + len(listed_hz) - 1)
        frequency = step * np.arange(skipped + len(listed_hz), dtype=float)
        if np.abs(listed_hz - frequency[skipped:]).max() < _OFF_GRID * step:
            return skipped, frequency
    raise BadInput(
        "its frequencies do not lie on an even grid from 0.",
        file=path,
        remedy="Export lines at whole multiples of one step.",
    )


def _from_zero(rows: np.ndarray, skipped: int) -> np.ndarray:
    return np.pad(rows, ((0, 0), (skipped, 0)), constant_values=np.nan)
