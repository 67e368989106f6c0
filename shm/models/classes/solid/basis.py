"""The reduced basis of one solid class of one hanger, from memory, from disk or made now.

scikit-fem and scipy's sparse matrices are slow to import and needed only while a basis is made or
the full model solved: they are imported there, so that all else begins quickly.

Reduced bases kept on disk, so that each is computed once for a geometry, mesh and prior.

The folder is `$SHM_CACHE`, else `$XDG_CACHE_HOME/shm`, else `~/.cache/shm`. It may be deleted at
any time: what is missing is computed again.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING
from zipfile import BadZipFile

import numpy as np

from shm.models.classes.solid.geometry import Geometry, Material, Support
from shm.models.classes.solid.reduction import TARGET_ERROR, Projected, Reduction
from shm.values import FloatArray, Plane

if TYPE_CHECKING:
    from shm.models.classes.solid.reduction import AffineSystem

# To be raised whenever the same description gives another basis than before.
_VERSION = 3
_BATCH_OF_MODES = 6
_CELLS_A_MODE = 6


@dataclass(frozen=True)
class Description:
    """All that a basis depends on; `lower` and `upper` bound tension (N) and log10 k."""

    geometry: Geometry
    material: Material
    support: Support
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def system(self, plane: Plane, modes: int) -> AffineSystem:
        """Return the full model's bending plane, on a mesh that resolves that many modes."""
        return self.meshed(plane, max(self.geometry.fineness.rod, _CELLS_A_MODE * modes))

    def meshed(self, plane: Plane, rod: int) -> AffineSystem:
        """Return the full model's bending plane with that many cells along the rod."""
        from shm.models.classes.solid.assembly import assembled

        fine = replace(self.geometry.fineness, rod=rod)
        return assembled(replace(self.geometry, fineness=fine), self.material, self.support, plane)

    def full_frequencies_hz(self, points: FloatArray, modes: int) -> FloatArray:
        """Transverse frequencies (n, modes) of the full model at points of tension and log10 k."""
        from shm.models.classes.solid.reduction import natural_modes

        system = self.system("transverse", rounded_up(modes))
        return np.array(
            [
                natural_modes(system, float(point[0]), 10 ** point[1:], modes).frequencies_hz
                for point in points
            ]
        )

    def key(self, modes: int) -> str:
        """Return a name that changes with anything that would change the basis."""
        text = json.dumps([_VERSION, TARGET_ERROR, modes, asdict(self)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:32]


_made: dict[tuple[Description, int], Reduction] = {}


def rounded_up(modes: int) -> int:
    """Return the number of modes that a basis for `modes` is made for."""
    return -(-modes // _BATCH_OF_MODES) * _BATCH_OF_MODES


def transverse_basis(
    description: Description, modes: int, progress: Callable[[float], None]
) -> Reduction:
    """Return the basis for the first `modes` transverse modes."""
    modes = rounded_up(modes)
    if (description, modes) not in _made:
        key = description.key(modes)
        _made[description, modes] = load(key) or _make(description, key, modes, progress)
    return _made[description, modes]


def _make(
    description: Description, key: str, modes: int, progress: Callable[[float], None]
) -> Reduction:
    from shm.models.classes.solid.reduction import reduce

    box = np.array(description.lower), np.array(description.upper)
    reduction = reduce(description.system("transverse", modes), *box, modes, progress)
    save(key, reduction)
    return reduction


_log = logging.getLogger(__name__)


def folder() -> Path:
    """Return the folder of the stored bases."""
    if "SHM_CACHE" in os.environ:
        return Path(os.environ["SHM_CACHE"])
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "shm"


def load(key: str) -> Reduction | None:
    """Return the basis of that key; None where there is none that can be read."""
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
        _log.warning("the reduced basis %s cannot be read (%s): it is computed again.", path, error)
        return None


def save(key: str, reduction: Reduction) -> None:
    """Write the basis whole or not at all; where the folder refuses it, says so and goes on."""
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
            "the reduced basis cannot be kept in %s (%s): each process will compute it again. "
            "Set SHM_CACHE to a folder that can be written.",
            path.parent,
            error,
        )


def _path(key: str) -> Path:
    return folder() / f"basis-{key}.npz"
