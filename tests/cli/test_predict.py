"""`shm predict`: names as in the thesis, one set or a sweep."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shm.bridge import load_hanger
from shm.models import THESIS, build
from shm_cli.example import HANGER_FILE
from tests.cli.conftest import Shm

STIFF = [part for k in range(1, 5) for part in ("--set", f"log10_k{k}=12")]


def test_the_document_holds_the_frequencies_of_the_model(shm: Shm, hanger_file: Path) -> None:
    ended = shm(
        "predict", "beam1", "--hanger-file", hanger_file, "--set", "theta_F=1.1",
        "--set", "theta_L=0.97", "--modes", 4, "--json",
    )  # fmt: skip
    assert ended.code == 0
    assert ended.document["model"] == "beam1"
    rows = ended.document["frequencies"]
    assert [(row["plane"], row["order"]) for row in rows] == [
        (plane, order) for plane in ("transverse", "longitudinal") for order in (1, 2, 3, 4)
    ]
    model = build("beam1", load_hanger(hanger_file), THESIS)
    exact = model.frequencies_hz(np.array([[1.1, 0.97]]), 4)[0]
    assert [row["frequency_hz"] for row in rows] == pytest.approx(exact.ravel())


def test_a_spring_that_is_not_set_is_named(shm: Shm, hanger_file: Path) -> None:
    ended = shm("predict", "beam2", "--hanger-file", hanger_file, *STIFF[2:])
    assert ended.code == 2
    assert "log10_k1" in ended.err


def test_a_sweep_gives_a_row_for_each_value(shm: Shm, hanger_file: Path) -> None:
    ended = shm(
        "predict", "beam2", "--hanger-file", hanger_file, *STIFF,
        "--sweep", "theta_F=0.5:2:4", "--json",
    )  # fmt: skip
    points = ended.document["points"]
    assert [point["theta_F"] for point in points] == [0.5, 1.0, 1.5, 2.0]
    first = [point["frequencies"][0]["frequency_hz"] for point in points]
    assert first == sorted(first)


def test_the_table_of_a_sweep_has_a_column_a_mode(shm: Shm, hanger_file: Path) -> None:
    told = shm("predict", "beam1", "--hanger-file", hanger_file, "--sweep", "theta_L=0.9:1:2").out
    assert "T1" in told
    assert "L6" in told


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["beam9"], "beam1, "),
        (["beam1", "--set", "theta_F"], "NAME=VALUE"),
        (["beam1", "--set", "theta_X=1"], "unknown ['theta_X']"),
        (["beam1", "--sweep", "theta_F=1:2"], "NAME=FROM:TO:N"),
        (["beam1", "--set", "theta_L=-1"], "no frequencies at theta_F=1, theta_L=-1"),
        (["beam1", "--set", "theta_L=0"], "no frequencies at theta_F=1, theta_L=0"),
    ],
)
def test_a_wrong_parameter_is_a_usage_error_that_says_how(
    shm: Shm, hanger_file: Path, arguments: list[str], said: str
) -> None:
    ended = shm("predict", *arguments, "--hanger-file", hanger_file)
    assert ended.code == 2
    assert said in ended.err


def test_a_sweep_is_drawn(shm: Shm, hanger_file: Path, tmp_path: Path) -> None:
    drawn = ("--sweep", "theta_F=0.5:2:4", "--figure", tmp_path / "sweep.png")
    assert shm("predict", "beam1", "--hanger-file", hanger_file, *drawn).code == 0
    assert (tmp_path / "sweep.png").read_bytes().startswith(b"\x89PNG")
    nowhere = ("--figure", tmp_path / "no" / "sweep.png")
    assert "is no folder" in shm("predict", "beam1", *drawn[:2], *nowhere).err
    alone = shm("predict", "beam1", "--hanger-file", hanger_file, *drawn[2:])
    assert alone.code == 2
    assert "--sweep" in alone.err


def test_predict_draws_a_mode_of_a_solid_and_refuses_a_beam_s(shm: Shm, tmp_path: Path) -> None:
    path = tmp_path / "mode.png"
    given = ("--hanger-file", HANGER_FILE, "--shape", "longitudinal:1", "--figure", path)
    ended = shm("predict", "s1", *given)
    assert (ended.code, ended.err) == (0, "")
    assert f"is drawn in {path}" in ended.out.replace("\n", " ")
    assert path.read_bytes().startswith(b"\x89PNG")
    assert "is no solid" in shm("predict", "beam1", *given).err
