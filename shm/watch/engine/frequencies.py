"""Watch a structure without a model: its log frequencies, against its own first tests.

Each frequency is a quantity with its own coefficients of temperature, frost and excitation. All may
move alike (mass, stiffness, a clock), one alone, or each by its own amount; the decision is that of
`change_point`. Tests of three days are pooled, each mode by its median, and all tests within 45
days share what wanders: moisture, ice in the joints, ballast.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime

import numpy as np
import scipy

from shm.assumptions import DEFAULTS
from shm.errors import BadInput
from shm.values import FREQUENCY, ModalTest, ModeReading, Reading, WatchedQuantity
from shm.watch.engine.causes import UNEXPLAINED, Columns, Direction, Layout, Structure
from shm.watch.engine.limits import LIMITS
from shm.watch.engine.options import DAYS_PER_YEAR, WatchOptions, reference_of
from shm.watch.engine.quantities import MeasuredMode

POOLED_DAYS = 3.0  # judgement: short beside three weeks in which an owner wants to know, and cheap


class FrequencyReader:
    """Reads tests of one structure against its baseline: log frequencies beside their first level.

    Raises BadInput where no test of the baseline has a mode.
    """

    def __init__(self, tests: Sequence[ModalTest]):
        found: dict[MeasuredMode, list[float]] = {}
        for test in tests:
            for key, (hz, _) in _frequencies(test).items():
                found.setdefault(key, []).append(math.log(hz))
        if not found:
            raise BadInput("The first tests hold no mode.", remedy="Give tests with modes.")
        self.modes: tuple[MeasuredMode, ...] = tuple(sorted(found))
        self._level = np.array([float(np.median(found[key])) for key in self.modes])
        n = len(self.modes)
        # No model says what causes do.
        self.columns = Columns(self.modes, {}, np.zeros((n, n)), slopes=np.eye(n))
        self.quantities = tuple(map(_quantity, self.modes, self._level.tolist()))

    @property
    def levels_hz(self) -> dict[str, float]:
        """The baseline's frequencies by their names."""
        return {each.name: each.baseline for each in self.quantities}

    def reading(self, tests: Sequence[ModalTest], time: datetime) -> Reading:
        """Return the pooled `tests`: medians of each mode, their mean temperature and level."""
        n = len(self.modes)
        rows = [self._matched(test) for test in tests]
        values, variances = np.zeros(n), np.full(n, np.inf)
        for j in range(n):
            seen = [row[j] for row in rows if j in row]
            if seen:
                values[j] = float(np.median([value for value, _ in seen]))
                # The median of m has pi / 2 times the variance of the mean, of up to two the same.
                wider = math.pi / 2 if len(seen) > 2 else 1.0
                its = wider * float(np.mean([sd**2 for _, sd in seen])) / len(seen)
                variances[j] = its + LIMITS.frequency_allowance**2
        levels = [math.log(test.amplitude) for test in tests if test.amplitude > 0]
        return Reading(
            test=tests[-1].id,
            time=time,
            temperature_c=reference_of([test.temperature_c for test in tests]),
            mean=values,
            information=np.diag(1 / variances),
            modes=ModeReading(values, variances, np.zeros(n), np.zeros(n, dtype=bool)),
            amplitude=math.exp(float(np.mean(levels))) if levels else math.nan,
        )

    def _matched(self, test: ModalTest) -> dict[int, tuple[float, float]]:
        """Log frequency over the level and its sd by mode: as named, or by the nearest frequency.

        Two close modes are exchanged in one test in a hundred, and a mode that a test lacks makes
        the orders above it too low.
        """
        seen = _frequencies(test)
        if not seen:
            return {}
        log_hz = np.log([hz for hz, _ in seen.values()])
        cost = np.abs(log_hz[:, None] - self._level)
        named = np.array([[key == mode for mode in self.modes] for key in seen])
        cost = cost + np.where(named, 0.0, LIMITS.renamed)
        # A name that the baseline does not know may be none of its modes.
        nearby = np.where(named.any(axis=1), np.inf, LIMITS.renamed + 0.5 * LIMITS.renamed)
        nothing = np.where(np.eye(len(seen), dtype=bool), nearby[:, None], 1e6)
        nothing[~np.isfinite(nothing)] = 1e3
        at, to = scipy.optimize.linear_sum_assignment(np.hstack([cost, nothing]))
        sds = [sd for _, sd in seen.values()]
        return {
            int(j): (float(log_hz[i] - self._level[j]), sds[i])
            for i, j in zip(at.tolist(), to.tolist(), strict=True)
            if j < len(self.modes)
        }


def _frequencies(test: ModalTest) -> dict[MeasuredMode, tuple[float, float]]:
    """Frequency and its relative sd of each mode that was measured; the first of a name counts."""
    unstated = DEFAULTS.unstated_frequency_sd.value  # a structure has no assumptions of its own
    found: dict[MeasuredMode, tuple[float, float]] = {}
    for mode in test.modes:
        hz, sd = mode.frequency_hz, mode.frequency_sd_hz
        if math.isfinite(hz) and hz > 0 and not math.isinf(sd):
            found.setdefault((mode.plane, mode.order), (hz, sd / hz if sd > 0 else unstated))
    return found


def _quantity(mode: MeasuredMode, level: float) -> WatchedQuantity:
    plane, order = mode
    reach = np.linspace(-2.0, 2.0, 5)  # technical: a frequency sevenfold or a seventh
    hz = math.exp(level)
    return WatchedQuantity(
        f"{FREQUENCY}{plane} {order}",
        hz,
        reach,
        hz * np.exp(reach),
        LIMITS.frequencies_step,
        plane=plane,
    )


def structure_of_frequencies(n: int, options: WatchOptions) -> Structure:
    """Return the hypotheses of `n` frequencies."""
    ones = np.ones(n)
    prior_sd = np.concatenate(
        [
            ones,
            LIMITS.frequencies_step * ones,
            LIMITS.per_kelvin_sd * ones,
            LIMITS.per_kelvin_of_frost_sd * ones,
            options.tension_per_amplitude_sd * ones,
            [
                1.0,
                LIMITS.creep_per_year_sd,
            ],  # nothing stiffens with the excitation beside the modes
        ]
    )
    its = np.vstack([np.zeros((n, n)), LIMITS.frequencies_step * np.eye(n)])
    each = np.vstack([LIMITS.frequencies_step * np.eye(n), np.zeros((n, n))])
    directions = [
        Direction(
            "alike", its.sum(axis=1, keepdims=True), tuple(range(n)), math.log(LIMITS.alike_share)
        )
    ]
    if n > 1:
        directions += [
            Direction("alone", its[:, [j]], (j,), math.log(LIMITS.alone_share / n))
            for j in range(n)
        ]
        directions.append(Direction(UNEXPLAINED, each, (), math.log(LIMITS.each_share)))
    wander = np.hstack([LIMITS.wander * ones[:, None], LIMITS.wander_of_a_mode * np.eye(n)])
    return Structure(
        layout=Layout(n, n, prior_sd),
        slopes=np.eye(n),
        directions=tuple(directions),
        scattering=ones[:, None],
        scatter_variance=np.append(np.full(n, LIMITS.scatter_of_a_mode), LIMITS.frequencies_scatter)
        ** 2,
        scales=np.array(options.scatter_scales),
        stiffening=np.zeros(n),
        wander=wander,
        wander_years=LIMITS.wander_days / DAYS_PER_YEAR,
        thermal_laws=2,
        is_modelled=False,
    )
