"""Bayesian updating: the posterior of tension and end stiffness, and the evidence of each class."""

from __future__ import annotations

from shm.update.updating import Progress, UpdateOptions, select, update

__all__ = ["Progress", "UpdateOptions", "select", "update"]
