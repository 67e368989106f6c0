"""Where model and measurement differ, which effect causes it, how far the gap shrinks."""

from __future__ import annotations

from shm.gap.diagnose import diagnose
from shm.gap.options import GapOptions, Progress

__all__ = ["GapOptions", "Progress", "diagnose"]
