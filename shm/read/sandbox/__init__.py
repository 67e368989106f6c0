"""Reading a foreign file in a process of its own, which may crash, hang or grow without harm.

The verbs are those of `shm.read` and `shm.modes_document`, and take `limits` besides. Parsers of
others are written in C and were seen to crash and to allocate gigabytes on damaged files, so
everything unattended reads through here. `shm.read.read` and `read_test` themselves stay in the
caller's process: for a person's own files in a notebook they save the second that the first reading
costs.
"""

from shm.read.limits import Limits
from shm.read.sandbox.client import (
    foreign_modes,
    layout_of,
    load_modes,
    missing_bounds,
    peek_test,
    read_test,
    survey,
)

__all__ = [
    "Limits",
    "foreign_modes",
    "layout_of",
    "load_modes",
    "missing_bounds",
    "peek_test",
    "read_test",
    "survey",
]
