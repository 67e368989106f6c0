"""`shm acquire` writes a test that `shm ingest` takes in."""

from __future__ import annotations

import zipfile
from functools import partial
from pathlib import Path

import pytest

from shm import acquire
from shm.read import read_test
from tests.cli.conftest import Shm
from tests.helpers.workspaces import make_workspace

HIT = ("--hammer", "1.9:transverse:5000", "--sensor", "2.52:transverse:400",
       "--sensor", "4.4:transverse:400", "--seconds", "8", "--most-hits", "4")  # fmt: skip


@pytest.fixture
def described(shm: Shm, hanger_file: Path) -> tuple[str, ...]:
    return ("acquire", "--hanger-file", str(hanger_file), *HIT)


def test_acquired_test_is_ingested(shm: Shm, described: tuple[str, ...], tmp_path: Path) -> None:
    out = tmp_path / "test.zip"

    ended = shm(*described, "--device", "simulated", "--out", out, "--temperature-c", 8, "--json")

    assert ended.code == 0, ended.err
    assert ended.document["schema"] == "shm.acquire/1"
    assert ended.document["is_enough"]
    assert len(ended.document["rejected"]) == 2
    for words in ("hit now", "Double hit", "Overload", "noise"):
        assert words in ended.err
    records = read_test(out)
    assert len(records) == ended.document["hits"] == 3
    assert {(each.hanger, each.temperature_c) for each in records} == {(3, 8.0)}
    workspace = make_workspace(tmp_path / "bridge", settings={"models": "beam2"})
    at = ("--workspace", workspace.folder)
    assert shm(*at, "ingest", out).code == 0
    (row,) = shm(*at, "status", "--json").document["hangers"]
    tension = row["averaged"]["tension_n"]
    assert tension["q05"] < 711e3 < tension["q95"]


def test_acquire_lost_keeps_file(
    shm: Shm,
    described: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = tmp_path / "test.zip"
    vanishing = partial(acquire.SimulatedDevice, lost_s=15.0)
    monkeypatch.setattr(acquire, "SimulatedDevice", vanishing)

    ended = shm(*described, "--device", "simulated", "--out", out)

    assert ended.code == 3
    assert "1 hit is kept in" in ended.err
    with zipfile.ZipFile(out) as archive:
        assert archive.namelist() == ["hit01.csv"]


@pytest.mark.parametrize(
    ("option", "text", "wrong"),
    [
        ("--hammer", "1.9:5000", "X:PLANE:FULL_SCALE"),
        ("--sensor", "2.5:vertical:400", "X:PLANE:FULL_SCALE"),
        ("--sensor", "2.5:transverse:0", "X:PLANE:FULL_SCALE"),
        ("--out", "test.csv", "no .zip"),
    ],
)
def test_acquire_bad_call(
    shm: Shm, described: tuple[str, ...], tmp_path: Path, option: str, text: str, wrong: str
) -> None:
    out = ("--out", str(tmp_path / "test.zip"))
    value = str(tmp_path / text) if option == "--out" else text

    ended = shm(*described, "--device", "simulated", *out, option, value)

    assert ended.code == 2
    assert wrong in ended.err
