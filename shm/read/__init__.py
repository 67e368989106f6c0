"""Readers: a file becomes a `Recording` or a `FrequencyResponse`, in SI units, gaps as NaN.

A format is one file and one line of `FORMATS`. Beside a file NAME.csv (or .uff, .h5, .csv.gz) a
sidecar NAME.toml may say what the file does not: hanger, time, temperature, and each channel's
unit, calibration, place and plane. What the sidecar says goes before what the file says. A .zip
holds the files of one test.

These verbs work in the caller's process, for a person's own files; whatever comes by itself is read
through `shm.read.sandbox`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from shm.read.base import Format, Peek, PeekChannel
from shm.read.bundles import bundle, holds_test
from shm.read.limits import Limits
from shm.read.sidecar import sidecar_path

if TYPE_CHECKING:
    from shm.read.registry import FORMATS, peek, read, write
    from shm.read.whole_test import peek_test, read_test

__all__ = [
    "FORMATS",
    "Format",
    "Limits",
    "Peek",
    "PeekChannel",
    "bundle",
    "holds_test",
    "peek",
    "peek_test",
    "read",
    "read_test",
    "sidecar_path",
    "write",
]

_HOME = {
    **dict.fromkeys(("FORMATS", "peek", "read", "write"), "registry"),
    **dict.fromkeys(("peek_test", "read_test"), "whole_test"),
}

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """The formats bring their libraries: who only looks for a file's sidecar does without."""
        if name not in _HOME:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f"shm.read.{_HOME[name]}"), name)
