"""Read the watched quantities from one test: Gauss-Newton of the model class, without a prior.

The model's error, 0.1 to 1 % of a frequency, is the same in every test of a hanger, and so are the
deviations of the bar as made. Each mode's own residual at the baseline is therefore taken off
before anything is read, and what is left over are the errors of the identification.

A reading is the likelihood linearised where it is largest (Gauss and Newton; Bjoerck 1996,
Numerical Methods for Least Squares Problems). A weak pull to the baseline chooses that place where
the data do not; it has no part in the reading's mean and information.

Steel softens as it warms, by 0.03 % of its modulus per kelvin: over the year a stiff hanger's
frequencies swing by half a percent, as if its tension and its ends moved. What the modulus does is
known and taken off, too, from the mean temperature of the baseline's tests on. Where a test has no
temperature, the reading says what a kelvin has done to it.

Springs that frequencies cannot tell apart move together: how unlike two springs are that are nearly
alike shows in the square of the difference only, and no normal distribution could follow it. One
of the two that moves alone is read as a move of both, and a part of it as tension: for a loss of
30 % up to 0.5 % of it where the softer spring has 1e7 N m/rad and both planes are measured, more
where it is softer still.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np

from shm.errors import BadInput
from shm.models import Model, class_of
from shm.values import (
    PLANES,
    BoolArray,
    FloatArray,
    Hanger,
    IntArray,
    ModalTest,
    Mode,
    ModeReading,
    Posterior,
    Reading,
)
from shm.watch.causes import columns_of, mounted_kg
from shm.watch.linear_reading import Likelihood, LinearReading, SeenModes
from shm.watch.mistaken_modes import MOST_MISTAKEN, SoundModes, sound_modes
from shm.watch.quantities import MeasuredMode, base_point, watched_quantities
from shm.watch.reading_corrections import AmplitudeSlopes, loosening_of, softening

_FREQUENCY_ALLOWANCE = 1e-4

# Mode by mode two tests of one state differ by more than is stated: the sensors' mass and place, a
# joint that gives. Judgement, the better end of what repeated tests of real hangers show.
_MODE_SCATTER = 1e-3
_LOOSENED_STEPS = 6.0  # judgement: of the largest change of an end that is looked for
_LOOSENED = 0.5  # of tests with a mode that seems mistaken, judgement: an end has loosened
# Of a log frequency: a mode that is off by less may be so by its joint or its sensor.
_LEAST_MISTAKE = 0.006
_ROUNDS = 3  # technical: of "which modes are sound" and "where they lie"
_PRIOR_FREEDOM = 4.0  # judgement: stated sds are off by a factor of up to two


class Reader:
    """Reads tests of one hanger against its baseline.

    Made of the baseline's posterior and its tests, which may be of any conditions. Raises BadInput
    where these hold no mode. `reference_temperature_c` is their mean, NaN where none has one.
    `frequency_allowance`, a fraction of a frequency, is what two tests
    may differ by beyond their stated errors: a logger's clock, a tenth of a kelvin.
    """

    def __init__(
        self,
        baseline: Posterior,
        tests: Sequence[ModalTest],
        hanger: Hanger,
        *,
        frequency_allowance: float = _FREQUENCY_ALLOWANCE,
    ):
        self._model = class_of(baseline, hanger)
        self._base = base_point(baseline, self._model)
        self._allowance = frequency_allowance
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
        self._per_amplitude = AmplitudeSlopes.of(usable, self.modes)
        mass_kg = hanger.mass_per_length_kg_m * hanger.length_m
        self._unstated_sd = hanger.assumptions.unstated_frequency_sd.value
        sensors_kg = mounted_kg(hanger)
        self._scatter = math.hypot(_MODE_SCATTER, sensors_kg / mass_kg / math.sqrt(8))
        self._loosening = np.vstack(self.columns.loosening).T
        self._known: dict[int, tuple[ModalTest, Reading]] = {}
        self._residual = np.zeros(len(self.modes))
        self._residual = self._own_residual([self._seen(test) for test in usable])

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
        sound = self._sound(seen)
        mistaken, seen = seen.own[~sound], seen.taken(sound)
        linear = self._likelihood.settled(seen)
        misfit = linear.residual + linear.slopes @ linear.x
        softer = self._per_kelvin[seen.own] / np.sqrt(seen.variance)
        (mean, per_kelvin), information = self._likelihood.read(linear, np.array([misfit, softer]))
        left = None if self._is_warmth_known(test) else per_kelvin
        modes = self._by_mode(seen, linear, mistaken, is_warmth_known=left is None)
        return replace(
            blind,
            mean=mean,
            information=information,
            per_kelvin=left,
            modes=modes,
            amplitude=test.amplitude,
        )

    def _by_mode(
        self, seen: SeenModes, linear: LinearReading, mistaken: IntArray, *, is_warmth_known: bool
    ) -> ModeReading:
        """Return the same for each of the baseline's modes.

        Stated errors are taken to be off by a factor that the misfit tells, as far as it can.
        """
        sd, n = np.sqrt(seen.variance), len(self.modes)
        free = max(len(seen.own) - len(linear.x), 0)
        misfit = float(linear.residual @ linear.residual)
        larger = max(1.0, (_PRIOR_FREEDOM + misfit) / (_PRIOR_FREEDOM + free))
        values, variances = np.zeros(n), np.full(n, np.inf)
        slopes = np.zeros((n, len(linear.x)))
        values[seen.own] = sd * (linear.residual + linear.slopes @ linear.x)
        variances[seen.own] = larger * seen.variance
        slopes[seen.own] = sd[:, None] * linear.slopes
        wrong = np.zeros(n, bool)
        wrong[mistaken] = True
        softer = np.zeros(n) if is_warmth_known else self._per_kelvin
        return ModeReading(values, variances, slopes, softer, wrong)

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
        if slack.log_evidence > found.log_evidence:
            found = slack
        if self._loosening.size:
            loose = self._sound_by(seen, self._loosening, still)
            if loose.log_evidence + math.log(_LOOSENED) > found.log_evidence:
                found = loose
        return found.sound if (~found.sound).sum() <= MOST_MISTAKEN * len(every) else every

    def _sound_by(self, seen: SeenModes, more: FloatArray, start: FloatArray) -> SoundModes:
        """Find the sound modes where the quantities, and `more` (modes, k), may have moved.

        The quantities are sought from `start` (q,) on.
        """
        variance, more = seen.variance + self._scatter**2, more[seen.own]
        wide, sd = replace(seen, variance=variance), np.sqrt(variance)
        pull = np.append(self._likelihood.pull, np.full(more.shape[1], 1 / _LOOSENED_STEPS**2))
        x = start
        for _ in range(_ROUNDS):
            linear = self._likelihood.linear(x, wide)
            off = sd * (linear.residual + linear.slopes @ x)
            slopes = np.hstack([sd[:, None] * linear.slopes, more])
            found = sound_modes(off, slopes, variance, pull)
            x = self._likelihood.inside(found.x[: len(x)])
        is_near = np.abs(off - slopes @ found.x) < _LEAST_MISTAKE
        return replace(found, sound=found.sound | is_near)

    def _is_warmth_known(self, test: ModalTest) -> bool:
        return math.isfinite(test.temperature_c) and math.isfinite(self.reference_temperature_c)

    def _own_residual(self, tests: Sequence[SeenModes]) -> FloatArray:
        """Measured less predicted log frequency (modes,), over the tests.

        The weighted mean; of three tests or more the median of what is left of each once its own
        state is taken off, so that a mistaken mode of one of them moves nothing.
        """
        its = np.concatenate([seen.own for seen in tests])
        base = np.zeros((1, len(self.quantities)))
        off = [seen.log_frequency - self._likelihood.predicted(base, seen)[0] for seen in tests]
        if len(tests) < _ROUNDS:
            weight = 1 / np.concatenate([seen.variance for seen in tests])
            total = np.bincount(its, weight * np.concatenate(off), len(self.modes))
            return np.asarray(total / np.bincount(its, weight, len(self.modes)))
        table = np.full((len(tests), len(self.modes)), np.nan)
        for row, seen, each in zip(table, tests, off, strict=True):
            row[seen.own] = each
        residual = np.nanmedian(table, axis=0)
        for _ in range(_ROUNDS):
            common = np.nanmedian(table - residual, axis=1)
            residual = np.nanmedian(table - common[:, None], axis=0)
        return np.asarray(residual)

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
        slip, slip_sd = self._per_amplitude.at(test, modes, its)
        return SeenModes(
            conditions=self._model.conditions(test),
            plane=np.array([PLANES.index(mode.plane) for mode in modes], dtype=int),
            order=np.array([mode.order - 1 for mode in modes], dtype=int),
            own=its,
            log_frequency=np.log(frequency_hz) - self._residual[its] - variation - slip,
            variance=sd**2 + slip_sd**2 + self._allowance**2,
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
