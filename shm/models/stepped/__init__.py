"""A tensioned beam whose section changes in steps: exact frequencies and shapes."""

from __future__ import annotations

from shm.models.stepped.beam import SteppedBeam
from shm.models.stepped.shape import mode_shape
from shm.models.stepped.turnbuckles import alike_from_both_ends, stepped_beam

__all__ = ["SteppedBeam", "alike_from_both_ends", "mode_shape", "stepped_beam"]
