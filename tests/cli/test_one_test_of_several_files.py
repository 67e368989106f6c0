"""A roving hammer over several files: identified, taken in and shown as one test."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from shm.identify import Identification, identify
from shm.pipeline import reporting
from shm.store import Stage, Workspace
from shm.store.recordings import count_stages
from shm_cli import working
from shm_cli.main import run
from tests.cli.conftest import Shm
from tests.helpers.flows import threads
from tests.helpers.painting import unpaint
from tests.helpers.workspaces import make_workspace

PLACES_M = (1.9, 2.7, 3.5)


@pytest.fixture(scope="module")
def set_ups(tmp_path_factory: pytest.TempPathFactory, hanger_file: Path) -> list[Path]:
    """One biaxial sensor stays, the hammer strikes three places in turn."""
    folder = tmp_path_factory.mktemp("roving")
    for number, place_m in enumerate(PLACES_M):
        call = [
            "simulate", "--hanger-file", str(hanger_file), "--sensors", "1", "--hits", "3",
            "--seconds", "6", "--hammer-x", str(place_m), "--seed", str(number),
            "--out", str(folder / str(number)),
        ]  # fmt: skip
        assert run(call) == 0
        (made,) = (folder / str(number)).glob("*.csv")
        made.rename(folder / f"set_up_{number}.csv")
    return sorted(folder.glob("*.csv"))


@pytest.fixture(scope="module")
def taken_in(
    tmp_path_factory: pytest.TempPathFactory, set_ups: list[Path]
) -> tuple[Workspace, int]:
    workspace = make_workspace(tmp_path_factory.mktemp("together") / "bridge")
    files = [str(path) for path in set_ups]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(working, "executor_of", threads)
        code = run(["--workspace", str(workspace.folder), "ingest", "--together", *files])
    return workspace, code


@pytest.mark.slow
def test_the_shapes_of_a_roving_hammer_stand_at_its_places(
    shm: Shm, set_ups: list[Path], hanger_file: Path
) -> None:
    ended = shm("identify", "--together", *set_ups, "--hanger-file", hanger_file, "--json")
    assert ended.code == 0, ended.err
    (test,) = ended.document["tests"]
    assert {tuple(point["x_m"] for point in mode["shape"]) for mode in test["modes"]} == {PLACES_M}
    assert len(test["modes"]) >= 6


def test_files_taken_in_together_are_one_test_kept_as_one_archive(
    taken_in: tuple[Workspace, int],
) -> None:
    workspace, code = taken_in
    assert code == 0
    with workspace.store() as store:
        assert sum(count_stages(store).values()) == count_stages(store)[Stage.DONE] == 1
        (stored,) = store.tests.list_all(3)
        assert store.recordings.get(stored.recording_id).file.file_name == "set_up_0.zip"
    assert stored.test.id == "set_up_0"
    assert {check.name for check in stored.quality} >= {"hits", "noise", "repeatability"}


def test_a_stored_test_shows_how_it_was_identified(
    shm: Shm, taken_in: tuple[Workspace, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each form of the sheet is of the same files: they are identified for the first."""
    workspace, _ = taken_in
    unpaint(monkeypatch)
    found: list[Identification] = []

    def identify_once(*arguments: Any, **options: Any) -> Identification:
        if not found:
            found.append(identify(*arguments, **options))
        return found[0]

    monkeypatch.setattr(reporting, "identify", identify_once)
    ask = ("--workspace", workspace.folder, "report", "--hanger", 3, "--test", "set_up_0")
    document = json.loads(shm(*ask, "--json").out)
    with workspace.store() as store:
        (stored,) = store.tests.list_all(3)
    shown = [mode["frequency_hz"] for mode in document["test"]["modes"]]
    assert shown == pytest.approx([mode.frequency_hz for mode in stored.test.modes])
    assert [check["name"] for check in document["quality"]] == [c.name for c in stored.quality]
    page = tmp_path / "sheet.html"
    assert shm(*ask, "--out", page).code == 0
    assert "set_up_0" in page.read_text(encoding="utf-8")
    assert "QUALITY" in shm(*ask, "--full").out


def test_a_test_that_is_not_there_names_the_latest(
    shm: Shm, taken_in: tuple[Workspace, int]
) -> None:
    workspace, _ = taken_in
    ended = shm("--workspace", workspace.folder, "report", "--hanger", 3, "--test", "t9")
    assert ended.code == 4
    assert "set_up_0" in ended.err


def test_a_test_whose_modes_a_file_gave_says_so(shm: Shm, bridge: Workspace) -> None:
    ended = shm("--workspace", bridge.folder, "report", "--hanger", 3, "--test", "t0")
    assert ended.code == 4
    assert "t0.modes.json gave the modes" in ended.err
