"""`shm ingest --peek`: what a crew sees before anything is done."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from shm.read import bundle, sidecar_path
from shm.values import FrequencyResponse, Recording
from shm_cli.main import run
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
