"""Notes of a hanger and of the bridge: what is kept of them and of a photo, what is refused."""

from __future__ import annotations

import io
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from PIL import Image

from shm.errors import BadInput, NothingThere, ShmError, UsageError
from shm.store import Store
from shm.store.journal import list_changes
from shm.store.notes import LARGEST_PHOTO_BYTES
from shm.values.notes import NoteKind

NOW = datetime(2026, 5, 1, 12, 0, tzinfo=UTC)
DAY = timedelta(days=1)
SECRET = b"GPS 47.3N 8.5E"


def a_photo(kind: str, width: int = 40, height: int = 20) -> bytes:
    """Left half red, with the place in every field that a file may have one, to be turned left."""
    image = Image.new("RGB", (width, height), "blue")
    image.paste("red", (0, 0, width // 2, height))
    exif = Image.Exif()
    exif[0x0112], exif[0x010E] = 8, SECRET.decode()  # orientation, description
    made = io.BytesIO()
    image.save(made, kind, exif=exif, comment=SECRET, xmp=SECRET, icc_profile=SECRET)
    assert SECRET in made.getvalue()
    return made.getvalue()


@pytest.mark.parametrize("kind", ["JPEG", "PNG"])
def test_of_a_photo_the_picture_alone_is_kept_upright_and_no_larger_than_a_screen(
    file_store: Store, kind: str
) -> None:
    note = file_store.notes.add(
        3, NOW, NoteKind.NOTE, "rust", "anna", NOW, a_photo(kind, 2000, 1000)
    )
    assert note.has_photo
    assert file_store.notes.list_all(3) == (note,)
    kept = file_store.notes.photo(note.id)
    assert SECRET not in kept
    image = Image.open(io.BytesIO(kept))
    assert (image.format, image.size, len(image.getexif())) == ("JPEG", (800, 1600), 0)
    red, _, blue = image.getpixel((400, 1500))  # type: ignore[misc]
    assert red > 200 > 50 > blue


def test_the_worst_picture_is_kept_in_less_than_what_is_taken(file_store: Store) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (1100, 1500, 3), np.uint8)
    made = io.BytesIO()
    Image.fromarray(noise).save(made, "PNG")
    note = file_store.notes.add(None, NOW, NoteKind.NOTE, "x", "a", NOW, made.getvalue())
    assert len(file_store.notes.photo(note.id)) * 1600**2 / (1100 * 1500) < LARGEST_PHOTO_BYTES


@pytest.mark.parametrize(
    ("text", "days", "photo", "error"),
    [
        (" ", 0, b"", UsageError),
        ("x" * 2001, 0, b"", UsageError),
        ("x", 1.01, b"", UsageError),
        ("x", 0, b"no image", BadInput),
        ("x", 0, a_photo("JPEG")[:-300], BadInput),
        ("x", 0, b"GIF89a" + bytes(100), BadInput),
        ("x", 0, bytes(LARGEST_PHOTO_BYTES + 1), BadInput),
    ],
)
def test_what_cannot_be_is_refused_and_leaves_nothing(
    file_store: Store, text: str, days: float, photo: bytes, error: type[ShmError]
) -> None:
    with pytest.raises(error):
        file_store.notes.add(3, NOW + days * DAY, NoteKind.NOTE, text, "anna", NOW, photo)
    assert file_store.notes.list_all() == ()
    assert list_changes(file_store) == ()
    with pytest.raises(NothingThere):
        file_store.notes.photo(1)
