"""`shm ingest`: what is taken in, known, refused or looked at, and what a person answers.

Days such as 9/10/2025 are read as the logger's profile learnt, else asked of a person.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tomllib
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from shm.documents import dump
from shm.identify import Identification, identify
from shm.modes_document import modes_document
from shm.pipeline import reporting
from shm.pipeline.lineage import discarded_of_baselines
from shm.store import Decision, Stage, Workspace
from shm.store.posteriors import list_history
from shm.store.recordings import count_stages, find_latest_hold, list_holds, list_recordings
from shm_cli import working
from shm_cli.main import run
from tests.cli.conftest import Shm
from tests.cli.test_import_prompts import terminal
from tests.helpers.flows import threads
from tests.helpers.logger_exports import write_described_export, write_export
from tests.helpers.painting import unpaint
from tests.helpers.taken_in import copied, ingest_quickly
from tests.helpers.workspaces import START, make_workspace, modelled_test, put, write_test

# ------------------------------------------------------------ taken in, known, refused


def in_a_process(*words: object) -> subprocess.CompletedProcess[str]:
    """Run the command line as it is run: in a process, whose steps have processes."""
    program = [sys.executable, "-c", "from shm_cli.main import main; main()", *map(str, words)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    return subprocess.run(program, capture_output=True, text=True, check=False, env=environment)


def test_ingest_reports_each_file(tmp_path: Path) -> None:
    """A baseline, two tests with a fifth less tension, an empty file and a copy are dropped."""
    workspace = make_workspace(tmp_path / "bridge")
    for name, day, tension in (("a", 0, 1.0), ("b", 59, 0.8), ("c", 60, 0.8)):
        write_test(tmp_path / f"{name}.modes.json", workspace, day=day, tension=tension)
    (tmp_path / "empty.csv").write_text("")
    shutil.copy(tmp_path / "a.modes.json", tmp_path / "again.modes.json")
    names = ("a.modes.json", "b.modes.json", "c.modes.json", "empty.csv", "again.modes.json")
    files = (tmp_path / name for name in names)
    ended = in_a_process("--workspace", workspace.folder, "ingest", *files, "--json")
    assert ended.returncode == 3, "a file was refused"
    document = json.loads(ended.stdout)
    *taken, refused, known = document["files"]
    assert [(row["file"], row["outcome"], row["stage"]) for row in taken] == [
        (name, "taken in", "done") for name in names[:3]
    ]
    assert (refused["file"], refused["outcome"]) == ("empty.csv", "refused")
    assert "the file is empty" in refused["reason"]
    assert list(workspace.quarantine.folder.glob("*.reason.json"))
    assert known["outcome"] == "known already"
    assert (known["file"], known["known_as"]) == ("again.modes.json", "a.modes.json")
    assert [(alert["test"], alert["kinds"]) for alert in document["alerts"]] == [
        ("b", ["repeat the test"]),
        ("c", ["beyond threshold"]),
    ]
    assert (tmp_path / "a.modes.json").is_file(), "what is ingested stays where it is"
    with workspace.store() as store:
        assert len(list_recordings(store)) == 4


def test_ingest_beside_a_daemon_says_what_to_do(on_empty: Shm, empty: Workspace) -> None:
    with empty.lock():
        ended = on_empty("ingest", __file__)
    assert ended.code == 5
    assert "spool/" in ended.err


@pytest.mark.slow
def test_the_daemon_empties_the_spool_once_and_ends(empty: Workspace) -> None:
    write_test(empty.spool / "a.modes.json", empty)
    ended = in_a_process("--workspace", empty.folder, "daemon", "--once")
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout == ""
    assert "watching" in ended.stderr
    with empty.store() as store:
        assert len(list_history(store, 3)) == 1


def test_peek_shows_what_is_in_a_file_and_takes_nothing_in(
    on_empty: Shm, empty: Workspace, hanger_file: Path, modes_file: Path, tmp_path: Path
) -> None:
    """It goes on after a file that it cannot read."""
    call = ["simulate", "--hanger-file", str(hanger_file), "--hits", "1", "--seconds", "2"]
    assert run([*call, "--out", str(tmp_path / "made")]) == 0
    (path,) = (tmp_path / "made").iterdir()
    told = on_empty.told("ingest", "--peek", path)
    assert "hanger 3" in told
    assert "acc_4" in told
    (look,) = on_empty.json("ingest", "--peek", path)["files"]
    assert look["sampling_rate_hz"] == 512
    assert look["channels"][0]["quantity"] == "force"
    with empty.store() as store:
        assert list_recordings(store) == ()
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("")
    ended = on_empty("ingest", "--peek", wrong, modes_file)
    assert ended.code == 3
    assert "the file is empty" in ended.err
    assert "t9: 12 modes" in ended.out


def test_a_refusal_names_line_and_channel(on_empty: Shm, tmp_path: Path) -> None:
    rows = "\n".join("0.0,0.1" for _ in range(40))
    head = "# hanger: 3\n# sampling_rate_hz: 512\n# unit: N, furlong\nforce,acc_1\n"
    (tmp_path / "unit.csv").write_text(f"{head}{rows}\n")
    ended = on_empty("ingest", tmp_path / "unit.csv")
    assert ended.code == 3
    assert "unit.csv: line 3: channel acc_1: the unit 'furlong'" in ended.err


# ------------------------------------------------------------ held until a person answers


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


@pytest.fixture
def on_held(shm: Shm, held: Workspace) -> Shm:
    return shm.at(held)


def test_ingest_says_how_to_answer(on_empty: Shm, empty: Workspace, tmp_path: Path) -> None:
    (tmp_path / "lost.modes.json").write_text(epoch(empty))
    document = on_empty.json("ingest", tmp_path / "lost.modes.json")
    (row,) = document["files"]
    assert (row["outcome"], row["stage"], row["hanger"]) == ("held", "held", 3)
    assert "shm ingest --confirm 1 --time TIME" in row["reason"]
    (alert,) = document["alerts"]
    assert alert["kinds"] == ["held"]


def test_what_is_held_is_listed_and_counts_in_nothing(on_held: Shm) -> None:
    told = on_held.told("ingest --held")
    assert "recording 2, lost.modes.json" in told
    assert "may have lost 10 % of its tension" in told
    (hold,) = on_held.json("ingest --held")["held"]
    assert (hold["recording"], hold["hanger"], hold["decision"]) == (2, 3, None)
    (test,) = hold["tests"]
    assert test["tension_shift"] == pytest.approx(-0.1, abs=0.01)
    assert [doubt["check"] for doubt in test["doubts"]] == ["clock before the bridge"]
    status = on_held.told("status")
    for said in ("1 held", "held until you decide: 1", "shm ingest --confirm 2 --time TIME"):
        assert said in status
    document = on_held.json("status")
    assert document["under_way"] == 0
    assert [each["recording"] for each in document["held"]] == [2]
    (hanger,) = document["hangers"]
    assert (hanger["tests"], hanger["held"]) == (1, 1)


def test_confirmed_is_done_with_true_time(on_held: Shm, held: Workspace) -> None:
    document = on_held.json(
        "ingest --confirm lost --time 2026-06-01T10:00Z --why 'clock was dead' --who Ann"
    )
    known = [document[key] for key in ("decision", "who", "why", "stage")]
    assert known == ["confirmed", "Ann", "clock was dead", "done"]
    with held.store() as store:
        times = {test.test.id: test.time for test in store.tests.list_all(3)}
        assert times == {"good": START, "lost": datetime(2026, 6, 1, 10, tzinfo=UTC)}
        assert [drift.test for drift in store.watch.list_drifts(3)] == ["lost"]
    assert on_held("ingest --held").out == "Nothing is held.\n"


def test_confirmed_beside_a_daemon(on_held: Shm, held: Workspace) -> None:
    with held.lock():
        ended = on_held.done("ingest --confirm 2")
    assert "The daemon does the rest" in ended.err
    assert "its receipt counts" in ended.out
    with held.store() as store:
        assert count_stages(store)[Stage.IDENTIFIED] == 1


def test_what_is_discarded_says_that_its_raw_file_stays(on_held: Shm) -> None:
    told = on_held.told("ingest --discard 2 --why 'wrong hanger'")
    assert "Its raw file stays in the archive." in told
    again = on_held("ingest --confirm 2")
    assert again.code == 2
    assert "it was discarded by" in again.err
    assert "`shm ingest --confirm 2 --why TEXT`" in again.said
    back = on_held.told("ingest --confirm lost --why 'it was right' --time 2026-06-01T10:00Z")
    assert "counts again from now on; it is done. Its time is 2026-06-01 10:00." in back


def test_discard_asks_why_at_a_terminal(held: Workspace) -> None:
    with terminal(held, "--discard", 2, verb="ingest") as person:
        person.answer("Why is it discarded?", "  ", "wrong hanger")
        assert person.end() == 0
    with held.store() as store:
        hold = find_latest_hold(store, 2)
    assert hold is not None
    assert (hold.decision, hold.why) == (Decision.DISCARDED, "wrong hanger")


@pytest.mark.parametrize("verb", ["--confirm", "--discard"])
def test_part_of_hold(on_held: Shm, held: Workspace, tmp_path: Path, verb: str) -> None:
    """Of a file of two sound tests and two that are held, a test not named is left as it is."""
    test, reset = modelled_test("t", held.bridge.hanger(3)), datetime(1970, 1, 1, tzinfo=UTC)
    day = timedelta(days=1)
    times = {"sound9": START + 9 * day, "sound10": START + 10 * day, "1970a": reset,
             "1970b": reset + day}  # fmt: skip
    visit = modes_document([replace(test, id=name, time=at) for name, at in times.items()])
    (tmp_path / "visit.modes.json").write_text(dump(visit))
    on_held("ingest", tmp_path / "visit.modes.json")
    ended = on_held(f"ingest {verb} 1970b --why 'so it is'")
    assert ended.code == 2
    assert "holds 1970b together with 1970a" in ended.said
    assert len(on_held.json("ingest --held")["held"]) == 2


def test_discarded_file_comes_again(on_held: Shm, held: Workspace, tmp_path: Path) -> None:
    on_held.done("ingest --discard 2 --why 'wrong hanger.' --who Ann")
    (tmp_path / "resent.modes.json").write_text(epoch(held))
    ended = on_held.done("ingest", tmp_path / "resent.modes.json")
    (line,) = [each for each in ended.err.splitlines() if "discarded before" in each]
    today = f"{datetime.now(UTC):%Y-%m-%d}"
    assert line == (
        f"resent.modes.json: discarded before, on {today} by Ann, because: wrong hanger. Its raw "
        "file stays in the archive. To let it count after all: `shm ingest --confirm 2 --why TEXT`."
    )
    (row,) = on_held.json("ingest", tmp_path / "resent.modes.json")["files"]
    assert (row["outcome"], row["stage"]) == ("discarded before", "refused")
    assert on_held("ingest --held").out == "Nothing is held.\n"
    name = "recording 2: lost.modes.json (also came as resent.modes.json)"
    assert name in on_held.told("status --of resent")
    assert on_held.json("status --of resent") == on_held.json("status --of lost")


def test_discard_what_counts_and_back(on_held: Shm, held: Workspace) -> None:
    refused = on_held("ingest --discard good")
    assert refused.code == 2
    assert "`shm ingest --discard 1 --why TEXT`" in refused.said
    told = on_held.told("ingest --discard good --why 'of hanger 4'")
    for said in (
        "Recording 1 (good.modes.json): good is discarded and counts in nothing",
        "`shm drift rebaseline --hanger 3 --since 2026-05-01 --why TEXT`",
        "`shm ingest --confirm 1 --why TEXT`",
    ):
        assert said in told
    with held.store() as store:
        assert store.tests.list_all(3) == ()
        assert discarded_of_baselines(store) == {3: ("good",)}
    on_held.done("db check")
    stages = on_held("status --of 1").told
    assert "refused" not in stages
    assert " withdrawn by " in stages
    assert "baseline made from a test that was discarded: 3" in on_held("doctor").told
    back = on_held.json("ingest --confirm 1 --why 'of hanger 3 after all'")
    assert (back["decision"], back["stage"]) == ("reinstated", "done")
    assert on_held("ingest --confirm 1").code == on_held("ingest --confirm 1 --why x").code == 2


def test_a_decision_is_undone_by_the_file_beside_a_sidecar(on_held: Shm, held: Workspace) -> None:
    on_held.done("ingest --confirm 2")
    assert "it was confirmed by" in on_held("ingest --discard 2").err
    put(held.spool / "lost.modes.toml", "temperature_c = 12.0\n")
    put(held.spool / "lost.modes.json", epoch(held))
    ingest_quickly(held)
    assert [hold["recording"] for hold in on_held.json("ingest --held")["held"]] == [2]
    on_held.done("ingest --discard 2")
    with held.store() as store:
        assert [test.test.id for test in store.tests.list_all(3)] == ["good"]
        assert store.watch.list_drifts(3) == ()


def test_what_makes_no_sense_changes_nothing(on_held: Shm, held: Workspace) -> None:
    for words, code in (
        ("--confirm 2 --discard 2", 2), ("--why because --again 2", 2),
        ("--confirm 2 --time yesterday", 2), ("--confirm 2 --time 2999-01-01", 2),
        ("--confirm 2 --time 1970-01-01", 2), ("--discard 1", 2),
    ):  # fmt: skip
        assert on_held(f"ingest {words}").code == code
    with held.store() as store:
        assert len(list_holds(store)) == 1


# ------------------------------------------------------------ days that may be two

DESCRIBED = "--hanger 3 --place 2.52,2.52 --plane transverse,longitudinal"


def peek(shm: Shm, *files: Path) -> list[Any]:
    """Look into files; one that leaves something open has exit code 3."""
    ended = shm("ingest", "--peek", *files, "--json")
    looks: list[Any] = ended.document["files"]
    assert ended.code == (3 if any(look["missing"] for look in looks) else 0), ended.err
    return looks


def imported(shm: Shm, file: Path, more: str = "") -> Any:
    return shm.json(f"import {file} {DESCRIBED} {more}")


def times_of(workspace: Workspace) -> list[datetime | None]:
    with workspace.store() as store:
        return [each.test.time for each in store.tests.list_all(3)]


def at(month: int, day: int) -> datetime:
    return datetime(2025, month, day, 9, 12, 31, tzinfo=UTC)


def test_ingest_reads_days_as_imported(on_empty: Shm, empty: Workspace, tmp_path: Path) -> None:
    """A loss of 7 % over three tests must raise its alert, whatever the receipt."""
    imported(on_empty, write_export(tmp_path / "a.csv", "5/14/2025 9:12:31 AM"))
    days = ("9/10/2025 9:12:31 AM", "10/11/2025 9:12:31 AM", "11/12/2025 9:12:31 AM")
    later = [
        write_export(tmp_path / f"{n}.csv", day, 650e3, seed=n)
        for n, day in enumerate(days, start=2)
    ]
    assert [look["time"] for look in peek(on_empty, *later)] == [
        f"2025-{day}T09:12:31Z" for day in ("09-10", "10-11", "11-12")
    ]
    on_empty.done("ingest", empty.spool / "a.csv")
    taken = on_empty.json("ingest", *later)
    assert [row["outcome"] for row in taken["files"]] == ["taken in"] * 3
    assert times_of(empty) == [at(5, 14), at(9, 10), at(10, 11), at(11, 12)]
    assert any("fell by" in alert["message"] for alert in taken["alerts"])


@pytest.mark.parametrize(
    ("day", "possible"),
    [
        ("9/10/2025", ["2025-10-09", "2025-09-10"]),
        ("26/02/03", ["2003-02-26", "2026-02-03"]),
        ("04/05/06", ["2006-05-04", "2006-04-05", "2004-05-06"]),
        ("14-05-26", ["2026-05-14", "2014-05-26"]),
    ],
)
def test_ingest_holds_unknown_day_order(
    on_empty: Shm, empty: Workspace, tmp_path: Path, day: str, possible: list[str]
) -> None:
    """A year of two digits may come first or last: it proves no order for the logger's others."""
    file = write_described_export(tmp_path / "a.csv", f"{day} 9:12:31")
    (row,) = on_empty.json("ingest", file)["files"]
    assert row["outcome"] == "held"
    said = f"its day may be {' or '.join(possible)}"
    assert said in row["reason"]
    for each in possible:
        assert f"`shm ingest --confirm 1 --time {each}T09:12:31Z`" in row["reason"]
    assert times_of(empty) == []
    assert said in on_empty("ingest --held").told
    later = write_described_export(tmp_path / "b.csv", "9/10/2025 9:12:31", seed=2)
    (look,) = peek(on_empty, later)
    assert look["missing"] == ["which day, 2025-10-09 or 2025-09-10"]


@pytest.mark.parametrize(
    ("certain", "day", "time"),
    [
        (["14/5/2025"], "9/10/2025", "2025-10-09T09:12:31Z"),
        (["05-14-2025"], "09-10-2025", "2025-09-10T09:12:31Z"),
        (["5/14/2025", "5/15/2025"], "9/10/2025", "2025-09-10T09:12:31Z"),
        (["5/14/2025", "15/5/2025"], "9/10/2025", None),
    ],
)
def test_import_learns_day_order(
    on_empty: Shm, tmp_path: Path, certain: list[str], day: str, time: str | None
) -> None:
    """Files that prove both orders leave it open."""
    for number, each in enumerate(certain):
        imported(on_empty, write_export(tmp_path / f"{number}.csv", f"{each} 9:12:31"))
    (look,) = peek(on_empty, write_export(tmp_path / "later.csv", f"{day} 9:12:31"))
    assert look["time"] == time
    assert look["missing"] == ([] if time else ["which day, 2025-10-09 or 2025-09-10"])


@pytest.mark.parametrize("is_asked", [True, False])
def test_ingest_and_confirm_teach_day_order(
    on_empty: Shm, empty: Workspace, tmp_path: Path, is_asked: bool
) -> None:
    day = "9/10/2025 9:12:31 AM" if is_asked else "5/14/2025 9:12:31 AM"
    on_empty("ingest", write_described_export(tmp_path / "a.csv", day))
    if is_asked:
        on_empty.done("ingest --confirm 1 --time 2025-09-10T09:12:31Z")
        assert times_of(empty) == [at(9, 10)]
    later = write_described_export(tmp_path / "b.csv", "10/11/2025 9:12:31 AM", seed=2)
    (look,) = peek(on_empty, later)
    assert (look["time"], look["missing"]) == ("2025-10-11T09:12:31Z", [])


def test_import_asks_for_day(on_empty: Shm, empty: Workspace, tmp_path: Path) -> None:
    """What the question offers, the option takes."""
    file = write_export(tmp_path / "a.csv", "9/10/2025 9:12:31 AM")

    def days_asked(document: Any) -> list[str]:
        return [each["text"] for each in document["questions"] if each["about"] == "time"]

    (question,) = days_asked(imported(on_empty, file, "--dry-run"))
    assert "2025-10-09 or on 2025-09-10" in question
    unknown = imported(on_empty, file, "--dry-run --time unknown")
    assert (unknown["time"], days_asked(unknown)) == (None, [])
    answered = imported(on_empty, file, "--time 2025-09-10")
    assert (answered["time"], days_asked(answered)) == ("2025-09-10T09:12:31Z", [])
    (profile,) = (empty.folder / "loggers").iterdir()
    assert tomllib.loads(profile.read_text())["day_order"] == "month first"


def test_undated_tests_are_named(on_empty: Shm, empty: Workspace, tmp_path: Path) -> None:
    """No test is dated by its receipt without a line in status and report."""
    write_test(tmp_path / "dated.modes.json", empty)
    file = tmp_path / "undated.modes.json"
    write_test(file, empty, day=1)
    document = file.read_text()
    file.write_text(document.replace(document.split('"time": ')[1].split(",")[0], "null"))
    on_empty.done("ingest", tmp_path / "dated.modes.json", file)
    (row,) = on_empty.json("status")["hangers"]
    assert row["dated_by_receipt"] == ["undated"]
    line = "1 test without a time is dated by the receipt of the file: undated"
    assert line in on_empty("status").told
    assert line in on_empty("report --hanger 3").told
    assert on_empty.json("report --hanger 3")["dated_by_receipt"] == ["undated"]


# ------------------------------------------------------------ one test of several files

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
def together(tmp_path_factory: pytest.TempPathFactory, set_ups: list[Path]) -> Workspace:
    workspace = make_workspace(tmp_path_factory.mktemp("together") / "bridge")
    files = [str(path) for path in set_ups]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(working, "executor_of", threads)
        assert run(["--workspace", str(workspace.folder), "ingest", "--together", *files]) == 0
    return workspace


@pytest.mark.slow
def test_shapes_of_roving_hammer(shm: Shm, set_ups: list[Path], hanger_file: Path) -> None:
    (test,) = shm.json("identify", "--together", *set_ups, "--hanger-file", hanger_file)["tests"]
    assert {tuple(point["x_m"] for point in mode["shape"]) for mode in test["modes"]} == {PLACES_M}
    assert len(test["modes"]) >= 6


def test_files_taken_in_together_are_one_test_that_shows_how_it_was_identified(
    shm: Shm, together: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kept as one archive; each form of the sheet is of the same files, identified once."""
    with together.store() as store:
        assert sum(count_stages(store).values()) == count_stages(store)[Stage.DONE] == 1
        (stored,) = store.tests.list_all(3)
        assert store.recordings.get(stored.recording_id).file.file_name == "set_up_0.zip"
    assert stored.test.id == "set_up_0"
    assert {check.name for check in stored.quality} >= {"hits", "noise", "repeatability"}
    unpaint(monkeypatch)
    found: list[Identification] = []

    def identify_once(*arguments: Any, **options: Any) -> Identification:
        if not found:
            found.append(identify(*arguments, **options))
        return found[0]

    monkeypatch.setattr(reporting, "identify", identify_once)
    shm = shm.at(together)
    document = shm.json("report --hanger 3 --test set_up_0")
    shown = [mode["frequency_hz"] for mode in document["test"]["modes"]]
    assert shown == pytest.approx([mode.frequency_hz for mode in stored.test.modes])
    assert [check["name"] for check in document["quality"]] == [c.name for c in stored.quality]
    page = tmp_path / "sheet.html"
    shm.done(f"report --hanger 3 --test set_up_0 --out {page}")
    assert "set_up_0" in page.read_text(encoding="utf-8")
    assert "QUALITY" in shm("report --hanger 3 --test set_up_0 --full").out
