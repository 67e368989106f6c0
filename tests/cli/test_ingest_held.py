"""`shm ingest --held`, `--confirm` and `--discard`: a person answers what is held."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from shm.documents import dump
from shm.modes_document import modes_document
from shm.pipeline.lineage import discarded_of_baselines
from shm.store import Stage, Workspace
from shm.store.recordings import count_stages, list_holds
from tests.cli.conftest import Shm
from tests.helpers.taken_in import copied, ingest_quickly
from tests.helpers.workspaces import START, make_workspace, modelled_test, put, write_test


@pytest.fixture
def held(tmp_path: Path) -> Workspace:
    """Hanger 3 has a baseline and a test of 1970 with a tenth less tension, recording 2."""
    return copied("held", tmp_path / "bridge", _make_held)


def _make_held(folder: Path) -> None:
    made = make_workspace(folder)
    write_test(made.spool / "good.modes.json", made)
    ingest_quickly(made)
    put(made.spool / "lost.modes.json", epoch(made))
    ingest_quickly(made)


def epoch(workspace: Workspace) -> str:
    test = modelled_test("lost", workspace.bridge.hanger(3), tension=0.9)
    return dump(modes_document([replace(test, time=datetime(1970, 1, 1, tzinfo=UTC))]))


def test_ingest_says_that_a_file_is_held_and_how_to_answer(
    shm: Shm, empty: Workspace, tmp_path: Path
) -> None:
    (tmp_path / "lost.modes.json").write_text(epoch(empty))
    ended = shm("--workspace", empty.folder, "ingest", tmp_path / "lost.modes.json", "--json")
    assert ended.code == 0
    (row,) = ended.document["files"]
    assert (row["outcome"], row["stage"], row["hanger"]) == ("held", "held", 3)
    assert "shm ingest --confirm 1 --time TIME" in row["reason"]
    (alert,) = ended.document["alerts"]
    assert alert["kinds"] == ["held"]


def test_what_is_held_is_listed(shm: Shm, held: Workspace) -> None:
    said = shm("--workspace", held.folder, "ingest", "--held")
    assert "recording 2, lost.modes.json" in said.out
    assert "may have lost 10 % of its tension" in " ".join(said.out.split())
    (hold,) = shm("--workspace", held.folder, "ingest", "--held", "--json").document["held"]
    assert (hold["recording"], hold["hanger"], hold["decision"]) == (2, 3, None)
    (test,) = hold["tests"]
    assert test["tension_shift"] == pytest.approx(-0.1, abs=0.01)
    assert [doubt["check"] for doubt in test["doubts"]] == ["clock before the bridge"]


def test_status_shows_it_and_counts_it_in_nothing(shm: Shm, held: Workspace) -> None:
    said = shm("--workspace", held.folder, "status")
    assert "1 held" in said.out
    assert "held until you decide: 1" in said.out
    assert "shm ingest --confirm 2 --time TIME" in " ".join(said.out.split())
    document = shm("--workspace", held.folder, "status", "--json").document
    assert document["under_way"] == 0
    assert [each["recording"] for each in document["held"]] == [2]
    (hanger,) = document["hangers"]
    assert (hanger["tests"], hanger["held"]) == (1, 1)


def test_what_is_confirmed_is_done_at_once_with_its_true_time(shm: Shm, held: Workspace) -> None:
    ended = shm(
        "--workspace", held.folder, "ingest", "--confirm", "lost", "--time", "2026-06-01T10:00Z",
        "--why", "clock was dead", "--who", "Ann", "--json",
    )  # fmt: skip
    assert ended.code == 0
    assert ended.document["decision"] == "confirmed"
    assert (ended.document["who"], ended.document["why"]) == ("Ann", "clock was dead")
    assert ended.document["stage"] == "done"
    with held.store() as store:
        times = {test.test.id: test.time for test in store.tests.list_all(3)}
        assert times == {"good": START, "lost": datetime(2026, 6, 1, 10, tzinfo=UTC)}
        assert [drift.test for drift in store.watch.list_drifts(3)] == ["lost"]
    assert shm("--workspace", held.folder, "ingest", "--held").out == "Nothing is held.\n"


def test_what_is_confirmed_while_a_daemon_serves_is_left_to_it(shm: Shm, held: Workspace) -> None:
    with held.lock():
        ended = shm("--workspace", held.folder, "ingest", "--confirm", 2)
    assert ended.code == 0
    assert "The daemon does the rest" in ended.err
    assert "its receipt counts" in ended.out
    with held.store() as store:
        assert count_stages(store)[Stage.IDENTIFIED] == 1


def test_what_is_discarded_says_that_its_raw_file_stays(shm: Shm, held: Workspace) -> None:
    say = ("--workspace", held.folder, "ingest")
    ended = shm(*say, "--discard", 2, "--why", "wrong hanger")
    assert ended.code == 0
    assert "Its raw file stays in the archive." in ended.out
    again = shm(*say, "--confirm", 2)
    assert again.code == 2
    assert "it was discarded by" in again.err
    assert "`shm ingest --confirm 2 --why TEXT`" in " ".join(again.err.split())
    back = shm(*say, "--confirm", "lost", "--why", "it was right", "--time", "2026-06-01T10:00Z")
    assert back.code == 0
    assert "counts again from now on; it is done. Its time is 2026-06-01 10:00." in back.out


def a_visit(workspace: Workspace) -> str:
    """Return a file of two sound tests and two that are held, `1970a` and `1970b`."""
    test, reset = modelled_test("t", workspace.bridge.hanger(3)), datetime(1970, 1, 1, tzinfo=UTC)
    times = {
        "sound9": START + timedelta(days=9),
        "sound10": START + timedelta(days=10),
        "1970a": reset,
        "1970b": reset + timedelta(days=1),
    }
    return dump(modes_document([replace(test, id=name, time=at) for name, at in times.items()]))


@pytest.mark.parametrize("verb", ["--confirm", "--discard"])
def test_decide_refuses_part_of_hold(shm: Shm, held: Workspace, tmp_path: Path, verb: str) -> None:
    """A test that was not named is neither counted nor discarded."""
    say = ("--workspace", held.folder, "ingest")
    (tmp_path / "visit.modes.json").write_text(a_visit(held))
    shm(*say, tmp_path / "visit.modes.json")
    ended = shm(*say, verb, "1970b", "--why", "so it is")
    assert ended.code == 2
    assert "holds 1970b together with 1970a" in " ".join(ended.err.split())
    assert len(shm(*say, "--held", "--json").document["held"]) == 2


def test_a_discarded_file_that_comes_again_is_told_in_one_line(
    shm: Shm, held: Workspace, tmp_path: Path
) -> None:
    say = ("--workspace", held.folder, "ingest")
    assert shm(*say, "--discard", 2, "--why", "wrong hanger.", "--who", "Ann").code == 0
    (tmp_path / "resent.modes.json").write_text(epoch(held))
    ended = shm(*say, tmp_path / "resent.modes.json")
    assert ended.code == 0
    (line,) = [each for each in ended.err.splitlines() if "discarded before" in each]
    today = f"{datetime.now(UTC):%Y-%m-%d}"
    assert line == (
        f"resent.modes.json: discarded before, on {today} by Ann, because: wrong hanger. Its raw "
        "file stays in the archive. To let it count after all: `shm ingest --confirm 2 --why TEXT`."
    )
    (row,) = shm(*say, tmp_path / "resent.modes.json", "--json").document["files"]
    assert (row["outcome"], row["stage"]) == ("discarded before", "refused")
    assert shm(*say, "--held").out == "Nothing is held.\n"
    of = ("--workspace", held.folder, "status", "--of")
    assert "recording 2: lost.modes.json (also came as resent.modes.json)" in " ".join(
        shm(*of, "resent").out.split()
    )
    assert shm(*of, "resent", "--json").document == shm(*of, "lost", "--json").document


def test_what_counts_is_discarded_with_a_reason_and_taken_back(shm: Shm, held: Workspace) -> None:
    say = ("--workspace", held.folder, "ingest")
    refused = shm(*say, "--discard", "good")
    assert refused.code == 2
    assert "`shm ingest --discard 1 --why TEXT`" in " ".join(refused.err.split())
    ended = shm(*say, "--discard", "good", "--why", "of hanger 4")
    assert ended.code == 0
    said = " ".join(ended.out.split())
    assert "Recording 1 (good.modes.json): good is discarded and counts in nothing" in said
    assert "`shm drift rebaseline --hanger 3 --since 2026-05-01 --why TEXT`" in said
    assert "`shm ingest --confirm 1 --why TEXT`" in said
    with held.store() as store:
        assert store.tests.list_all(3) == ()
        assert discarded_of_baselines(store) == {3: ("good",)}
    assert shm("--workspace", held.folder, "db", "check").code == 0
    stages = " ".join(shm("--workspace", held.folder, "status", "--of", 1).out.split())
    assert "refused" not in stages
    assert " withdrawn by " in stages
    doctor = " ".join(shm("--workspace", held.folder, "doctor").out.split())
    assert "baseline made from a test that was discarded: 3" in doctor
    back = shm(*say, "--confirm", 1, "--why", "of hanger 3 after all", "--json").document
    assert (back["decision"], back["stage"]) == ("reinstated", "done")
    assert shm(*say, "--confirm", 1).code == shm(*say, "--confirm", 1, "--why", "x").code == 2


def test_a_decision_is_undone_by_the_file_beside_a_sidecar(shm: Shm, held: Workspace) -> None:
    say = ("--workspace", held.folder, "ingest")
    assert shm(*say, "--confirm", 2).code == 0
    assert "it was confirmed by" in shm(*say, "--discard", 2).err
    put(held.spool / "lost.modes.toml", "temperature_c = 12.0\n")
    put(held.spool / "lost.modes.json", epoch(held))
    ingest_quickly(held)
    assert [hold["recording"] for hold in shm(*say, "--held", "--json").document["held"]] == [2]
    assert shm(*say, "--discard", 2).code == 0
    with held.store() as store:
        assert [test.test.id for test in store.tests.list_all(3)] == ["good"]
        assert store.watch.list_drifts(3) == ()


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("--confirm", 2, "--discard", 2), 2),
        (("--held", "a.csv"), 2),
        (("--time", "2026-05-01"), 2),
        (("--why", "because", "--again", 2), 2),
        (("--confirm", 2, "--time", "yesterday"), 3),
        (("--confirm", 2, "--time", "2999-01-01"), 2),
        (("--confirm", 2, "--time", "1970-01-01"), 2),
        (("--confirm", 99), 4),
        (("--confirm", "nobody"), 4),
        (("--discard", 1), 2),
    ],
)
def test_what_makes_no_sense_changes_nothing(
    shm: Shm, held: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    words: tuple[object, ...], code: int,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text("")
    assert shm("--workspace", held.folder, "ingest", *words).code == code
    with held.store() as store:
        assert len(list_holds(store)) == 1
