"""Days such as 9/10/2025: read as the logger's profile learnt, else asked of a person."""

from __future__ import annotations

import tomllib
from datetime import UTC, datetime
from pathlib import Path

import pytest

from shm.store import Workspace
from tests.cli.conftest import Shm
from tests.helpers.logger_exports import (
    write_described_export,
    write_export,
)
from tests.helpers.workspaces import make_workspace, write_test

DESCRIBED = ("--hanger", 3, "--place", "2.52,2.52", "--plane", "transverse,longitudinal")


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "bridge")


def times_of(workspace: Workspace) -> list[datetime | None]:
    with workspace.store() as store:
        return [each.test.time for each in store.tests.list_all(3)]


def at(month: int, day: int) -> datetime:
    return datetime(2025, month, day, 9, 12, 31, tzinfo=UTC)


def test_ingest_reads_days_as_imported(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    """A loss of 7 % over three tests must raise its alert, whatever the receipt."""
    first = write_export(tmp_path / "a.csv", "5/14/2025 9:12:31 AM")
    in_place = ("--workspace", workspace.folder)
    assert shm(*in_place, "import", first, *DESCRIBED).code == 0
    days = ("9/10/2025 9:12:31 AM", "10/11/2025 9:12:31 AM", "11/12/2025 9:12:31 AM")
    later = [
        write_export(tmp_path / f"{n}.csv", day, 650e3, seed=n)
        for n, day in enumerate(days, start=2)
    ]
    looks = shm(*in_place, "ingest", "--peek", *later, "--json").document["files"]
    assert [look["time"] for look in looks] == [
        f"2025-{day}T09:12:31Z" for day in ("09-10", "10-11", "11-12")
    ]
    assert shm(*in_place, "ingest", workspace.spool / "a.csv").code == 0
    taken = shm(*in_place, "ingest", *later, "--json").document
    assert [row["outcome"] for row in taken["files"]] == ["taken in"] * 3
    assert times_of(workspace) == [at(5, 14), at(9, 10), at(10, 11), at(11, 12)]
    assert any("fell by" in alert["message"] for alert in taken["alerts"])


def test_ingest_holds_unknown_day_order(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    file = write_described_export(tmp_path / "a.csv", "9/10/2025 9:12:31 AM")
    in_place = ("--workspace", workspace.folder)
    (row,) = shm(*in_place, "ingest", file, "--json").document["files"]
    assert row["outcome"] == "held"
    assert "its day may be 2025-10-09 or 2025-09-10" in row["reason"]
    for time in ("2025-10-09T09:12:31Z", "2025-09-10T09:12:31Z"):
        assert f"`shm ingest --confirm 1 --time {time}`" in row["reason"]
    assert times_of(workspace) == []
    held = " ".join(shm(*in_place, "ingest", "--held").out.split())
    assert "its day may be 2025-10-09 or 2025-09-10" in held


def test_confirm_teaches_day_order(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    in_place = ("--workspace", workspace.folder)
    shm(*in_place, "ingest", write_described_export(tmp_path / "a.csv", "9/10/2025 9:12:31 AM"))
    said = ("--confirm", 1, "--time", "2025-09-10T09:12:31Z")
    assert shm(*in_place, "ingest", *said).code == 0
    assert times_of(workspace) == [at(9, 10)]
    later = write_described_export(tmp_path / "b.csv", "10/11/2025 9:12:31 AM", seed=2)
    (look,) = shm(*in_place, "ingest", "--peek", later, "--json").document["files"]
    assert (look["time"], look["missing"]) == ("2025-10-11T09:12:31Z", [])


def test_ingest_teaches_day_order(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    in_place = ("--workspace", workspace.folder)
    shm(*in_place, "ingest", write_described_export(tmp_path / "a.csv", "5/14/2025 9:12:31"))
    later = write_described_export(tmp_path / "b.csv", "9/10/2025 9:12:31", seed=2)
    (look,) = shm(*in_place, "ingest", "--peek", later, "--json").document["files"]
    assert (look["time"], look["missing"]) == ("2025-09-10T09:12:31Z", [])


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
    shm: Shm, workspace: Workspace, tmp_path: Path, certain: list[str], day: str, time: str | None
) -> None:
    """Files that prove both orders leave it open."""
    in_place = ("--workspace", workspace.folder)
    for number, each in enumerate(certain):
        file = write_export(tmp_path / f"{number}.csv", f"{each} 9:12:31")
        assert shm(*in_place, "import", file, *DESCRIBED).code == 0
    later = write_export(tmp_path / "later.csv", f"{day} 9:12:31")
    (look,) = shm(*in_place, "ingest", "--peek", later, "--json").document["files"]
    assert look["time"] == time
    assert look["missing"] == ([] if time else ["which day, 2025-10-09 or 2025-09-10"])


def test_import_asks_for_day(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    file = write_export(tmp_path / "a.csv", "9/10/2025 9:12:31 AM")
    command = ("--workspace", workspace.folder, "import", file, *DESCRIBED)
    asked = shm(*command, "--dry-run", "--json").document["questions"]
    (question,) = [each for each in asked if each["about"] == "time"]
    assert "2025-10-09 or on 2025-09-10" in question["text"]
    answered = shm(*command, "--time", "2025-09-10", "--json").document
    assert answered["time"] == "2025-09-10T09:12:31Z"
    assert not [each for each in answered["questions"] if each["about"] == "time"]
    (profile,) = (workspace.folder / "loggers").iterdir()
    assert tomllib.loads(profile.read_text())["day_order"] == "month first"


def test_undated_tests_are_named(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    """No test is dated by its receipt without a line in status and report."""
    write_test(tmp_path / "dated.modes.json", workspace)
    file = tmp_path / "undated.modes.json"
    write_test(file, workspace, day=1)
    document = file.read_text()
    file.write_text(document.replace(document.split('"time": ')[1].split(",")[0], "null"))
    in_place = ("--workspace", workspace.folder)
    assert shm(*in_place, "ingest", tmp_path / "dated.modes.json", file).code == 0
    line = "1 test without a time is dated by the receipt of the file: undated"
    (row,) = shm(*in_place, "status", "--json").document["hangers"]
    assert row["dated_by_receipt"] == ["undated"]
    for verb in (("status",), ("report", "--hanger", 3)):
        assert line in " ".join(shm(*in_place, *verb).out.split())
    report = shm(*in_place, "report", "--hanger", 3, "--json").document
    assert report["dated_by_receipt"] == ["undated"]


@pytest.mark.parametrize(
    ("day", "possible"),
    [
        ("26/02/03", ["2003-02-26", "2026-02-03"]),
        ("04/05/06", ["2006-05-04", "2006-04-05", "2004-05-06"]),
        ("14-05-26", ["2026-05-14", "2014-05-26"]),
    ],
)
def test_ingest_holds_two_digit_years(
    shm: Shm, workspace: Workspace, tmp_path: Path, day: str, possible: list[str]
) -> None:
    """The year may come first or last: no such day proves an order for the logger's others."""
    in_place = ("--workspace", workspace.folder)
    file = write_described_export(tmp_path / "a.csv", f"{day} 9:12:31")
    (row,) = shm(*in_place, "ingest", file, "--json").document["files"]
    assert row["outcome"] == "held"
    assert f"its day may be {' or '.join(possible)}" in row["reason"]
    for each in possible:
        assert f"`shm ingest --confirm 1 --time {each}T09:12:31Z`" in row["reason"]
    later = write_described_export(tmp_path / "b.csv", "9/10/2025 9:12:31", seed=2)
    (look,) = shm(*in_place, "ingest", "--peek", later, "--json").document["files"]
    assert look["missing"] == ["which day, 2025-10-09 or 2025-09-10"]


def test_import_takes_unknown_time(shm: Shm, workspace: Workspace, tmp_path: Path) -> None:
    """What the question offers, the option takes."""
    file = write_export(tmp_path / "a.csv", "9/10/2025 9:12:31 AM")
    command = ("--workspace", workspace.folder, "import", file, *DESCRIBED, "--dry-run", "--json")
    answered = shm(*command, "--time", "unknown")
    assert answered.code == 0
    assert answered.document["time"] is None
    assert not [each for each in answered.document["questions"] if each["about"] == "time"]
