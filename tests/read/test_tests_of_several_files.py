"""One archive holds one test: its files, their sidecars, and nothing that could do harm."""

from __future__ import annotations

import io
import stat
import zipfile
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from shm.errors import BadInput, UsageError
from shm.read import bundle, holds_test, peek, peek_test, read, read_test, sidecar_path
from shm.read.limits import Limits, limited
from shm.values import Recording
from tests.helpers.written import refused, write

SUFFIXES = (".csv", ".uff", ".h5", ".mat", ".tdms", ".npz")


@pytest.fixture
def files(recording: Recording, tmp_path: Path) -> list[Path]:
    """Return a roving hammer: one file a point, each in another format, two with a sidecar."""
    folder = tmp_path / "test"
    folder.mkdir()
    paths = [folder / f"point_{i}{suffix}" for i, suffix in enumerate(SUFFIXES, start=5)]
    for place, path in enumerate(paths):
        force = replace(recording.channels[0], x_m=1.0 + place)
        write(replace(recording, channels=(force, *recording.channels[1:])), path)
    sidecar_path(paths[0]).write_text("[channel.force]\nx_m = 7.5\n")
    return paths


def zipped(path: Path, members: dict[str, bytes], how: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", how) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def csv(rows: int = 20) -> bytes:
    return b"# sampling_rate_hz: 512\nforce,acc_1\n" + b"1,2.5\n" * rows


def test_a_test_is_read_file_by_file_in_the_order_of_names(
    files: list[Path], tmp_path: Path
) -> None:
    archive = bundle(list(reversed(files)), tmp_path / "test.zip")
    records = read_test(archive)
    assert [record.source for record in records] == [str(archive / path.name) for path in files]
    places = [r.force.x_m for r in records if isinstance(r, Recording) and r.force]
    assert places == [7.5, 2.0, 3.0, 4.0, 5.0, 6.0]
    for record, path in zip(records, files, strict=True):
        alone = read(path)
        assert isinstance(record, Recording)
        assert isinstance(alone, Recording)
        for one, other in zip(record.channels, alone.channels, strict=True):
            np.testing.assert_array_equal(one.values, other.values)


def test_names_are_in_the_order_that_people_count_in(recording: Recording, tmp_path: Path) -> None:
    paths = [tmp_path / f"hit_{i}.csv" for i in (10, 9, 1)]
    for path in paths:
        write(recording, path)
    records = read_test(bundle(paths, tmp_path / "test.zip"))
    assert [Path(r.source).name for r in records] == ["hit_1.csv", "hit_9.csv", "hit_10.csv"]


def test_a_single_file_is_a_test_of_one(files: list[Path]) -> None:
    (record,) = read_test(files[0])
    assert record.source == str(files[0])
    assert peek_test(files[0]) == (peek(files[0]),)
    assert not holds_test(files[0])


def test_the_same_files_give_the_same_bytes(files: list[Path], tmp_path: Path) -> None:
    first = bundle(files, tmp_path / "first.zip").read_bytes()
    for path in files:
        path.touch()
        path.chmod(0o600)
    assert bundle(files[::-1], tmp_path / "second.zip").read_bytes() == first
    with zipfile.ZipFile(io.BytesIO(first)) as archive:
        names = archive.namelist()
    assert names == sorted([*(p.name for p in files), "point_5.toml", "point_6.toml"])


def test_what_makes_no_test_is_not_packed(files: list[Path], tmp_path: Path) -> None:
    other = tmp_path / "other" / files[0].name
    other.parent.mkdir()
    other.write_bytes(csv())
    archive = bundle(files, tmp_path / "test.zip")
    for wrong, words in (
        ([files[0], other], "two of the files are called point_5.csv"),
        ([], "0 files cannot be packed"),
        ([files[0], archive], "cannot be packed as one test"),
    ):
        with pytest.raises(UsageError, match=words):
            bundle(wrong, tmp_path / "wrong.zip")
    assert not (tmp_path / "wrong.zip").exists()


def test_the_sidecar_of_an_archive_tells_of_the_whole_test(
    files: list[Path], tmp_path: Path
) -> None:
    archive = bundle(files, tmp_path / "test.zip")
    sidecar_path(archive).write_text("hanger = 9\ntime = 2026-07-01T10:00:00Z\n")
    for found in (*read_test(archive), *peek_test(archive)):
        assert (found.hanger, found.temperature_c) == (9, -2.5)
        assert found.time == datetime(2026, 7, 1, 10, tzinfo=UTC)


def test_the_sidecar_of_an_archive_lists_nothing_of_channels(
    files: list[Path], tmp_path: Path
) -> None:
    archive = bundle(files, tmp_path / "test.zip")
    sidecar_path(archive).write_text('plane = "transverse"')
    with pytest.raises(BadInput, match="is said of a whole test") as refusal:
        read_test(archive)
    assert refusal.value.where == "test.toml"


def test_a_faulty_member_is_named(files: list[Path], tmp_path: Path) -> None:
    files[2].write_bytes(files[2].read_bytes()[:-500])
    sidecar_path(files[0]).write_text("hanger = 'x'\n")
    archive = bundle(files, tmp_path / "test.zip")
    with pytest.raises(BadInput, match=r"point_5.toml: hanger = 'x' is not a number") as refusal:
        read_test(archive)
    assert refusal.value.file == str(archive / "point_5.toml")
    looks = peek_test(archive)
    assert [bool(look.problems) for look in looks] == [True, False, True, False, False, False]
    assert (looks[2].format, looks[2].source) == ("not readable", str(archive / "point_7.h5"))
    assert "point_7.h5" in looks[2].problems[0]


def test_a_test_is_not_read_as_one_file(files: list[Path], tmp_path: Path) -> None:
    refused(
        bundle(files, tmp_path / "test.zip"),
        "the files of a test, where one file is read",
        read,
        peek,
    )


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("../evil.csv", "leads outside the archive"),
        ("a/../../evil.csv", "leads outside the archive"),
        ("/etc/evil.csv", "leads outside the archive"),
        ("C:\\evil.csv", "leads outside the archive"),
        ("..\\evil.csv", "leads outside the archive"),
        ("\\\\host\\evil.csv", "leads outside the archive"),
        ("inner.zip", "is an archive itself"),
        ("inner.TAR", "is an archive itself"),
        ("notes.toml", "describes a recording that the archive does not hold"),
        ("sub/hit.csv", "has the name of another one"),
    ],
)
def test_members_that_cannot_be_trusted_are_refused_by_name(
    tmp_path: Path, name: str, words: str
) -> None:
    archive = zipped(tmp_path / "test.zip", {"hit.csv": csv(), name: csv()})
    before = sorted(tmp_path.iterdir())
    for verb in (read_test, peek_test):
        with pytest.raises(BadInput, match=words) as refusal:
            verb(archive)
        assert name.rsplit("/")[-1].rsplit("\\")[-1] in refusal.value.message
        assert refusal.value.remedy
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFCHR, stat.S_IFIFO])
def test_links_and_devices_are_refused(tmp_path: Path, kind: int) -> None:
    member = zipfile.ZipInfo("hit.csv")
    member.create_system, member.external_attr = 3, (kind | 0o777) << 16
    with zipfile.ZipFile(tmp_path / "test.zip", "w") as archive:
        archive.writestr(member, "/etc/passwd")
    with pytest.raises(BadInput, match=r"'hit.csv' is a link or a device"):
        read_test(tmp_path / "test.zip")


def test_encrypted_members_are_refused(tmp_path: Path) -> None:
    content = zipped(tmp_path / "test.zip", {"hit.csv": csv()}).read_bytes()
    start = content.index(b"PK\x01\x02") + 8
    (tmp_path / "test.zip").write_bytes(content[:start] + b"\x01\x00" + content[start + 2 :])
    with pytest.raises(BadInput, match=r"'hit.csv' is encrypted"):
        read_test(tmp_path / "test.zip")


def test_a_member_that_unpacks_too_far_is_refused_while_it_does(tmp_path: Path) -> None:
    """30 MB of zeros in 30 kB; a header that lies about it changes nothing."""
    archive = zipped(tmp_path / "test.zip", {"hit.csv": bytes(30_000_000)})
    honest = archive.read_bytes()
    lying = honest.replace((30_000_000).to_bytes(4, "little"), (100).to_bytes(4, "little"))
    assert lying != honest
    for content in (honest, lying):
        archive.write_bytes(content)
        with pytest.raises(BadInput, match=r"unpacks to far more|cannot be read"):
            read_test(archive)


def test_all_members_together_are_limited(tmp_path: Path) -> None:
    archive = zipped(tmp_path / "test.zip", {f"hit_{i}.csv": csv(100) for i in (1, 2)})
    few = limited(Limits(parse_memory_bytes=4000))
    with few, pytest.raises(BadInput, match=r"'hit_2.csv' unpacks to far more"):
        read_test(archive)


def test_too_many_members_are_refused(tmp_path: Path) -> None:
    archive = zipped(tmp_path / "test.zip", {f"hit_{i}.csv": b"" for i in range(201)})
    with pytest.raises(BadInput, match="201 files in one archive; at most 200"):
        read_test(archive)


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "empty"), (b"PK\x03\x04" + bytes(60), "cannot be read"), (csv(), "cannot be read")],
)
def test_what_is_no_archive_is_refused(tmp_path: Path, content: bytes, words: str) -> None:
    (tmp_path / "test.zip").write_bytes(content)
    refused(tmp_path / "test.zip", words, read_test, peek_test)


def test_hidden_files_of_systems_are_passed_over_and_folders_opened(tmp_path: Path) -> None:
    members = {"t/": b"", "t/hit.csv": csv(), "__MACOSX/t/._hit.csv": b"x", "t/.DS_Store": b"x"}
    archive = zipped(tmp_path / "test.zip", members)
    assert len(read_test(archive)) == 1
    hidden = {name: b"x" for name in members if name != "t/hit.csv"}
    with pytest.raises(BadInput, match="holds no recording"):
        read_test(zipped(tmp_path / "test.zip", hidden))
