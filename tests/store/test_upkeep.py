"""What is found wrong in a store and an archive, how it is named, and what heals it."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest

from shm.errors import DamagedRow
from shm.store import IdentifiedTest, Lineage, Store
from shm.store.archive import Archive, Quarantine
from shm.store.checking import (
    CheckedArchive,
    CheckedStore,
    check_archive,
    check_store,
    of_no_recording,
    quick_troubles,
    unknown_files,
)
from shm.store.checksums import of_readable
from shm.store.upkeep import DamagedPosterior
from tests.helpers.contents import quiet
from tests.helpers.damaging import change, flipped
from tests.helpers.nouns import NOW, a_file, a_posterior, a_test

HOUR = timedelta(hours=1)
GONE = "index ix_posterior_tests_test_id"
LINEAGE = Lineage("0" * 64, "1" * 64, "0.1.0")


def damage(store: Store, table: str, column: str, id_: int) -> None:
    change(store.engine.url.render_as_string(hide_password=False), table, column, id_, flipped)


def test_the_last_backup_is_the_newest(file_store: Store) -> None:
    upkeep = file_store.upkeep
    assert upkeep.last_backup() is upkeep.newest_row_at() is None
    for hours in (0, 2):
        upkeep.note_backup(Path(f"/backups/{hours}.db"), NOW + hours * HOUR)
    assert upkeep.last_backup() == (NOW + 2 * HOUR, "/backups/2.db")
    file_store.recordings.receive(a_file(1), NOW + 3 * HOUR)
    assert upkeep.newest_row_at() == NOW + 3 * HOUR


def test_damage_is_noted_once_and_known_until_it_is_healed(filled_copy: Store) -> None:
    upkeep = filled_copy.upkeep
    error = DamagedRow("tests", 2, 3, "Make it again.")
    assert upkeep.note_damage(error, NOW)
    assert not upkeep.note_damage(error, NOW + HOUR)
    assert upkeep.known_damage() == ()
    damage(filled_copy, "tests", "document", 2)
    (found,) = upkeep.known_damage()
    assert (found.table, found.id, found.hanger) == ("tests", 2, 3)
    assert found.remedy == "Make it again from the archive: `shm ingest --again tests/2`."
    assert upkeep.damaged_tests(2) == (2,)
    assert upkeep.damaged_tests(1) == upkeep.damaged_posteriors(2) == ()
    again = IdentifiedTest(a_test("t2", 2), notes=("anew",))
    upkeep.heal_tests([2], [replace(again, position=5)], LINEAGE)
    assert upkeep.damaged_tests(2) == (2,)
    upkeep.heal_tests([2], [again], LINEAGE)
    assert upkeep.damaged_tests(2) == upkeep.known_damage() == ()
    assert check_store(filled_copy, quiet).troubles == ()
    assert filled_copy.tests.named(3, "t2").notes == ("anew",)


def test_a_damaged_posterior_is_named_with_its_class_and_tests(filled_copy: Store) -> None:
    upkeep = filled_copy.upkeep
    damage(filled_copy, "posteriors", "samples", 3)
    assert upkeep.damaged_posteriors(2) == (DamagedPosterior(3, "beam1", (2,)),)
    assert upkeep.damaged_posteriors(1) == ()
    test = filled_copy.tests.named(3, "t2")
    upkeep.heal_posterior(3, a_posterior("beam1", ("t2",), seed=8), [test], LINEAGE, NOW)
    assert upkeep.damaged_posteriors(2) == ()
    assert check_store(filled_copy, quiet).troubles == ()


def test_damaged_rows_that_are_made_again_by_themselves_are_thrown_away(filled_copy: Store) -> None:
    damage(filled_copy, "watches", "document", 1)
    assert filled_copy.upkeep.drop_damaged() == filled_copy.upkeep.drop_damaged(1) == 0
    assert [row.table for row in check_store(filled_copy, quiet).damaged] == ["watches"]
    assert filled_copy.upkeep.drop_damaged(2) == 1
    assert check_store(filled_copy, quiet).damaged == ()


def test_findings_say_of_each_trouble_its_kind_its_place_and_its_remedy(filled_copy: Store) -> None:
    whole = check_store(filled_copy, quiet)
    assert whole.findings == whole.unfit == quick_troubles(filled_copy) == ()
    damage(filled_copy, "tests", "document", 2)
    with filled_copy.engine.begin() as connection:
        connection.exec_driver_sql("DROP INDEX ix_posterior_tests_test_id")
    found = check_store(filled_copy, quiet)
    kinds = [(each.kind, each.where) for each in found.findings]
    assert kinds == [("damaged row", "tests/2"), ("changed schema", GONE)]
    row, schema = found.findings
    assert str(row).startswith("tests/2: ")
    assert str(row).endswith("`shm ingest --again tests/2`.")
    assert "shm db backup FILE" in schema.remedy
    assert found.unfit == found.troubles[:1]
    file = CheckedStore((), ("the file is damaged: page 3",)).findings[0]
    assert (file.kind, file.where, file.what) == (
        "fault of the file", "store", "the file is damaged: page 3.",
    )  # fmt: skip


def test_hangers_with_damage_are_left_out_and_named() -> None:
    asked: list[set[int]] = []

    def ask(damaged: object) -> dict[int, str]:
        asked.append(set(damaged))  # type: ignore[call-overload]
        for hanger in (3, 5):
            if hanger not in asked[-1]:
                raise DamagedRow("watches", hanger, hanger, "")
        return {4: "fine"}

    damaged: dict[int, DamagedRow] = {}
    assert of_readable(ask, damaged) == {4: "fine"}
    assert asked == [set(), {3}, {3, 5}]
    assert [damaged[hanger].id for hanger in (3, 5)] == [3, 5]

    def of_none(_: object) -> dict[int, str]:
        raise DamagedRow("events", 1, None, "")

    with pytest.raises(DamagedRow):
        of_readable(of_none, {})

    def again(_: object) -> dict[int, str]:
        raise DamagedRow("watches", 3, 3, "")

    with pytest.raises(DamagedRow):
        of_readable(again, {3: DamagedRow("watches", 3, 3, "")})


def test_an_archive_says_what_is_missing_changed_and_of_nobody(
    file_store: Store, tmp_path: Path
) -> None:
    archive = Archive(tmp_path / "archive")
    archive.folder.mkdir()
    contents = (b"one", b"two", b"three")
    for number, content in enumerate(contents, start=1):
        source = tmp_path / "new.csv"
        source.write_bytes(content)
        kept = archive.keep(source)
        names = {"sha256": kept.sha256, "archived_as": kept.archived_as}
        file_store.recordings.receive(a_file(number, **names), NOW)
    names = [each.file.archived_as or "" for each in file_store.recordings.list_all()]
    told: list[float] = []
    whole = check_archive(file_store, archive, lambda _, share: told.append(share))
    assert (whole.whole, whole.troubles, whole.findings) == (3, (), ())
    assert told == pytest.approx([1 / 3, 2 / 3, 1])
    (archive.folder / names[0]).unlink()
    changed = archive.folder / names[1]
    changed.chmod(0o644)
    changed.write_bytes(b"owt")
    stray = archive.folder / "ab" / "ab12.csv"
    stray.parent.mkdir()
    stray.touch()
    stray.with_name("ab12.csv.toml").touch()
    found = check_archive(file_store, archive, quiet)
    assert found.whole == 1
    assert (found.missing, found.damaged) == ((names[0],), (names[1],))
    assert found.troubles == (
        f"{names[0]} is not in the archive",
        f"{names[1]} of the archive has another SHA-256",
    )
    assert [(each.kind, each.where) for each in found.findings] == [
        ("missing raw file", f"archive/{names[0]}"),
        ("damaged raw file", f"archive/{names[1]}"),
    ]
    assert unknown_files(file_store, archive)[0] == "ab/ab12.csv"
    assert CheckedArchive(1, (), (), ()).removed == 0


def test_files_of_no_recording_are_counted_and_the_first_is_named() -> None:
    what, remedy = of_no_recording(["ab/1", "cd/2"])
    assert what == "2 of the archive belong to no recording: ab/1 and others"
    assert remedy.endswith("`shm ingest archive/ab/1`.")
    assert of_no_recording(["ab/1"])[0] == "1 of the archive belong to no recording: ab/1"


def test_a_refused_file_is_moved_with_its_reason_and_its_sidecar(tmp_path: Path) -> None:
    quarantine = Quarantine(tmp_path / "refused")
    quarantine.folder.mkdir()
    reason = {"message": "too large.", "remedy": "Cut it.", "sha256": "a" * 64}
    for content in ("first", "second"):
        source = tmp_path / "a.csv"
        source.write_text(content)
        sidecar = tmp_path / "a.csv.toml"
        sidecar.write_text("hanger = 3")
        target = quarantine.move(source, "a.csv", reason, sidecar)
        assert not source.exists()
        assert not sidecar.exists()
        assert target.read_text() == content
        assert target.with_name(f"{target.name}.reason.json").is_file()
    assert len({path.name for path in quarantine.folder.glob("a*.csv")}) == 2
