"""Define the options of an update, and who hears how far it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from shm.values import FloatArray

Progress = Callable[[str, float], None]


def silent(label: str, fraction: float) -> None:
    """No progress is shown."""


IMPORTANCE, EMCEE = "importance", "emcee"
SAMPLERS = (IMPORTANCE, EMCEE)


@dataclass(frozen=True, eq=False)
class Calibration:
    """Hold what measured tensions have taught of the deviations of a bar as made.

    `names` are among `section`, `density`, `modulus`, `theta_L` and `bending_factor` (as logarithms
    of true over described); `mean` (k,) and `covariance` (k, k).
    """

    names: tuple[str, ...]
    mean: FloatArray
    covariance: FloatArray


@dataclass(frozen=True)
class UpdateOptions:
    """Options of an update: posterior samples to keep, and seed.

    `sampler` is one of `SAMPLERS`: importance sampling, which emcee continues where it has to, or
    emcee at once, as an independent check. `calibration` is what an earlier measured tension taught
    of the bar (`calibration_of`).
    """

    samples: int = 1000
    seed: int = 1
    calibration: Calibration | None = None
    sampler: str = IMPORTANCE
