"""Watch a hanger over time: what has changed, since when, by how much, and when to alert.

`watcher.py` decides; `alert_text.py` alone puts a change into words, for alerts, pages and reports.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from shm.resources import when_asked

if TYPE_CHECKING:
    from shm.models import end_stiffness
    from shm.watch.engine.options import WatchOptions
    from shm.watch.frequency_watch import WatchedFrequencies, watch_frequencies
    from shm.watch.gap import gap_percent, has_grown, joined, watch_gap
    from shm.watch.watching import DatedTest, Newest, Watched, watch_hanger, watch_newest

__all__ = [
    "DatedTest", "Newest", "WatchOptions", "Watched", "WatchedFrequencies", "end_stiffness",
    "gap_percent", "has_grown", "joined", "watch_frequencies", "watch_gap", "watch_hanger",
    "watch_newest",
]  # fmt: skip

if not TYPE_CHECKING:
    # The engine is large: who only words what it found, as `shm status` does, does without.
    __getattr__ = when_asked(
        __name__,
        {
            "end_stiffness": "shm.models",
            **dict.fromkeys(
                ("WatchedFrequencies", "watch_frequencies"), "shm.watch.frequency_watch"
            ),
            **dict.fromkeys(("gap_percent", "has_grown", "joined", "watch_gap"), "shm.watch.gap"),
            "WatchOptions": "shm.watch.engine.options",
            **dict.fromkeys(
                ("DatedTest", "Newest", "Watched", "watch_hanger", "watch_newest"),
                "shm.watch.watching",
            ),
        },
    )
