"""Bayesian updating: the posterior of tension and end stiffness, and the evidence of each class."""

from __future__ import annotations

from shm.update.ensemble import refresh
from shm.update.options import METHODS, NOISE_FLOOR, TEXTBOOK, Progress, UpdateOptions
from shm.update.textbook import BiasedEvidenceWarning
from shm.update.updating import select, update

__all__ = [
    "METHODS",
    "NOISE_FLOOR",
    "TEXTBOOK",
    "BiasedEvidenceWarning",
    "Progress",
    "UpdateOptions",
    "refresh",
    "select",
    "update",
]
