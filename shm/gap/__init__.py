"""Diagnose where model and measurement differ, which effect causes it, how far the gap shrinks."""

from __future__ import annotations

from shm.gap.bridge.bridge_diagnosis import diagnose_bridge
from shm.gap.diagnose import diagnose
from shm.gap.hypotheses.contract import GapOptions
from shm.inference.options import Progress

__all__ = ["GapOptions", "Progress", "diagnose", "diagnose_bridge"]
