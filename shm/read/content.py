"""Read the bytes of a file: check that it exists and is of its kind, unpack it, decode text.

Nothing that the headers of ZIP archives state is relied on.
"""

from __future__ import annotations

import codecs
import gzip
import re
import stat
import tempfile
import tomllib
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import TYPE_CHECKING, Any

from shm.errors import BadInput
from shm.read.limits import guarded, limits, too_large

if TYPE_CHECKING:
    from shm.read.base import Format

# judgement: marks of formats stand at the beginning, and a page tells text from other bytes
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
    (b"\xd0\xcf\x11\xe0", "a document of an old Excel or Word"),
    (b"SQLite format 3", "a SQLite database"),
    (b"\x7fELF", "a program"),
)
_MOSTLY = 0.9  # judgement: letters beyond Latin are rare in a heading
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_TEXT_CONTROLS = {*b"\t\n\r\f\x1a"}  # 0x1a ends a text file of DOS
MOST_MEMBERS = 200
_MOST_RATIO = 200
_CHUNK = 1 << 20
_ENCRYPTED = 0x1
FIRST_DAY = (1980, 1, 1, 0, 0, 0)  # the earliest that ZIP knows, so that equal files pack alike
_ARCHIVES = (".zip", ".tar", ".tgz", ".7z", ".rar", ".bz2", ".xz", ".zst")
_PACK_AGAIN = "Pack the plain files of one test again."


def head_of(path: Path) -> bytes:
    """Return the first bytes of a file; raises BadInput where it cannot be read or is empty."""
    head = _bytes(path, _HEAD_BYTES)
    if not head.strip():
        raise BadInput("the file is empty.", file=path, remedy="Export or send it again.")
    return head


def unreadable(path: Path, error: OSError) -> BadInput:
    """Return the refusal of a file that the system does not hand out."""
    reason = error.strerror or str(error)
    return BadInput(f"cannot be read: {reason}.", file=path, remedy="Check path and permissions.")


def read_toml(path: Path, remedy: str) -> dict[str, Any]:
    """Return what a TOML file says; raises BadInput where it cannot be read."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise unreadable(path, error) from error
    except (ValueError, RecursionError) as error:
        what = f"not a readable TOML file: {error}."
        raise BadInput(what, file=path, remedy=remedy) from error


def refuse_unreadable_suffix(
    path: Path, suffixes: list[str], recognised: Format | None
) -> BadInput:
    """Return the refusal of a file whose suffix belongs to no format."""
    suffix = f"the suffix {path.suffix}" if path.suffix else "a name without suffix"
    remedy = f"Export as one of {', '.join(suffixes)}."
    if recognised is not None:
        remedy = f"Its content looks like {recognised.name}: rename it to {recognised.suffixes[0]}."
    return BadInput(f"{suffix} belongs to no format that is read.", file=path, remedy=remedy)


def refuse_unless_readable(
    path: Path, head: bytes, claimed: Format, recognised: Format | None
) -> None:
    """Raise BadInput where the first bytes are not of the format that the suffix claims."""
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
        f"{what}, not {claimed.name}.", file=path, remedy=f"Export it again as {claimed.name}."
    )


def is_text(head: bytes) -> bool:
    """Return whether the first bytes of a file are text, that is, hold no control characters."""
    if head.startswith(_UTF16) or _unmarked_utf16(head):
        return True
    return not any(byte < 32 and byte not in _TEXT_CONTROLS for byte in head)


def text_of(path: Path) -> str:
    """Return a file as text: UTF-8, UTF-16 with a mark, or else Western European (for m/s²)."""
    content = bytes_of(path)
    try:
        if content.startswith(_UTF16):
            return content.decode("utf-16", errors="replace")
        return content.decode(_unmarked_utf16(content[:_HEAD_BYTES]) or "utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


LINE_BREAK = re.compile(r"\r\n|\r|\n")


def mark_between(line: str) -> str:
    """Return the mark that separates the columns of a line."""
    return next((mark for mark in "\t;" if mark in line), ",")


def cells_of(line: str, mark: str) -> list[str]:
    """Return the cells of a line without blanks and quotes around them."""
    return [cell.strip().strip('"').strip() for cell in line.split(mark)]


def _unmarked_utf16(head: bytes) -> str | None:
    """Return the encoding of a text in UTF-16 without its mark: every other byte is zero."""
    even, odd = head[: len(head) // 2 * 2 : 2], head[1::2]
    if len(odd) < 8 or len(odd) != len(even):
        return None
    for zeros, others, name in ((odd, even, "utf-16-le"), (even, odd, "utf-16-be")):
        plain = all(byte >= 32 or byte in _TEXT_CONTROLS for byte in others)
        if zeros.count(0) > _MOSTLY * len(zeros) and plain:
            return name
    return None


def bytes_of(path: Path) -> bytes:
    """Return the bytes of a file, unpacked if gzipped; raises BadInput where it cannot be read."""
    most = limits().bytes_at_once
    content = _bytes(path, most + 1)
    if len(content) > most:
        raise too_large(path)
    return content


def is_gzipped(path: Path) -> bool:
    """Return whether a name claims a gzipped file, as NAME.csv.gz does."""
    return path.suffix.lower() == ".gz"


def holds_test(path: Path) -> bool:
    """Return whether a name is that of an archive with the files of one test."""
    return path.suffix.lower() == ".zip"


@contextmanager
def plain_file(path: Path, content: bytes) -> Iterator[Path]:
    """Yield the file itself or, where it is gzipped, a file of its unpacked content for a while."""
    if not is_gzipped(path):
        yield path
        return
    with unpacking_folder() as folder:
        plain = folder / path.stem
        with plain.open("xb") as file:
            file.write(content)
        yield plain


def _bytes(path: Path, most: int) -> bytes:
    """Return at most so many bytes of a file, unpacked where its name ends in .gz."""
    try:
        with gzip.open(path) if is_gzipped(path) else path.open("rb") as stream:
            return bytes(stream.read(most))
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise BadInput(
            f"cannot be unpacked: {error}.", file=path, remedy="Pack or send it again."
        ) from error
    except OSError as error:
        raise unreadable(path, error) from error


_given: ContextVar[Path | None] = ContextVar("given", default=None)


@contextmanager
def unpacking_in(folder: Path | None) -> Iterator[None]:
    """Unpack everything within the context into a folder that the caller removes."""
    before = _given.set(folder)
    try:
        yield
    finally:
        _given.reset(before)


@contextmanager
def unpacking_folder() -> Iterator[Path]:
    """Yield a new folder to unpack in, removed with the context unless the caller removes it."""
    given = _given.get()
    if given is not None:
        yield Path(tempfile.mkdtemp(dir=given))
        return
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def checked_members(path: Path) -> list[zipfile.ZipInfo]:
    """Return the files in an archive, without hidden ones.

    Raises BadInput naming the member at fault. Refused: too many members, paths that lead
    outside, links, encryption, archives in the archive, two members of one name.
    """
    if path.stat().st_size > limits().bytes_at_once:
        raise too_large(path)
    with guarded(path, "the archive"), zipfile.ZipFile(path) as archive:
        found = [member for member in archive.infolist() if not member.is_dir()]
    if len(found) > MOST_MEMBERS:
        what = f"{len(found)} files in one archive; at most {MOST_MEMBERS} are read."
        raise BadInput(what, file=path, remedy=_PACK_AGAIN)
    seen: set[str] = set()
    for member in found:
        _refuse_member(member, seen, path)
        seen.add(member.filename)
    return [member for member in found if not _is_hidden(member.filename)]


def unpack(archive: zipfile.ZipFile, member: zipfile.ZipInfo, target: Path, left: int) -> int:
    """Write a member to a file, and return its size; raises BadInput beyond `left` bytes.

    What comes out is counted; the sizes in the archive's headers are not believed.
    """
    path = Path(str(archive.filename))
    size = 0
    with archive.open(member) as packed, target.open("xb") as plain:
        while chunk := packed.read(_CHUNK):
            size += len(chunk)
            if size > left or size > max(_CHUNK, _MOST_RATIO * member.compress_size):
                raise refusal(member.filename, "unpacks to far more than it should", path)
            plain.write(chunk)
    return size


def refusal(member: str, what: str, path: Path) -> BadInput:
    """Return the refusal of an archive for one of its members."""
    return BadInput(f"the member {member!r} {what}.", file=path, remedy=_PACK_AGAIN)


def _refuse_member(member: zipfile.ZipInfo, seen: set[str], path: Path) -> None:
    name, mode = member.filename, member.external_attr >> 16
    faults = {
        "leads outside the archive": _leads_outside(name),
        "is a link or a device": bool(mode) and stat.S_IFMT(mode) not in (0, stat.S_IFREG),
        "is encrypted": bool(member.flag_bits & _ENCRYPTED),
        "is an archive itself": name.lower().endswith(_ARCHIVES),
        "occurs twice in it": name in seen,
    }
    for what, at_fault in faults.items():
        if at_fault:
            raise refusal(name, what, path)


def _leads_outside(name: str) -> bool:
    parts = name.replace("\\", "/").split("/")
    absolute = PurePosixPath(name).is_absolute() or bool(PureWindowsPath(name).anchor)
    return absolute or ".." in parts or "\x00" in name


def _is_hidden(name: str) -> bool:
    """Return whether the operating system added the member: .DS_Store, __MACOSX/..."""
    parts = PurePosixPath(name.replace("\\", "/")).parts
    return any(part.startswith(".") or part == "__MACOSX" for part in parts)
