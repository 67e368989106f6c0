"""What is in a file, or in each file of a test, by headers alone: `shm ingest --peek`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

import rich_click as click
from rich.table import Table

from shm.errors import BadInput
from shm.read import Peek, PeekChannel
from shm.read.apart import load_modes, peek_test
from shm_cli.common import show, show_table, table

_MODES_SUFFIX = ".modes.json"


def show_peeks(files: Sequence[Path], as_json: bool) -> int:
    """Shows all files; exit code 3 where one cannot be read or its headers have faults."""
    looks = [look for path in files for look in _looks(path)]
    if as_json:
        show({"files": [asdict(look) for look in looks]})
    else:
        for look in looks:
            _show(look)
    return BadInput.exit_code if any(look.problems for look in looks) else 0


def _looks(path: Path) -> Sequence[Peek]:
    """A file of which nothing can be made out is one with a problem and no channels."""
    try:
        return [_modes(path)] if path.name.lower().endswith(_MODES_SUFFIX) else peek_test(path)
    except BadInput as error:
        return [Peek(str(path), "not readable", (), 0, problems=(str(error),))]


def _modes(path: Path) -> Peek:
    tests = load_modes(path)
    channels = tuple(PeekChannel(f"{test.id}: {len(test.modes)} modes", None) for test in tests)
    first = tests[0]
    return Peek(
        str(path),
        "modal tests",
        channels,
        0,
        hanger=first.hanger,
        time=first.time,
        temperature_c=first.temperature_c,
    )


def _show(look: Peek) -> None:
    if look.channels:
        show_table(_table(look))
    else:
        click.echo(_title(look))
    if look.left_out:
        click.echo(f"left out: {', '.join(look.left_out)}")
    for problem in look.problems:
        click.echo(f"problem: {problem}", err=True)


def _table(look: Peek) -> Table:
    """A row a channel; calibration and full scale only where a channel has one."""
    columns = [name for name in _COLUMNS if name not in _RARE or _has(look, name)]
    made = table(_title(look), *columns)
    for channel in look.channels:
        made.add_row(*(_COLUMNS[name](channel) for name in columns))
    return made


def _number(value: float) -> str:
    return f"{value:g}" if math.isfinite(value) else ""


_COLUMNS: dict[str, Callable[[PeekChannel], str]] = {
    "channel": lambda channel: channel.name,
    "quantity": lambda channel: channel.quantity or "",
    "unit": lambda channel: channel.unit,
    "plane": lambda channel: channel.plane or "",
    "x (m)": lambda channel: _number(channel.x_m),
    "calibration": lambda channel: _number(channel.calibration),
    "full scale": lambda channel: _number(channel.full_scale),
}
_RARE = ("calibration", "full scale")


def _has(look: Peek, column: str) -> bool:
    return any(_COLUMNS[column](channel) for channel in look.channels)


def _title(look: Peek) -> str:
    rate = look.sampling_rate_hz
    parts = (
        f"{look.source}: {look.format}",
        _kind(look),
        f"hanger {look.hanger}" if look.hanger is not None else "hanger not named",
        f"{look.time:%Y-%m-%d %H:%M} UTC" if look.time else "time not recorded",
        f"{look.temperature_c:g} °C" if math.isfinite(look.temperature_c) else "",
        f"{look.samples} samples" if look.samples else "",
        f"{look.samples / rate:.1f} s at {rate:g} Hz" if math.isfinite(rate) else "",
    )
    return ", ".join(part for part in parts if part)


def _kind(look: Peek) -> str:
    """What the file is, where that is not a plain hammer test."""
    if look.lines:
        return f"frequency responses of {look.lines} lines every {look.frequency_step_hz:g} Hz"
    ambient = look.samples and all(channel.quantity == "acceleration" for channel in look.channels)
    return "ambient (no hammer force)" if ambient else ""
