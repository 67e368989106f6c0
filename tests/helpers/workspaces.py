"""Workspaces and modal-tests files for tests."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from shm.documents import dump
from shm.models import THESIS, build
from shm.modes_document import modes_document
from shm.store import Workspace
from shm.values import PLANES, Hanger, ModalTest, Mode

START = datetime(2026, 5, 1, 10, 0, tzinfo=UTC)
QUICK = {
    "models": "beam1",
    "samples": 100,
    "spool_scan_seconds": 0.05,
    "spool_stable_seconds": 0.0,
    "alert_grouping_seconds": 0.0,
}


def make_workspace(
    folder: Path,
    *,
    hangers: Sequence[int] = (3,),
    settings: Mapping[str, object] | None = None,
    hooks: Mapping[str, Sequence[str]] | None = None,
) -> Workspace:
    """A workspace whose hangers are all like hanger 3 of the thesis."""
    lines = ['[bridge]\nname = "Test bridge"']
    for number in hangers:
        lines.append(
            f"[[hanger]]\nid = {number}\ndiameter_m = 0.130\nlength_m = 12.0\n"
            "elastic_modulus_pa = 200e9\ndensity_kg_m3 = 7800\nnominal_tension_n = 711e3"
        )
    for name, command in (hooks or {}).items():
        lines.append(f"[[hook]]\nname = {json.dumps(name)}\ncommand = {json.dumps(list(command))}")
    values = {**QUICK, **(settings or {})}
    lines.append("[settings]\n" + "\n".join(f"{k} = {json.dumps(v)}" for k, v in values.items()))
    config = folder.with_name(f"{folder.name}.toml")
    config.write_text("\n\n".join(lines) + "\n")
    return Workspace.initialise(folder, config)


def modes_of(hanger: Hanger, tension: float, modes: int = 6) -> tuple[Mode, ...]:
    """The first modes of a clamped beam, in both planes, at a fraction of the nominal tension."""
    model = build("beam1", hanger, THESIS)
    theta = np.array([[tension if name == "theta_F" else 1.0 for name in model.parameter_names]])
    frequencies = model.frequencies_hz(theta, modes)[0]
    return tuple(
        Mode(plane, order + 1, float(frequencies[row, order]))
        for row, plane in enumerate(PLANES)
        for order in range(modes)
    )


def write_test(
    path: Path,
    workspace: Workspace,
    *,
    hanger: int = 3,
    day: float = 0.0,
    tension: float = 1.0,
    name: str = "",
) -> ModalTest:
    """Writes a `*.modes.json` of one test, whole at once, and returns the test."""
    described = replace(workspace.bridge.hangers[0], id=hanger)
    test = modelled_test(name or path.name.removesuffix(".modes.json"), described, day, tension)
    put(path, dump(modes_document([test])))
    return test


def modelled_test(name: str, hanger: Hanger, day: float = 0.0, tension: float = 1.0) -> ModalTest:
    """A test at a fraction of the nominal tension, all of one temperature."""
    return ModalTest(
        id=name,
        modes=modes_of(hanger, tension),
        hanger=hanger.id,
        time=START + timedelta(days=day),
        temperature_c=11.5,
    )


def write_loss(folder: Path, workspace: Workspace, lost: int = 2) -> None:
    """Writes `t0`, and of the days up to so many months later tests with a fifth less tension.

    `t1` is to be repeated, since it may be a blunder; `t2`, a day later, agrees with it, which is
    an alert. That the watch detects a change takes more tests before it and later visits: see
    `write_slow_loss`.
    """
    for number in range(1 + lost):
        path, day = folder / f"t{number}.modes.json", 29 * lost + number if number else 0
        write_test(path, workspace, day=day, tension=0.8 if number else 1.0)


SLOW_LOSS = (1.0, 1.0, 1.0, 1.0, 0.96, 0.93, 0.92)


def write_slow_loss(folder: Path, workspace: Workspace) -> None:
    """Writes `t0` to `t6`, one a month, whose loss no two tests tell before `t6`.

    Then the watch detects it and is sure that it is beyond the threshold: one alert.
    """
    for number, tension in enumerate(SLOW_LOSS):
        path = folder / f"t{number}.modes.json"
        write_test(path, workspace, day=30 * (number - 4), tension=tension)


def put(path: Path, content: str | bytes) -> None:
    """Writes a file and gives it its name at the end, as a careful uploader does."""
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_bytes(content if isinstance(content, bytes) else content.encode())
    temporary.rename(path)


def write_held(workspace: Workspace, hanger: int, folder: Path | None = None) -> None:
    """Write a test of 1970 into the spool or a folder; it is held until a person decides."""
    test = modelled_test(f"epoch{hanger}", workspace.bridge.hanger(hanger), tension=0.9)
    test = replace(test, time=datetime(1970, 1, 1, tzinfo=UTC))
    put((folder or workspace.spool) / f"{test.id}.modes.json", dump(modes_document([test])))
