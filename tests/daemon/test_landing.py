"""What comes over the network lands whole, under a free name, or leaves nothing behind."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from shm.errors import BadInput, ShmError
from shm_daemon.spool import Landed, incoming, landing_name

SAID = {"hanger": 3}
CONTENT = b"force,acc_1\n1,2\n"
DIGEST = hashlib.sha256(CONTENT).hexdigest()


def land(spool: Path, name: str = "a.csv", content: bytes = CONTENT, **said: object) -> Landed:
    with incoming(spool, 100) as file:
        file.write(content[:5])
        file.write(content[5:])
        return file.land(name, said)


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.rglob("*") if path.is_file()}


def test_a_file_lands_with_its_sidecar_and_nothing_is_left_under_way(tmp_path: Path) -> None:
    landed = land(tmp_path, **SAID)
    assert landed == Landed(tmp_path / "a.csv", DIGEST, len(CONTENT))
    assert landed.path.read_bytes() == CONTENT
    assert (tmp_path / "a.toml").read_text() == "hanger = 3\n"
    assert names(tmp_path) == {"a.csv", "a.toml"}


@pytest.mark.parametrize(
    ("content", "said"), [(CONTENT, {}), (CONTENT, {"hanger": 4}), (b"force,acc_1\n1,3\n", SAID)]
)
def test_another_file_of_the_name_gets_one_beside_it(
    content: bytes, said: dict[str, object], tmp_path: Path
) -> None:
    land(tmp_path, **SAID)
    other = land(tmp_path, content=content, **said)
    assert other.path.name == f"a-{hashlib.sha256(content).hexdigest()[:8]}.csv"
    assert (tmp_path / "a.csv").read_bytes() == CONTENT
    third = land(tmp_path, content=content, hanger=5)
    assert len(third.path.stem) == len("a-") + 12
    assert third.path.read_bytes() == content


def test_what_does_not_land_leaves_nothing(tmp_path: Path) -> None:
    with incoming(tmp_path, 100) as file:
        file.write(CONTENT)
        assert file.whole().read_bytes() == CONTENT
        assert (file.sha256, file.size_bytes) == (DIGEST, len(CONTENT))
        with pytest.raises(BadInput):
            file.land("..", SAID)
    assert names(tmp_path) == set()


def test_more_than_is_taken_is_refused_before_it_is_kept(tmp_path: Path) -> None:
    with incoming(tmp_path, 10) as file:
        file.write(b"0123456789")
        with pytest.raises(ShmError):
            file.write(b"x")
        assert file.size_bytes == 10


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("a.csv", "a.csv"),
        ("C:\\data\\a.csv", "a.csv"),
        ("/etc/../a.csv", "a.csv"),
        (" .a\x00\u2028.csv ", "a.csv"),
        ("...a.csv", "a.csv"),
    ],
)
def test_a_name_is_its_last_part_without_what_harms(given: str, name: str) -> None:
    assert landing_name(given) == name
