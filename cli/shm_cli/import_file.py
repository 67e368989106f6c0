"""`shm import`: a file of any logger, the first time; the second needs nothing.

What `shm import` does with modes that another program identified.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import rich_click as click

from shm.errors import BadInput, UsageError
from shm.pipeline.importing import (
    Answers,
    Import,
    Question,
    Understood,
    answer_of_test,
    answer_to,
    channel_answer,
    import_document,
    keep_profile,
    look_into,
    plane_named,
    question_document,
    understand,
    unit_recorded,
)
from shm.pipeline.importing_modes import ImportedModes, keep_modes_profile, understand_modes
from shm.pipeline.lineage import read_limits
from shm.read.logger_words import unit_of
from shm.read.modal_sets import ForeignModes, axes_of
from shm.read.profiles import Profile
from shm.read.sandbox import foreign_modes
from shm.report.formatting import plain
from shm.store import Workspace
from shm_cli import flags
from shm_cli.common import can_ask, open_workspace, show, show_rows
from shm_cli.import_prompts import asked, asked_if_it_stays
from shm_daemon.spool import Landed, incoming


def import_modes(
    modes: ForeignModes, workspace: Workspace, answers: Answers, planes: Sequence[str], *,
    dry_run: bool, asks: bool,
) -> int:  # fmt: skip
    """Take in the modes of a file, or say what is open; return the exit code."""
    answers = replace(answers, channels=_planes(planes, axes_of(modes.modes)))
    found = understand_modes(modes, workspace, answers)
    if found.questions and asks:
        answers = asked(
            found.questions, answers, workspace, lambda _, text: {"plane": plane_named(text)}
        )
        answers = asked_if_it_stays(answers, is_known=found.is_known or dry_run)
        found = understand_modes(modes, workspace, answers)
    landed = None
    if found.test is not None and not dry_run:
        keep_modes_profile(found, workspace, answers)
        landed = _land_modes(found, workspace)
    if flags.wants_json():
        show(_modes_document(found, landed), "import_modes")
    else:
        _show_modes(found, landed)
    return 0 if found.test is not None else BadInput.exit_code


def _planes(given: Sequence[str], axes: Sequence[str]) -> dict[str, dict[str, object]]:
    found: dict[str, dict[str, object]] = {}
    for pair in (pair for value in given for pair in value.split(",")):
        axis, mark, plane = pair.partition("=")
        if not mark or axis.strip() not in axes:
            raise UsageError(
                f"--plane {pair} names no axis of the shapes.",
                remedy=f"Give AXIS=PLANE, of the axes {', '.join(axes)}.",
            )
        found[axis.strip()] = {"plane": plane_named(plane.strip())}
    return found


def _land_modes(found: ImportedModes, workspace: Workspace) -> Landed:
    with incoming(workspace.spool, workspace.settings.max_file_bytes) as coming:
        coming.write(found.document.encode())
        return coming.land(f"{Path(found.found.source).stem}.modes.json", {})


def _show_modes(found: ImportedModes, landed: Landed | None) -> None:
    program = found.found.program or "another program"
    name = Path(found.found.source).name
    rows = [
        (
            f"{mode.frequency_hz:.4g}", str(order or ""), mode.axis,
            found.planes.get(mode.axis, ""),
            f"{100 * mode.damping_ratio:.2g}" if math.isfinite(mode.damping_ratio) else "",
            str(len(mode.points)),
        )
        for mode, order in zip(found.found.modes, found.orders, strict=True)
    ]  # fmt: skip
    headings = ("Hz", "order", "axis", "plane", "damping (%)", "places")
    show_rows(f"{name}: modes of {program}", headings, rows)
    for note in found.notes:
        click.echo(f"note: {note}")
    for question in found.questions:
        click.echo(f"open: {question.text}", err=True)
    if found.questions:
        options = " ".join(question.option for question in found.questions)
        click.echo(f"Add: shm import {shlex.quote(found.found.source)} {options}", err=True)
    if landed is not None:
        click.echo(f"In the spool as {landed.path.name}.")


def _modes_document(found: ImportedModes, landed: Landed | None) -> dict[str, Any]:
    return {
        "file": found.found.source,
        "program": found.found.program,
        "hanger": found.hanger,
        "modes": [
            {
                "frequency_hz": mode.frequency_hz, "damping_ratio": mode.damping_ratio,
                "order": order, "axis": mode.axis, "plane": found.planes.get(mode.axis),
            }
            for mode, order in zip(found.found.modes, found.orders, strict=True)
        ],
        "questions": [question_document(question) for question in found.questions],
        "remarks": list(found.notes),
        "landed": None if landed is None else str(landed.path),
    }  # fmt: skip


_BARS = " ▁▂▃▄▅▆▇█"
UFF_SUFFIXES = (".uff", ".unv", ".uf")


@click.command()
@click.argument("file", type=flags.FILE)
@click.option("--hanger", type=click.IntRange(min=0), metavar="N", help="The hanger tested.")
@click.option(
    "--each-time", is_flag=True, help="The logger goes from hanger to hanger: ask each time."
)
@click.option(
    "--place", multiple=True, metavar="[NAME=]M", help="Metres of a sensor from the deck end."
)
@click.option(
    "--plane", multiple=True, metavar="[NAME=]PLANE", help="Plane in which a sensor measures."
)
@click.option("--unit", multiple=True, metavar="NAME=UNIT", help="Unit of a column that has none.")
@click.option(
    "--sensitivity", multiple=True, metavar="NAME=S", help="Of a sensor in volts: '100 mV/g'."
)
@click.option("--leave-out", multiple=True, metavar="NAME", help="A column that is no channel.")
@click.option("--rate", type=float, metavar="HZ", help="Samples a second, if the file says none.")
@click.option(
    "--time",
    type=flags.Words(),
    help="When the test was, if the file does not say; or 'unknown'.",
)
@click.option("--temperature", type=float, metavar="C", help="Degrees Celsius of the steel.")
@click.option("--operator", default="", metavar="NAME", help="Who measured.")
@click.option("--dry-run", is_flag=True, help="Only show what is understood; keep nothing.")
@flags.json
def command(file: Path, dry_run: bool, **options: Any) -> int:
    """Take in the first file of a logger; asks what it does not say.

    Later files of that logger need no answers: use `shm ingest FILE`, or copy them into the spool.

    Shows each column with its meaning, range, hits and clipping, and asks for what the file does
    not say: hanger, positions and planes of the sensors, units. The answers are stored in
    loggers/. With --each-time the hanger is not stored: each file must name it.

    Without a terminal nothing is asked: exit code 3, and the options to add.

    \b
    Example: shm import export.csv
    Example: shm import export.csv --hanger 3 --place 4.2,4.2 --plane transverse,longitudinal
    """
    workspace = open_workspace()
    asks = can_ask()
    if options["hanger"] is not None:
        workspace.bridge.tested(options["hanger"])
    first = look_into(file, workspace, _whole_file(options))
    modes = None if first.columns else _modes_in(file, workspace)
    if modes is not None:
        return import_modes(
            modes, workspace, _whole_file(options), options["plane"],
            dry_run=dry_run, asks=asks,
        )  # fmt: skip
    answers = _answers(options, first)
    found = (
        first if answers == _whole_file(options) else understand(first.survey, workspace, answers)
    )
    if found.questions and asks:
        _show(found)
        answers = asked(found.of_test, answers, workspace, partial(_answer, found))
        while found.questions:  # a column with a unit may be a sensor, whose place is asked next
            answers = asked(found.questions, answers, workspace, partial(_answer, found))
            found = understand(found.survey, workspace, answers)
        answers = asked_if_it_stays(answers, is_known=_is_described(found) or dry_run)
    landed, profile = None, found.profile
    if found.is_ready and not dry_run:
        profile = keep_profile(found, workspace, each_time=answers.each_time)
        landed = _land(file, workspace, found)
    if flags.wants_json():
        show(_document(found, profile, landed))
    else:
        _show(found)
        _say_next(found, profile, landed, file, workspace)
    return 0 if found.is_ready else BadInput.exit_code


def _is_described(found: Import) -> bool:
    return found.profile is not None and found.profile.answers_questions


def _modes_in(file: Path, workspace: Workspace) -> ForeignModes | None:
    """Return modes of another program, where a UFF file holds nothing else that is read."""
    is_universal = any(part in file.name.lower() for part in UFF_SUFFIXES)
    return foreign_modes(file, read_limits(workspace.settings)) if is_universal else None


# ---------------------------------------------------------------- answers


def _whole_file(options: dict[str, Any]) -> Answers:
    """Return the answers of the options for the complete file."""
    rate, temperature = options["rate"], options["temperature"]
    if rate is not None and not 0 < rate < math.inf:
        raise UsageError(
            f"--rate {rate:g} is no rate.", remedy="Give samples a second: --rate 512."
        )
    answers = Answers(
        options["hanger"],
        math.nan if rate is None else rate,
        temperature_c=math.nan if temperature is None else temperature,
        operator=options["operator"].strip(),
        each_time=options["each_time"],
    )
    time = options["time"]
    return answers if time is None else answer_of_test("time", time, answers)


def _answers(options: dict[str, Any], found: Import) -> Answers:
    """Return the answers of the options, those for channels included."""
    names = [column.name for column in found.survey.columns]
    tables: dict[str, dict[str, object]] = {}
    for name in options["leave_out"]:
        tables.setdefault(_column(name, names), {})["leave_out"] = True
    for key, values in (("unit", options["unit"]), ("sensitivity", options["sensitivity"])):
        for name, value in _named(key, values, names, names):
            tables.setdefault(name, {}).update(
                channel_answer(key, value, unit_recorded(name, found))
            )
    sensors = _accelerations(found, tables)
    for key, values in (("place", options["place"]), ("plane", options["plane"])):
        for name, value in _named(key, values, names, sensors):
            tables.setdefault(name, {}).update(channel_answer(key, value))
    return replace(_whole_file(options), channels=tables)


def _accelerations(found: Import, tables: dict[str, dict[str, object]]) -> list[str]:
    """Return the accelerations in the order of the file, with those that the options make such."""
    known = {column.name: column.quantity for column in found.columns}
    for name, given in tables.items():
        unit = unit_of(str(given.get("unit", "")))
        if "leave_out" in given or unit is not None:
            known[name] = None if unit is None else unit.quantity
    return [name for name, quantity in known.items() if quantity == "acceleration"]


def _named(
    option: str, values: Sequence[str], names: Sequence[str], in_order: Sequence[str]
) -> list[tuple[str, str]]:
    """Return names and values: NAME=VALUE, or in the order of the sensors, or one for all."""
    found: list[tuple[str, str]] = []
    plain: list[str] = []
    for value in values:
        name, mark, rest = value.rpartition("=")
        if mark:
            found.append((_column(name, names), rest.strip()))
        else:
            plain += [part.strip() for part in value.split(",")]
    others = [name for name in names if name not in in_order] or ["NAME"]
    example = f"{shlex.quote(others[0])}=..."
    if len(plain) == 1:
        plain = plain * max(1, len(in_order))
    if plain and len(plain) != len(in_order):
        raise UsageError(
            f"--{option} gives {len(plain)} values for {len(in_order)} channels.",
            remedy=f"Give one each, in this order: {', '.join(in_order) or 'none is known'}. Name "
            f"any other column, such as the hammer: --{option} {example}.",
        )
    return found + list(zip(in_order, plain, strict=False))


def _column(name: str, names: Sequence[str]) -> str:
    if name.strip() in names:
        return name.strip()
    raise UsageError(f"the file has no column {name!r}.", remedy=f"It has {', '.join(names)}.")


def _answer(found: Import, question: Question, text: str) -> dict[str, object]:
    return answer_to(question, text, found)


# ---------------------------------------------------------------- what is shown and kept


def _land(file: Path, workspace: Workspace, found: Import) -> Landed:
    """Put the file into the spool with its sidecar, for the daemon to take."""
    with incoming(workspace.spool, workspace.settings.max_file_bytes) as coming:
        with file.open("rb") as stream:
            while piece := stream.read(1 << 20):
                coming.write(piece)
        return coming.land(file.name, found.described)


def _show(found: Import) -> None:
    rate, survey = found.sampling_rate_hz, found.survey
    time = found.described.get("time", survey.time)
    parts = (
        f"{Path(survey.source).name}: {survey.format}",
        f"hanger {found.hanger}" if found.hanger is not None else "hanger not named",
        f"{time:%Y-%m-%d %H:%M} UTC" if isinstance(time, datetime) else "time not recorded",
        f"{survey.samples} samples" if survey.samples else "",
        f"{survey.samples / rate:.1f} s at {rate:g} Hz" if rate > 0 else "rate not recorded",
    )
    rows = [[cell_of(column) for cell_of in _COLUMNS.values()] for column in found.columns]
    show_rows(", ".join(part for part in parts if part), tuple(_COLUMNS), rows)
    for remark in found.remarks:
        click.echo(f"note: {remark}")


def _range(column: Understood) -> str:
    if not math.isfinite(column.largest):
        return ""
    unit = "N" if column.quantity == "force" else "m/s²"
    return f"{plain(column.least)} to {plain(column.largest)} {unit}"


def _seen(column: Understood) -> str:
    words = [] if column.hits is None else [f"{column.hits} hit{'s' * (column.hits != 1)}"]
    words += [f"{column.overloads} overloads"] if column.overloads else []
    words += ["clipped"] if column.is_clipped else []
    return ", ".join(words)


_COLUMNS: dict[str, Callable[[Understood], str]] = {
    "column": lambda column: column.name,
    "unit": lambda column: column.unit,
    "taken for": lambda column: column.quantity or "left out",
    "plane": lambda column: column.plane or "",
    "x (m)": lambda column: f"{column.x_m:g}" if math.isfinite(column.x_m) else "",
    "range": _range,
    "seen": _seen,
    "over time": lambda column: "".join(
        _BARS[round(share * (len(_BARS) - 1))] for share in column.outline
    ).replace(" ", "·"),
}


def _say_next(
    found: Import, profile: Profile | None, landed: Landed | None, file: Path, workspace: Workspace
) -> None:
    for problem in found.problems:
        click.echo(f"problem: {problem}", err=True)
    if found.questions:
        for question in found.questions:
            click.echo(f"open: {question.text}", err=True)
        options = " ".join(question.option for question in found.questions)
    if found.questions and landed is None:
        click.echo(f"Add: shm import {shlex.quote(str(file))} {options}", err=True)
    if landed is None:
        return
    if profile is not None:
        where = profile.path.relative_to(workspace.folder)
        roams = " It goes from hanger to hanger: each file must say its own." * profile.roams
        click.echo(f"Kept for all files of this logger: {where}.{roams}")
    command = f"shm --workspace {shlex.quote(str(workspace.folder))} daemon --once"
    running = workspace.holder() is not None
    then = "the daemon takes it" if running else f"no daemon runs; `{command}` takes it"
    click.echo(f"In the spool as {landed.path.name}: {then}.")


def _document(found: Import, profile: Profile | None, landed: Landed | None) -> dict[str, Any]:
    return {
        "file": found.survey.source,
        **import_document(found),
        "profile": None if profile is None else str(profile.path),
        "landed": None if landed is None else str(landed.path),
    }
