"""How much one file may hold, stated once; readers check it before they allocate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from shm.errors import BadInput

LARGEST_BYTES = 256 * 2**20
MOST_VALUES = LARGEST_BYTES // 8  # an hour of 17 channels at 500 Hz
MOST_ACCELERATIONS = 16
_SPLIT = "Split the record, or leave out what is not needed."


def refuse_large(shape: Sequence[int], item_bytes: int, what: str, path: Path) -> None:
    """Raises BadInput where an array of this shape would outgrow the memory set aside for it."""
    if any(length < 0 for length in shape) or math.prod(shape) * item_bytes > LARGEST_BYTES:
        size = "x".join(str(length) for length in shape)
        raise BadInput(
            f"holds {size} values, beyond the {LARGEST_BYTES >> 20} MB that are read at once.",
            file=path,
            channel=what,
            remedy=_SPLIT,
        )


def too_large(path: Path) -> BadInput:
    """The refusal of a file that is, or unpacks to, more than may be read at once."""
    return BadInput(
        f"holds more than the {LARGEST_BYTES >> 20} MB that are read at once.",
        file=path,
        remedy=_SPLIT,
    )
