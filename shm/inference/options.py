"""How to update, and who hears how far it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from shm.errors import UsageError
from shm.inference import modal_groups
from shm.inference.priors import Calibration

Progress = Callable[[str, float], None]

NOISE_FLOOR = "noise-floor"
TEXTBOOK = "textbook"
METHODS = (NOISE_FLOOR, TEXTBOOK)
"""From the prior to the posterior by a falling noise floor, or by a rising power."""


def silent(label: str, fraction: float) -> None:
    """No progress is shown."""


@dataclass(frozen=True)
class UpdateOptions:
    """How to update: posterior samples to keep, seed, how often the data set counts (N_D), method.

    `sigma`: "one" model error of all modes, or one of each "plane", "order" or "mode", or of each
    group of orders, "1-3,4-6"; with the thesis's priors.
    `calibration` is what an earlier measured tension taught of the bar (`calibration_of`).

    Raises UsageError for a method that is not one of `METHODS`, and for no such groups.
    """

    samples: int = 1000
    seed: int = 1
    repeat: int = 1
    method: str = NOISE_FLOOR
    calibration: Calibration | None = None
    sigma: str = modal_groups.ONE

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            known = ", ".join(METHODS)
            raise UsageError(f"unknown method {self.method!r}.", remedy=f"Known: {known}.")
        modal_groups.check(self.sigma)
