"""What is in a file, by its headers alone: `shm ingest --peek`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import rich_click as click
from rich.table import Table

from shm.documents import load_modes
from shm.errors import BadInput
from shm.read import Peek, PeekChannel, peek
from shm_cli.common import show, show_table, table

_MODES_SUFFIX = ".modes.json"


def show_peeks(files: Sequence[Path], as_json: bool) -> int:
    """Shows all files; exit code 3 where one cannot be read or its headers have faults."""
    looks = [_look(path) for path in files]
    if as_json:
        show({"files": [asdict(look) for look in looks]})
    else:
        for look in looks:
            _show(look)
    return BadInput.exit_code if any(look.problems for look in looks) else 0


def _look(path: Path) -> Peek:
    """A file of which nothing can be made out is one with a problem and no channels."""
    try:
        return _modes(path) if path.name.lower().endswith(_MODES_SUFFIX) else peek(path)
    except BadInput as error:
        return Peek(str(path), "not readable", (), 0, problems=(str(error),))


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
    for problem in look.problems:
        click.echo(f"problem: {problem}", err=True)


def _table(look: Peek) -> Table:
    made = table(_title(look), "channel", "quantity", "unit", "plane", "x (m)")
    for channel in look.channels:
        place = f"{channel.x_m:g}" if math.isfinite(channel.x_m) else ""
        made.add_row(channel.name, channel.quantity or "", channel.unit, channel.plane or "", place)
    return made


def _title(look: Peek) -> str:
    rate = look.sampling_rate_hz
    parts = (
        f"{look.source}: {look.format}",
        f"hanger {look.hanger}" if look.hanger is not None else "hanger not named",
        f"{look.time:%Y-%m-%d %H:%M} UTC" if look.time else "time not recorded",
        f"{look.temperature_c:g} °C" if math.isfinite(look.temperature_c) else "",
        f"{look.samples} samples" if look.samples else "",
        f"{look.samples / rate:.1f} s at {rate:g} Hz" if math.isfinite(rate) else "",
    )
    return ", ".join(part for part in parts if part)
