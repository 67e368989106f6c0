"""Watch a permanent sensor: pooled readings of each hour, one after the other.

Each reading becomes a shift of the tension and a contrast of the planes (`stream_reading`), which
the filters explain by what the conditions do and by wander, or by a change (`stream_filter`). The
cause of a detected change is found among those of hammer tests (`stream_causes`). What is the
measurement's is an event of the stream and rings nobody. The first days are the baseline.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from itertools import pairwise

import numpy as np
import scipy

from shm.assumptions import DEFAULTS, Assumptions
from shm.errors import BadInput
from shm.values import (
    NAN,
    PLANES,
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
from shm.values.rounding import NINETY_PERCENT
from shm.values.stream import (
    PERIODS,
    PooledReading,
    StreamEvent,
    StreamEventKind,
    WindowReading,
)
from shm.watch.engine.causes import TIMEBASE
from shm.watch.engine.kept_state import from_bytes, to_bytes
from shm.watch.engine.limits import LIMITS
from shm.watch.sensors.stream_causes import EXCHANGED, StreamCause, find_cause, find_exchange
from shm.watch.sensors.stream_filter import (
    CLIP,
    FAST,
    FEATURES,
    LEVEL,
    NOTHING,
    SLOW,
    Bank,
    Evidence,
)
from shm.watch.sensors.stream_reading import ModeTable, SeenReading, planes_of, usable
from shm.watch.sensors.stream_thermometer import Believed, Thermometer, believed
from shm.watch.watching import AlertState, after

HOURS_A_DAY = 24.0  # by definition
# Of the temperature: 3 hours' mean, a day's, ten days'.
_LAGS_DAYS = np.array([2.0, 14.0, 240.0]) / HOURS_A_DAY
# Judgement: by what an hour's temperature differs from ten days' mean, and that the errors of some
# ten hours without a thermometer are one error: an hour counts for a third of what it would.
_UNKNOWN_K, TOGETHER = 4.0, 3.0
NO_CONDITIONS = np.zeros(0)
"""Of the contrast of the planes: what the weather does to one more than the other is its wander."""


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
    newest readings' modes, `ring_conditions` and `ring_day` what they are of, `old` (n,) the mean
    of those before without what the conditions do. Shifts count from `zero`, compensated ones from
    `compensated_zero`; a change that was told of the tension is `called`, of one plane `apart`.
    `contrast` are the filters of what one plane says more than the other, less what was `absorbed`
    into the modes' levels.
    The planes have looked exchanged for `exchanged_hours`. `unknown_sd` of ln T is what an unknown
    temperature may do, 0 where it is known. Up to `settled_day` readings are gone over again: no
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
    ring_conditions: FloatArray
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
            ring_conditions=np.zeros((0, len(condition_sd(assumed)))),
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
    """With the modes and conditions of one more reading."""
    n = len(state.table.modes)
    grown = np.full((len(state.ring), n), NAN)
    grown[:, : state.ring.shape[1]] = state.ring
    old = np.append(state.old, np.full(n - len(state.old), NAN))
    ring, days = np.vstack([grown, seen.off]), np.append(state.ring_day, day)
    met = np.vstack([state.ring_conditions, conditions])
    if len(ring) > LIMITS.ring:
        left = _without_conditions(state.table, state.bank, ring[:1], met[:1])[0]
        ring, met, days = ring[1:], met[1:], days[1:]
        share = 1 / min(max(state.readings - LIMITS.ring, 1), LIMITS.memory_readings)
        mixed = np.where(np.isfinite(left), old + share * (left - old), old)
        old = np.where(np.isfinite(old), mixed, left)
    return replace(state, ring=ring, ring_conditions=met, ring_day=days, old=old)


def _without_conditions(
    table: ModeTable, bank: Bank, ring: FloatArray, conditions: FloatArray
) -> FloatArray:
    """Return changes of ln f (readings, n) without what the conditions (readings, k) do."""
    coefficients = bank.weight @ bank.mean[:, FEATURES:]
    return np.asarray(ring - np.outer(conditions @ coefficients, table.tension))


_VERSION = "stream-watch-3"
_CLOCK = (
    "All frequencies moved by one same fraction, {size}: the time base, not the tension. Check the "
    "logger's clock and sampling rate."
)
_EXCHANGED = (
    "The modes of each plane lie where those of the other did: the planes are exchanged, "
    "not the tension. Check the cables of the sensors."
)
_SENSORS = (
    "Each mode moved by its own fraction: the sensors, not the tension. Check which sensors are "
    "mounted, and where."
)


@dataclass(frozen=True)
class StreamOptions:
    """`limit_years` is the mean time to a false call, a hanger's own `false_call_years` goes first.

    Less than `least_shift` of the tension is not told; `learning_days` are the baseline.
    `share_of_one_plane` of all changes are of one plane alone, as the causes' priors have it.
    """

    limit_years: float = 100.0
    change_rate_per_year: float = 0.02
    least_shift: float = 0.005
    learning_days: float = 3.0
    share_of_one_plane: float = 0.2


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


# ---------------------------------------------------------------- one reading


def watch_reading(
    baseline: Posterior | None,
    reading: PooledReading,
    hanger: Hanger,
    kept: bytes | None,
    options: StreamOptions | None = None,
) -> StreamWatched:
    """Return the result of one more reading of a stream, from the state `kept` before it.

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
    state = None if kept is None else from_bytes(StreamState, kept)
    watch = StreamWatch(baseline, hanger, options or StreamOptions())
    found, state = watch.after(state if state and state.key == key else None, reading, key)
    return replace(found, kept=to_bytes(state) if state else b"")


def _key(baseline: Posterior | None, hanger: Hanger, stream: str) -> str:
    """Return what the state rests on; thresholds may change without a new beginning."""
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
        end = reading.start + PERIODS[reading.period]
        if state is None and modes:
            table = ModeTable.of(self.baseline, self.hanger, modes)
            state = StreamState.begun(key, reading.start, table, self.hanger.assumptions)
        if (
            state is None
            or not modes
            or (end - state.start).total_seconds() / 86400 <= state.bank.day
        ):
            return _nothing(), state
        day = (end - state.start).total_seconds() / 86400
        state, conditions, extra = with_conditions(state, reading, day)
        bank = state.bank.advanced(day, condition_sd(self.hanger.assumptions))
        expected = bank.along(bank.design(conditions))[0]
        contrast = state.contrast.advanced(day, NO_CONDITIONS)
        between = contrast.along(compensated(contrast))
        table = state.table.with_new(self.baseline, self.hanger, modes, expected, between[0])
        seen = table.seen(modes, warmth(state), self.hanger.assumptions, between)
        if not state.is_learning:
            bank = bank.with_beginning(state.bank.day)
            contrast = contrast.with_beginning(state.contrast.day)
        bank = bank.seen(seen.shift, seen.variance + extra, conditions)
        if math.isfinite(seen.contrast):
            contrast = contrast.seen(seen.contrast, seen.contrast_variance, NO_CONDITIONS)
            state = replace(state, contrast=contrast)
        state = replace(state, table=table.learnt(seen), bank=bank, readings=state.readings + 1)
        state = with_ring(state, seen, conditions, day)
        if state.is_learning:
            return self._learning(state, seen, end)
        unlike = _find_contradiction(state, seen, conditions)
        return self._decided(state, seen, reading, end, unlike)

    def _learning(
        self, state: StreamState, seen: SeenReading, end: datetime
    ) -> tuple[StreamWatched, StreamState]:
        """Add a reading to the baseline, whose mean is where shifts count from."""
        n = state.readings
        zero = state.zero + (seen.shift - state.zero) / n
        days = self.options.learning_days
        # A night's gap is no end of learning: half of the hours at least.
        is_over = state.bank.day >= days and n >= days * HOURS_A_DAY / 2
        at_rest, _ = state.bank.along(compensated(state.bank))
        state = replace(state, zero=zero, compensated_zero=at_rest, is_learning=not is_over)
        since = f"{state.start:%Y-%m-%d %H:%M}"
        words = f"learning since {since}: {state.bank.day:.1f} of {days:g} days."
        return replace(_nothing(), learning="" if is_over else words), state

    def _decided(
        self,
        state: StreamState,
        seen: SeenReading,
        reading: PooledReading,
        end: datetime,
        unlike: float,
    ) -> tuple[StreamWatched, StreamState]:
        state, events = _with_exchange(state, seen, reading, end)
        evidence, of_tension, apart, is_apart = self._weigh(state)
        if state.exchanged_hours and not events:  # not known yet: no change is reported meanwhile
            evidence = NOTHING
        moved: tuple[Moved, ...] = ()
        if evidence.years > self._limit_years and evidence.material > 0.5:
            # The change itself has pulled at what the conditions seem to do.
            bank = state.bank.changed(of_tension)
            by_mode, since = _move_of_modes(state, bank, evidence)
            wander_sd = _wander_sd(state, since)
            cause = find_cause(by_mode, state.table, self.baseline, self.hanger, wander_sd)
            if cause.takes_hours and since < LIMITS.hours_of_a_fault:
                evidence = NOTHING
            elif cause.is_measurement:
                events += (_event(cause, state, evidence, reading, end),)
                state, evidence, unlike = _absorb_fault(state, cause), NOTHING, 0.0
            elif cause.plane or is_apart:
                before = _contrast(state)[0]
                if cause.plane:
                    state = _absorb_plane(state, cause, apart, None if is_apart else evidence)
                else:
                    state = replace(state, contrast=state.contrast.changed(apart))
                state = replace(state, apart=state.apart.after(before, _contrast(state)[0]))
                moved, unlike, is_apart = cause.moved, 0.0, True
            else:
                evidence = _sized(evidence, cause)
                state, unlike = replace(state, bank=state.bank.changed(evidence)), 0.0
                now = _shift(state)[0]
                state = replace(state, called=state.called.after(now - evidence.shift, now))
                mean, sd = math.expm1(evidence.shift), evidence.shift_sd
                moved = tuple(
                    replace(each, shift_mean=mean, shift_sd=sd)
                    if each.quantity == TENSION
                    else each
                    for each in cause.moved
                )
        test = self._watched_test(state, evidence, moved, is_apart, unlike, reading, end)
        reported, alert = after(state.told, test, self.hanger)
        # Technical: of changes that were told, so that what is kept stays bounded
        reported = replace(reported, called=reported.called[-8:])
        standing = (*state.standing, alert.key) if alert else state.standing
        in_force = alert or reported.beyond or reported.called or state.bank.day < state.settled_day
        ended = () if in_force else standing
        state = replace(state, told=reported, standing=() if ended else standing)
        if ended:
            state = replace(state, called=Reported(), apart=Reported())
        shift, sd = test.drifts[0].shift_mean, test.drifts[0].shift_sd
        its, its_sd = shift_of_reading(state, seen)
        return StreamWatched(b"", its, its_sd, shift, sd, test, alert, events, ended, ""), state

    def _weigh(self, state: StreamState) -> tuple[Evidence, Evidence, Evidence, bool]:
        """Return the evidence of any change, the tension's, one plane's, and if it is that."""
        of_tension = state.bank.evidence(self.options.least_shift)
        apart = state.contrast.evidence(self.options.least_shift)
        share = self.options.share_of_one_plane
        shares = (1 - share) * of_tension.years, share * apart.years
        is_apart = shares[1] > shares[0]
        either = replace(apart if is_apart else of_tension, years=sum(shares))
        return either, of_tension, apart, is_apart

    @property
    def _limit_years(self) -> float:
        its = self.hanger.thresholds.false_call_years
        return self.options.limit_years if its is None else its

    def _watched_test(
        self,
        state: StreamState,
        evidence: Evidence,
        moved: tuple[Moved, ...],
        is_apart: bool,
        unlike: float,
        reading: PooledReading,
        end: datetime,
    ) -> WatchedTest:
        """Return the reading as the rules of alerts take any test.

        Its interval reaches as far as the reading is `unlike` what the filters say.
        """
        rate = self.options.change_rate_per_year * evidence.years
        mean, sd = _shift(state)
        sd = math.hypot(sd, unlike / NINETY_PERCENT)
        limits, table = self.hanger.thresholds, state.table
        chance = rate / (1 + rate)
        of_tension = (mean - state.called.since, sd, state.called.shift)
        between, between_sd = _contrast(state)
        of_plane = (between - state.apart.since, between_sd, state.apart.shift)
        standing = [each for each in (of_tension, of_plane) if each[2]]
        if standing:
            left = max(_beyond(now / size - 0.5, its / abs(size)) for now, its, size in standing)
            chance = max(left, chance) if moved else left
            now, _, size = of_plane if is_apart else of_tension
            if moved and size and now / size < 0.5:  # it came back: the end of an alert
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


def compensated(bank: Bank) -> FloatArray:
    """Return the state without what the conditions do, as a direction (p,)."""
    direction = np.zeros(bank.mean.shape[1])
    direction[[LEVEL, SLOW, FAST]] = 1
    return direction


def _shift(state: StreamState) -> tuple[float, float]:
    """Since the baseline, under its conditions: a fraction of the tension."""
    mean, sd = state.bank.along(compensated(state.bank))
    return fraction_of(mean - state.compensated_zero, sd, state.table)


def _contrast(state: StreamState) -> tuple[float, float]:
    """Return what one plane says of ln T more than the other, as at first, with its sd."""
    mean, sd = state.contrast.along(compensated(state.contrast))
    return mean + state.absorbed, sd


def _find_contradiction(state: StreamState, seen: SeenReading, conditions: FloatArray) -> float:
    """Return how far either plane of a reading is from what the filters say, 0 within scatter."""
    expected, sd = state.bank.along(state.bank.design(conditions))
    off = abs(seen.shift - expected)
    reach = off if off > CLIP * math.hypot(sd, math.sqrt(seen.variance)) else 0.0
    if not math.isfinite(seen.contrast):
        return reach
    between, sd = state.contrast.along(compensated(state.contrast))
    apart = abs(seen.contrast - between)
    if apart > CLIP * math.hypot(sd, math.sqrt(seen.contrast_variance)):
        reach = float(np.nanmax(np.abs(seen.by_plane - expected)))
    return reach


def shift_of_reading(state: StreamState, seen: SeenReading) -> tuple[float, float]:
    """Since the baseline, as the tension is at a reading."""
    return fraction_of(seen.shift - state.zero, math.sqrt(seen.variance), state.table)


def fraction_of(log_shift: float, sd: float, table: ModeTable) -> tuple[float, float]:
    """A shift is off by what the sensitivities are: the share of bending is known to a fifth."""
    off = LIMITS.stream_watch_model_off * float(
        np.mean(0.5 - table.tension) / np.mean(table.tension)
    )
    return math.expm1(log_shift), math.hypot(sd, off * log_shift)


# ---------------------------------------------------------------- what changed


def _move_of_modes(state: StreamState, bank: Bank, evidence: Evidence) -> tuple[FloatArray, int]:
    """Return how the modes (n,) moved when a change began, NaN where that is not known.

    And the number of readings since. What the conditions do is by `bank`.
    """
    ring = _without_conditions(state.table, bank, state.ring, state.ring_conditions)
    later = state.ring_day >= evidence.by_day
    later[-1] = True
    earlier = state.ring_day <= evidence.after_day
    before = np.vstack([state.old, ring[earlier]])
    weight = np.append(LIMITS.memory_readings, np.ones(earlier.sum()))[:, None] * np.isfinite(
        before
    )
    moved = np.full(before.shape[1], np.nan)
    known = (weight.sum(axis=0) > 0) & np.isfinite(ring[later]).any(axis=0)
    weight, before = weight[:, known], np.nan_to_num(before[:, known])
    first = np.sum(weight * before, axis=0) / weight.sum(axis=0)
    # One of them may be mistaken for a neighbour.
    moved[known] = np.nanmedian(ring[later][:, known], axis=0) - first
    return moved, int((state.ring_day >= evidence.by_day).sum())


def _wander_sd(state: StreamState, since: int) -> float:
    """Return by what the mean of ln T over `since` hours wanders, and goes with what is unknown."""
    later = max(since / TOGETHER, 1.0)
    return math.hypot(state.bank.wander_sd / math.sqrt(later), state.unknown_sd)


def _sized(evidence: Evidence, cause: StreamCause) -> Evidence:
    """A step of the tension by the readings' means before and after it: that no reading adds more
    to the evidence than it may makes the evidence's own size too small."""
    if cause.name != TENSION or evidence.kind:
        return evidence
    its = cause.moved[0]
    return replace(evidence, shift=math.log1p(its.shift_mean), shift_sd=its.shift_sd)


def _absorb_plane(
    state: StreamState, cause: StreamCause, apart: Evidence, of_tension: Evidence | None
) -> StreamState:
    """With a change of one plane in its modes' levels: the tension goes on by the other plane.

    `of_tension` is what the filters of the tension took it for, if they did.
    """
    table, its = state.table, planes_of(state.table.modes)[cause.plane or PLANES[0]]
    other = np.nan_to_num(np.nanmedian((cause.by_mode / table.tension)[~its]))
    moved = np.where(its, np.nan_to_num(cause.by_mode - other * table.tension), 0.0)
    size = float(np.median((moved / table.tension)[its & np.isfinite(cause.by_mode)]))
    size = size if cause.plane == PLANES[0] else -size
    contrast = state.contrast
    if apart.beginning >= 0:
        contrast = contrast.absorbed(replace(apart, shift=size, kind=0))
    bank = state.bank if of_tension is None else state.bank.absorbed(of_tension)
    began = of_tension or apart
    ring = np.where((state.ring_day >= began.by_day)[:, None], state.ring - moved, state.ring)
    ring[(state.ring_day > began.after_day) & (state.ring_day < began.by_day)] = np.nan
    return replace(
        state,
        table=replace(table, level=table.level + moved),
        bank=bank,
        contrast=contrast,
        absorbed=state.absorbed + size,
        ring=ring,
    )


def _with_exchange(
    state: StreamState, seen: SeenReading, reading: PooledReading, end: datetime
) -> tuple[StreamState, tuple[StreamEvent, ...]]:
    """Count the hours that the planes look exchanged; after a few it is an event."""
    exchange = find_exchange(seen.off, state.table)
    state = replace(state, exchanged_hours=state.exchanged_hours + 1 if exchange else 0)
    if exchange is None or state.exchanged_hours < LIMITS.hours_exchanged:
        return state, ()
    return _absorb_fault(state, exchange), (_event(exchange, state, NOTHING, reading, end),)


def _absorb_fault(state: StreamState, cause: StreamCause) -> StreamState:
    """With a fault of the measurement in the modes' levels: the tension goes on as it was."""
    level = state.table.level + np.nan_to_num(cause.by_mode)
    return replace(
        state,
        table=replace(state.table, level=level),
        bank=state.bank.without_beginnings(),
        contrast=state.contrast.without_beginnings(),
        ring=state.ring[:0],
        ring_conditions=state.ring_conditions[:0],
        ring_day=state.ring_day[:0],
    )


def _event(
    cause: StreamCause,
    state: StreamState,
    evidence: Evidence,
    reading: PooledReading,
    end: datetime,
) -> StreamEvent:
    size = f"{100 * cause.by_mode[0]:+.2f} %"
    kinds: dict[str, tuple[StreamEventKind, str]] = {
        TIMEBASE: ("clock drift", _CLOCK.format(size=size)),
        EXCHANGED: ("swapped", _EXCHANGED),
    }
    kind, detail = kinds.get(cause.name, ("drifting", _SENSORS))
    return StreamEvent(
        stream=reading.stream,
        kind=kind,
        start=_at(state, evidence.after_day),
        end=end,
        detail=detail,
    )
