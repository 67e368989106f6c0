"""A worker that lives for a year does not hold what it has freed."""

from __future__ import annotations

import os
import sys

import pytest

from shm.pipeline.registry import run_step
from tests.helpers.footprint import resident_mb

BLOCK, BLOCKS = 64_000, 2000
"""Below what the allocator takes from the system one by one; 128 MB together."""


@pytest.mark.skipif(sys.platform != "linux", reason="another allocator than glibc's")
def test_a_step_gives_back_what_it_has_freed() -> None:
    left: list[bytes] = []

    def step() -> None:
        blocks = [bytes(BLOCK) for _ in range(BLOCKS)]
        left.extend(blocks[::100])

    before_mb = resident_mb(os.getpid())
    run_step(step)
    assert len(left) == BLOCKS // 100
    assert resident_mb(os.getpid()) < before_mb + 40
