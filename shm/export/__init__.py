"""Posteriors and modes for other programs: pandas, ArviZ (xarray, netCDF), CSV, JSON, npz.

`samples` and `modes` are tables, `datatree` is what ArviZ reads, `write` makes a file. Units stand
in the attributes of a DataTree and in the names of a table's columns.
"""

from __future__ import annotations

from shm.export.tree import datatree
from shm.export.writing import FORMATS, check_format, modes, samples, write

__all__ = ["FORMATS", "check_format", "datatree", "modes", "samples", "write"]
