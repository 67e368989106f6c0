"""Read the watched quantities from one test: Gauss-Newton of the model class, without a prior.

A reading is the likelihood linearised where it is largest (Bjoerck 1996, Numerical Methods for
Least Squares Problems), of log frequencies less each mode's own residual at the baseline: the
model's error and the deviations of the bar as made are the same in every test. A weak pull to the
baseline chooses the place where the data do not; it has no part in mean and information. What
softening steel does, 0.03 % of its modulus per kelvin, is taken off.

Springs that frequencies cannot tell apart move together. One of the two that moves alone is read as
a move of both, and a part of it as tension: for a loss of 30 % up to 0.5 % of it at 1e7 N m/rad. As
an end loosens, the modes go by how soft it is, which the baseline hardly tells: `loosening_of`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
import scipy

from shm.errors import BadInput
from shm.models import Model, class_of, described
from shm.models.classes.base import Conditions
from shm.values import (
    PLANES,
    TENSION,
    BoolArray,
    FloatArray,
    Hanger,
    IntArray,
    ModalTest,
    Mode,
    ModeReading,
    Posterior,
    Reading,
    WatchedQuantity,
)
from shm.watch.engine.causes import columns_of, mounted_kg
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.mistaken_modes import MOST_MISTAKEN, SoundModes, sound_modes
from shm.watch.engine.quantities import (
    MeasuredMode,
    base_point,
    log_frequencies,
    moved,
    shift_of,
    watched_quantities,
)


@dataclass(frozen=True, eq=False)
class SeenModes:
    """The modes (n,) of a test that the baseline has too: what is measured less its own residual.

    `plane` and `order` index the model's frequencies, `own` the reader's modes; `log_frequency`
    and its `variance` are (n,).
    """

    conditions: Conditions
    plane: IntArray
    order: IntArray
    own: IntArray
    log_frequency: FloatArray
    variance: FloatArray

    def taken(self, rows: BoolArray) -> SeenModes:
        """Return some of the modes."""
        arrays = ("plane", "order", "own", "log_frequency", "variance")
        return replace(self, **{name: getattr(self, name)[rows] for name in arrays})


@dataclass(frozen=True, eq=False)
class LinearReading:
    """The likelihood about coordinates `x` (q,): residuals (n,) and slopes (n, q), both over sd."""

    x: FloatArray
    residual: FloatArray
    slopes: FloatArray
    pull: FloatArray

    @property
    def information(self) -> FloatArray:
        return self.slopes.T @ self.slopes

    @property
    def cost(self) -> float:
        """Return the cost that is minimised: the misfit and the pull to the baseline."""
        return float(self.residual @ self.residual + self.x @ (self.pull * self.x))

    @property
    def step(self) -> FloatArray:
        """To where the cost is least, were it all linear."""
        downhill = self.slopes.T @ self.residual - self.pull * self.x
        return np.asarray(np.linalg.solve(self.information + np.diag(self.pull), downhill))

    def gain(self, step: FloatArray) -> float:
        """Of a step, in units of the variance."""
        return float(step @ self.information @ step)


def _error_inflation(misfit: FloatArray, fitted: int) -> float:
    """Return by what the stated variances of a test are too small, at least 1.

    By its `misfit` over sd (n,), as far as that can tell: a prior is worth a few modes
    (Birge 1932).
    """
    free = max(len(misfit) - fitted, 0)
    return max(1.0, (LIMITS.prior_freedom + float(misfit @ misfit)) / (LIMITS.prior_freedom + free))


class Likelihood:
    """The likelihood of a test over the coordinates (q,) of a hanger's `quantities`.

    About the parameters `base` of the model, whose first `orders` modes of each plane are asked.
    """

    def __init__(
        self,
        model: Model,
        base: FloatArray,
        quantities: Sequence[WatchedQuantity],
        orders: int,
    ):
        self._model, self._base, self._quantities, self._orders = model, base, quantities, orders
        names = model.parameter_names
        self._columns = [[names.index(name) for name in each.parameters] for each in quantities]
        self._scale: FloatArray = np.array([each.step_sd for each in quantities])
        self.pull: FloatArray = 1 / (LIMITS.pull_steps * self._scale) ** 2
        self._lowest = np.array([each.coordinates[0] for each in quantities])
        self._highest = np.array([each.coordinates[-1] for each in quantities])

    def inside(self, x: FloatArray) -> FloatArray:
        """Coordinates (q,) no further beyond the tables than a search may go."""
        return np.clip(x, self._lowest - LIMITS.beyond, self._highest + LIMITS.beyond)

    def far_start(self, seen: SeenModes) -> FloatArray:
        """Return where the tension alone fits best: half of the modes may be anywhere."""
        first = np.linspace(self._lowest[0], self._highest[0], LIMITS.starts)
        places = np.zeros((LIMITS.starts, len(self._quantities)))
        places[:, 0] = first
        off = np.abs(seen.log_frequency - self.predicted(places, seen))
        return np.asarray(places[int(np.median(off, axis=1).argmin())])

    def settled(self, seen: SeenModes) -> LinearReading:
        """Return the likelihood about where it is largest, or very nearly.

        Sought from the baseline on; where that fits badly, from where the tension alone fits best,
        too: on the way to a slack hanger a descent may lose itself among stiffnesses.
        """
        near = self._descended(np.zeros(len(self._quantities)), seen)
        misfit = float(near.residual @ near.residual)
        if misfit <= scipy.special.chdtri(len(near.residual), LIMITS.seldom):
            return near
        far = self._descended(self.far_start(seen), seen)
        return far if far.cost < near.cost else near

    def _descended(self, start: FloatArray, seen: SeenModes) -> LinearReading:
        """Return the same from `start` (q,) on; steps that overshoot halve."""
        best = self.linear(start, seen)
        step = best.step
        for _ in range(LIMITS.most_steps):
            if best.gain(step) < LIMITS.settled:
                break
            near = self.inside(best.x + step)
            tried = self.linear(near, seen)
            if tried.cost <= best.cost:
                best, step = tried, tried.step
            else:
                step = step / 2
        return best

    def linear(self, x: FloatArray, seen: SeenModes) -> LinearReading:
        """One call of the model: at `x` and to both sides of it along each coordinate.

        Beyond the end of a table the model stands still, and frequencies go on straight.
        """
        count, inside = len(x), np.clip(x, self._lowest, self._highest)
        # Technical: of a quantity's step, over which frequencies go nearly straight
        half = np.maximum(0.1 * self._scale, LIMITS.least_slope_step)
        low = np.maximum(inside - half, self._lowest)
        high = np.minimum(inside + half, self._highest)
        places = np.vstack([inside, *(_with_diagonal(inside, ends) for ends in (low, high))])
        predicted = self.predicted(places, seen)
        rise = predicted[1 + count :] - predicted[1 : 1 + count]
        slopes = (rise / (high - low)[:, None]).T
        sd = np.sqrt(seen.variance)
        residual = seen.log_frequency - predicted[0] - slopes @ (x - inside)
        return LinearReading(x, residual / sd, slopes / sd[:, None], self.pull)

    def read(self, linear: LinearReading, off: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what moves of the modes `off` (n,), over sd, make of the coordinates (q,).

        And the information (q, q) of the likelihood alone, 0 along what is not seen.
        """
        slopes = linear.slopes * self._scale
        shares, axes = np.linalg.eigh(slopes.T @ slopes)
        shares = shares / _error_inflation(linear.residual, len(linear.x))
        seen = shares > LIMITS.unseen
        steps = (off @ slopes @ axes)[seen] / np.linalg.norm(slopes @ axes[:, seen], axis=0) ** 2
        information = (axes[:, seen] * shares[seen]) @ axes[:, seen].T
        information = information / np.outer(self._scale, self._scale)
        return self._scale * (steps @ axes[:, seen].T), (information + information.T) / 2

    def predicted(self, x: FloatArray, seen: SeenModes) -> FloatArray:
        """Log frequencies (n, modes) of the model at coordinates (n, q) within the tables."""
        theta = np.tile(self._base, (len(x), 1))
        for quantity, columns, values in zip(self._quantities, self._columns, x.T, strict=True):
            shift = shift_of(quantity, values)
            if quantity.name == TENSION:
                theta[:, columns] *= 1 + shift[:, None]
            else:
                theta[:, columns] = moved(self._model, self._base, columns, shift)[:, columns]
        found = self._model.frequencies_at(theta, self._orders, seen.conditions)
        return np.asarray(np.log(found[:, seen.plane, seen.order]))


def _with_diagonal(row: FloatArray, diagonal: FloatArray) -> FloatArray:
    """`row` (q,) once for each entry of `diagonal` (q,), which replaces its own: (q, q)."""
    return np.where(np.eye(len(row), dtype=bool), diagonal, row)


_CLAMPED = "beam1"


def softening(
    model: Model, base: FloatArray, hanger: Hanger, modes: Sequence[MeasuredMode]
) -> FloatArray:
    """By what the log frequency of each mode (modes,) goes with a kelvin, as steel softens.

    Nothing where the class follows the temperature itself: it was fitted to what softens, too.
    Where the class is expensive, that of a clamped beam: it differs by a few percent.
    """
    mild, warm = (
        model.frequencies_at(base[None], 1, Conditions(temperature_shift_k=kelvin))
        for kelvin in (0.0, 1.0)
    )
    if not np.array_equal(mild, warm):
        return np.zeros(len(modes))
    if model.expensive:
        known = dict(zip(model.parameter_names, base.tolist(), strict=True))
        model = described(_CLAMPED, hanger)
        base = np.array([known.get(each, 1.0) for each in model.parameter_names])
    stiffer = replace(
        hanger, elastic_modulus_pa=hanger.elastic_modulus_pa * (1 + LIMITS.readings_stiffer)
    )
    stiff = described(model.name, stiffer, model.priors)
    change = log_frequencies(stiff, base[None], modes)
    change = change - log_frequencies(model, base[None], modes)
    return np.asarray(
        hanger.assumptions.modulus_per_kelvin.value * change[0] / LIMITS.readings_stiffer
    )


def loosening_of(
    model: Model,
    base: FloatArray,
    hanger: Hanger,
    modes: Sequence[MeasuredMode],
    quantities: Sequence[WatchedQuantity],
) -> tuple[FloatArray, ...]:
    """Of each quantity patterns (r, modes): what one step may do beside its mean, of one sd each.

    None of the tension.
    """
    tension_n = base[model.parameter_names.index("theta_F")] * hanger.nominal_tension_n
    of_decay = math.log10(math.sqrt(hanger.bending_stiffness_n_m2 * tension_n))
    levels = [of_decay + math.log10(each) for each in LIMITS.may_be]
    return tuple(
        np.zeros((0, len(modes)))
        if each.name == TENSION
        else _patterns(model, base, modes, each, levels)
        for each in quantities
    )


def _patterns(
    model: Model,
    base: FloatArray,
    modes: Sequence[MeasuredMode],
    quantity: WatchedQuantity,
    levels: Sequence[float],
) -> FloatArray:
    columns = [model.parameter_names.index(name) for name in quantity.parameters]
    before, after = [], []
    for each in (columns, *([column] for column in columns)):
        its = float(base[each].min())
        for level in (its, *(level for level in levels if level < its)):
            start = base.copy()
            start[each] = np.minimum(start[each], level)
            before.append(start)
            # Technical: half of its stiffness
            after.append(moved(model, start, each, np.array([-0.3]))[0])
    shifts = log_frequencies(model, np.array(after), modes)
    shifts = shifts - log_frequencies(model, np.array(before), modes)
    mean = shifts.mean(axis=1, keepdims=True)
    if abs(mean[0, 0]) < LIMITS.seen:
        return np.zeros((0, len(modes)))
    is_seen = np.abs(mean[:, 0]) > LIMITS.seen
    like = quantity.step_sd * shifts[is_seen] / mean[is_seen]
    _, strength, axes = np.linalg.svd(like[1:] - like[0], full_matrices=False)
    strength = strength / math.sqrt(max(len(like) - 1, 1))
    # Technical: patterns that add less are within a mode's own scatter
    chosen = strength > 0.05 * np.linalg.norm(like[0])
    return np.asarray(strength[chosen, None] * axes[chosen])


class Reader:
    """Reads tests of one hanger against its baseline.

    Made of the baseline's posterior and its tests, which may be of any conditions. Raises BadInput
    where these hold no mode. `reference_temperature_c` is their mean, NaN where none has one.
    """

    def __init__(self, baseline: Posterior, tests: Sequence[ModalTest], hanger: Hanger):
        self._model = class_of(baseline, hanger)
        self._base = base_point(baseline, self._model)
        usable = [test for test in tests if _is_described(test, self._model)]
        keys = {_key(mode) for test in usable for mode in test.regular_modes if _is_measured(mode)}
        if not keys:
            raise BadInput(
                f"the baseline of hanger {hanger.id} has no test with a mode that model class "
                f"{baseline.model} describes.",
                remedy="Set another baseline.",
            )
        self.modes: tuple[MeasuredMode, ...] = tuple(sorted(keys))
        self.quantities = watched_quantities(baseline, hanger, self.modes)
        loosening = loosening_of(self._model, self._base, hanger, self.modes, self.quantities)
        self.columns = replace(
            columns_of(self._model, self._base, hanger, self.modes), loosening=loosening
        )
        highest = max(order for _, order in self.modes)
        self._likelihood = Likelihood(self._model, self._base, self.quantities, highest)
        self.reference_temperature_c = mean_temperature_c(usable)
        self._per_kelvin = softening(self._model, self._base, hanger, self.modes)
        mass_kg = hanger.mass_per_length_kg_m * hanger.length_m
        self._unstated_sd = hanger.assumptions.unstated_frequency_sd.value
        sensors_kg = mounted_kg(hanger)
        self._scatter = math.hypot(LIMITS.mode_scatter, sensors_kg / mass_kg / math.sqrt(8))
        self._loosening = np.vstack(self.columns.loosening).T
        self._known: dict[int, tuple[ModalTest, Reading]] = {}
        self.columns = replace(self.columns, slopes=self._slopes_at_baseline())
        self._residual = np.zeros(len(self.modes))
        self._residual = self._mean_residual([self._seen(test) for test in usable])

    def reading(self, test: ModalTest, time: datetime) -> Reading:
        """Return what a test by itself states of the quantities; it was made at `time`.

        Modes that the baseline does not have are left out, and so are those that fit no state of
        the hanger which the others fit: mistaken ones. Where too many are, none is, and all count
        for less than their errors say. A test without any mode that the baseline has, or of
        conditions that the model class cannot describe, says nothing: information 0. A test is
        read once, since rules that compare it with others ask again.
        """
        known, found = self._known.get(id(test), (None, None))
        if found is None or known is not test:
            found = self._read(test, time)
            self._known[id(test)] = test, found
        return replace(found, time=time)

    def _read(self, test: ModalTest, time: datetime) -> Reading:
        count = len(self.quantities)
        blind = Reading(test.id, time, test.temperature_c, np.zeros(count), np.zeros((count,) * 2))
        if not (_is_described(test, self._model) and len((seen := self._seen(test)).own)):
            return blind
        sound, n = self._sound(seen), len(self.modes)
        wrong = np.zeros(n, bool)
        wrong[seen.own[~sound]] = True
        seen = seen.taken(sound)
        linear, sd = self._likelihood.settled(seen), np.sqrt(seen.variance)
        moved_by = linear.residual + linear.slopes @ linear.x
        mean, information = self._likelihood.read(linear, moved_by)
        values, variances = np.zeros(n), np.full(n, np.inf)
        values[seen.own] = sd * linear.residual + self.columns.slopes[seen.own] @ linear.x
        # Stated errors are taken to be off by a factor that the misfit tells, as far as it can.
        variances[seen.own] = _error_inflation(linear.residual, count) * seen.variance
        softer = np.zeros(n) if self._is_warmth_known(test) else self._per_kelvin
        modes = ModeReading(values, variances, softer, wrong)
        return replace(
            blind, mean=mean, information=information, modes=modes, amplitude=test.amplitude
        )

    def _slopes_at_baseline(self) -> FloatArray:
        n, (planes, orders) = len(self.modes), zip(*self.modes, strict=True)
        plane = np.array([PLANES.index(each) for each in planes])
        order, still = np.array(orders) - 1, np.zeros(len(self.quantities))
        every = SeenModes(Conditions(), plane, order, np.arange(n), np.zeros(n), np.ones(n))
        return self._likelihood.linear(still, every).slopes

    def _sound(self, seen: SeenModes) -> BoolArray:
        """Return which modes (n,) are not mistaken: more probably good than off by anything.

        Each is good with its error and scatter or, seldom, anywhere. Which are mistaken is asked
        anew about the state that the others give, for only near it are frequencies linear: once
        springs have moved, what looked mistaken from the baseline may be none.
        """
        every = np.ones(len(seen.own), bool)
        if len(seen.own) < len(self.quantities) + 2:
            return every
        still, none = np.zeros(len(self.quantities)), self._loosening[:, :0]
        found = self._sound_by(seen, none, still)
        if found.sound.all():
            return every
        slack = self._sound_by(seen, none, self._likelihood.far_start(seen))
        found = max(found, slack, key=lambda each: each.log_evidence)
        if self._loosening.size:
            loose = self._sound_by(seen, self._loosening, still)
            if loose.log_evidence + math.log(LIMITS.loosened) > found.log_evidence:
                found = loose
        return found.sound if (~found.sound).sum() <= MOST_MISTAKEN * len(every) else every

    def _sound_by(self, seen: SeenModes, more: FloatArray, start: FloatArray) -> SoundModes:
        """Find the sound modes where the quantities, and `more` (modes, k), may have moved.

        The quantities are sought from `start` (q,) on.
        """
        variance, more = seen.variance + self._scatter**2, more[seen.own]
        wide, sd = replace(seen, variance=variance), np.sqrt(variance)
        pull = np.append(
            self._likelihood.pull, np.full(more.shape[1], 1 / LIMITS.loosened_steps**2)
        )
        x = start
        for _ in range(LIMITS.rounds):
            linear = self._likelihood.linear(x, wide)
            off = sd * (linear.residual + linear.slopes @ x)
            slopes = np.hstack([sd[:, None] * linear.slopes, more])
            found = sound_modes(off, slopes, variance, pull)
            x = self._likelihood.inside(found.x[: len(x)])
        is_near = np.abs(off - slopes @ found.x) < LIMITS.least_mistake
        return replace(found, sound=found.sound | is_near)

    def _is_warmth_known(self, test: ModalTest) -> bool:
        return math.isfinite(test.temperature_c) and math.isfinite(self.reference_temperature_c)

    def _mean_residual(self, tests: Sequence[SeenModes]) -> FloatArray:
        """Return measured less predicted log frequency (modes,), the mean over the tests."""
        base, n = np.zeros((1, len(self.quantities))), len(self.modes)
        off = [seen.log_frequency - self._likelihood.predicted(base, seen)[0] for seen in tests]
        its = np.concatenate([seen.own for seen in tests])
        weight = 1 / np.concatenate([seen.variance for seen in tests])
        total = np.bincount(its, weight * np.concatenate(off), n)
        return np.asarray(total / np.bincount(its, weight, n))

    def _seen(self, test: ModalTest) -> SeenModes:
        read = (mode for mode in test.regular_modes if _is_measured(mode))
        modes = [mode for mode in read if _key(mode) in self.modes]
        its = np.array([self.modes.index(_key(mode)) for mode in modes], dtype=int)
        frequency_hz = np.array([mode.frequency_hz for mode in modes], dtype=float)
        sd_hz = np.array([mode.frequency_sd_hz for mode in modes], dtype=float)
        sd = np.where(sd_hz > 0, sd_hz / frequency_hz, self._unstated_sd)
        variation = (
            (test.temperature_c - self.reference_temperature_c) * self._per_kelvin[its]
            if self._is_warmth_known(test)
            else 0.0
        )
        return SeenModes(
            conditions=self._model.conditions(test),
            plane=np.array([PLANES.index(mode.plane) for mode in modes], dtype=int),
            order=np.array([mode.order - 1 for mode in modes], dtype=int),
            own=its,
            log_frequency=np.log(frequency_hz) - self._residual[its] - variation,
            variance=sd**2 + LIMITS.frequency_allowance**2,
        )


def mean_temperature_c(tests: Sequence[ModalTest]) -> float:
    """Of those tests that have one; NaN where none has."""
    known = [test.temperature_c for test in tests if math.isfinite(test.temperature_c)]
    return sum(known) / len(known) if known else math.nan


def _key(mode: Mode) -> MeasuredMode:
    return mode.plane, mode.order


def _is_measured(mode: Mode) -> bool:
    """Return True if the mode has a frequency whose error is not endless."""
    return (
        bool(np.isfinite(mode.frequency_hz))
        and mode.frequency_hz > 0
        and not np.isinf(mode.frequency_sd_hz)
    )


def _is_described(test: ModalTest, model: Model) -> bool:
    """Return True if the class can describe the conditions of a test."""
    try:
        model.refuse(test)
    except BadInput:
        return False
    return True
