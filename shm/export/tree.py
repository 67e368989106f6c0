"""A posterior as ArviZ reads it: an xarray DataTree with one group a kind of number.

The layout is ArviZ's schema of inference data: dimensions `chain` and `draw` first. The draws come
by importance sampling, equally weighted and in no order, so they are one chain of independent draws
and `r_hat` is an attribute (ArviZ's own needs several chains).

What each draw of a posterior says of each measured frequency.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from shm import __version__
from shm.errors import BadInput, UsageError, needing
from shm.inference.options import silent
from shm.inference.problem.data_checks import check_for_update
from shm.inference.problem.hanger_problem import Problem
from shm.inference.problem.thesis_noise import ThesisLikelihood
from shm.models import THESIS, class_of, parameter_sets
from shm.values import FloatArray, Hanger, ModalTest, Posterior
from shm.values.parameter_names import is_logarithm

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
    """Return the posterior as a DataTree for ArviZ, 0.23 or 1.x.

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


def inference_data(
    posterior: Posterior, tests: Sequence[ModalTest] = (), hanger: Hanger | None = None
) -> Any:
    """Return the `datatree` as the installed ArviZ computes with it: 0.x has a class of its own.

    Raises UsageError where ArviZ is not installed, and as `datatree` does.

    Example:
        >>> arviz.summary(shm.export.inference_data(posterior))
    """
    with needing("arviz"), warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # ArviZ announces its next version at import
        import arviz
    tree = datatree(posterior, tests, hanger)
    this = getattr(arviz, "InferenceData", None)
    return tree if this is None else this.from_datatree(tree)


def write_netcdf(tree: DataTree, path: Path) -> None:
    """Write a DataTree as netCDF, whole or not at all; raises UsageError without h5netcdf."""
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
    """Return the content of a posterior by itself."""
    parameters = dict(zip(posterior.names, posterior.samples.T, strict=True))
    drawn: Group = {
        name: (_DRAWN, values, _unit(posterior, name)) for name, values in parameters.items()
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
    """Return coordinates of every dimension; of a measurement plane, order and test."""
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
    retained = {
        name: value
        for name, value in named.items()
        if (value[0] if isinstance(value, tuple) else name) in used
    }
    return Dataset(variables, retained)


def _lineage(posterior: Posterior) -> dict[str, Any]:
    """Return the origin of the draws; numbers that are not known are left out."""
    wording = {
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
    return {name: value for name, value in wording.items() if value is not None and value == value}


def _unit(posterior: Posterior, name: str) -> str:
    """Return the unit of a parameter, `log10(N m/rad)` of a logarithm; empty where unknown."""
    unit = posterior.unit(name)
    return f"log10({unit})" if unit and is_logarithm(name) else unit


_TOLERANCE = 1e-6  # technical: rounding through a store and back, far below another likelihood
_NATS = 0.2
"""The covariance was settled near the optimum that the sampler found, not at the most probable
draw: between the two the joint likelihood differs by 0.06 nats."""


@dataclass(frozen=True, eq=False)
class Predictive:
    """By draw and measurement, all (samples, measurements).

    `frequency_hz` are draws of what would be measured: the model's frequency with model error and
    identification error. `log_likelihood` is that of each measurement, its density in 1/Hz. With
    the priors of a description it is that of each by itself: errors that several share, and the
    doubt about the stated ones, belong to no measurement alone, and it does not add up to the
    posterior's.
    """

    frequency_hz: FloatArray
    log_likelihood: FloatArray


def predictive(posterior: Posterior, tests: Sequence[ModalTest], hanger: Hanger) -> Predictive:
    """Evaluate the model class again; draws are seeded with the posterior's seed.

    Raises BadInput where `tests` and `hanger` are not those that the posterior was made from.
    """
    if posterior.priors != THESIS:
        return _of_the_field(posterior, tests, hanger)
    likelihood = ThesisLikelihood(tests)
    model = class_of(posterior, hanger)
    sigma, theta = posterior.samples[:, -1], parameter_sets(posterior, model)
    model.prepare(likelihood.highest_order)
    predicted = likelihood.predict(model, theta)
    measured = likelihood.frequency_hz
    noise = np.hypot(sigma[:, None], likelihood.identification_error) * measured
    standardised = (measured - predicted) / noise
    log_likelihood = -0.5 * standardised**2 - np.log(noise) - 0.5 * np.log(2 * np.pi)
    _refuse_another(posterior, log_likelihood.sum(axis=1))
    rng = np.random.default_rng(posterior.seed)
    return Predictive(
        predicted + noise * rng.standard_normal(predicted.shape), np.asarray(log_likelihood)
    )


def _of_the_field(posterior: Posterior, tests: Sequence[ModalTest], hanger: Hanger) -> Predictive:
    """Return the same where the likelihood is that of `shm.inference.problem.field`."""
    model = class_of(posterior, hanger)
    used = check_for_update(tests, model)[0] if posterior.remarks else tests
    problem = Problem.of(used, model, silent)
    likelihood, sigma = problem.measured, posterior.samples[:, -1]
    likelihood.settle(problem.model, posterior.most_probable[:-1])
    predicted = problem.run(parameter_sets(posterior, model))
    retained = posterior.log_likelihood
    if not np.allclose(likelihood.joint(predicted, sigma), retained, rtol=1e-4, atol=_NATS):
        raise _another(posterior)
    by_mode = likelihood.by_mode(predicted)
    stated = [mode.frequency_sd_hz / mode.frequency_hz for mode in likelihood.modes]
    sd = np.hypot(sigma[:, None], np.nan_to_num(np.array(stated)))
    measured = np.array([mode.frequency_hz for mode in likelihood.modes])
    standardised = np.log(measured / by_mode) / sd
    this = -0.5 * standardised**2 - np.log(sd * measured) - 0.5 * np.log(2 * np.pi)
    rng = np.random.default_rng(posterior.seed)
    return Predictive(by_mode * np.exp(sd * rng.standard_normal(sd.shape)), np.asarray(this))


def _refuse_another(posterior: Posterior, joint: FloatArray) -> None:
    """Refuse a posterior whose stored joint likelihood is another.

    Earlier versions could count a data set N_D times: the stored one is then N_D times as large.
    """
    repeat = max(1, round(float(np.median(posterior.log_likelihood / joint))))
    if not np.allclose(repeat * joint, posterior.log_likelihood, rtol=_TOLERANCE, atol=_TOLERANCE):
        raise _another(posterior)


def _another(posterior: Posterior) -> BadInput:
    return BadInput(
        f"the posterior of {', '.join(posterior.tests)} was not made from these tests and this "
        "description of the hanger.",
        remedy="Give those that it was made from, or leave them out.",
    )
