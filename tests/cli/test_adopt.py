"""`shm gap adopt`, `adopted`, `drop`, and what status, select and update make of an adoption."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from shm.pipeline import adopting
from shm.store import Store, Workspace
from shm.store.watch import list_adoptions
from tests.cli.conftest import Shm
from tests.helpers import quick_update

STIFFNESS = "beam1+bending_stiffness@everywhere"
ADOPT = ("gap", "adopt", "--hanger", 3, "--effect", "bending_stiffness", "--at", "everywhere")


@pytest.fixture
def workspace(bridge: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the bridge with a short history, and a stand-in for the sampler."""
    monkeypatch.setattr(
        adopting,
        "update",
        lambda tests, model, options, *_, **__: quick_update.update(tests, model, options),
    )
    folder = tmp_path / "arch"
    shutil.copytree(bridge.folder, folder)
    return folder


def test_adopting_says_what_it_did_and_status_keeps_saying_it(shm: Shm, workspace: Path) -> None:
    ended = shm("--workspace", workspace, *ADOPT, "--why", "a strand, not a rod")
    assert ended.code == 0, ended.err
    assert f"Hanger 3 has the model class {STIFFNESS} from now on." in ended.out
    assert "beam1 with bending_stiffness (everywhere), adopted" in ended.out
    status = shm("--workspace", workspace, "status")
    assert "hanger 3: beam1 with bending_stiffness (everywhere)" in status.out
    document = shm("--workspace", workspace, "status", "--json").document["hangers"]
    assert (document[0]["model"], document[1]["model"]) == (STIFFNESS, None)
    assert STIFFNESS in document[0]["competing"]
    assert document[0]["gap"]["has_grown"] is False
    assert document[1]["gap"] is None


def test_the_record_names_who_and_why_and_outlives_the_dropping(shm: Shm, workspace: Path) -> None:
    shm("--workspace", workspace, *ADOPT, "--why", "a strand", "--who", "Jansen")
    listed = shm("--workspace", workspace, "gap", "adopted", "--json").document["adoptions"]
    assert [(each["who"], each["why"], each["model"]) for each in listed] == [
        ("Jansen", "a strand", STIFFNESS)
    ]
    dropped = shm(
        "--workspace", workspace, "gap", "drop", "--hanger", 3, "--why", "a rod after all"
    )
    assert dropped.code == 0
    assert "hanger 3 has the class beam1 again" in dropped.out
    assert shm("--workspace", workspace, "gap", "adopted").code == 4
    table = shm("--workspace", workspace, "gap", "adopted", "--all")
    assert "Jansen" in table.out
    (record,) = shm("--workspace", workspace, "gap", "adopted", "--all", "--json").document[
        "adoptions"
    ]
    assert record["undone_why"] == "a rod after all"


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("adopt", "--hanger", 3, "--effect", "gremlins", "--why", "x"), 2, "unknown effect"),
        (("adopt", "--hanger", 3, "--effect", "effective_length", "--why", "x"), 2, "Give --at"),
        (("adopt", "--hanger", 3, "--effect", "sensor_mass", "--why", "x"), 2, "of the sensors"),
        (("adopt", "--hanger", 3, "--effect", "temperature_tension", "--why", "x"), 3, "single"),
        (("adopt", "--hanger", 3, "--effect", "geometric_hardening", "--why", "x"), 3, "diagnos"),
        (("adopt", "--hanger", 4, "--effect", "sag", "--why", "x"), 4, "no baseline yet"),
        (("adopt", "--hanger", 9, "--effect", "sag", "--why", "x"), 4, "hanger 9"),
        (("adopt", "--hanger", 3, "--effect", "sag"), 2, "--why"),
        (("drop", "--hanger", 3, "--why", "x"), 4, "adopted nothing"),
        (("adopted", "--hanger", 3), 4, "no effect has been adopted"),
    ],
)
def test_what_cannot_be_done_is_said_with_its_exit_code(
    shm: Shm, workspace: Path, arguments: tuple[object, ...], code: int, said: str
) -> None:
    ended = shm("--workspace", workspace, "gap", *arguments)
    assert ended.code == code, ended.err
    assert said in " ".join(ended.err.split())
    assert ended.out == ""


def test_of_several_adoptions_one_is_dropped_by_its_number(shm: Shm, workspace: Path) -> None:
    shm("--workspace", workspace, *ADOPT, "--why", "a")
    shm("--workspace", workspace, *ADOPT[:-4], "--effect", "distributed_mass", "--why", "b")
    drop = ("--workspace", workspace, "gap", "drop", "--hanger", 3, "--why", "no")
    ended = shm(*drop)
    assert ended.code == 2
    assert "one of 1, 2" in ended.err
    assert shm(*drop, "--number", 7).code == 4
    assert "has the class beam1+distributed_mass@everywhere again" in shm(*drop, "--number", 1).out
    assert "has the class beam1 again" in shm(*drop).out


def test_the_gap_now_stands_beside_the_adoption_that_is_watched_and_no_other(
    shm: Shm, workspace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(adopting, "gap_percent", lambda found: 0.2 if "+" in found.model else 2.0)
    shm("--workspace", workspace, *ADOPT, "--why", "a")
    shm("--workspace", workspace, *ADOPT[:-4], "--effect", "distributed_mass", "--why", "b")

    def watch(store: Store, hanger: int) -> adopting.GapWatch:
        return adopting.GapWatch(list_adoptions(store, hanger)[-1], 4.321, True)

    monkeypatch.setattr("shm_cli.adopt.gap_watch", watch)
    listed = shm("--workspace", workspace, "gap", "adopted", "--json").document["adoptions"]
    assert [each["gap_now_percent"] for each in listed] == [None, 4.321]
    assert [each["gap_has_grown"] for each in listed] == [None, True]
    rows = shm("--workspace", workspace, "gap", "adopted").out
    assert "2.00, 0.20, none" in rows
    assert "0.20, 0.20, 4.32" in rows
    assert "gap before, with it, now (%)" in " ".join(rows.split())


def test_select_lets_the_adopted_classes_of_the_hanger_compete(
    shm: Shm, workspace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shm_cli.update.select", lambda t, m, o, *_: quick_update.select(t, m, o))
    shm("--workspace", workspace, *ADOPT, "--why", "a strand")
    ended = shm("--workspace", workspace, "select", "--hanger", 3, "--json")
    assert ended.code == 0, ended.err
    assert [each["model"] for each in ended.document["models"]] == ["beam1", STIFFNESS]


def test_predict_knows_adopted_classes(shm: Shm, hanger_file: Path) -> None:
    zero = [f"--set={name}=0" for name in ("section", "density", "length", "modulus")]
    plain = shm("predict", "beam1", "--hanger-file", hanger_file, "--json").document
    ended = shm(
        "predict", STIFFNESS, "--hanger-file", hanger_file, *zero, "--set=stiffness_change=0",
        "--json",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    found = [
        [row["frequency_hz"] for row in each["frequencies"]] for each in (plain, ended.document)
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6)


def test_update_takes_the_name_of_an_adopted_class(
    shm: Shm, hanger_file: Path, modes_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shm_cli.update.update", lambda t, m, o, _: quick_update.update(t, m, o))
    ended = shm("update", modes_file, "--hanger-file", hanger_file, "--model", STIFFNESS, "--json")
    assert ended.code == 0, ended.err
    assert ended.document["model"] == STIFFNESS
    assert "stiffness_change" in ended.document["parameters"]
    wrong = shm("update", modes_file, "--hanger-file", hanger_file, "--model", "beam1+sag")
    assert wrong.code == 2
    assert "BASELINE+EFFECT@WHERE" in wrong.err
