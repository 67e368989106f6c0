"""Notes, inspections and repairs: what people write of a hanger or the bridge, with a photo each.

A photo is drawn anew before it is kept, so that nothing in its file but the picture stays: neither
where it was taken nor anything that is no picture.
"""

from __future__ import annotations

import io
from datetime import datetime, timedelta

import sqlalchemy as sa

from shm.errors import BadInput, NothingThere, UsageError
from shm.store.columns import insert_value, value_in
from shm.store.database import Repository
from shm.store.journal import note
from shm.store.tables import notes
from shm.values.notes import Note, NoteKind

LARGEST_PHOTO_BYTES = 5_000_000
"""Judgement: what a telephone makes of 12 million pixels."""
_LONGEST_SIDE = 1600  # judgement: it fills a screen, and a crack of a hand's breadth is seen
_MOST_PIXELS = 50_000_000  # technical: 150 MB of memory while it is drawn anew
_LONGEST_TEXT = 2000  # characters, as of what is said to an alert
_AHEAD = timedelta(days=1)  # a day begins up to 14 h earlier east of Greenwich
_COLUMNS = (
    *(column for column in notes.c if column is not notes.c.photo),
    notes.c.photo.is_not(None).label("has_photo"),
)
_KINDS = ("JPEG", "PNG")


class Notes(Repository):
    """Notes; none is changed or taken out: a later one corrects it."""

    def add(
        self,
        hanger: int | None,
        at: datetime,
        kind: NoteKind,
        text: str,
        who: str,
        now: datetime,
        photo: bytes = b"",
    ) -> Note:
        """Keeps a note of a hanger, or of the bridge where None.

        Raises UsageError for a text or time that cannot be, BadInput for a photo that is none.
        """
        text = _checked(text, at, now)
        encoded = _reencode(photo) if photo else None
        written = Note(0, hanger, at, kind, text, who, now, encoded is not None)
        with self.writing() as connection:
            made = insert_value(connection, notes, written, photo=encoded)
            note(connection, now, "note written", f"note {made.id}, {made.of}", text, who)
        return made

    def list_all(self, hanger: int | None = None, *, of_bridge: bool = False) -> tuple[Note, ...]:
        """All, those of a hanger and of the bridge, or of the bridge alone; what was seen or done
        last comes first.
        """
        query = sa.select(*_COLUMNS).order_by(notes.c.at.desc(), notes.c.id.desc())
        if hanger is not None:
            query = query.where(sa.or_(notes.c.hanger == hanger, notes.c.hanger.is_(None)))
        elif of_bridge:
            query = query.where(notes.c.hanger.is_(None))
        return tuple(value_in(row, Note) for row in self.rows(query))

    def photo(self, number: int) -> bytes:
        """The photo of a note, a JPEG; raises NothingThere."""
        photo = self.scalar(sa.select(notes.c.photo).where(notes.c.id == number))
        if photo is None:
            raise NothingThere(f"no photo of a note {number}.", remedy="See `shm note list`.")
        return bytes(photo)


def _checked(text: str, at: datetime, now: datetime) -> str:
    # No database keeps half a character, nor PostgreSQL a zero.
    text = text.encode("utf-8", "replace").decode().replace("\0", "").strip()
    if not 0 < len(text) <= _LONGEST_TEXT:
        raise UsageError(
            f"the text of a note has 1 to {_LONGEST_TEXT} characters; this has {len(text)}.",
            remedy="Write several notes, or a shorter one.",
        )
    if at > now + _AHEAD:
        raise UsageError(
            f"{at:%Y-%m-%d} has not come yet.", remedy="Give the day on which it was seen or done."
        )
    return text


def _reencode(content: bytes) -> bytes:
    """The picture alone, as a JPEG that is no larger than a screen."""
    if len(content) > LARGEST_PHOTO_BYTES:
        raise _unfit(f"has {len(content) / 1e6:.1f} MB, at most 5 are taken")
    # Loaded here: most who open a store show no image.
    from PIL import Image, ImageOps

    try:
        with Image.open(io.BytesIO(content), formats=_KINDS) as image:
            if image.width * image.height > _MOST_PIXELS:
                raise _unfit(f"has {image.width} x {image.height} pixels, too many")
            image.draft("RGB", (_LONGEST_SIDE, _LONGEST_SIDE))
            drawn = ImageOps.exif_transpose(image).convert("RGB")
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise _unfit("is no JPEG or PNG image that can be read") from error
    drawn.thumbnail((_LONGEST_SIDE, _LONGEST_SIDE))
    drawn.info = {}
    made = io.BytesIO()
    drawn.save(made, "JPEG", quality=85)
    return made.getvalue()


def _unfit(why: str) -> BadInput:
    return BadInput(f"the photo {why}.", remedy="Give a JPEG or PNG of 5 MB at most.")
