"""What processes take of the machine: memory and open files, and whether that grows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Trend:
    """A straight line through measured values: its rise over all of them, and the sd of that."""

    rise: float
    rise_sd: float
    level: float

    def grows(self, negligible: float) -> bool:
        """Whether it rises by more than a negligible part of its level, and not by chance."""
        return self.rise > max(negligible * self.level, 2 * self.rise_sd)

    def __str__(self) -> str:
        return f"{self.level:.1f}, {self.rise:+z.2f} ± {self.rise_sd:.2f} from first to last"


def trend(values: Sequence[float]) -> Trend:
    """Of values at equal steps, of which there must be three or more."""
    steps = np.linspace(-0.5, 0.5, len(values))
    (rise, level), covariance = np.polyfit(steps, np.asarray(values, float), 1, cov=True)
    return Trend(float(rise), float(np.sqrt(covariance[0, 0])), float(level))


def resident_mb(pid: int) -> float:
    """Memory that is held; 0 of a process that has ended."""
    try:
        found = re.search(r"VmRSS:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
    except FileNotFoundError:
        return 0.0
    return int(found[1]) / 1000 if found else 0.0


def open_files(pid: int) -> int:
    """Descriptors of files, sockets and pipes."""
    return sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())


def descendants(pid: int) -> list[int]:
    """All processes that one has begun, and those that these have."""
    parents = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                told = (entry / "stat").read_text()
            except (FileNotFoundError, ProcessLookupError):
                continue
            parents[int(entry.name)] = int(told.rpartition(")")[2].split()[1])
    found = [pid]
    for each in found:
        found += [child for child, parent in parents.items() if parent == each]
    return found[1:]
