"""The one door to pyOMA2 (D. Pasca and A. Aloisio): its realisation, its poles, its own SSI.

pyOMA2 is imported where it is first needed, as that takes a second or more. It sets numpy's error
state for the whole process, adds a handler to its log, silences matplotlib's, and draws progress
bars; none of this comes through the door.
"""

from __future__ import annotations

import logging
import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

from shm.identify.contract import (
    FREQUENCY_FLOOR,
    Dropped,
    Finding,
    FoundMode,
    Measurement,
    Poles,
)
from shm.identify.estimation.poles import PoleSet
from shm.identify.estimation.shapes import real_shape
from shm.identify.options import IdentifyOptions
from shm.values import NAN, FloatArray

_HIGHEST_ORDER, _STEP = 60, 2
"""Of pyOMA2's own SSI: its clustering costs the square of the poles. In five records of
tests/worlds/recordings.py, order 100 by ones takes ten times as long and finds 32 modes of 35
instead of 30."""
_LEAST_BLOCK_ROWS = 20  # its default


def poles_of_orders(
    hankel: FloatArray,
    block_rows: int,
    orders: Sequence[int],
    sampling_rate_hz: float,
    shift_hz: float = 0.0,
) -> list[PoleSet]:
    """Return the oscillating poles of each of `orders`, raised by `shift_hz`.

    `orders` are multiples of their first step; `hankel` (channels * block_rows, columns) has the
    rank of the highest. Orders that are not asked for are made, which is cheap, but not solved.
    """
    ssi = _ssi()
    step, highest = _step(orders), max(orders)
    with _quiet():
        observability, states, outputs, _ = ssi.SSI_fast(hankel, block_rows, highest, step=step)
        wanted = [a if step * n in orders else np.empty((0, 0)) for n, a in enumerate(states)]
        # Of the observability matrix it needs the number of channels alone, unless uncertainties
        # are asked for.
        channels = observability[: len(outputs[0])]
        _, _, shapes, rates, *_ = ssi.SSI_poles(
            channels, wanted, outputs, highest, 1 / sampling_rate_hz, step=step, HC=False
        )
    return [
        _pole_set(order, rates[:order, order // step], shapes[:order, order // step],
                  sampling_rate_hz, shift_hz)
        for order in orders
    ]  # fmt: skip


def _step(orders: Sequence[int]) -> int:
    return math.gcd(*orders)


def _pole_set(
    order: int, rates: Any, shapes: Any, sampling_rate_hz: float, shift_hz: float
) -> PoleSet:
    """Return one pole of each conjugate pair; poles on the real axis do not oscillate."""
    turns = rates.imag / (np.pi * sampling_rate_hz)
    above = (turns > 0) & (turns < 1 - 1e-12)
    raised = rates[above] + 2j * np.pi * shift_hz
    return PoleSet(
        order=order,
        frequency_hz=np.abs(raised) / (2 * np.pi),
        damping_ratio=-raised.real / np.abs(raised),
        shapes=shapes[above].T,
        dropped=(Dropped("poles", order - 2 * int(np.sum(above)), "do not oscillate"),),
    )


def identify_with_pyoma2(measurement: Measurement, options: IdentifyOptions) -> Finding:
    """Return what pyOMA2's own SSI and clustering find, with the steps of its documentation.

    It looks at all ring-downs in a row. How well hits repeat is not known: frequencies have the
    stated standard deviation of few hits, damping and shape none.
    """
    motion = np.hstack(measurement.decays)
    none = np.empty(0)
    poles = Poles(none, none, none, none.astype(bool))
    if not np.any(motion):
        return Finding(
            (), (Dropped("ring-downs", len(measurement.decays), "nothing moves"),), poles
        )
    try:
        with _quiet():
            result = _clustered(motion, measurement.sampling_rate_hz, options)
    except (ValueError, np.linalg.LinAlgError) as error:
        reason = f"pyOMA2's clustering makes nothing of them ({error})".split("\n")[0][:200]
        return Finding((), (Dropped("poles", 1, reason),), poles)
    found = result.clustering_results["own"]
    frequency_hz, damping = np.atleast_1d(found.Fn), np.atleast_1d(found.Xi)
    shapes = np.asarray(found.Phi).reshape(len(motion), -1).T
    inside = (frequency_hz >= options.band_low_hz) & (frequency_hz <= options.band_high_hz)
    inside &= (damping > 0) & (damping < options.max_damping_ratio)
    modes = [
        _mode(*each, found, number, options)
        for number, each in enumerate(zip(frequency_hz, damping, shapes, strict=True))
        if inside[number]
    ]
    lost = int(np.sum(~inside))
    dropped = (Dropped("modes", lost, "outside of the band, or damped like none"),) if lost else ()
    return Finding(tuple(sorted(modes, key=lambda m: m.frequency_hz)), dropped, _diagram(result))


def _clustered(motion: FloatArray, sampling_rate_hz: float, options: IdentifyOptions) -> Any:
    """Return pyOMA2's result for signals (channels, samples), clustered under the name `own`."""
    algorithms, setup = _import("pyoma2.algorithms"), _import("pyoma2.setup")
    parameters = _import("pyoma2.algorithms.data.run_params")
    setattr(_import("pyoma2.algorithms.ssi"), "trange", range)  # noqa: B010
    _ssi()
    rows = max(_LEAST_BLOCK_ROWS, 1 + math.ceil(_HIGHEST_ORDER / len(motion)))
    ssi = algorithms.SSI(name="ssi", br=rows, ordmax=_HIGHEST_ORDER, step=_STEP)
    single = setup.SingleSetup(motion.T, sampling_rate_hz)
    single.add_algorithms(ssi)
    single.run_by_name("ssi")
    limits = parameters.Step3(freqlim=(options.band_low_hz, options.band_high_hz))
    steps = (parameters.Step1(), parameters.Step2(), limits)
    ssi.add_clustering(parameters.Clustering(name="own", steps=steps))
    ssi.run_clustering("own")
    return ssi.result


def _mode(
    frequency_hz: float, damping: float, shape: Any, clusters: Any, number: int, options: Any
) -> FoundMode:
    """Return a cluster as a mode; its frequency is as sure as its poles agree, at best a floor."""
    of_cluster = clusters.Fn_fl[clusters.labels == number]
    scatter = float(np.std(of_cluster)) if len(of_cluster) > 1 else 0.0
    sd_hz = math.hypot(
        max(scatter, FREQUENCY_FLOOR * frequency_hz), options.frequency_allowance * frequency_hz
    )
    unknown = np.full(len(shape), NAN)
    return FoundMode(float(frequency_hz), sd_hz, float(damping), NAN, real_shape(shape), unknown)


def _diagram(result: Any) -> Poles:
    """Return all poles over the orders; those that pyOMA2 calls stable are."""
    shown = np.isfinite(result.Fn_poles)
    order = np.broadcast_to(_STEP * np.arange(shown.shape[1], dtype=float), shown.shape)
    return Poles(
        order[shown], result.Fn_poles[shown], result.Xi_poles[shown], result.Lab[shown] == 1
    )


@cache
def _ssi() -> ModuleType:
    """Return pyOMA2's functions of SSI, without their progress bars."""
    module = _import("pyoma2.functions.ssi")
    setattr(module, "trange", range)  # noqa: B010
    return module


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep numpy's warnings and pyOMA2's log lines in."""
    log = logging.getLogger("pyoma2")
    level = log.level
    with np.errstate(divide="ignore", invalid="ignore"):
        log.setLevel(logging.ERROR)
        try:
            yield
        finally:
            log.setLevel(level)


def _import(name: str) -> ModuleType:
    """Return a module of pyOMA2; error state, log and matplotlib's log stay as they were."""
    if name in sys.modules:
        return sys.modules[name]
    log, drawing = logging.getLogger("pyoma2"), logging.getLogger("matplotlib")
    handlers, level, drawing_level = list(log.handlers), log.level, drawing.level
    with np.errstate():
        module = import_module(name)
    log.handlers[:] = handlers
    log.setLevel(level)
    drawing.setLevel(drawing_level)
    return module
