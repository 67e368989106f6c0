"""The bytes of a file: there at all, of the kind its name says, unpacked, and as text."""

from __future__ import annotations

import codecs
import gzip
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from shm.errors import BadInput
from shm.read.base import Format
from shm.read.limits import limits, too_large
from shm.read.packed import unpacking_folder

_HEAD_BYTES = 4096
_MAGIC: tuple[tuple[bytes, str], ...] = (
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"GIF8", "a GIF picture"),
    (b"II*\x00", "a TIFF picture"),
    (b"MM\x00*", "a TIFF picture"),
    (b"RIFF", "a sound, film or WebP picture"),
    (b"%PDF", "a PDF document"),
    (b"PK\x03\x04", "a ZIP archive or office document"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"SQLite format 3", "a SQLite database"),
    (b"\x7fELF", "a program"),
)
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_TEXT_CONTROLS = {*b"\t\n\r\f\x1a"}  # 0x1a ends a text file of DOS


def head_of(path: Path) -> bytes:
    """The first bytes of a file; raises BadInput where it cannot be read or is empty."""
    head = _bytes(path, _HEAD_BYTES)
    if not head.strip():
        raise BadInput("the file is empty.", file=path, remedy="Export or send it again.")
    return head


def unreadable(path: Path, error: OSError) -> BadInput:
    """The refusal of a file that the system does not hand out."""
    reason = error.strerror or str(error)
    return BadInput(f"cannot be read: {reason}.", file=path, remedy="Check path and permissions.")


def refuse_unreadable_suffix(
    path: Path, suffixes: list[str], recognised: Format | None
) -> BadInput:
    """The refusal of a file whose suffix belongs to no format."""
    suffix = f"the suffix {path.suffix}" if path.suffix else "a name without suffix"
    remedy = f"Export as one of {', '.join(suffixes)}."
    if recognised is not None:
        remedy = f"Its content looks like {recognised.name}: rename it to {recognised.suffixes[0]}."
    return BadInput(f"{suffix} belongs to no format that is read.", file=path, remedy=remedy)


def refuse_unless_readable(
    path: Path, head: bytes, claimed: Format, recognised: Format | None
) -> None:
    """Raises BadInput where the first bytes are not of the format that the suffix claims."""
    known = next((what for magic, what in _MAGIC if head.startswith(magic)), None)
    if recognised is not None and recognised.recognises is not is_text:
        known = None
    if known is None and recognised is claimed:
        return
    if known is None and recognised is not None:
        raise BadInput(
            f"named {path.suffix}, but the content is {recognised.name}.",
            file=path,
            remedy=f"Rename it to {recognised.suffixes[0]}.",
        )
    what = f"holds {known}" if known else "does not hold what its name says"
    raise BadInput(
        f"{what}, not {claimed.name}.", file=path, remedy=f"Export it anew as {claimed.name}."
    )


def is_text(head: bytes) -> bool:
    """Whether the first bytes of a file are text, that is, hold no control characters."""
    if head.startswith(_UTF16):
        return True
    return not any(byte < 32 and byte not in _TEXT_CONTROLS for byte in head)


def text_of(path: Path) -> str:
    """A whole file as text: UTF-8, UTF-16 with a mark, or else Western European (for m/s²)."""
    content = bytes_of(path)
    try:
        return content.decode("utf-16" if content.startswith(_UTF16) else "utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def bytes_of(path: Path) -> bytes:
    """A whole file, unpacked where it is gzipped; raises BadInput where it cannot be read."""
    most = limits().bytes_at_once
    content = _bytes(path, most + 1)
    if len(content) > most:
        raise too_large(path)
    return content


def is_gzipped(path: Path) -> bool:
    """Whether a name claims a gzipped file, as NAME.csv.gz does."""
    return path.suffix.lower() == ".gz"


@contextmanager
def plain_file(path: Path, content: bytes) -> Iterator[Path]:
    """The file itself or, where it is gzipped, a file of its unpacked content for a while."""
    if not is_gzipped(path):
        yield path
        return
    with unpacking_folder() as folder:
        plain = folder / path.stem
        with plain.open("xb") as file:
            file.write(content)
        yield plain


def _bytes(path: Path, most: int) -> bytes:
    """At most so many bytes of a file, unpacked where its name ends in .gz."""
    try:
        with gzip.open(path) if is_gzipped(path) else path.open("rb") as stream:
            return bytes(stream.read(most))
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise BadInput(
            f"cannot be unpacked: {error}.", file=path, remedy="Pack or send it again."
        ) from error
    except OSError as error:
        raise unreadable(path, error) from error
