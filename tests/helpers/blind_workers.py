"""Workers of a blind trial without the seconds that a fresh process takes to start."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor


def in_this_process(*_: object) -> ThreadPoolExecutor:
    """In place of `tests.benchmarks.blind.workers.workers`: one thread, and no guard."""
    return ThreadPoolExecutor(1)
