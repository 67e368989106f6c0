"""The state of the watch of a stream from one reading to the next, of a bounded size.

Beside modes and filters it is the conditions: temperatures as they lag, the level and the wind at
first, and the modes of the last day, by which a change is told apart.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import pairwise

import numpy as np

from shm.assumptions import DEFAULTS, Assumptions
from shm.errors import BadInput
from shm.values import NAN, FloatArray, Mode
from shm.values.stream import PooledReading, WindowReading
from shm.watch.alert_state import AlertState
from shm.watch.kept_state import from_bytes, to_bytes
from shm.watch.stream_filter import FEATURES, Bank
from shm.watch.stream_reading import ModeTable, SeenReading, exchanged
from shm.watch.stream_thermometer import Believed, Thermometer, believed

HOURS_A_DAY = 24.0  # by definition
# Of the temperature: 3 hours' mean, a day's, ten days'.
_LAGS_DAYS = np.array([2.0, 14.0, 240.0]) / HOURS_A_DAY
# Judgement: by what an hour's temperature differs from ten days' mean, and that the errors of some
# ten hours without a thermometer are one error: an hour counts for a third of what it would.
_UNKNOWN_K, TOGETHER = 4.0, 3.0
HOURS_EXCHANGED, _SURELY_EXCHANGED = 3, 8
"""Judgement: until it is told, as mistaken modes look like it for an hour; and until it is over."""
NO_CONDITIONS = np.zeros(0)
"""Of the contrast of the planes: what the weather does to one more than the other is its wander."""
_RING = 24  # readings: a change is told within a day or is slow
OLD_READINGS = 120.0  # judgement: five days, as what a mode differs by is learnt over


def condition_sd(assumed: Assumptions) -> FloatArray:
    """Return the prior sds of what the conditions do to ln T.

    A kelvin now, of 3 hours', a day's and ten days' mean; the square of a kelvin (judgement: 0.2 %
    at 10 K); an e-fold of the excitation; a m/s of wind (judgement: a storm of 20 m/s moves a
    deck's loads by 0.4 %); and the sun's round (judgement).
    """
    kelvin, e_fold = assumed.tension_per_kelvin_sd.value, assumed.tension_per_amplitude_sd.value
    return np.array([kelvin] * 4 + [2e-5, e_fold, 2e-4] + [1e-3] * 6)


@dataclass(frozen=True)
class Reported:
    """A change that was told: by how much, and from where on; 0 where none is in force."""

    shift: float = 0.0
    since: float = 0.0

    def after(self, before: float, now: float) -> Reported:
        """Return what is in force after a change; what was told is until half of it is back."""
        if self.shift and (now - self.since) / self.shift < 0.5:
            return self
        since = self.since if self.shift else before
        return Reported(now - since, since)


@dataclass(frozen=True, eq=False)
class StreamState:
    """The state from reading to reading. Days count from `start`.

    `lagged_c` are the temperature's exponential means, `reference` its first value, that of the
    log level and of the wind; `known_day` is the last with a temperature. `ring` (24, n) are the
    newest readings' modes with the conditions taken off, `ring_day` their days, `old` (n,) the mean
    of those before. Shifts count from `zero`, compensated ones from `compensated_zero`; a change
    that was told of the tension is `called`, of one plane `apart`. `contrast` are the filters of
    what one plane says more than the other, less what was `absorbed` into the modes' levels.
    So many hours the planes were exchanged. `unknown_sd` of ln T is what an unknown temperature may
    do, 0 where it is known. Up to `settled_day` readings are gone over again: no
    alert ends before.
    """

    key: str
    start: datetime
    table: ModeTable
    bank: Bank
    contrast: Bank
    lagged_c: FloatArray
    reference: FloatArray
    ring: FloatArray
    ring_day: FloatArray
    old: FloatArray
    known_day: float = 0.0
    zero: float = 0.0
    compensated_zero: float = 0.0
    readings: int = 0
    is_learning: bool = True
    called: Reported = Reported()
    apart: Reported = Reported()
    absorbed: float = 0.0
    told: AlertState = field(default_factory=AlertState)
    standing: tuple[str, ...] = ()
    exchanged_hours: int = 0
    settled_day: float = 0.0
    unknown_sd: float = 0.0
    thermometer: Thermometer = field(default_factory=Thermometer)

    @classmethod
    def begun(
        cls, key: str, start: datetime, table: ModeTable, assumed: Assumptions = DEFAULTS
    ) -> StreamState:
        n = len(table.modes)
        return cls(
            key,
            start,
            table,
            Bank.begun(0.0, condition_sd(assumed)),
            Bank.begun(0.0, NO_CONDITIONS),
            lagged_c=np.full(3, NAN),
            reference=np.full(3, NAN),
            ring=np.zeros((0, n)),
            ring_day=np.zeros(0),
            old=np.full(n, NAN),
        )


def gone_back(earlier: bytes, newest: bytes) -> bytes:
    """An earlier state, from which to go over the readings up to the newest again, with those that
    came late. What stands by now stands until then: it is not told and not ended twice.
    """
    state, last = from_bytes(StreamState, earlier), from_bytes(StreamState, newest)
    ahead = (last.start - state.start).total_seconds() / 86400
    settled = max(state.settled_day, ahead + last.bank.day, ahead + last.settled_day)
    standing = tuple(dict.fromkeys((*state.standing, *last.standing)))
    return to_bytes(replace(state, settled_day=settled, standing=standing))


def as_mounted(state: StreamState, modes: tuple[Mode, ...]) -> tuple[StreamState, tuple[Mode, ...]]:
    """The modes in the planes that were always theirs, where those of the sensors are exchanged."""
    found = None if state.is_learning else state.table.are_exchanged(modes)
    hours = state.exchanged_hours
    if found or (found is None and hours >= HOURS_EXCHANGED):
        hours = hours + 1 if hours < HOURS_EXCHANGED else _SURELY_EXCHANGED
    elif found is not None:
        hours = hours - 1 if hours > HOURS_EXCHANGED + 1 else 0
    return replace(state, exchanged_hours=hours), exchanged(modes) if hours else modes


def with_believed(
    kept: bytes | None, readings: Sequence[WindowReading]
) -> tuple[bytes | None, Believed]:
    """Return windows with the temperatures that are believed, and the state that goes on.

    None where nothing was kept, or what cannot be read: the stream is then learnt again.
    """
    try:
        state = None if kept is None else from_bytes(StreamState, kept)
    except BadInput:
        state = None
    if state is None:
        return None, believed(Thermometer(), readings, learning=True)
    found = believed(state.thermometer, readings, learning=state.is_learning)
    return to_bytes(replace(state, thermometer=found.thermometer)), found


def windows_as_mounted(
    kept: bytes | None, readings: Sequence[WindowReading]
) -> Sequence[WindowReading]:
    """The windows with each mode in the plane that was always its own, by what the watch knows."""
    state = None if kept is None else from_bytes(StreamState, kept)
    if state is None or state.is_learning:
        return readings
    return [
        replace(each, modes=exchanged(each.modes))
        if state.table.are_exchanged(each.modes)
        else each
        for each in readings
    ]


def warmth(state: StreamState) -> float:
    """Of the steel: an hour or three behind the air's."""
    warmth = float(state.lagged_c[0] - state.reference[0])
    return warmth if math.isfinite(warmth) else 0.0


def with_conditions(
    state: StreamState, reading: PooledReading, day: float
) -> tuple[StreamState, FloatArray, float]:
    """Return the conditions of a reading, and the variance that unknown ones add to it."""
    level = math.log(reading.level_m_s2) if reading.level_m_s2 > 0 else NAN
    now = np.array([reading.temperature_c, level, reading.wind_m_s])
    reference = np.where(np.isfinite(state.reference), state.reference, now)
    lagged, known_day, extra = state.lagged_c, state.known_day, 0.0
    if math.isfinite(reading.temperature_c):
        share = -np.expm1((known_day - day) / _LAGS_DAYS)
        lagged = np.where(np.isfinite(lagged), lagged + share * (now[0] - lagged), reference[0])
        kelvin, known_day = np.array([now[0], *lagged, reference[0]]), day
    else:  # as warm as it was in the last ten days, give or take what a day brings
        kelvin = np.nan_to_num(np.append(np.full(4, lagged[-1]), reference[0]))
        of_kelvin = range(FEATURES, FEATURES + len(_LAGS_DAYS))
        square = sum(
            sum(part**2 for part in state.bank.along(unit))
            for unit in np.eye(state.bank.mean.shape[1])[of_kelvin]
        )
        extra = TOGETHER * square * _UNKNOWN_K**2 if math.isfinite(lagged[-1]) else 0.0
    now = np.where(np.isfinite(now), now, reference)
    steps = [before - behind for before, behind in pairwise(kelvin)]
    hour = 2 * math.pi * ((state.start.hour + state.start.minute / 60) / HOURS_A_DAY + day)
    others = np.nan_to_num(now[1:] - reference[1:])
    warm = kelvin[2] - kelvin[4]
    rounds = hour * np.arange(1, 4)
    conditions = np.array([*steps, warm**2, *others, *np.sin(rounds), *np.cos(rounds)])
    state = replace(
        state,
        lagged_c=lagged,
        reference=reference,
        known_day=known_day,
        unknown_sd=math.sqrt(extra / TOGETHER),
    )
    return state, conditions, extra


def with_ring(
    state: StreamState, seen: SeenReading, conditions: FloatArray, day: float
) -> StreamState:
    """With the modes of one more reading, what the conditions do taken off."""
    bank, n = state.bank, len(state.table.modes)
    of_conditions = np.concatenate([np.zeros(len(bank.mean[0]) - len(conditions)), conditions])
    now = seen.off - state.table.tension * bank.along(of_conditions)[0]
    grown = np.full((len(state.ring), n), NAN)
    grown[:, : state.ring.shape[1]] = state.ring
    old = np.append(state.old, np.full(n - len(state.old), NAN))
    ring, days = np.vstack([grown, now]), np.append(state.ring_day, day)
    if len(ring) > _RING:
        left, ring, days = ring[0], ring[1:], days[1:]
        share = 1 / min(max(state.readings - _RING, 1), OLD_READINGS)
        mixed = np.where(np.isfinite(left), old + share * (left - old), old)
        old = np.where(np.isfinite(old), mixed, left)
    return replace(state, ring=ring, ring_day=days, old=old)
