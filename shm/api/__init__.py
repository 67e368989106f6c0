"""The steps as a researcher calls them in a notebook; `import shm` offers them under their names.

Each has the defaults of the command of its name and gives the value that the step itself gives.
The steps behind them (`shm.identify.identify`, `shm.inference.update`, ...) take options as values
and model classes as objects; these here take names and numbers.
"""

from __future__ import annotations

from shm.api.analysing import (
    diagnose,
    identify,
    load_hanger,
    load_modes,
    read,
    round_bar,
    select,
    update,
)
from shm.api.simulating import simulate
from shm.api.stored import Store
from shm.gap.any_simulator import diagnose_simulator

__all__ = [
    "Store",
    "diagnose",
    "diagnose_simulator",
    "identify",
    "load_hanger",
    "load_modes",
    "read",
    "round_bar",
    "select",
    "simulate",
    "update",
]
