"""`shm ingest --peek`: what a crew sees before anything is done."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from shm.pipeline.importing import Answers, keep_profile, look_into, understand
from shm.read import bundle, sidecar_path
from shm.values import FrequencyResponse, Recording
from shm_cli.main import run
from tests.helpers.workspaces import make_workspace
from tests.helpers.written import write


def shown(capsys: pytest.CaptureFixture[str], *files: Path, code: int = 0) -> str:
    assert run(["ingest", "--peek", *map(str, files)]) == code
    return capsys.readouterr().out


def test_calibration_and_full_scale_are_shown_where_there_are_any(
    recording: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "test.h5"
    write(recording, path)
    assert "full scale" not in shown(capsys, path)
    sidecar_path(path).write_text("[channel.acc_1]\ncalibration = 10.25\nfull_scale = 49.5\n")
    out = shown(capsys, path)
    assert "full scale" in out
    assert "10.25" in out
    assert "49.5" in out


def test_frequency_responses_and_ambient_records_are_named_as_such(
    recording: Recording,
    response: FrequencyResponse,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    write(response, tmp_path / "response.mat")
    write(Recording("", recording.channels[1:], 512.0), tmp_path / "ambient.npz")
    out = shown(capsys, tmp_path / "response.mat", tmp_path / "ambient.npz", code=3)
    assert "frequency responses of 65 lines every 0.0195312 Hz" in out
    assert "ambient (no hammer force)" in out


def test_every_member_of_a_test_is_shown_with_its_problems(
    recording: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.csv", "b.uff"):
        write(recording, tmp_path / name)
    (tmp_path / "c.csv").write_text("force,acc_1\n")
    archive = bundle([tmp_path / name for name in ("a.csv", "b.uff", "c.csv")], tmp_path / "t.zip")
    assert run(["ingest", "--peek", str(archive)]) == 3
    captured = capsys.readouterr()
    for name in ("t.zip/a.csv: CSV", "t.zip/b.uff: UFF", "t.zip/c.csv: CSV"):
        assert name in captured.out
    assert "problem: c.csv: the record has 0 samples" in captured.err


def test_what_is_left_out_is_no_problem(
    recording: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "test.csv"
    write(recording, path)
    sidecar_path(path).write_text("[channel.acc_2]\nleave_out = true\n")
    assert "left out: acc_2" in shown(capsys, path)
    assert run(["ingest", "--peek", "--json", str(path)]) == 0
    (look,) = json.loads(capsys.readouterr().out)["files"]
    assert (look["left_out"], look["problems"]) == (["acc_2"], [])


def strip_planes(recording: Recording) -> Recording:
    bare = tuple(replace(channel, plane=None) for channel in recording.channels)
    return replace(recording, channels=bare, hanger=None)


def test_peek_missing_planes(
    recording: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "test.csv"
    write(strip_planes(recording), path)
    assert run(["ingest", "--peek", str(path)]) == 3
    said = capsys.readouterr().err
    assert f"missing: plane of acc_1, acc_2: run `shm import {path}`" in said
    assert run(["ingest", "--peek", "--json", str(path)]) == 3
    (look,) = json.loads(capsys.readouterr().out)["files"]
    assert look["missing"] == ["plane of acc_1, acc_2"]
    sidecar_path(path).write_text('plane = ["transverse", "longitudinal"]\n')
    assert run(["ingest", "--peek", str(path)]) == 0
    assert capsys.readouterr().err == ""


def test_peek_in_workspace(
    recording: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A workspace needs the hanger as well, and knows what its loggers' profiles say."""
    workspace = make_workspace(tmp_path / "bridge", hangers=(3,))
    path = tmp_path / "test.csv"
    write(strip_planes(recording), path)
    peek = ["--workspace", str(workspace.folder), "ingest", "--peek", str(path)]
    assert run(peek) == 3
    assert "missing: hanger; plane of acc_1, acc_2: run" in capsys.readouterr().err
    found = look_into(path, workspace, Answers())
    sensors = {
        "acc_1": {"plane": "transverse", "x_m": 2.5},
        "acc_2": {"plane": "longitudinal", "x_m": 2.5},
    }
    keep_profile(understand(found.survey, workspace, Answers(3, channels=sensors)), workspace)
    assert run(peek) == 0
    out = capsys.readouterr()
    assert out.out.startswith(f"{path}: CSV, hanger 3")
    assert out.err == ""


def test_peek_structure_needs_no_planes(
    recording: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    workspace = make_workspace(tmp_path / "bridge", hangers=(3,))
    described = workspace.folder / "bridge.toml"
    described.write_text(f'{described.read_text()}\n[[structure]]\nid = 9\nname = "deck"\n')
    path = tmp_path / "test.csv"
    write(replace(strip_planes(recording), hanger=9), path)
    assert run(["--workspace", str(workspace.folder), "ingest", "--peek", str(path)]) == 0
    assert capsys.readouterr().err == ""
