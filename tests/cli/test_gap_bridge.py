"""`shm gap diagnose` of several hangers together, on files and in a workspace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from shm.documents import dump
from shm.modes_document import modes_document
from shm.store import Workspace
from shm.values import Hanger, ModalTest
from tests.cli.conftest import Shm
from tests.cli.test_gap import SHORT
from tests.gap.test_shared_causes import bridge as bridge_of
from tests.helpers.flows import ingest
from tests.helpers.hangers import HANGER_3
from tests.helpers.workspaces import make_workspace, modes_of


def sound(number: int) -> ModalTest:
    """Three modes of each plane as the clamped beam has them, which is soon diagnosed."""
    modes = [
        replace(mode, frequency_sd_hz=1e-3 * mode.frequency_hz)
        for mode in modes_of(replace(HANGER_3, plate=None), 0.9, 3)
    ]
    return ModalTest(f"t{number}", tuple(modes), number, temperature_c=12.0, amplitude=1.0)


@pytest.fixture(scope="module")
def pairs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two hangers, each as a MODES.json and its H.toml."""
    folder = tmp_path_factory.mktemp("pairs")
    files = []
    for number in (3, 4):
        modes, description = folder / f"h{number}.modes.json", folder / f"h{number}.toml"
        modes.write_text(dump(modes_document([sound(number)])))
        description.write_text(
            f"[[hanger]]\nid = {number}\ndiameter_m = 0.130\nlength_m = 12.0\n"
            "elastic_modulus_pa = 200e9\ndensity_kg_m3 = 7800\nnominal_tension_n = 711e3\n"
        )
        files += [modes, description]
    return files


def test_pairs_of_files_are_diagnosed_together(
    shm: Shm, pairs: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[tuple[int, str]] = []

    def answer(hangers: Sequence[tuple[Hanger, Sequence[ModalTest]]], *_: object) -> object:
        given.extend((hanger.id, test.id) for hanger, tests in hangers for test in tests)
        return bridge_of((20.0, 20.0, 20.0, 20.0), (0.05, 0.05, 0.05, 0.05))

    monkeypatch.setattr("shm_cli.gap.diagnose_bridge", answer)
    page, figures = tmp_path / "bridge.html", tmp_path / "figures"
    ended = shm("gap", "diagnose", *pairs, "--html", page, "--figures", figures, "--json")
    assert ended.code == 0, ended.err
    assert given == [(3, "t3"), (4, "t4")]
    document = ended.document
    assert document["schema"] == "shm.bridge_diagnosis/1"
    assert document["answer"] == "shared cause"
    assert "shared by all 4 hangers" in document["summary"]
    assert [bar["hanger"] for bar in document["bars"]] == [3, 4]
    assert "The bars as described" in page.read_text()
    assert "<svg" in page.read_text()
    assert [path.name for path in figures.iterdir()] == ["shared.png"]


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    made = make_workspace(tmp_path_factory.mktemp("bridge") / "bridge", hangers=(3, 4))
    for number in (3, 4):
        (made.spool / f"{number}.modes.json").write_text(dump(modes_document([sound(number)])))
    ingest(made)
    return made


def test_a_workspace_keeps_the_diagnosis_of_each_hanger(shm: Shm, workspace: Workspace) -> None:
    at = ("--workspace", workspace.folder)
    ended = shm(*at, "gap", "diagnose", "--bridge", *SHORT)
    assert ended.code == 0, ended.err
    assert ended.out.startswith("Gap diagnosis, 2 hangers")
    for number in (3, 4):
        assert shm(*at, "report", "--hanger", number, "--json").document["diagnosis"] is not None


def test_a_workspace_with_one_hanger_tested_is_nothing_there(shm: Shm, bridge: Workspace) -> None:
    ended = shm("--workspace", bridge.folder, "gap", "diagnose", "--bridge")
    assert ended.code == 4
    assert "shm ingest" in ended.err


def test_files_without_their_descriptions_are_wrong_usage(shm: Shm, pairs: list[Path]) -> None:
    for wrong in ([*pairs, pairs[0]], [pairs[0], pairs[2]], ["--bridge", *pairs]):
        ended = shm("gap", "diagnose", *wrong)
        assert ended.code == 2
        assert "pairs" in ended.err or "H.toml" in ended.err
