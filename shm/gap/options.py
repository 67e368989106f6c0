"""How to diagnose, and who hears how far it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

Progress = Callable[[str, float], None]


def silent(label: str, fraction: float) -> None:
    """No progress is shown."""


@dataclass(frozen=True)
class GapOptions:
    """`baseline` is the model class whose gap is diagnosed, its length that of the description.

    `without` are effects taken out of the catalogue; `hold_out` what the held-out misfit leaves out
    of the fit: ids of tests, or orders of modes such as `4`; empty: every order and every test in
    turn. `draws` are kept of each posterior.
    """

    baseline: str = "beam1"
    without: tuple[str, ...] = ()
    hold_out: tuple[str, ...] = ()
    draws: int = 1000
    seed: int = 1
