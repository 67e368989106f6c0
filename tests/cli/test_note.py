"""`shm note`: what is written is listed, and what cannot be says how to go on."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from shm.store import Workspace
from tests.cli.conftest import Ended, Shm


@pytest.fixture
def note(shm: Shm, empty: Workspace) -> Shm:
    def call(*words: object) -> Ended:
        return shm("--workspace", empty.folder, "note", *words)

    return call


def test_a_note_with_a_photo_is_written_and_listed(note: Shm, tmp_path: Path) -> None:
    assert "No note" in note("list").out
    photo = tmp_path / "pin.png"
    Image.new("RGB", (4, 4)).save(photo)
    told = ("--hanger", 3, "--kind", "repair", "--at", "2026-05-01", "--photo", photo)
    made = note("add", "new pin", *told, "--who", "anna", "--json").document
    assert (made["id"], made["has_photo"], made["at"][:10]) == (1, True, "2026-05-01")
    assert note("add", "storm", "--bridge").code == 0
    listed = note("list", "--hanger", 3, "--json").document["notes"]
    assert [each["text"] for each in listed] == ["storm", "new pin"]
    assert "new pin" in note("list").out


@pytest.mark.parametrize(
    ("words", "codes", "said"),
    [
        (("x",), (2, 3), "--bridge"),
        (("x", "--bridge", "--hanger", 3), (2, 3), "--bridge"),
        (("x", "--hanger", 99), (4,), "99"),
        (("x", "--bridge", "--at", "2999-01-01"), (2, 3), "has not come yet"),
        (("x", "--bridge", "--photo", __file__), (2, 3), "JPEG or PNG"),
    ],
)
def test_what_cannot_be_is_refused(
    note: Shm, words: tuple[object, ...], codes: tuple[int, ...], said: str
) -> None:
    ended = note("add", *words)
    assert ended.code in codes
    assert said in ended.err
    assert "No note" in note("list").out
