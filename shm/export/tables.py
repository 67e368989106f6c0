"""Plain tables: the draws of a posterior, the modes of tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from shm.values import FloatArray, ModalTest, Posterior

if TYPE_CHECKING:
    from pandas import DataFrame


def columns(posterior: Posterior) -> dict[str, FloatArray]:
    """Equally weighted draws by name, each (samples,): parameters, tension, log likelihood."""
    parameters = dict(zip(posterior.names, posterior.samples.T, strict=True))
    return {
        **parameters,
        "tension_n": posterior.tension_n,
        "log_likelihood": posterior.log_likelihood,
    }


def samples(posterior: Posterior) -> DataFrame:
    """The draws as a table: a row a draw, all of equal weight.

    A column a parameter (`theta_F` is tension over nominal tension, `log10_k1` the log10 of a
    spring in N m/rad, `sigma` the fractional model error), then `tension_n` in N and
    `log_likelihood`.

    Example:
        >>> table = shm.export.samples(posterior)
        >>> table["tension_n"].quantile([0.05, 0.95])
    """
    from pandas import DataFrame

    return DataFrame(columns(posterior))


def modes(tests: Sequence[ModalTest]) -> DataFrame:
    """The modes of tests as a table, a row a mode; what is not known is NaN or NaT.

    Columns: test, time (UTC), temperature_c, amplitude, plane, order, frequency_hz,
    frequency_sd_hz, damping_ratio, damping_sd.

    Example:
        >>> table = shm.export.modes(store.tests(3))
        >>> table.pivot_table("frequency_hz", "test", ["plane", "order"])
    """
    from pandas import DataFrame, Series, to_datetime

    rows = [(test, mode) for test in tests for mode in test.modes]
    return DataFrame(
        {
            "test": [test.id for test, _ in rows],
            "time": to_datetime(Series([test.time for test, _ in rows], dtype=object), utc=True),
            "temperature_c": _numbers([test.temperature_c for test, _ in rows]),
            "amplitude": _numbers([test.amplitude for test, _ in rows]),
            "plane": [mode.plane for _, mode in rows],
            "order": [mode.order for _, mode in rows],
            "frequency_hz": _numbers([mode.frequency_hz for _, mode in rows]),
            "frequency_sd_hz": _numbers([mode.frequency_sd_hz for _, mode in rows]),
            "damping_ratio": _numbers([mode.damping_ratio for _, mode in rows]),
            "damping_sd": _numbers([mode.damping_sd for _, mode in rows]),
        }
    )


def _numbers(values: Sequence[float]) -> FloatArray:
    return np.array(values, dtype=np.float64)
