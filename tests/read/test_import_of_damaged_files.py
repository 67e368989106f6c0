"""Files of loggers, cut, flipped, with lines lost: refused with words, or read; never a fault."""

from __future__ import annotations

import random
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from shm.errors import BadInput
from shm.read import peek, read
from shm.read.registry import survey
from tests.read.test_logger_text import SHAPES

DAMAGES: dict[str, Callable[[random.Random, bytes], bytes]] = {
    "cut": lambda rng, whole: whole[: rng.randrange(1, len(whole))],
    "flipped": lambda rng, whole: _flipped(rng, whole),
    "lines lost": lambda rng, whole: _lines_lost(rng, whole),
    "a piece lost": lambda rng, whole: _piece_lost(rng, whole),
    "heading shuffled": lambda rng, whole: _shuffled(rng, whole),
    "marks exchanged": lambda rng, whole: whole.replace(
        rng.choice([b";", b",", b"\t", b".", b":", b"[", b"0", b"\n"]),
        rng.choice([b";", b",", b"\t", b"", b"9", b"e", b"-", b"\r"]),
        rng.choice([-1, 5, 500]),
    ),
}
TRIALS = 10


def _flipped(rng: random.Random, whole: bytes) -> bytes:
    changed = bytearray(whole)
    for _ in range(rng.choice([1, 5, 50])):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def _lines_lost(rng: random.Random, whole: bytes) -> bytes:
    lines = whole.split(b"\n")
    for _ in range(min(rng.choice([1, 3, 30]), len(lines) - 1)):
        del lines[rng.randrange(len(lines))]
    return b"\n".join(lines)


def _piece_lost(rng: random.Random, whole: bytes) -> bytes:
    first, last = sorted(rng.randrange(len(whole)) for _ in range(2))
    return whole[:first] + whole[last:]


def _shuffled(rng: random.Random, whole: bytes) -> bytes:
    lines = whole.split(b"\n")
    heading = lines[:12]
    rng.shuffle(heading)
    return b"\n".join([*heading, *lines[12:]])


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("shape", ["german", "LabVIEW", "clock times over midnight", "quotes"])
def test_a_damaged_export_is_read_or_refused_with_a_remedy(
    shape: str, damage: str, tmp_path: Path
) -> None:
    rng = random.Random(f"{shape} {damage}")
    content = SHAPES[shape]
    whole = content if isinstance(content, bytes) else content.encode()
    path = tmp_path / "export.csv"
    for _ in range(TRIALS):
        path.write_bytes(DAMAGES[damage](rng, whole) or b"\n")
        for verb in (survey, read, peek):
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                remedy = _remedy(verb, path)
            assert remedy


def _remedy(verb: Callable[[Path], object], path: Path) -> str:
    """Return the remedy of a refusal; "read" where the file is read. All else is a fault."""
    try:
        verb(path)
    except BadInput as refusal:
        return refusal.remedy
    return "read"
