"""Waiting for what other threads and processes do, for as long as a busy machine may take."""

from __future__ import annotations

import time
from collections.abc import Callable


def until(condition: Callable[[], object], seconds: float = 120.0) -> None:
    """Wait until a condition holds; fail where it does not within a limit that says: never."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"waited in vain for {seconds:g} s"
        time.sleep(0.02)
