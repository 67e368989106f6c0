"""Posterior samples as plain tables, for programs that are not ours."""

from __future__ import annotations

import numpy as np

from shm.store.blobs import pack
from shm.values import FloatArray, Posterior


def samples_table(posterior: Posterior) -> tuple[tuple[str, ...], FloatArray]:
    """Column names and values (samples, columns): parameters, `tension_n`, `log_likelihood`."""
    names = (*posterior.names, "tension_n", "log_likelihood")
    columns = [posterior.samples, posterior.tension_n, posterior.log_likelihood]
    return names, np.column_stack(columns)


def samples_npz(posterior: Posterior) -> bytes:
    """The same table as npz bytes, one array (samples,) a column."""
    names, table = samples_table(posterior)
    return pack(**dict(zip(names, table.T, strict=True)))
