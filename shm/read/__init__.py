"""Read a file into a `Recording` or a `FrequencyResponse`, in SI units, gaps as NaN.

A format is one file and one line of `FORMATS` in `registry.py`; `base.py` says what a `Format` is,
`header.py` which keys a header may have (`KEYS`). Beside a file NAME.csv (or .uff, .h5, .csv.gz) a
sidecar NAME.toml may say what the file does not: hanger, time, temperature, and each channel's
unit, calibration, place and plane. What the sidecar says goes before what the file says. A .zip
holds the files of one test.

These verbs work in the caller's process, for a person's own files; whatever comes by itself is read
through `shm.read.sandbox`.
"""

from typing import TYPE_CHECKING

from shm.resources import when_asked

if TYPE_CHECKING:
    from shm.read.base import Format, Peek, PeekChannel
    from shm.read.bundles import bundle
    from shm.read.content import holds_test
    from shm.read.limits import Limits
    from shm.read.registry import FORMATS, peek, peek_test, read, read_test, write
    from shm.read.sidecar import sidecar_path

_HOMES = {
    "base": ("Format", "Peek", "PeekChannel"),
    "bundles": ("bundle",),
    "content": ("holds_test",),
    "limits": ("Limits",),
    "registry": ("FORMATS", "peek", "peek_test", "read", "read_test", "write"),
    "sidecar": ("sidecar_path",),
}
__all__ = sorted(name for names in _HOMES.values() for name in names)

if not TYPE_CHECKING:
    # The formats bring their libraries: who only looks for a file's sidecar does without.
    __getattr__ = when_asked(
        __name__, {name: f"{__name__}.{home}" for home, names in _HOMES.items() for name in names}
    )
