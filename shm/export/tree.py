"""A posterior as ArviZ reads it: an xarray DataTree with one group a kind of number.

The layout is ArviZ's schema of inference data: dimensions `chain` and `draw` first. The draws come
by importance sampling, equally weighted and in no order, so they are one chain of independent draws
and `r_hat` is an attribute (ArviZ's own needs several chains).

The unit of a parameter, from its name and the model class that has it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from shm import __version__
from shm.errors import UsageError
from shm.export.predictive import predictive
from shm.values import FloatArray, Hanger, ModalTest, Posterior

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

_DRAWN = ("chain", "draw")
_MEASUREMENT = ("measurement",)
_MEASURED = (*_DRAWN, *_MEASUREMENT)

Group: TypeAlias = dict[str, tuple[tuple[str, ...], FloatArray, str]]
"""By the name of a variable: its dimensions, its values without that of the chain, its unit."""


def datatree(
    posterior: Posterior, tests: Sequence[ModalTest] = (), hanger: Hanger | None = None
) -> DataTree:
    """The posterior as a DataTree for ArviZ, 0.23 or 1.x.

    Groups:

    - `posterior`: each parameter and `tension_n`, (chain, draw).
    - `sample_stats`: `lp`, the log likelihood of all measurements together, which is the log
      posterior but for a constant, as the priors are uniform; (chain, draw).
    - `observed_data`: the measured `frequency_hz` (measurement), with the coordinates plane and
      order.
    - `constant_data`: `predicted_mean_hz` and `predicted_sd_hz` (measurement).
    - `log_likelihood` of each measurement and `posterior_predictive`, draws of what would be
      measured, both `frequency_hz` (chain, draw, measurement): only with the `tests` and the
      `hanger` that the posterior was made from, by which the model class is evaluated again.

    Units stand in the attribute `units` of each variable; evidence, seed, tests and version in the
    attributes of the root. Raises UsageError where xarray is not installed or only one of tests and
    hanger is given, BadInput where the posterior is not theirs.

    Example:
        >>> tree = shm.export.datatree(posterior, [test.test], hanger)
        >>> float(tree["posterior"]["tension_n"].mean())
        711000.0
    """
    if bool(tests) != (hanger is not None):
        raise UsageError(
            "the tests and the hanger of a posterior go together.", remedy="Give both, or neither."
        )
    _require("xarray")
    from xarray import DataTree

    groups = _groups(posterior)
    if hanger is not None:
        found = predictive(posterior, tests, hanger)
        groups["log_likelihood"] = {"frequency_hz": (_MEASURED, found.log_likelihood, "1")}
        groups["posterior_predictive"] = {"frequency_hz": (_MEASURED, found.frequency_hz, "Hz")}
    named = _coordinates(posterior, tests)
    tree = DataTree.from_dict({name: _dataset(group, named) for name, group in groups.items()})
    tree.attrs = _lineage(posterior)
    return tree


def write_netcdf(tree: DataTree, path: Path) -> None:
    """Writes a DataTree as netCDF, whole or not at all; raises UsageError without h5netcdf."""
    _require("h5netcdf")
    part = path.with_name(f".{path.name}.part")
    try:
        tree.to_netcdf(part, engine="h5netcdf")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _require(library: str) -> None:
    from importlib.util import find_spec

    if find_spec(library) is None:
        raise UsageError(
            f"{library} is not installed, which a DataTree and netCDF need.",
            remedy="Run `pip install shm[export]`, or write CSV, npz or JSON.",
        )


def _groups(posterior: Posterior) -> dict[str, Group]:
    """What a posterior holds by itself."""
    parameters = dict(zip(posterior.names, posterior.samples.T, strict=True))
    drawn: Group = {
        name: (_DRAWN, values, unit_of(name, posterior.model))
        for name, values in parameters.items()
    }
    rows = posterior.predicted
    return {
        "posterior": {**drawn, "tension_n": (_DRAWN, posterior.tension_n, "N")},
        "sample_stats": {"lp": (_DRAWN, posterior.log_likelihood, "1")},
        "observed_data": {"frequency_hz": _hertz([row.measured_hz for row in rows])},
        "constant_data": {
            "predicted_mean_hz": _hertz([row.mean_hz for row in rows]),
            "predicted_sd_hz": _hertz([row.sd_hz for row in rows]),
        },
    }


def _hertz(values: Sequence[float]) -> tuple[tuple[str, ...], FloatArray, str]:
    return _MEASUREMENT, np.array(values, dtype=np.float64), "Hz"


def _coordinates(posterior: Posterior, tests: Sequence[ModalTest]) -> dict[str, Any]:
    """Of every dimension; a measurement has its plane, its order and, where known, its test."""
    rows = posterior.predicted
    named: dict[str, Any] = {
        "chain": [0],
        "draw": np.arange(len(posterior.samples)),
        "measurement": np.arange(len(rows)),
        "plane": ("measurement", [row.plane for row in rows]),
        "order": ("measurement", [row.order for row in rows]),
    }
    if tests:
        named["test"] = ("measurement", [test.id for test in tests for _ in test.regular_modes])
    return named


def _dataset(group: Group, named: dict[str, Any]) -> Dataset:
    from xarray import Dataset

    variables = {
        name: (
            dimensions,
            values[None] if dimensions[0] == "chain" else values,
            {"units": unit} if unit else {},
        )
        for name, (dimensions, values, unit) in group.items()
    }
    used = {each for dimensions, _, _ in group.values() for each in dimensions}
    kept = {
        name: value
        for name, value in named.items()
        if (value[0] if isinstance(value, tuple) else name) in used
    }
    return Dataset(variables, kept)


def _lineage(posterior: Posterior) -> dict[str, Any]:
    """Where the draws come from; numbers that are not known are left out."""
    told = {
        "model": posterior.model,
        "hanger": posterior.hanger,
        "tests": list(posterior.tests),
        "nominal_tension_n": posterior.nominal_tension_n,
        "log_evidence": posterior.log_evidence,
        "log_evidence_sd": posterior.log_evidence_sd,
        "effective_sample_size": posterior.effective_sample_size,
        "r_hat": posterior.r_hat,
        "method": posterior.method,
        "seed": posterior.seed,
        "inference_library": "shm",
        "inference_library_version": __version__,
    }
    return {name: value for name, value in told.items() if value is not None and value == value}


_NONE = ("theta_F", "theta_L", "sigma", "section", "density", "length", "modulus")
_UNITS = {"kg": "kg", "m": "m", "n": "N", "hz": "Hz", "s": "s", "rad": "rad", "c": "degC"}


def unit_of(name: str, model: str) -> str:
    """As a text, `1` where it has none; empty where the name does not say.

    End springs are in N m/rad for beams, in N/m a node for solids; of a logarithm, the unit of what
    it is the logarithm of.
    """
    if name in _NONE:
        return "1"
    if name.startswith("log10_k") and "+" not in model:
        return "log10(N m/rad)" if model.startswith("beam") else "log10(N/m)"
    return _UNITS.get(name.rpartition("_")[2], "")
