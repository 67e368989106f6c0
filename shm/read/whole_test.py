"""A whole test: one file, or all files of an archive; a document of modal tests with the sidecar
beside it, which goes before it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from shm import modes_document
from shm.errors import BadInput
from shm.read.base import Peek
from shm.read.bundles import each_member, entries_of_test, holds_test
from shm.read.content import head_of
from shm.read.header import CHANNEL_KEYS, Header
from shm.read.registry import peek, read
from shm.read.sidecar import document_beside, sidecar_path
from shm.values import FrequencyResponse, ModalTest, Recording

T = TypeVar("T")
Found = TypeVar("Found", bound=Recording | FrequencyResponse | Peek)


def read_test(path: Path) -> tuple[Recording | FrequencyResponse, ...]:
    """The files of one test: all of a .zip, in the order of their names, else the one file."""
    if not holds_test(path):
        return (read(path),)
    head_of(path)
    records = each_member(path, lambda file, name: replace(_named(read, file, name), source=name))
    return tuple(_told(record, path) for record in records)


def peek_test(path: Path) -> tuple[Peek, ...]:
    """What the headers of each file of a test say; members not readable have that as problem."""
    if not holds_test(path):
        return (peek(path),)
    head_of(path)
    return tuple(_told(found, path) for found in each_member(path, _peek_member))


def _peek_member(file: Path, name: str) -> Peek:
    try:
        return replace(_named(peek, file, name), source=name)
    except BadInput as refusal:
        return Peek(name, "not readable", (), 0, problems=(str(refusal),))


def _named(verb: Callable[[Path], T], file: Path, name: str) -> T:
    """What `verb` gives; its refusals name the member of the archive, not where it was unpacked."""
    try:
        return verb(file)
    except BadInput as refusal:
        inside = Path(name).with_name(Path(refusal.file or name).name)
        raise BadInput(
            refusal.message,
            file=inside,
            channel=refusal.channel,
            line=refusal.line,
            remedy=refusal.remedy,
        ) from refusal


def _told(found: Found, path: Path) -> Found:
    """A member with what the sidecar of its archive says of the whole test."""
    said = entries_of_test(path)
    known = [key for key in ("hanger", "time", "temperature_c") if key in said.entries]
    told = replace(found, **{key: getattr(said, key) for key in known})
    return told if said.added_mass is None else replace(told, added_mass=said.added_mass)


def load_modes(path: Path) -> tuple[ModalTest, ...]:
    """The tests of a `*.modes.json` file; raises BadInput with file, test, mode and remedy.

    Hanger, time, temperature and the known mass of a sidecar are those of its tests.
    """
    tests = modes_document.load_modes(path)
    _refuse_channels(path)
    said = entries_of_test(path)
    _refuse_what_samples_have(said, tests, path)
    return tuple(_as_said(test, said) for test in tests)


def _as_said(test: ModalTest, said: Header) -> ModalTest:
    return replace(
        test,
        hanger=test.hanger if said.hanger is None else said.hanger,
        time=said.time or test.time,
        temperature_c=test.temperature_c if math.isnan(said.temperature_c) else said.temperature_c,
        added_mass=said.added_mass or test.added_mass,
    )


def _refuse_channels(path: Path) -> None:
    for key in document_beside(path).keys() & {"channel", *CHANNEL_KEYS}:
        raise BadInput(
            f"{key!r} is said of modes, which have no channels.",
            file=sidecar_path(path),
            remedy=f"Say hanger, time and temperature_c here, all else in {path.name}.",
        )


def _refuse_what_samples_have(said: Header, tests: tuple[ModalTest, ...], path: Path) -> None:
    sidecar = sidecar_path(path)
    if not math.isnan(said.sampling_rate_hz):
        raise BadInput(
            "sampling_rate_hz is said of modes, whose frequencies are known.",
            file=sidecar,
            remedy=f"Correct the frequencies in {path.name} and send it again.",
        )
    if said.time is not None and len(tests) > 1:
        raise BadInput(
            f"one time is said of {len(tests)} tests.",
            file=sidecar,
            remedy=f"Give each test its own time in {path.name}.",
        )
