"""Define what is watched of a hanger, in coordinates that frequencies follow nearly linearly.

Base point of all is the baseline's most probable parameter set; the tension that people see is the
posterior's mean. What 0.3 decades do is taken at the base point or, where that is more, as the root
mean square over the baseline's samples: an end that seems clamped may have any stiffness there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np
import scipy

from shm.errors import UsageError
from shm.models import MODELS, AdoptedName, Model, class_of, is_adopted
from shm.models.classes.base import Conditions
from shm.models.classes.beam import Beam
from shm.values import (
    NAN,
    PLANES,
    TENSION,
    End,
    FloatArray,
    Hanger,
    Plane,
    Posterior,
    WatchedQuantity,
    is_ratio,
)
from shm.watch.engine.limits import LIMITS

MeasuredMode = tuple[Plane, int]
"""Plane and order, which counts from 1."""

_X = TypeVar("_X", float, FloatArray)

_TENSION_RATIO = "theta_F"
_STIFFNESS = "log10_k"

_ENDS: dict[str, End] = {
    **dict.fromkeys(("k1", "k2"), "deck"),
    **dict.fromkeys(("k3", "k4"), "arch"),
    **dict.fromkeys(("krx", "kry"), "deck"),
    **dict.fromkeys(("klx", "kly"), "arch"),
}
_PLANES: dict[str, Plane] = {
    **dict.fromkeys(("krx", "klx"), "transverse"),
    **dict.fromkeys(("kry", "kly"), "longitudinal"),
}
_PLANES_OF_BEAMS: dict[str, Plane] = {
    **dict.fromkeys(("k1", "k3"), "transverse"),
    **dict.fromkeys(("k2", "k4"), "longitudinal"),
}


def watched_quantities(
    baseline: Posterior, hanger: Hanger, modes: Sequence[MeasuredMode]
) -> tuple[WatchedQuantity, ...]:
    """Return the tension, then the stiffness of each end of the baseline's class that modes see.

    A stiffness's coordinate is the change of the mean log frequency over `modes` as it goes through
    its prior range, all else at the base point. Left out are those whose whole range moves no
    frequency by more than 1e-5, and parameters of adopted effects. Springs that can be exchanged
    without changing any frequency are one quantity.
    """
    model = class_of(baseline, hanger)
    base = base_point(baseline, model)
    pairs = _exchangeable(model, base, modes)
    paired = {name for pair in pairs for name in pair}
    held = [*pairs, *((name,) for name in _springs(model) if name not in paired)] if modes else []
    springs = (_spring(baseline, model, base, names, modes) for names in held)
    return (_tension(baseline, model, base), *(each for each in springs if each))


def _exchangeable(
    model: Model, base: FloatArray, modes: Sequence[MeasuredMode]
) -> list[tuple[str, str]]:
    """Return pairs of springs of which the frequencies do not say which is at which end.

    Those that the class declares, although its own weight tells them apart by less than absolute
    frequencies are known. Of an adopted class those of its baseline, where with a decade between
    the two, the softer at the base point's or in the lower half of its prior, and all else at the
    base point, exchanging them moves no frequency by more than 1e-5.
    """
    if not modes or not is_adopted(model.name):
        return list(model.swaps) if modes else []
    pairs = []
    for pair in MODELS[_baseline_class(model)].swaps:
        columns = [model.parameter_names.index(name) for name in pair]
        middle = (model.prior.lower[columns] + model.prior.upper[columns]).mean() / 2
        # Clamped ends always look alike: it is as they come loose that they are told apart.
        softer = min(base[columns].min(), middle - 1)
        theta = np.tile(base, (2, 1))
        theta[:, columns] = [[softer, softer + 1], [softer + 1, softer]]
        one, other = log_frequencies(model, theta, modes)
        if np.abs(one - other).max() < LIMITS.invisible:
            pairs.append(pair)
    return pairs


def base_point(baseline: Posterior, model: Model) -> FloatArray:
    """Return the baseline's most probable parameter set (parameters,), its tension kept in N.

    What the bar as made deviates by from its description is part of it: all tests have it alike.
    Springs lie within their prior, which is that of the described bar.
    """
    known = dict(zip(baseline.names, baseline.most_probable.tolist(), strict=True))
    known[_TENSION_RATIO] *= baseline.nominal_tension_n / model.hanger.nominal_tension_n
    springs, prior = _springs(model), model.prior
    for name, lower, upper in zip(prior.names, prior.lower, prior.upper, strict=True):
        if name in springs:
            known[name] = float(np.clip(known[name], lower, upper))
    lacking = []
    for name in model.parameter_names:
        if name not in known:
            try:
                known[name] = model.usual(name)
            except KeyError:
                lacking.append(name)
    if lacking:
        raise UsageError(
            f"the baseline in {model.name} was made by a former shm, without {', '.join(lacking)}.",
            remedy="Set it again: `shm drift rebaseline`.",
        )
    return np.array([known[name] for name in model.parameter_names])


def posterior_at(model: str, hanger: Hanger, values: Mapping[str, float]) -> Posterior:
    """Return one parameter set as a posterior; nothing is sampled."""
    theta = np.array(list(values.values()))
    return Posterior(
        model=model,
        hanger=hanger.id,
        names=tuple(values),
        samples=theta[None],
        log_likelihood=np.zeros(1),
        most_probable=theta,
        nominal_tension_n=hanger.nominal_tension_n,
        log_evidence=0.0,
        log_evidence_sd=0.0,
        effective_sample_size=NAN,
        r_hat=NAN,
        evaluations=0,
        predicted=(),
        tests=(),
        seed=0,
        seconds=0.0,
        method="none",
    )


def value_at(quantity: WatchedQuantity, x: _X) -> _X:
    """The tension in N or log10 of the stiffness at coordinate `x`, no further than the table."""
    if is_ratio(quantity.name):
        inside = np.clip(x, quantity.coordinates[0], quantity.coordinates[-1])
        return _like(x, quantity.baseline * np.exp(inside))
    return _like(x, np.interp(x, quantity.coordinates, quantity.values))


def shift_of(quantity: WatchedQuantity, x: _X) -> _X:
    """The shift from the baseline: a fraction of the tension, or decades of the stiffness."""
    value = value_at(quantity, x)
    if is_ratio(quantity.name):
        return _like(x, value / quantity.baseline - 1)
    return _like(x, value - quantity.baseline)


def _like(x: _X, found: float | FloatArray) -> _X:
    return np.asarray(found) if isinstance(x, np.ndarray) else float(found)


def _tension(baseline: Posterior, model: Model, base: FloatArray) -> WatchedQuantity:
    """Return the tension, as far as the class's prior reaches, and down to a slack hanger."""
    column = model.parameter_names.index(_TENSION_RATIO)
    lower, upper = (ends[column] / base[column] for ends in (model.prior.lower, model.prior.upper))
    lower = min(lower, LIMITS.slack)
    # Technical: interpolated between
    between = np.linspace(min(np.log(lower), 0.0), max(np.log(upper), 0.0), 201)
    coordinates = np.union1d(between, 0.0)
    mean_n = float(baseline.tension_n.mean())
    values = mean_n * np.exp(coordinates)
    at_base_n = base[column] * model.hanger.nominal_tension_n
    return WatchedQuantity(
        TENSION,
        mean_n,
        coordinates,
        values,
        LIMITS.quantities_tension_step,
        parameters=(_TENSION_RATIO,),
        scale_sd=_off_by(at_base_n / baseline.tension_n),
        unit="N",
    )


def moved(
    model: Model, base: FloatArray, columns: Sequence[int], decades: FloatArray
) -> FloatArray:
    """Parameter sets (n, parameters): `base` with springs moved, no further than their priors."""
    theta = np.tile(base, (len(decades), 1))
    prior = model.prior
    for column in columns:
        theta[:, column] = (base[column] + decades).clip(prior.lower[column], prior.upper[column])
    return theta


def log_frequencies(model: Model, theta: FloatArray, modes: Sequence[MeasuredMode]) -> FloatArray:
    """Of parameter sets (n, parameters): (n, modes)."""
    planes, orders = np.array([(PLANES.index(plane), order - 1) for plane, order in modes]).T
    frequencies = model.frequencies_at(theta, int(orders.max()) + 1, Conditions())
    return np.asarray(np.log(frequencies[:, planes, orders]))


def _springs(model: Model) -> list[str]:
    """Return the springs of the class, or of the baseline of an adopted one."""
    its = MODELS[_baseline_class(model)].bounds
    return [each for each in model.parameter_names if each in its and each.startswith(_STIFFNESS)]


def _baseline_class(model: Model) -> str:
    """Return the name of the class, or of the baseline of an adopted one."""
    return AdoptedName.parse(model.name).baseline if is_adopted(model.name) else model.name


def _spring(
    baseline: Posterior,
    model: Model,
    base: FloatArray,
    names: tuple[str, ...],
    modes: Sequence[MeasuredMode],
) -> WatchedQuantity | None:
    """Return springs that move together as one quantity; None where no mode sees them."""
    columns = [model.parameter_names.index(name) for name in names]
    centre = float(common_stiffness(base[None, columns])[0])
    lower, upper = model.prior.lower[columns[0]], model.prior.upper[columns[0]]
    # Technical: frequencies are smooth in log k, and refined between
    nodes = np.linspace(lower, upper, round((upper - lower) * 4) + 1)
    # A node so near the base that both would be one by rounding gives way to it.
    grid = np.sort(np.append(nodes[np.abs(nodes - centre) > 0.01], centre))
    found = log_frequencies(model, moved(model, base, columns, grid - centre), modes)
    if np.ptp(found, axis=0).max() <= LIMITS.invisible:
        return None
    at = int(np.searchsorted(grid, centre))
    # Users go straight from node to node. Towards the clamped end the response falls tenfold in a
    # decade: at 40 nodes a decade the slope is right within 3 %, at two within 70 %.
    rising = np.maximum.accumulate((found - found[at]).mean(axis=1))
    log10_k = np.interp(
        np.arange((len(grid) - 1) * LIMITS.finer + 1) / LIMITS.finer, range(len(grid)), grid
    )
    mean = np.asarray(scipy.interpolate.PchipInterpolator(grid, rising)(log10_k))
    mean = mean - mean[at * LIMITS.finer]

    def step_at(stiffness: FloatArray) -> FloatArray:
        """Return what 0.3 decades do, the larger of up and down."""
        steps = (0.0, -LIMITS.stiffness_step_decades, LIMITS.stiffness_step_decades)
        here, down, up = (np.interp(stiffness + step, log10_k, mean) for step in steps)
        return np.asarray(np.maximum(here - down, up - here))

    samples = step_at(common_stiffness(np.column_stack([baseline.parameter(n) for n in names])))
    at_base = step_at(np.array([centre]))
    chosen = _rising(mean, at * LIMITS.finer)
    planes = _PLANES | _PLANES_OF_BEAMS if _is_beam(model) else _PLANES
    bare, alone = names[0].removeprefix("log10_"), len(names) == 1
    plane = planes.get(bare)
    return WatchedQuantity(
        name=names[0] if alone else f"{plane}_end_stiffness",
        baseline=centre,
        coordinates=mean[chosen],
        values=log10_k[chosen],
        step_sd=float(max(at_base[0], np.sqrt(np.mean(samples**2)))),
        end=_ENDS.get(bare) if alone else None,
        plane=plane,
        parameters=names,
        scale_sd=_off_by(at_base / np.maximum(samples, LIMITS.invisible)),
        unit=model.units.get(names[0], ""),
    )


def common_stiffness(log10_k: FloatArray) -> FloatArray:
    """Return log10 (n,) of the stiffness of alike springs that give as much as (n, springs)."""
    return np.asarray(-np.log10(np.mean(10.0**-log10_k, axis=1)))


def _is_beam(model: Model) -> bool:
    """Return True if each spring holds one plane alone, as those of the beam classes do."""
    return issubclass(MODELS[_baseline_class(model)], Beam)


def _rising(mean: FloatArray, at: int) -> list[int]:
    """Return the nodes to keep so that coordinates rise strictly, that of the base `at` always."""
    above, below = [at], [at]
    for index in range(at + 1, len(mean)):
        if mean[index] > mean[above[-1]] + LIMITS.rounding:
            above.append(index)
    for index in range(at - 1, -1, -1):
        if mean[index] < mean[below[-1]] - LIMITS.rounding:
            below.append(index)
    return [*below[:0:-1], *above]


def _off_by(ratios: FloatArray) -> float:
    """Root mean square of ratios (n,) less 1; off by all of itself is not known at all."""
    return min(
        math.hypot(float(np.sqrt(np.mean((ratios - 1) ** 2))), LIMITS.quantities_model_off), 1.0
    )
