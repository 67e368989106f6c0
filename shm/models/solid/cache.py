"""Reduced bases kept on disk, so that each is computed once for a geometry, mesh and prior.

The folder is `$SHM_CACHE`, else `$XDG_CACHE_HOME/shm`, else `~/.cache/shm`. It may be deleted at
any time: what is missing is computed again.
"""

from __future__ import annotations

import logging
import os
import tempfile
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from shm.models.solid.projected import Projected, Reduction

_log = logging.getLogger(__name__)


def folder() -> Path:
    """Where the bases are kept."""
    if "SHM_CACHE" in os.environ:
        return Path(os.environ["SHM_CACHE"])
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "shm"


def load(key: str) -> Reduction | None:
    """The basis of that key; None where there is none that can be read."""
    path = _path(key)
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            return Reduction(
                Projected(data["matrices"]),
                data["axis_m"],
                data["deflections"],
                int(data["solutions"]),
                float(data["estimated_error"]),
            )
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        _log.warning("the reduced basis %s cannot be read (%s): it is made anew.", path, error)
        return None


def save(key: str, reduction: Reduction) -> None:
    """Writes the basis whole or not at all; where the folder refuses it, says so and goes on."""
    path = _path(key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as part:
            np.savez(
                part,
                matrices=reduction.projected.matrices,
                axis_m=reduction.axis_m,
                deflections=reduction.deflections,
                solutions=reduction.solutions,
                estimated_error=reduction.estimated_error,
            )
        Path(part.name).replace(path)
    except OSError as error:
        _log.warning(
            "the reduced basis cannot be kept in %s (%s): each process will make it anew. "
            "Set SHM_CACHE to a folder that can be written.",
            path.parent,
            error,
        )


def _path(key: str) -> Path:
    return folder() / f"basis-{key}.npz"
