"""What parsers of others raise on damaged files, as one refusal."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from shm.errors import BadInput, ShmError


@contextmanager
def guarded(path: Path, what: str = "the file") -> Iterator[None]:
    """Turns whatever a parser raises or warns of within the context into a BadInput."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("error")
            yield
    except ShmError:
        raise
    except MemoryError as error:
        raise BadInput(
            f"{what} needs more memory than is given to one file.",
            file=path,
            remedy="Export a small file again; split a long one, or raise parse_memory_bytes.",
        ) from error
    except Exception as error:
        raise BadInput(
            f"{what} cannot be read: its structure is damaged or of an unknown kind.",
            file=path,
            remedy="Export or send it again.",
        ) from error
