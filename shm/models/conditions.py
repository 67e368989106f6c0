"""The conditions of a test, as far as a model may depend on them."""

from __future__ import annotations

from dataclasses import dataclass

from shm.values import AddedMass


@dataclass(frozen=True)
class Conditions:
    """What one test was made under, as far as an effect may depend on it.

    `temperature_shift_k` counts from the reference (the mean of the tests), 0 where unknown: the
    diagnosis says so; `amplitude` is relative to the reference level, 1 where unknown.
    `tension_shift_n` is by how much the tension read in the test exceeds the mean of all readings,
    0 where none was read, and `tension_shift_sd_n` the standard deviation of the reading.
    """

    test: str = ""
    temperature_shift_k: float = 0.0
    amplitude: float = 1.0
    added_mass: AddedMass | None = None
    tension_shift_n: float = 0.0
    tension_shift_sd_n: float = 0.0
