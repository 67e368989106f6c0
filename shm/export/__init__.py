"""Posteriors, modes and causes for other programs: pandas, ArviZ (xarray, netCDF), CSV, JSON, npz.

`samples`, `modes` and `causes` are tables, `datatree` is what ArviZ reads from a file and
`inference_data` what it computes with, `write` makes a file. Units stand in the attributes of a
DataTree and in the names of a table's columns.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shm.documents import dump, posterior_document
from shm.errors import UsageError
from shm.export.tree import datatree, inference_data, write_netcdf
from shm.values import Diagnosis, FloatArray, Hanger, ModalTest, Posterior

__all__ = [
    "FORMATS", "causes", "check_format", "datatree", "inference_data", "modes", "samples", "write",
]  # fmt: skip


SAMPLES_SCHEMA = "shm.samples/1"
FORMATS = ("csv", "json", "netcdf", "npz")


def write(
    posterior: Posterior,
    path: str | Path,
    format: str | None = None,
    *,
    tests: Sequence[ModalTest] = (),
    hanger: Hanger | None = None,
) -> None:
    """Write the draws of a posterior; `format` is one of `FORMATS`, or follows from the suffix.

    `csv` (.csv) and `npz` (.npz): a column a parameter, then `tension_n` in N and `log_likelihood`.
    `json` (.json): the document of `shm update --json` with all draws by name under `draws`.
    `netcdf` (.nc): the `datatree` for ArviZ, to which `tests` and `hanger` add the likelihood of
    each measurement. Raises UsageError for another format, or where a library is missing.

    Example:
        >>> shm.export.write(posterior, "hanger3.nc", tests=[test.test], hanger=hanger)
        >>> arviz.summary(arviz.from_netcdf("hanger3.nc"))
    """
    path = Path(path)
    match check_format(path, format):
        case "csv":
            samples(posterior).to_csv(path, index=False)
        case "npz":
            buffer = io.BytesIO()
            np.savez_compressed(buffer, allow_pickle=False, **columns(posterior))
            path.write_bytes(buffer.getvalue())
        case "json":
            draws = {name: values.tolist() for name, values in columns(posterior).items()}
            head = {"schema": SAMPLES_SCHEMA, **posterior_document(posterior)}
            path.write_text(dump({**head, "draws": draws}) + "\n", encoding="utf-8")
        case _:
            write_netcdf(datatree(posterior, tests, hanger), path)


def check_format(path: Path, format: str | None = None) -> str:
    """Return the format of a file to be; raises UsageError for one that is not known."""
    suffixes = {".nc": "netcdf"} | {f".{name}": name for name in FORMATS}
    named = suffixes.get(path.suffix.lower()) if format is None else format
    if named is None or named not in FORMATS:
        what = f"suffix {path.suffix!r}" if format is None else f"format {format!r}"
        raise UsageError(f"{path.name}: unknown {what}.", remedy="Use .csv, .nc, .json or .npz.")
    return named


if TYPE_CHECKING:
    from pandas import DataFrame


def columns(posterior: Posterior) -> dict[str, FloatArray]:
    """Return equally weighted draws by name, each (samples,): parameters, tension, likelihood."""
    parameters = dict(zip(posterior.names, posterior.samples.T, strict=True))
    return {
        **parameters,
        "tension_n": posterior.tension_n,
        "log_likelihood": posterior.log_likelihood,
    }


def samples(posterior: Posterior) -> DataFrame:
    """Return the draws as a table: a row a draw, all of equal weight.

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
    """Return the modes of tests as a table, a row a mode; what is not known is NaN or NaT.

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


def causes(diagnosis: Diagnosis) -> DataFrame:
    """Return the causes of a diagnosis as a table, a row a cause, best first.

    Columns: cause, at, probability, log_bayes_factor, log_fit, log_occam, group (NaN where the data
    tell it from all others), method, then mean and standard deviation of each parameter in the unit
    of its name, `mass_kg` and `sd_mass_kg`, NaN of a cause without it. What is left to 1 are no gap
    and something unknown.

    Example:
        >>> shm.export.causes(diagnosis).nlargest(3, "probability")
    """
    from pandas import DataFrame

    of_cause = ("at", "probability", "log_bayes_factor", "log_fit", "log_occam", "group", "method")
    rows = []
    for cause in diagnosis.causes:
        row = {"cause": cause.effect} | {name: getattr(cause, name) for name in of_cause}
        row["group"] = np.nan if cause.group is None else float(cause.group)
        for each in cause.parameters:
            row |= {each.name: each.mean, f"sd_{each.name}": each.sd}
        rows.append(row)
    return DataFrame(rows) if rows else DataFrame(columns=["cause", *of_cause])


def _numbers(values: Sequence[float]) -> FloatArray:
    return np.array(values, dtype=np.float64)
