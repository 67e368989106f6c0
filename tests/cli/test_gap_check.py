"""`shm gap check`: a table, a document and a picture; what it cannot do it says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from shm.bridge import load_hanger
from shm.gap import check as module
from shm.gap.twin import Twin
from shm.modes_document import load_modes
from shm.store import Workspace
from shm_cli import gap_check as command
from tests.cli.conftest import Shm
from tests.helpers.gap_checks import names_from

QUICK = ["--effects", "distributed_mass,timebase", "--sound", 1, "--processes", 1]


@pytest.fixture
def call(
    shm: Shm, modes_file: Path, hanger_file: Path, monkeypatch: pytest.MonkeyPatch
) -> list[object]:
    """Make a check whose diagnoses name a mass where frequencies are more than 1 % off."""
    twin = Twin(load_modes(modes_file), load_hanger(hanger_file), "beam1", 1)
    monkeypatch.setattr(module, "diagnose", names_from(twin, 0.01, "distributed_mass"))
    return ["gap", "check", modes_file, "--hanger-file", hanger_file, *QUICK]


def test_check_prints_a_table(shm: Shm, call: list[object]) -> None:
    ended = shm.done(*call)
    assert "About 6 diagnoses of 5 to 30 s each, 1 at a time" in ended.err
    for said in (
        "distributed mass 9.7 % or more 9.7 % or more 2.1 %: not visible",
        "timebase (all tests) not found 2.4 %: taken for distributed mass",
        "a gap is claimed in 0 of 1",
    ):
        assert said in ended.told


def test_check_gives_a_document(shm: Shm, call: list[object], tmp_path: Path) -> None:
    for name, begins in (("c.svg", b"<?xml"), ("c.png", b"\x89PNG")):
        document = shm.json(*call, "--figure", tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(begins)
    assert document["schema"] == "shm.gap_check/1"
    mass, clock = document["effects"]
    assert mass["size"] == mass["sizes"][mass["found_from"]]
    assert (clock["size"], clock["taken_for"]) == (None, ["distributed_mass"])


def test_check_interrupted(shm: Shm, call: list[object], monkeypatch: pytest.MonkeyPatch) -> None:
    quick, done = vars(module)["diagnose"], 0

    def interrupted(*given: Any) -> Any:
        nonlocal done
        done += 1
        if done == 3:  # two sizes of the mass are through
            raise KeyboardInterrupt
        return quick(*given)

    monkeypatch.setattr(module, "diagnose", interrupted)
    ended = shm(*call)
    assert ended.code == 130
    assert "distributed mass" in ended.out
    assert "timebase" not in ended.out
    assert "Stopped: 1 of 3 searches are done." in ended.out


def test_check_in_processes(shm: Shm, call: list[object], monkeypatch: pytest.MonkeyPatch) -> None:
    from concurrent.futures import ThreadPoolExecutor
    from contextlib import contextmanager

    asked = []

    @contextmanager
    def threads(processes: int) -> Any:
        asked.append(processes)
        with ThreadPoolExecutor(processes) as pool:
            yield pool

    alone = shm.json(*call)
    monkeypatch.setattr(command, "_executor", threads)
    together = shm.json(*call[:-1], 2)
    assert asked == [2]
    assert together == alone


def test_check_without_test(shm: Shm, bridge: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    twin = Twin((), bridge.bridge.hanger(4), "beam1", 1)
    monkeypatch.setattr(module, "diagnose", names_from(twin, 0.01, "distributed_mass"))
    told = shm.at(bridge).told("gap", "check", "--hanger", 4, *QUICK)
    assert "a usual hammer test, for no test is there" in told
