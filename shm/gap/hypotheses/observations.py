"""The data vector of a hanger's tests: logarithms of frequencies, then components of mode shapes.

A shape is scaled to unit length over its own components. Where they are not equally certain, the
length is the one weighted by 1/sd^2 (to a mean weight of 1), lest the error of an uncertain
component spread over the certain ones.

Where a test says how its frequencies depend on amplitude, it counts as two: its frequencies of
small amplitude at amplitude 0, and at that of its hits those that change, each by its own slope.

Where two planes' frequencies are all but equal, both shapes may swing in any direction, and noise
turns them: every component errs by the same angle times the other component at its place, so that
the larger of a place's two standard deviations grows with the shape, sd^2 = own^2 + (turn size)^2.
Components err independently by `own` alone.

Frequencies that state no standard deviation may have been rounded. A step is the same number of Hz
for all modes, so that low ones are much less exact than high ones.
Frequencies rounded to one number, as of both planes, err alike: they are one datum and not two.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.assumptions import Assumptions
from shm.errors import BadInput
from shm.gap.hypotheses.contract import Design, Observations
from shm.inference.problem.data_checks import is_bare, step_hz
from shm.inference.problem.priors import reading_sd_n
from shm.models.effects import Conditions, Survey
from shm.values import PLANES, FloatArray, Hanger, IntArray, ModalTest, Mode

_SAME_PLACE_M = 1e-3  # judgement: places are written in mm; no two sensors fit nearer
_FEWEST_READINGS = 2  # of one there is no difference


@dataclass(frozen=True)
class _Component:
    """One measured component of the shape of frequency `mode`."""

    mode: int
    x_m: float
    axis: int
    value: float
    sd: float


def observed(tests: Sequence[ModalTest], hanger: Hanger) -> Observations:
    """All usable data of `tests`; shapes without standard deviations are not usable.

    They are as `shm.gap.hypotheses.data_checks` leaves them. Raises BadInput for a frequency or an
    order that cannot be.
    """
    _refuse_nonsense(tests)
    tests = [level for test in tests for level in _by_level(test)]
    modes = [(t, mode) for t, test in enumerate(tests) for mode in test.modes]
    frequency = np.array([mode.frequency_hz for _, mode in modes])
    sd = np.array([mode.frequency_sd_hz for _, mode in modes]) / frequency
    error = hanger.assumptions.shape_error.value
    shapes, noise = zip(
        *(_with_errors(_components(k, mode), error) for k, (_, mode) in enumerate(modes)),
        strict=True,
    )
    turns = np.vstack([turn_of_axes(test, hanger) for test in tests])
    turns[:, 0] = np.hypot(turns[:, 0], noise)
    turns[np.isnan(noise)] = 0.0
    components, lengths = _scaled(shapes)
    survey = survey_of(tests)
    design = Design(
        survey=survey,
        conditions=_conditions(tests, hanger.assumptions),
        places_m=survey.sensor_places_m,
        frequency_test=np.array([t for t, _ in modes]),
        frequency_plane=np.array([PLANES.index(mode.plane) for _, mode in modes]),
        frequency_order=np.array([mode.order for _, mode in modes]),
        shape_mode=_integers([each.mode for each in components]),
        shape_place=_nearest([each.x_m for each in components], survey.sensor_places_m),
        shape_component=_integers([each.axis for each in components]),
    )
    shape = np.array([each.value for each in components]) / lengths
    shape_sd = np.array([each.sd for each in components]) / lengths
    return Observations(
        design,
        np.concatenate([np.log(frequency), shape]),
        np.concatenate([np.where(sd > 0, sd, np.nan), shape_sd]),
        turns if turns.any() else None,
        np.array([_damping(mode) for _, mode in modes]),
        rounding_sds(tests),
        hanger.assumptions,
    )


def _damping(mode: Mode) -> tuple[float, float]:
    """The logarithm of a damping ratio and its standard deviation; NaN where either is unknown."""
    if not (mode.damping_ratio > 0 and mode.damping_sd > 0):
        return math.nan, math.nan
    return math.log(mode.damping_ratio), mode.damping_sd / mode.damping_ratio


def survey_of(tests: Sequence[ModalTest]) -> Survey:
    """Return what `tests` measure and vary; sensors count only where their shapes can be used."""
    components = [c for test in tests for mode in test.modes for c in _components(0, mode)]
    modes = [mode for test in tests for mode in test.modes]
    axes = {(PLANES.index(mode.plane), c.axis) for mode in modes for c in _components(0, mode)}
    masses = {test.added_mass for test in tests if test.added_mass is not None}
    return Survey(
        tests=tuple(dict.fromkeys(test.id for test in tests)),
        planes=tuple(plane for plane in PLANES if any(mode.plane == plane for mode in modes)),
        sensor_places_m=_merged([each.x_m for each in components]),
        biaxial=any(plane != axis for plane, axis in axes),
        temperatures_c=_distinct([test.temperature_c for test in tests]),
        amplitudes=_distinct([test.amplitude for test in tests]),
        added_masses=tuple(sorted(masses, key=lambda mass: (mass.x_m, mass.mass_kg))),
        tensions_read_n=_distinct([test.tension_read_n for test in tests]),
    )


def _by_level(test: ModalTest) -> Iterator[ModalTest]:
    """A test at small amplitude and at that of its hits, as far as it is sure of the difference."""
    changing = [
        replace(
            mode,
            frequency_hz=mode.frequency_hz * (1 + mode.amplitude_slope),
            frequency_sd_hz=(1 + mode.amplitude_slope)
            * math.hypot(mode.frequency_sd_hz, mode.frequency_hz * mode.amplitude_slope_sd),
            shape=(),
            damping_ratio=math.nan,
        )
        for mode in test.modes
        if mode.depends_on_amplitude and mode.frequency_sd_hz > 0
    ]
    yield replace(test, amplitude=test.frequencies_amplitude)
    if changing:
        level = test.amplitude if math.isfinite(test.amplitude) else 1.0
        yield replace(test, modes=tuple(changing), amplitude=level)


def _conditions(tests: Sequence[ModalTest], assumed: Assumptions) -> tuple[Conditions, ...]:
    temperature = np.array([test.temperature_c for test in tests], dtype=float)
    known = np.isfinite(temperature)
    reference = temperature[known].mean() if known.any() else 0.0
    shift = np.where(known, temperature - reference, 0.0)
    shift_read = _tension_shifts(tests, assumed)
    sd_k = np.where(known, assumed.thermometer_sd_k.value, assumed.unknown_temperature_sd_k.value)
    amplitude = [test.amplitude if np.isfinite(test.amplitude) else 1.0 for test in tests]
    return tuple(
        Conditions(
            test.id,
            float(shift[t]),
            float(amplitude[t]),
            test.added_mass,
            tension_shift_n=float(shift_read[t, 0]),
            tension_shift_sd_n=float(shift_read[t, 1]),
            temperature_sd_k=float(sd_k[t]),
        )
        for t, test in enumerate(tests)
    )


def _tension_shifts(tests: Sequence[ModalTest], assumed: Assumptions) -> FloatArray:
    """Tension read less the mean of all readings, and its standard deviation (tests, 2).

    The level of all readings is left open, as is an error that they share. A test without a reading
    is taken at the mean, and where fewer than two tests have one it says nothing.
    """
    read = np.array([(test.tension_read_n, reading_sd_n(test, assumed)) for test in tests])
    known = np.isfinite(read).all(axis=1)
    if known.sum() < _FEWEST_READINGS:
        return np.zeros((len(tests), 2))
    read[:, 0] -= read[known, 0].mean()
    return np.where(known[:, None], read, 0.0)


def _components(index: int, mode: Mode) -> list[_Component]:
    """Return the usable components of a mode's shape.

    None where fewer than two are left, or none in the mode's own plane.
    """
    plane = PLANES.index(mode.plane)
    both = [
        _Component(index, point.x_m, axis, value, point.sd)
        for point in mode.shape
        for axis, value in ((plane, point.value), (1 - plane, point.cross))
    ]
    usable = [each for each in both if np.isfinite([each.value, each.sd]).all() and each.sd > 0]
    has_own = any(each.axis == plane and each.value != 0 for each in usable)
    return usable if len(usable) > 1 and has_own else []


def _with_errors(shape: list[_Component], error: float) -> tuple[list[_Component], float]:
    """Return a shape that errs by a part of its length more than stated, and its turn by noise.

    The turn is a standard deviation in radians; NaN unless all sensors have two axes.
    """
    least = error * math.hypot(*(each.value for each in shape))
    pairs = list(zip(shape[::2], shape[1::2], strict=False))
    if not shape or len(shape) % 2 or any(one.x_m != other.x_m for one, other in pairs):
        return [replace(each, sd=math.hypot(each.sd, least)) for each in shape], math.nan
    size = np.array([max(abs(one.value), abs(other.value)) for one, other in pairs])
    own, turn = separate_turn(np.array([one.sd for one, _ in pairs]), size, least)
    sds = np.repeat(np.hypot(own, least), 2).tolist()
    return [replace(each, sd=sd) for each, sd in zip(shape, sds, strict=True)], turn


def turn_of_axes(test: ModalTest, hanger: Hanger) -> FloatArray:
    """Return standard deviations (modes, 3), in radians, of the direction of each mode.

    A round bar swings in the planes of its supports only as far as these tell the planes apart:
    what couples them turns a pair of modes by its share of their distance (first order of
    perturbation), freely where they all but coincide. The first is that of each pair by itself, the
    others turn all pairs to one side: by what couples all alike, and by a section that is not
    round. Where the other plane's mode is missing, the distance is that of the next orders. 0 of
    less than sensors are turned, and of one plane alone.
    """
    at = {(mode.plane, mode.order): math.log(mode.frequency_hz) for mode in test.modes}
    orders = sorted({order for _, order in at if all((plane, order) in at for plane in PLANES)})
    if not orders:
        return np.zeros((len(test.modes), 3))
    apart = [abs(at[PLANES[0], order] - at[PLANES[1], order]) for order in orders]
    distance = np.interp([mode.order for mode in test.modes], orders, apart)[:, None]
    assumed = hanger.assumptions
    by_bending = np.array([_bending_share(mode, hanger) / 2 for mode in test.modes])
    own = assumed.plane_coupling_own.value
    shares = np.outer(np.ones(len(by_bending)), [own, math.sqrt(1 - own**2), 0.0])
    coupling = assumed.plane_coupling.value * shares
    coupling[:, 2] = assumed.out_of_round_sd.value * by_bending
    least = np.maximum(coupling / (np.pi / 2), np.finfo(float).tiny)  # a right angle is any
    turn = coupling / np.maximum(distance, least)
    return np.where(np.linalg.norm(turn, axis=1)[:, None] > hanger.scatter.sensor_turn, turn, 0.0)


def _bending_share(mode: Mode, hanger: Hanger) -> float:
    """Return the part of a mode's stiffness that is bending, as of a bar between pins."""
    wave = mode.order * math.pi / hanger.length_m
    bending = hanger.bending_stiffness_n_m2 * wave**4
    return min(
        1.0, bending / (hanger.mass_per_length_kg_m * (2 * math.pi * mode.frequency_hz) ** 2)
    )


def _scaled(shapes: Sequence[list[_Component]]) -> tuple[list[_Component], FloatArray]:
    """All components in a row and, for each, the length of its shape."""
    lengths = []
    for shape in shapes:
        value, sd = (np.array([getattr(each, name) for each in shape]) for name in ("value", "sd"))
        lengths += [weighted_length(value, sd)] * len(shape)
    return [each for shape in shapes for each in shape], np.array(lengths)


def weighted_length(value: FloatArray, sd: FloatArray) -> float:
    """The length of a shape of components `value`, weighted by 1/sd^2; both (components,)."""
    if len(value) == 0:
        return 1.0
    weight = 1 / sd**2
    return float(np.sqrt(weight @ value**2 / weight.mean()))


def _refuse_nonsense(tests: Sequence[ModalTest]) -> None:
    for of, mode in ((test, mode) for test in tests for mode in test.modes):
        where = f"test {of.id}, {mode.plane} mode {mode.order}"
        if not (np.isfinite(mode.frequency_hz) and mode.frequency_hz > 0):
            raise BadInput(
                f"{where}: {mode.frequency_hz} Hz is no frequency.", remedy="Leave it out."
            )
        if mode.order < 1:
            raise BadInput(
                f"{where}: orders count from 1.", remedy="Number the modes of each plane."
            )


def _merged(places_m: Sequence[float]) -> tuple[float, ...]:
    """Return the distinct places, sorted; those within a millimetre count as one."""
    merged: list[float] = []
    for x_m in sorted(places_m):
        if not merged or x_m - merged[-1] > _SAME_PLACE_M:
            merged.append(x_m)
    return tuple(merged)


def _distinct(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(sorted({value for value in values if np.isfinite(value)}))


def _nearest(x_m: Sequence[float], places_m: Sequence[float]) -> IntArray:
    away = np.abs(np.subtract.outer(np.array(x_m), np.array(places_m)))
    return away.argmin(axis=1) if len(x_m) else _integers([])


def _integers(values: Sequence[int]) -> IntArray:
    return np.array(values, dtype=np.int64)


_FEWEST = 3  # places: one more than the two unknowns, own standard deviation and turn


def separate_turn(sd: FloatArray, size: FloatArray, least: float) -> tuple[FloatArray, float]:
    """The components' own standard deviations (places,) and the turn's, in radians.

    `sd` and `size` (places,) are the larger standard deviation and the larger component of each
    place. Own ones are at least `least`. Where a turn is not most of what the largest component may
    err by it counts as none, for standard deviations scatter, too. Least squares of relative
    errors.
    """
    if len(sd) < _FEWEST:
        return sd, 0.0
    (variance, turn), _ = scipy.optimize.nnls(
        np.column_stack([np.ones_like(sd), size**2]) / sd[:, None] ** 2, sd / sd
    )
    if turn * np.max(size**2) <= max(variance, least**2):
        return sd, 0.0
    return np.full_like(sd, np.sqrt(max(variance, least**2))), float(np.sqrt(turn))


def rounding_sds(tests: Sequence[ModalTest]) -> FloatArray:
    """Of the logarithm of each frequency (F,) in the tests' order: step / sqrt(12) over it."""
    return np.array(
        [
            step / math.sqrt(12) / mode.frequency_hz if is_bare(mode) else 0.0
            for test in tests
            for step in [step_hz(test)]
            for mode in test.modes
        ]
    )


def rounding_covariance(observations: Observations) -> FloatArray:
    """Covariance (F, F) that rounding adds.

    The mean of k equal numbers errs as one of them does, and what was equal before rounding to
    within a step apart may differ by as much as two that were rounded independently.
    """
    count = observations.design.frequencies
    if observations.rounding is None:
        return np.zeros((count, count))
    value, sd = observations.value[:count], observations.rounding
    equal = np.equal.outer(value, value)
    shared = equal * (1 - 1 / equal.sum(axis=1))
    return np.asarray(np.outer(sd, sd) * (np.eye(count) + shared))


def remark_on_rounding(tests: Sequence[ModalTest]) -> str:
    """The coarsest rounding, in words."""
    steps = [(step_hz(test), test) for test in tests]
    step, test = max(steps, key=lambda pair: pair[0])
    if not step:
        return ""
    lowest = min(mode.frequency_hz for mode in test.modes if is_bare(mode))
    return (
        f"The frequencies of test {test.id} are rounded to {step:g} Hz: errors of "
        f"{100 * step / math.sqrt(12) / lowest:.2g} % of the lowest are expected from that alone. "
        "Give them with more digits."
    )
