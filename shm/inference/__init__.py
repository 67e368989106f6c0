"""Bayesian updating: the posterior of tension and end stiffness, and the evidence of each class."""

from __future__ import annotations

from shm.inference.ensemble import refresh
from shm.inference.likelihood import Sigma
from shm.inference.options import METHODS, NOISE_FLOOR, TEXTBOOK, Progress, UpdateOptions
from shm.inference.textbook import BiasedEvidenceWarning
from shm.inference.updating import class_probabilities, select, update

__all__ = [
    "METHODS",
    "NOISE_FLOOR",
    "TEXTBOOK",
    "BiasedEvidenceWarning",
    "Progress",
    "Sigma",
    "UpdateOptions",
    "class_probabilities",
    "refresh",
    "select",
    "update",
]
