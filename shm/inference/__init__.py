"""Update tension and end stiffness by measured modes: posterior, and evidence of each class."""

from __future__ import annotations

from typing import TYPE_CHECKING

from shm.inference.options import Progress, UpdateOptions
from shm.resources import when_asked

if TYPE_CHECKING:
    from shm.inference.answer.updating import class_probabilities, refresh, select, update

__all__ = ["Progress", "UpdateOptions", "class_probabilities", "refresh", "select", "update"]

if not TYPE_CHECKING:
    # Every command has the options of an update, and few make one.
    __getattr__ = when_asked(
        __name__,
        dict.fromkeys(
            ("class_probabilities", "refresh", "select", "update"), "shm.inference.answer.updating"
        ),
    )
