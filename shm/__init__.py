"""shm: the tension of bridge hangers from hammer tests, with its uncertainty, unattended."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shm.gap import diagnose as diagnose

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """`shm.diagnose` is loaded when it is asked for, so that `import shm` stays cheap."""
    if name != "diagnose":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from shm.gap import diagnose

    return diagnose
