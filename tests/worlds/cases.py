"""A hanger as described and as measured, its truth, and the random numbers it is drawn by."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Case:
    """A hanger as described and as measured, and the truth about it.

    `extra` are keys of the description that a reader may not know yet.
    """

    index: int
    hanger_toml: str
    modes: dict[str, Any]
    truth: dict[str, Any]
    groups: tuple[str, ...] = ()
    extra: dict[str, Any] = field(default_factory=dict)

    def write(self, folder: Path, *, with_new_keys: bool = False) -> tuple[Path, Path]:
        """Write hanger.toml and case.modes.json into the folder; `extra` only on request."""
        folder.mkdir(parents=True, exist_ok=True)
        hanger, modes = folder / "hanger.toml", folder / "case.modes.json"
        text = self.hanger_toml
        if with_new_keys:  # above the tables of the hanger
            lines = "".join(f"{key} = {json.dumps(value)}\n" for key, value in self.extra.items())
            text = text.replace("id = 1\n", "id = 1\n" + lines, 1)
        hanger.write_text(text, encoding="utf-8")
        modes.write_text(json.dumps(self.modes, indent=1) + "\n", encoding="utf-8")
        return hanger, modes


class Draws:
    """Random numbers of one case."""

    def __init__(self, *entropy: int) -> None:
        """Seed the draws by whole numbers."""
        self.rng = np.random.default_rng(entropy)

    def between(self, low: float, high: float) -> float:
        """Return a number from `low` to `high`."""
        return float(self.rng.uniform(low, high))

    def log(self, low: float, high: float) -> float:
        """Return a number whose logarithm is uniform."""
        return low * math.exp(math.log(high / low) * float(self.rng.random()))

    def normal(self, sd: float) -> float:
        """Return a normal number of mean 0."""
        return sd * float(self.rng.standard_normal())

    def lognormal(self, sd: float) -> float:
        """Return a factor about 1."""
        return math.exp(self.normal(sd))

    def chance(self, probability: float) -> bool:
        """Return True with a probability."""
        return bool(self.rng.random() < probability)

    def pick(self, *values: Any) -> Any:
        """Return one of the values."""
        return values[int(self.rng.integers(len(values)))]
