"""What `shm import` does with modes that another program identified."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import rich_click as click

from shm.errors import BadInput, UsageError
from shm.pipeline.import_answers import plane_named, question_document
from shm.pipeline.importing import Answers
from shm.pipeline.importing_modes import ImportedModes, keep_modes_profile, understand_modes
from shm.read.modal_sets import ForeignModes, axes_of
from shm.store import Workspace
from shm_cli.common import show, show_table, table
from shm_cli.import_prompts import asked, asked_if_it_stays
from shm_daemon.spool import Landed, incoming


def import_modes(
    modes: ForeignModes, workspace: Workspace, answers: Answers, planes: Sequence[str], *,
    dry_run: bool, as_json: bool, asks: bool,
) -> int:  # fmt: skip
    """Takes the modes of a file in, or says what is open; the exit code."""
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
        landed = _land(found, workspace)
    if as_json:
        show(_document(found, landed))
    else:
        _show(found, landed)
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


def _land(found: ImportedModes, workspace: Workspace) -> Landed:
    with incoming(workspace.spool, workspace.settings.max_file_bytes) as coming:
        coming.write(found.document.encode())
        return coming.land(f"{Path(found.found.source).stem}.modes.json", {})


def _show(found: ImportedModes, landed: Landed | None) -> None:
    program = found.found.program or "another program"
    name = Path(found.found.source).name
    made = table(
        f"{name}: modes of {program}", "Hz", "order", "axis", "plane", "damping (%)", "places"
    )
    for mode, order in zip(found.found.modes, found.orders, strict=True):
        made.add_row(
            f"{mode.frequency_hz:.4g}",
            str(order or ""),
            mode.axis,
            found.planes.get(mode.axis, ""),
            f"{100 * mode.damping_ratio:.2g}" if math.isfinite(mode.damping_ratio) else "",
            str(len(mode.points)),
        )
    show_table(made)
    for note in found.notes:
        click.echo(f"note: {note}")
    for question in found.questions:
        click.echo(f"open: {question.text}", err=True)
    if found.questions:
        options = " ".join(question.option for question in found.questions)
        click.echo(f"Add: shm import {shlex.quote(found.found.source)} {options}", err=True)
    if landed is not None:
        click.echo(f"In the spool as {landed.path.name}.")


def _document(found: ImportedModes, landed: Landed | None) -> dict[str, Any]:
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
