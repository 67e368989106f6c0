"""ZIP archives, with nothing believed that their headers say."""

from __future__ import annotations

import stat
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path, PurePosixPath, PureWindowsPath

from shm.errors import BadInput
from shm.read.guard import guarded
from shm.read.limits import limits, too_large

MOST_MEMBERS = 200
_given: ContextVar[Path | None] = ContextVar("given", default=None)
_MOST_RATIO = 200
_CHUNK = 1 << 20
_ENCRYPTED = 0x1
_ARCHIVES = (".zip", ".tar", ".tgz", ".7z", ".rar", ".bz2", ".xz", ".zst")
_PACK_AGAIN = "Pack the plain files of one test anew."


@contextmanager
def unpacking_in(folder: Path | None) -> Iterator[None]:
    """Whatever is unpacked within the context goes into a folder that somebody else removes."""
    before = _given.set(folder)
    try:
        yield
    finally:
        _given.reset(before)


@contextmanager
def unpacking_folder() -> Iterator[Path]:
    """A new folder to unpack in, which goes with the context unless somebody else removes it."""
    given = _given.get()
    if given is not None:
        yield Path(tempfile.mkdtemp(dir=given))
        return
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def checked_members(path: Path) -> list[zipfile.ZipInfo]:
    """The files in an archive, hidden ones left out; raises BadInput naming the member at fault.

    Refused: too many members, paths that lead outside, links, encryption, archives in the archive,
    two members of one name.
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
    """Writes a member to a file, and gives its size; raises BadInput beyond `left` bytes.

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
    """The refusal of an archive for one of its members."""
    return BadInput(f"the member {member!r} {what}.", file=path, remedy=_PACK_AGAIN)


def _refuse_member(member: zipfile.ZipInfo, seen: set[str], path: Path) -> None:
    name, mode = member.filename, member.external_attr >> 16
    faults = {
        "leads outside the archive": _leads_outside(name),
        "is a link or a device": bool(mode) and stat.S_IFMT(mode) not in (0, stat.S_IFREG),
        "is encrypted": bool(member.flag_bits & _ENCRYPTED),
        "is an archive itself": name.lower().endswith(_ARCHIVES),
        "stands twice in it": name in seen,
    }
    for what, at_fault in faults.items():
        if at_fault:
            raise refusal(name, what, path)


def _leads_outside(name: str) -> bool:
    parts = name.replace("\\", "/").split("/")
    absolute = PurePosixPath(name).is_absolute() or bool(PureWindowsPath(name).anchor)
    return absolute or ".." in parts or "\x00" in name


def _is_hidden(name: str) -> bool:
    """What systems add by themselves: .DS_Store, __MACOSX/..."""
    parts = PurePosixPath(name.replace("\\", "/")).parts
    return any(part.startswith(".") or part == "__MACOSX" for part in parts)
