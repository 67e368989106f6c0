"""The watch of a permanent sensor: pooled readings of each hour, one after the other, for good.

Each reading becomes a shift of the tension (`stream_reading`), which the filters explain by what
the conditions do, or by a change (`stream_filter`). A detected change is told apart by its pattern
over the modes: a tension moves each by its sensitivity, springs the lower ones of a stiff bar more,
a time base all alike, a sensor those of one plane. What is the measurement's is an event of the
stream and rings nobody. All that the next reading needs is kept as bytes of a bounded size.

The first days are the baseline: nothing is told in them. Later, what is not learnt yet, such as
the winter's temperatures in the first summer, is unknown to the filters, and makes them careful.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from shm.errors import BadInput
from shm.values import (
    NAN,
    TENSION,
    Alert,
    Change,
    Drift,
    FloatArray,
    Hanger,
    Moved,
    Posterior,
    WatchedTest,
)
from shm.values.stream import PooledReading, StreamEvent
from shm.watch.alert_state import AlertState
from shm.watch.stream_filter import FAST, FEATURES, LEVEL, NOTHING, SLOW, Bank, Evidence
from shm.watch.stream_reading import (
    MODEL_OFF,
    TIME_BASE,
    Cause,
    ModeTable,
    SeenReading,
    cause_of,
    usable,
)
from shm.watch.watching import after

_VERSION = "stream-watch-1"
_LENGTH = {"hour": 1.0, "six hours": 6.0, "day": 24.0}
_HOURS_A_DAY = 24.0
# Prior sds of what the conditions do to ln T: a kelvin now, over 3 hours' mean, over a day's, over
# ten days' (1e-3 each: `WatchOptions.tension_per_kelvin_sd`), that of its square (judgement: 0.2 %
# at 10 K), an e-fold of the excitation (`tension_per_amplitude_sd`), a m/s of wind (judgement: a
# storm of 20 m/s moves a deck's loads by 0.4 %), and the sun's round (judgement).
_LAGS_DAYS = np.array([2.0, 14.0, 240.0]) / _HOURS_A_DAY
_CONDITION_SD = np.array([1e-3] * 4 + [2e-5, 2e-3, 2e-4] + [1e-3] * 6)
# Judgement: by what an hour's temperature differs from ten days' mean, and that the errors of some
# ten hours without a thermometer are one error: an hour counts for a third of what it would.
_UNKNOWN_K, _TOGETHER = 4.0, 3.0
_DAY_SD = 1e-4  # of ln f: what a mode keeps for a day, by joints that seat anew. Judgement
_RING = 24  # readings: a change is told within a day or is slow
_OLD_READINGS = 120.0  # judgement: five days, as what a mode differs by is learnt over
_CALLS_KEPT = 8  # technical: of changes that were told, so that what is kept stays bounded


@dataclass(frozen=True)
class StreamOptions:
    """`limit_years` is the mean time to a false call, a hanger's own `false_call_years` goes first.

    Less than `least_shift` of the tension is not told; `learning_days` are the baseline.
    """

    limit_years: float = 100.0
    change_rate_per_year: float = 0.02
    least_shift: float = 0.005
    learning_days: float = 3.0


@dataclass(frozen=True, eq=False)
class StreamWatched:
    """After one reading: the tension's shift since the baseline as it is, and what it would be
    under the baseline's conditions (`compensated`); fractions. NaN without a usable mode.

    `ended` are the keys of alerts whose condition is over. `learning` says since when it learns and
    what is missing; empty once it watches.
    """

    kept: bytes
    tension_shift: float
    tension_shift_sd: float
    compensated_shift: float
    compensated_sd: float
    test: WatchedTest | None
    alert: Alert | None
    events: tuple[StreamEvent, ...]
    ended: tuple[str, ...]
    learning: str


@dataclass(frozen=True, eq=False)
class StreamState:
    """What goes from reading to reading. Days count from `start`.

    `lagged_c` are the temperature's exponential means, `reference` its first value, that of the
    log level and of the wind; `known_day` the last with a
    temperature; `ring` (24, n) are the newest readings' modes with the conditions
    taken off, `ring_day` their days, `old` (n,) the mean of those before.
    """

    key: str
    start: datetime
    table: ModeTable
    bank: Bank
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
    called_from: float = 0.0
    called_shift: float = 0.0
    told: AlertState = field(default_factory=AlertState)
    standing: tuple[str, ...] = ()

    @classmethod
    def begun(cls, key: str, start: datetime, table: ModeTable) -> StreamState:
        n = len(table.modes)
        return cls(
            key,
            start,
            table,
            Bank.begun(0.0, _CONDITION_SD),
            lagged_c=np.full(3, NAN),
            reference=np.full(3, NAN),
            ring=np.zeros((0, n)),
            ring_day=np.zeros(0),
            old=np.full(n, NAN),
        )

    def to_bytes(self) -> bytes:
        """The state as a line of JSON, and the bytes of all arrays after it."""
        arrays = {
            f"{name}.{each.name}": value
            for name, part in (("state", self), ("table", self.table), ("bank", self.bank))
            for each in fields(part)
            if isinstance(value := getattr(part, each.name), np.ndarray)
        }
        head = {name: getattr(self, name) for name in _SCALARS} | {
            "start": self.start.isoformat(),
            "day": self.bank.day,
            "watched": self.bank.watched,
            "tension_n": self.table.tension_n,
            "modes": self.table.modes,
            "told": self.told.to_text(),
            "arrays": [(name, each.dtype.str, each.shape) for name, each in arrays.items()],
        }
        return b"\n".join(
            [json.dumps(head).encode(), b"".join(map(np.ndarray.tobytes, arrays.values()))]
        )

    @classmethod
    def from_bytes(cls, content: bytes) -> StreamState:
        """The state back; raises BadInput where the content is no such state."""
        try:
            line, _, rest = content.partition(b"\n")
            head = json.loads(line)
            parts: dict[str, dict[str, Any]] = {"state": {}, "table": {}, "bank": {}}
            at = 0
            for name, kind, shape in head["arrays"]:
                part, _, own = name.partition(".")
                count = math.prod(shape)
                parts[part][own] = np.frombuffer(rest, kind, count, at).reshape(shape)
                at += parts[part][own].nbytes
            modes = tuple((plane, order) for plane, order in head["modes"])
            return cls(
                start=datetime.fromisoformat(head["start"]),
                table=ModeTable(modes=modes, tension_n=head["tension_n"], **parts["table"]),
                bank=Bank(day=head["day"], watched=head["watched"], **parts["bank"]),
                told=AlertState.from_text(head["told"]),
                **{name: head[name] for name in _SCALARS},
                **parts["state"],
            )
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise BadInput(
                f"A kept state of a stream's watch cannot be read: {error!r}.",
                remedy="Drop it: the watch then learns the stream's baseline anew.",
            ) from error


_SCALARS = (
    "key", "known_day", "zero", "compensated_zero", "readings", "is_learning", "called_from",
    "called_shift", "standing",
)  # fmt: skip


# ---------------------------------------------------------------- one reading


def watch_reading(
    baseline: Posterior | None,
    reading: PooledReading,
    hanger: Hanger,
    kept: bytes | None,
    options: StreamOptions | None = None,
) -> StreamWatched:
    """What one more reading of a hanger's stream says, by what was `kept` after those before.

    The sensitivities are those of the baseline's model class, else of the beam that fits the first
    reading. Where the hanger's description, its baseline or this watch itself have changed, it
    learns anew. A reading before the last one, or without a mode, says nothing. Raises BadInput for
    a structure without a model.
    """
    if not hanger.is_modelled:
        raise BadInput(
            f"hanger {hanger.id} has no model, so that its stream tells no tension.",
            remedy="Watch its daily tests (`watch_frequencies`).",
        )
    key = _key(baseline, hanger, reading.stream)
    state = None if kept is None else StreamState.from_bytes(kept)
    watch = StreamWatch(baseline, hanger, options or StreamOptions())
    found, state = watch.after(state if state and state.key == key else None, reading, key)
    return replace(found, kept=state.to_bytes() if state else b"")


def _key(baseline: Posterior | None, hanger: Hanger, stream: str) -> str:
    """What the state rests on; thresholds may change without a new beginning."""
    of = baseline and (baseline.model, baseline.seed, baseline.tests)
    described = (hanger.length_m, hanger.bending_stiffness_n_m2, hanger.mass_per_length_kg_m)
    rests_on = repr((hanger.id, described, stream, of))
    return f"{_VERSION} {hashlib.sha256(rests_on.encode()).hexdigest()}"


@dataclass(frozen=True, eq=False)
class StreamWatch:
    """The watch of one hanger's stream."""

    baseline: Posterior | None
    hanger: Hanger
    options: StreamOptions

    def after(
        self, state: StreamState | None, reading: PooledReading, key: str = ""
    ) -> tuple[StreamWatched, StreamState | None]:
        """After one more reading; the same with its state to go on from."""
        modes = usable(reading)
        end = reading.start + timedelta(hours=_LENGTH[reading.period])
        if state is None and modes:
            table = ModeTable.of(self.baseline, self.hanger, modes)
            state = StreamState.begun(key, reading.start, table)
        if (
            state is None
            or not modes
            or (end - state.start).total_seconds() / 86400 <= state.bank.day
        ):
            return _nothing(), state
        day = (end - state.start).total_seconds() / 86400
        state, conditions, extra = _with_conditions(state, reading, day)
        bank = state.bank.advanced(day, _CONDITION_SD)
        expected = bank.along(bank.design(conditions))[0]
        table = state.table.with_new(self.baseline, self.hanger, modes, expected)
        seen = table.seen(modes, _warmth(state))
        if not state.is_learning:
            bank = bank.with_beginning(state.bank.day)
        bank = bank.seen(seen.shift, seen.variance + extra, conditions)
        state = replace(state, table=table.learnt(seen), bank=bank, readings=state.readings + 1)
        state = _with_ring(state, seen, conditions, day)
        if state.is_learning:
            return self._learning(state, seen, end)
        return self._decided(state, seen, reading, end)

    def _learning(
        self, state: StreamState, seen: SeenReading, end: datetime
    ) -> tuple[StreamWatched, StreamState]:
        """The baseline grows: its mean is where the shifts count from."""
        n = state.readings
        zero = state.zero + (seen.shift - state.zero) / n
        days = self.options.learning_days
        # A night's gap is no end of learning: half of the hours at least.
        is_over = state.bank.day >= days and n >= days * _HOURS_A_DAY / 2
        compensated, _ = state.bank.along(_compensated(state.bank))
        state = replace(state, zero=zero, compensated_zero=compensated, is_learning=not is_over)
        since = f"{state.start:%Y-%m-%d %H:%M}"
        words = f"learning since {since}: {state.bank.day:.1f} of {days:g} days."
        return replace(_nothing(), learning="" if is_over else words), state

    def _decided(
        self, state: StreamState, seen: SeenReading, reading: PooledReading, end: datetime
    ) -> tuple[StreamWatched, StreamState]:
        evidence = state.bank.evidence(self.options.least_shift)
        events: tuple[StreamEvent, ...] = ()
        moved: tuple[Moved, ...] = ()
        if self._is_called(evidence):
            cause = _cause_of(state, evidence)
            if cause.is_measurement:
                events = (_event(cause, state, evidence, reading, end),)
                state, evidence = _absorbed(state, cause), NOTHING
            else:
                evidence = _sized(evidence, cause, state)
                moved = tuple(
                    replace(each, shift_mean=evidence.shift, shift_sd=evidence.shift_sd)
                    if each.quantity == TENSION
                    else each
                    for each in cause.moved
                )
                state = _changed(state, evidence)
        test = self._watched_test(state, evidence, moved, reading, end)
        told, alert = after(state.told, test, self.hanger)
        told = replace(told, called=told.called[-_CALLS_KEPT:])
        standing = (*state.standing, alert.key) if alert else state.standing
        ended = standing if alert is None and not told.beyond and not told.called else ()
        state = replace(state, told=told, standing=() if ended else standing)
        if ended:
            state = replace(state, called_shift=0.0)
        shift, sd = test.drifts[0].shift_mean, test.drifts[0].shift_sd
        own, own_sd = shift_of_reading(state, seen)
        return StreamWatched(b"", own, own_sd, shift, sd, test, alert, events, ended, ""), state

    def _is_called(self, evidence: Evidence) -> bool:
        return evidence.years > self._limit_years and evidence.material > 0.5

    @property
    def _limit_years(self) -> float:
        own = self.hanger.thresholds.false_call_years
        return self.options.limit_years if own is None else own

    def _watched_test(
        self,
        state: StreamState,
        evidence: Evidence,
        moved: tuple[Moved, ...],
        reading: PooledReading,
        end: datetime,
    ) -> WatchedTest:
        """The reading as the rules of alerts take any test."""
        rate = self.options.change_rate_per_year * evidence.years
        mean, sd = _shift(state)
        limits, table = self.hanger.thresholds, state.table
        chance = rate / (1 + rate)
        if state.called_shift:
            gone = (mean - state.called_from) / state.called_shift
            left = _beyond(gone - 0.5, sd / abs(state.called_shift))
            chance = max(left, chance) if moved else left
            if moved and gone < 0.5:  # it came back: the end of an alert, not another
                chance, evidence, moved = left, NOTHING, ()
        threshold = limits.tension_shift_fraction
        beyond = _beyond(mean - threshold, sd) + _beyond(-mean - threshold, sd)
        test = f"{reading.stream} {reading.start:%Y-%m-%dT%H:%M}"
        drift = Drift(
            self.hanger.id, test, end, TENSION, table.tension_n, table.tension_n * (1 + mean),
            mean, sd, threshold, beyond * chance,
        )  # fmt: skip
        change = Change(
            evidence_years=evidence.years if moved else min(evidence.years, self._limit_years),
            limit_years=self._limit_years,
            probability=chance,
            sudden=evidence.sudden,
            began_after=_at(state, evidence.after_day),
            began_by=_at(state, evidence.by_day),
            moved=moved,
            material_probability=evidence.material,
        )
        return WatchedTest(test, end, reading.temperature_c, (drift,), change)


def _beyond(mean: float, sd: float) -> float:
    return float(scipy.special.ndtr(mean / sd))


def _at(state: StreamState, day: float) -> datetime:
    return state.start + timedelta(days=state.bank.day if math.isnan(day) else day)


def _nothing() -> StreamWatched:
    return StreamWatched(b"", NAN, NAN, NAN, NAN, None, None, (), (), "")


def _compensated(bank: Bank) -> FloatArray:
    """The state without what the conditions do, as a direction (p,)."""
    direction = np.zeros(bank.mean.shape[1])
    direction[[LEVEL, SLOW, FAST]] = 1
    return direction


def _shift(state: StreamState) -> tuple[float, float]:
    """Since the baseline, under its conditions: a fraction of the tension."""
    mean, sd = state.bank.along(_compensated(state.bank))
    return _fraction(mean - state.compensated_zero, sd, state.table)


def daily_shift(kept: bytes, hours: Sequence[PooledReading]) -> tuple[float, float]:
    """Of the tension over a day since the stream's baseline, with its sd: by the day's `hours`.

    The mean of what each hour says: the tension goes through the day by more than its mean is
    known to, and not all hours have all modes. Without thermometer's or watch's corrections.
    """
    state = StreamState.from_bytes(kept)
    seen = []
    for reading in hours:
        known = [mode for mode in usable(reading) if (mode.plane, mode.order) in state.table.modes]
        if known:
            kelvin = reading.temperature_c - state.reference[0]
            seen.append(state.table.seen(known, kelvin if math.isfinite(kelvin) else 0.0))
    if not seen:
        return NAN, NAN
    shifts, n = np.array([each.shift for each in seen]), len(seen)
    by_hour = float(np.mean([each.variance for each in seen])) / n
    # Hours that lack are as the others; some of them follow each other, and are as one.
    lacking = max(1 - n / _HOURS_A_DAY, 0.0) * float(np.var(shifts)) * _TOGETHER / n
    # Joints and clocks are the day's, mode by mode, and that of the baseline's days.
    day = 2 * _DAY_SD**2 / float(state.table.tension @ state.table.tension)
    sd = math.sqrt(by_hour + lacking + day)
    return _fraction(float(shifts.mean()) - state.zero, sd, state.table)


def shift_of_reading(state: StreamState, seen: SeenReading) -> tuple[float, float]:
    """Since the baseline, as the tension is at a reading."""
    return _fraction(seen.shift - state.zero, math.sqrt(seen.variance), state.table)


def _fraction(log_shift: float, sd: float, table: ModeTable) -> tuple[float, float]:
    """A shift is off by what the sensitivities are: the share of bending is known to a fifth."""
    off = MODEL_OFF * float(np.mean(0.5 - table.tension) / np.mean(table.tension))
    return math.expm1(log_shift), math.hypot(sd, off * log_shift)


# ---------------------------------------------------------------- conditions


def _warmth(state: StreamState) -> float:
    """Of the steel: an hour or three behind the air's."""
    warmth = float(state.lagged_c[0] - state.reference[0])
    return warmth if math.isfinite(warmth) else 0.0


def _with_conditions(
    state: StreamState, reading: PooledReading, day: float
) -> tuple[StreamState, FloatArray, float]:
    """The conditions of a reading, and the variance that unknown ones add to it."""
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
        extra = _TOGETHER * square * _UNKNOWN_K**2 if math.isfinite(lagged[-1]) else 0.0
    now = np.where(np.isfinite(now), now, reference)
    steps = [before - behind for before, behind in pairwise(kelvin)]
    hour = 2 * math.pi * ((state.start.hour + state.start.minute / 60) / _HOURS_A_DAY + day)
    others = np.nan_to_num(now[1:] - reference[1:])
    warm = kelvin[2] - kelvin[4]
    rounds = hour * np.arange(1, 4)
    conditions = np.array([*steps, warm**2, *others, *np.sin(rounds), *np.cos(rounds)])
    state = replace(state, lagged_c=lagged, reference=reference, known_day=known_day)
    return state, conditions, extra


# ---------------------------------------------------------------- what changed


def _with_ring(
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
        share = 1 / min(max(state.readings - _RING, 1), _OLD_READINGS)
        mixed = np.where(np.isfinite(left), old + share * (left - old), old)
        old = np.where(np.isfinite(old), mixed, left)
    return replace(state, ring=ring, ring_day=days, old=old)


def _cause_of(state: StreamState, evidence: Evidence) -> Cause:
    """By how the modes moved between before and after its beginning."""
    later = state.ring_day >= evidence.by_day
    later[-1] = True
    earlier = state.ring_day <= evidence.after_day
    before = np.vstack([state.old, state.ring[earlier]])
    weight = np.append(_OLD_READINGS, np.ones(earlier.sum()))[:, None] * np.isfinite(before)
    with np.errstate(invalid="ignore", divide="ignore"):
        first = np.nansum(weight * np.nan_to_num(before), axis=0) / weight.sum(axis=0)
        count = np.isfinite(state.ring[later]).sum(axis=0)
        last = np.nansum(state.ring[later], axis=0) / count
    return cause_of(last - first, state.table, count)


def _sized(evidence: Evidence, cause: Cause, state: StreamState) -> Evidence:
    """A step of the tension by the readings' means before and after it: that no reading adds more
    to the evidence than it may makes the evidence's own size too small."""
    if cause.name != TENSION or evidence.kind:
        return evidence
    later = max(int((state.ring_day >= evidence.by_day).sum()) / _TOGETHER, 1.0)
    own = cause.moved[0]
    sd = math.hypot(own.shift_sd, state.bank.wander_sd / math.sqrt(later))
    return replace(evidence, shift=own.shift_mean, shift_sd=sd)


def _changed(state: StreamState, evidence: Evidence) -> StreamState:
    """With a change of the hanger in the filters. What was told stands until half of it is back."""
    state = replace(state, bank=state.bank.changed(evidence))
    now = _shift(state)[0]
    since = state.called_from if state.called_shift else now - evidence.shift
    if state.called_shift and (now - since) / state.called_shift < 0.5:
        return state
    return replace(state, called_from=since, called_shift=now - since)


def _absorbed(state: StreamState, cause: Cause) -> StreamState:
    """With a fault of the measurement in the modes' levels: the tension goes on as it was."""
    moved = np.nan_to_num(cause.by_mode)
    table = replace(state.table, level=state.table.level + moved)
    n = state.ring.shape[1]
    return replace(
        state,
        table=table,
        bank=state.bank.without_beginnings(),
        ring=np.zeros((0, n)),
        ring_day=np.zeros(0),
    )


def _event(
    cause: Cause, state: StreamState, evidence: Evidence, reading: PooledReading, end: datetime
) -> StreamEvent:
    return StreamEvent(
        stream=reading.stream,
        kind="clock drift" if cause.name == TIME_BASE else "drifting",
        start=_at(state, evidence.after_day),
        end=end,
        detail=cause.words,
    )
