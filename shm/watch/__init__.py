"""Watching a hanger: how far tension and end stiffness have moved, and when to say so."""

from __future__ import annotations

from shm.watch.drift import assess, decide, end_stiffness

__all__ = ["assess", "decide", "end_stiffness"]
