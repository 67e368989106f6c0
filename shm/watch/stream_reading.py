"""A pooled reading of a permanent sensor: how far the tension has moved, by each plane's modes.

The change of each mode's log frequency over its sensitivity d ln f / d ln T is a change of tension;
the modes of a plane together give it by robust weighted least squares, so that one that went astray
(close planes exchanged, a peak of the deck) moves nothing. What a mode differs by from the others
of its plane is learnt, for days: a reading that lacks a mode must not look like a step. What a
whole plane differs by from the other is no mistake: it is the reading's contrast.

Frequencies of a bar on springs are homogeneous of degree 1/2 in tension, bending stiffness and
springs. So what a kelvin does by softening steel is -3e-4 (1/2 - d ln f / d ln T).

A change is told apart by its pattern over the modes: a tension moves each by its sensitivity,
springs the lower ones of a stiff bar more, a time base all alike, a sensor those of its plane, each
as it likes. The hypotheses are compared by their evidence; each leaves room for one mode that goes
astray by itself.

How soft the ends are, the modes of a taut bar hardly tell: they are tried from soft to stiff. With
u = (alpha^2 + xi^2)^(1/2) of a mode and xi = L sqrt(T/EI), a spring k in EI/L shortens the bar by
L/u k/(k + u), so that a decade of it moves ln f by ln(10) k/(k + u)^2; k/xi and u/xi serve.
Tension has d ln f / d ln T = s = xi^2 / (2 u^2). Soft ends move the modes as the tension does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Any

import numpy as np

from shm.assumptions import DEFAULTS, Assumptions
from shm.models import class_of
from shm.models.tensioned_beam import frequencies_hz
from shm.values import (
    NAN,
    PLANES,
    Alert,
    BoolArray,
    Change,
    FloatArray,
    Hanger,
    Mode,
    Moved,
    Posterior,
)
from shm.values.stream import PooledReading, StreamEvent
from shm.watch.quantities import MeasuredMode, base_point, log_frequencies, moved

LEAST_SD = 3e-5
"""Of an hourly log frequency: 1 Hz is read to 1/30 mHz at best, and clocks wander by as much."""
_MEMORY_READINGS = 120.0  # judgement: five days of what modes differ by, ten times a night's
_DEGREES = 4.0  # judgement: of Student's t, as robust regressions take (Lange et al. 1989)
_HALVES = np.array([0.5, -0.5])  # by definition: of a contrast, in each of PLANES
_CLIP = 4.0  # sds: what a mode may add to its spread at once
_STEP = 0.01  # technical: of the tension, for a slope by central differences
_DECADES = 0.1  # technical: of the springs, likewise
# What is tried where there is no baseline: xi = L sqrt(T/EI) from slack to a slender cable, springs
# k L/EI from pinned to clamped, and the share of the solid stiffness that a strand may have.
_XI = np.geomspace(0.5, 300.0, 240)
_N_SPRINGS, _N_SHARES = 10, 4
# Of a sum of misfits: modes fit a beam to 0.3 % each, nominal tensions are good to 15 %. Judgement.
_NOMINAL = 0.003 * 3 / 0.15


def sensitivities(
    baseline: Posterior | None, hanger: Hanger, modes: Sequence[Mode]
) -> tuple[FloatArray, FloatArray, float]:
    """Return d ln f / d ln T of the modes (n,), that by a decade of all end springs, the tension.

    By the baseline's model class; without one, by the beam on springs that fits `modes` best.
    """
    keys = [(mode.plane, mode.order) for mode in modes]
    if baseline is not None:
        return _of_baseline(baseline, hanger, keys)
    return _of_beam(hanger, keys, np.log([mode.frequency_hz for mode in modes]))


def _of_baseline(
    baseline: Posterior, hanger: Hanger, keys: Sequence[MeasuredMode]
) -> tuple[FloatArray, FloatArray, float]:
    model = class_of(baseline, hanger)
    base = base_point(baseline, model)
    theta = np.tile(base, (2, 1))
    theta[:, model.parameter_names.index("theta_F")] *= np.exp([_STEP, -_STEP])
    up, down = log_frequencies(model, theta, keys)
    springs = [i for i, each in enumerate(model.parameter_names) if each.startswith("log10_k")]
    ends = np.array([_DECADES, -_DECADES])
    stiff, soft = log_frequencies(model, moved(model, base, springs, ends), keys)
    return (
        (up - down) / (2 * _STEP),
        (stiff - soft) / (2 * _DECADES),
        float(baseline.tension_n.mean()),
    )


def _of_beam(
    hanger: Hanger, keys: Sequence[MeasuredMode], log_hz: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """By the least sum of absolute misfits, springs by plane: a mode with a wrong order counts for
    little. The nominal tension tells a slack bar on stiff springs from a taut one on soft ones."""
    order = np.array([each for _, each in keys]) - 1
    assumed = hanger.assumptions
    stiffness = np.geomspace(*assumed.end_restraint.bounds, _N_SPRINGS)
    factors = np.geomspace(*assumed.strand_bending_factor.bounds, _N_SHARES)
    shares = factors if hanger.kind == "strand" else np.ones(1)
    length_m, mass = np.asarray(hanger.length_m), np.asarray(hanger.mass_per_length_kg_m)

    def log_f(xi: FloatArray, k: FloatArray, share: FloatArray) -> FloatArray:
        bending = hanger.bending_stiffness_n_m2 * share
        spring = k * bending / length_m
        tension = bending * (xi / length_m) ** 2
        found = frequencies_hz(length_m, tension, bending, mass, spring, spring, order.max() + 1)
        return np.asarray(np.log(found[..., order]))

    xi, k, share = np.meshgrid(_XI, stiffness, shares, indexing="ij")
    misfit, planes = np.abs(log_f(xi, k, share) - log_hz), planes_of(keys).values()
    by_plane = [misfit[..., its].sum(axis=-1) for its in planes]
    tension_n = hanger.bending_stiffness_n_m2 * share * (xi / length_m) ** 2
    total = sum(each.min(axis=1) for each in by_plane)
    if hanger.nominal_tension_n > 0:
        total = total + _NOMINAL * np.abs(np.log(tension_n[:, 0] / hanger.nominal_tension_n))
    at, of = np.unravel_index(int(np.argmin(total)), total.shape)
    springs = np.zeros(len(keys))
    for its, each in zip(planes, by_plane, strict=True):
        springs[its] = stiffness[each[at, :, of].argmin()]
    mode = np.arange(len(keys))

    def each_mode(xi_by: float, k_by: float) -> FloatArray:
        return log_f(_XI[at] * xi_by, springs * k_by, shares[of])[mode, mode]

    up, down = (each_mode(math.exp(way * _STEP / 2), 1.0) for way in (1, -1))
    stiff, soft = (each_mode(1.0, 10 ** (way * _DECADES)) for way in (1, -1))
    return ((up - down) / (2 * _STEP), (stiff - soft) / (2 * _DECADES), float(tension_n[at, 0, of]))


@dataclass(frozen=True, eq=False)
class ModeTable:
    """The n modes of a stream, as far as learnt: `level` is ln f where the tension has not moved.

    `spread` is the variance by which a mode differs from the others, `readings` of how many.
    """

    modes: tuple[MeasuredMode, ...]
    tension: FloatArray
    ends: FloatArray
    level: FloatArray
    spread: FloatArray
    readings: FloatArray
    tension_n: float

    @classmethod
    def of(cls, baseline: Posterior | None, hanger: Hanger, modes: Sequence[Mode]) -> ModeTable:
        tension, ends, tension_n = sensitivities(baseline, hanger, modes)
        keys = tuple((mode.plane, mode.order) for mode in modes)
        level, sd = _measured(modes, hanger.assumptions)
        zero = np.zeros(len(keys))
        return cls(keys, tension, ends, level, sd**2, zero, tension_n)

    def with_new(
        self,
        baseline: Posterior | None,
        hanger: Hanger,
        modes: Sequence[Mode],
        shift: float,
        contrast: float = 0.0,
    ) -> ModeTable:
        """With modes that were not seen before, at a tension moved by `shift`, planes apart."""
        new = [mode for mode in modes if (mode.plane, mode.order) not in self.modes]
        if not new:
            return self
        more = ModeTable.of(baseline, hanger, new)
        parts: dict[str, Any] = {
            name: np.append(getattr(self, name), getattr(more, name))
            for name in ("tension", "ends", "spread", "readings")
        }
        by_plane = dict(zip(PLANES, shift + contrast * _HALVES, strict=True))
        moved = more.tension * [by_plane[mode.plane] for mode in new]
        level = np.append(self.level, more.level - moved)
        return replace(self, modes=(*self.modes, *more.modes), level=level, **parts)

    def are_exchanged(
        self,
        modes: Sequence[Mode],
        least: int = 3,
        surely: float = 5.0,
        elsewhere_sd: float = 0.01,
    ) -> bool | None:
        """Return whether each mode lies where that of the other plane does, at any tension.

        None where the modes do not tell: fewer than `least`, log odds below `surely`, or where
        modes anywhere within `elsewhere_sd` of ln f are more likely than either.
        """
        place = {mode: index for index, mode in enumerate(self.modes)}
        its = [(mode.plane, mode.order) for mode in modes]
        other = [(_other(mode).plane, mode.order) for mode in modes]
        both = [n for n in range(len(modes)) if {its[n], other[n]} <= place.keys()]
        if len(both) < least:
            return None
        here, there = ([place[keys[n]] for n in both] for keys in (its, other))
        spread = np.maximum(np.maximum(self.spread[here], self.spread[there]), LEAST_SD**2)
        if np.sum((self.level[here] - self.level[there]) ** 2 / spread) < 8 * surely:
            return None  # chance alone would tell them exchanged in some hour
        log_hz = _measured([modes[n] for n in both])[0]
        straight, crossed = (self._weigh(log_hz, at) for at in (here, there))
        neither = -len(both) * math.log(elsewhere_sd)
        if max(straight, crossed) < neither or abs(crossed - straight) < surely:
            return None
        return crossed > straight

    def _weigh(self, log_hz: FloatArray, at: Sequence[int]) -> float:
        """Return the log likelihood of modes in these places of the table, at the best tension."""
        slope, variance = self.tension[at], np.maximum(self.spread[at], LEAST_SD**2)
        off = log_hz - self.level[at]
        left = off - slope * _read_plane(off, variance, slope)[0]
        tails = (_DEGREES + 1) * np.log1p(left**2 / (_DEGREES * variance))
        return -float(np.sum(tails + np.log(variance))) / 2

    def softer(self, assumed: Assumptions) -> FloatArray:
        """Return by what ln f goes with a kelvin, as steel softens."""
        return np.asarray(assumed.modulus_per_kelvin.value * (0.5 - self.tension))

    def seen(
        self,
        modes: Sequence[Mode],
        warmth_k: float,
        assumed: Assumptions = DEFAULTS,
        expected: tuple[float, float] = (0.0, 0.0),
    ) -> SeenReading:
        """A reading in the places of the table's modes, NaN where it lacks one.

        `expected` is the contrast between the planes by the readings before, with its sd.
        """
        off, variance = np.full(len(self.modes), np.nan), np.full(len(self.modes), np.inf)
        its = [self.modes.index((mode.plane, mode.order)) for mode in modes]
        log_hz, sd = _measured(modes, assumed)
        off[its] = log_hz - self.level[its] - warmth_k * self.softer(assumed)[its]
        variance[its] = np.maximum(sd**2, self.spread[its])
        return _read(off, variance, self.tension, planes_of(self.modes), expected)

    def learnt(self, seen: SeenReading) -> ModeTable:
        """With what a reading adds to each mode's level and spread.

        What is left over once each plane's shift is taken off adds up to 0 in the direction of a
        tension: the levels can take up neither what the tension does nor what one plane does.
        """
        known = np.isfinite(seen.left)
        readings = self.readings + known
        share = np.where(known, 1 / np.minimum(np.maximum(readings, 1), _MEMORY_READINGS), 0.0)
        sd = np.sqrt(self.spread)
        left = np.clip(np.where(known, seen.left, 0.0), -_CLIP * sd, _CLIP * sd)
        spread = self.spread + share * (left**2 - self.spread)
        return replace(
            self,
            readings=readings,
            level=self.level + share * left,
            spread=np.maximum(spread, LEAST_SD**2),
        )


@dataclass(frozen=True, eq=False)
class SeenReading:
    """`shift` of ln T by one reading with its variance; `left` (n,) of each mode, NaN if lacking.

    `off` (n,) are the modes' own changes of ln f, warmth of steel taken off. `contrast` is what the
    modes of the first plane say of ln T less what those of the other do; NaN without either plane.
    `by_plane` is what each plane says of the shift, as much apart as expected.
    """

    shift: float
    variance: float
    off: FloatArray
    left: FloatArray
    by_plane: FloatArray
    contrast: float = math.nan
    contrast_variance: float = math.inf


def usable(reading: PooledReading) -> tuple[Mode, ...]:
    """Return the modes that say something of the tension, each once."""
    found: dict[MeasuredMode, Mode] = {}
    for mode in reading.modes:
        is_measured = np.isfinite(mode.frequency_hz) and mode.frequency_hz > 0
        if is_measured and not mode.irregular and not np.isinf(mode.frequency_sd_hz):
            found.setdefault((mode.plane, mode.order), mode)
    return tuple(found.values())


def exchanged(modes: Sequence[Mode]) -> tuple[Mode, ...]:
    """Each as one of the other plane."""
    return tuple(map(_other, modes))


def _other(mode: Mode) -> Mode:
    return replace(mode, plane=PLANES[PLANES[0] == mode.plane])


def _measured(
    modes: Sequence[Mode], assumed: Assumptions = DEFAULTS
) -> tuple[FloatArray, FloatArray]:
    unstated = assumed.unstated_frequency_sd.value
    hz = np.array([mode.frequency_hz for mode in modes])
    sd = np.array([mode.frequency_sd_hz for mode in modes]) / hz
    return np.log(hz), np.where(sd > 0, np.maximum(sd, LEAST_SD), unstated)


def _read(
    off: FloatArray,
    variance: FloatArray,
    slope: FloatArray,
    planes: Mapping[str, BoolArray],
    expected: tuple[float, float],
) -> SeenReading:
    """Read each plane by itself; where planes disagree by more than expected, the errors grow."""
    left = np.full(len(off), np.nan)
    shift, its = np.zeros(len(PLANES)), np.full(len(PLANES), np.inf)
    for place, plane in enumerate(PLANES):
        seen = np.isfinite(off) & planes.get(plane, np.zeros(len(off), bool))
        if seen.any():
            shift[place], its[place] = _read_plane(off[seen], variance[seen], slope[seen])
            left[seen] = off[seen] - slope[seen] * shift[place]
    weight = (1 / its) / (1 / its).sum()
    by_plane = np.where(np.isfinite(its), shift - expected[0] * _HALVES, np.nan)
    mean = float(weight @ np.nan_to_num(by_plane))
    total = 1 / float((1 / its).sum()) + (float(weight @ _HALVES) * expected[1]) ** 2
    if not np.isfinite(its).all():
        return SeenReading(mean, total, off, left, by_plane)
    contrast = float(shift[0] - shift[1])
    both = float(its.sum())
    misfit = (contrast - expected[0]) ** 2 / (both + expected[1] ** 2)
    return SeenReading(mean, total * max(misfit, 1.0), off, left, by_plane, contrast, both)


def _read_plane(y: FloatArray, v: FloatArray, s: FloatArray) -> tuple[float, float]:
    """Reweighted least squares from the weighted median on; errors grow where the modes differ."""
    shift = _weighted_median(y / s, s / np.sqrt(v))
    # Technical: of reweighting, from the weighted median on
    for _ in range(4):
        weight = (_DEGREES + 1) / (_DEGREES + (y - s * shift) ** 2 / v) / v
        weight = np.minimum(weight, 1 / v)  # no mode is better than it says
        information = float(weight @ s**2)
        shift = float(weight @ (s * y)) / information
    misfit = float(weight @ (y - s * shift) ** 2) / max(len(y) - 1, 1)
    return shift, max(misfit, 1.0) / information


def _weighted_median(values: FloatArray, weight: FloatArray) -> float:
    order = np.argsort(values)
    share = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(share, share[-1] / 2)])


def planes_of(modes: Sequence[MeasuredMode]) -> dict[str, BoolArray]:
    """Return which modes (n,) are of each plane, for the planes that have any."""
    found = [plane for plane, _ in modes]
    return {plane: np.array([each == plane for each in found]) for plane in dict.fromkeys(found)}


TIME_BASE = "timebase"
SWAPPED = "swapped"
EXCHANGED = (
    "The modes of each plane lie where those of the other did: the planes are exchanged, "
    "not the tension. Check the cables of the sensors."
)
_SENSOR, _UNEXPLAINED = "sensor_mass", "unexplained"
_MEASUREMENT = (TIME_BASE, SWAPPED, _SENSOR)
# Prior sds: 3 % of ln T, 0.3 decades (`quantities`), 1 % of a time base and of single modes.
_TENSION_SD, _DECADES_SD, _BASE_SD, _MODE_SD = 0.03, 0.3, 0.01, 0.01
# Of ln f: a sensor of 0.3 kg on or off a hanger of 300 kg. What is larger is no sensor's.
_SENSOR_SD = 1e-3
_ALIKE = 20.0  # a log Bayes factor of 3, as `Moved.alike` has it
_DAY_SD = 3e-4  # of ln f: joints that slip by another level, each mode by its own. Judgement
MODEL_OFF = 0.2  # judgement: of bending's share in a sensitivity, and of springs'
_APART = 0.5  # judgement: of a loosened end, between planes
_EACH_OFF = 0.05  # judgement: likewise, of each mode by itself
_SOFTNESS = (0.1, 0.3, 1.0, 3.0, 10.0)  # technical: of springs, k/xi; half a decade each
_LEFT_SD = 1e-3  # of ln T: what the conditions leave while something else changes
_ASTRAY_SD, _ASTRAY = 0.03, 0.02  # judgement: how far and how often a single mode goes astray
# Judgement: tensions, ends in both planes, ends in one, a time base, one plane's sensors, others.
_PRIORS = {
    "tension": 0.5,
    "ends": 0.1,
    "end": 0.1,
    TIME_BASE: 0.1,
    _SENSOR: 0.1,
    SWAPPED: 0.1,
    _UNEXPLAINED: 0.1,
}


@dataclass(frozen=True, eq=False)
class _Pattern:
    """A hypothesis of what moved n modes: along columns (n, k) of prior sd 1, modes off by `sd`."""

    name: str
    columns: FloatArray
    sd: FloatArray
    plane: str = ""
    mean: FloatArray | float = 0.0


@dataclass(frozen=True, eq=False)
class Cause:
    """The most probable cause, all that may have `moved`, and how each mode did."""

    name: str
    moved: tuple[Moved, ...]
    by_mode: FloatArray
    size: float
    plane: str = ""

    @property
    def is_measurement(self) -> bool:
        """Return True if it is none of the hanger, so that nobody need go there today."""
        return self.name in _MEASUREMENT

    @property
    def takes_hours(self) -> bool:
        """Return True if two mistaken modes in a few hours look like it."""
        return self.name in (SWAPPED, _SENSOR, _UNEXPLAINED)

    @property
    def words(self) -> str:
        if self.name == TIME_BASE:
            return (
                f"All frequencies moved by one same fraction, {100 * self.size:+.2f} %: "
                "the time base, not the tension. Check the logger's clock and sampling rate."
            )
        if self.name == _SENSOR:
            return (
                f"Only the modes of the {self.plane} plane moved, each by its own fraction: the "
                "sensors, not the tension. Check which sensors are mounted, and where."
            )
        return EXCHANGED


def cause_of(moved: FloatArray, table: ModeTable, readings: FloatArray) -> Cause:
    """Find the cause of mean log frequencies that moved (n,), over so many `readings` each.

    What moved a mode is NaN where unknown; where that holds for all, nothing explains the change.
    """
    known = np.isfinite(moved) & (readings > 0)
    sub = replace(
        table,
        modes=tuple(mode for mode, its in zip(table.modes, known, strict=True) if its),
        **{name: getattr(table, name)[known] for name in ("tension", "ends", "spread", "level")},
    )
    if not known.any():
        return Cause(_UNEXPLAINED, (Moved(_UNEXPLAINED, 1.0, NAN, NAN),), moved, NAN)
    # Hours do not average out what a mode keeps for a day.
    y, variance = moved[known], sub.spread + _DAY_SD**2
    patterns, fits = _best_of_each(_patterns(sub, y), y, variance)
    log_each = np.array([fit[0] for fit in fits])
    chance = np.exp(log_each - log_each.max())
    chance = chance / chance.sum()
    best = int(chance.argmax())
    mean, sd = float(y.mean()), float(y.std()) / math.sqrt(len(y))
    by_mode_size = (mean / _DECADES_SD, sd / _DECADES_SD)  # of frequencies that no pattern ties
    sized = [
        fit if _names(pattern)[0] not in (_UNEXPLAINED, _SENSOR) else (fit[0], *by_mode_size)
        for pattern, fit in zip(patterns, fits, strict=True)
    ]
    total = _moved_quantities(
        [each for each in patterns if each.name != SWAPPED],
        [fit for each, fit in zip(patterns, sized, strict=True) if each.name != SWAPPED],
        np.array([c for each, c in zip(patterns, chance, strict=True) if each.name != SWAPPED]),
    )
    size = fits[best][1]
    if patterns[best].name == TIME_BASE:  # of all modes, those too that sleep at night
        size = float(np.median(y))
        moved = np.full(len(known), size)
    return Cause(patterns[best].name, total, moved, size, patterns[best].plane)


def _best_of_each(
    patterns: Sequence[_Pattern], y: FloatArray, variance: FloatArray
) -> tuple[list[_Pattern], list[tuple[float, float, float]]]:
    """Of variants of one hypothesis the likeliest, with the mean evidence of all."""
    found: dict[tuple[str, str], list[tuple[tuple[float, float, float], _Pattern]]] = {}
    for each in patterns:
        found.setdefault((each.name, each.plane), []).append((_fit(y, variance, each), each))
    best = []
    for variants in found.values():
        (_, *size), pattern = max(variants, key=lambda each: each[0][0])
        log = float(np.logaddexp.reduce([fit[0] for fit, _ in variants])) - math.log(len(variants))
        best.append((pattern, (log, size[0], size[1])))
    return [each for each, _ in best], [fit for _, fit in best]


def _ends(table: ModeTable) -> list[FloatArray]:
    """Return what a decade of an end's spring moves ln f by (n,), from soft to stiff."""
    s = np.clip(table.tension, 0.01, 0.499)
    order = np.array([each for _, each in table.modes])
    xi = float(np.median(math.pi * order * np.sqrt(s / (0.5 - s))))
    u = np.sqrt(0.5 / s)
    return [table.ends, *(math.log(10) / xi * k / (k + u) ** 2 for k in _SOFTNESS)]


def _patterns(table: ModeTable, y: FloatArray) -> list[_Pattern]:
    """All hypotheses; the larger a change, the more it is off by what the patterns are off."""
    s, n = table.tension, len(table.tension)
    left, none = _LEFT_SD * s[:, None], np.zeros(n)
    bent = (0.5 - s) * abs(float(s @ y) / float(s @ s))
    found = [
        _Pattern("tension", np.column_stack([_TENSION_SD * s, MODEL_OFF * bent]), _EACH_OFF * bent),
        _Pattern(TIME_BASE, np.column_stack([np.full(n, _BASE_SD), left]), none),
        _Pattern(_UNEXPLAINED, left, np.full(n, _MODE_SD)),
    ]
    planes = planes_of(table.modes)
    other = [(PLANES[PLANES[0] == plane], each) for plane, each in table.modes]
    if len(planes) > 1 and set(other) <= set(table.modes):
        swapped = table.level[[table.modes.index(each) for each in other]] - table.level
        found.append(_Pattern(SWAPPED, left, none, mean=swapped))
    for e in _ends(table):
        found += _loosened(e, y, table, planes)
    for plane, its in planes.items() if len(planes) > 1 else ():
        found.append(_Pattern(_SENSOR, left, np.where(its, _SENSOR_SD, 0.0), plane))
    return found


def _loosened(
    e: FloatArray, y: FloatArray, table: ModeTable, planes: Mapping[str, BoolArray]
) -> list[_Pattern]:
    """Ends in both planes, in each by its own, or in one, that move ln f by `e` a decade."""
    loose = e * abs(float(e @ y) / float(e @ e))
    order = np.array([each for _, each in table.modes])
    tilt = (order - order.mean()) / max(order.max() - 1, 1)
    each = _EACH_OFF * (np.abs(loose).max() - np.abs(loose))  # as of a tension: off a string
    left, off = _LEFT_SD * table.tension, MODEL_OFF * loose * tilt
    apart = [loose * (its - its.mean()) for its in planes.values()][:1]
    both = np.column_stack([_DECADES_SD * e, off, left, *(_APART * part for part in apart)])
    found = [_Pattern("ends", both, each)]
    for plane, its in planes.items() if len(planes) > 1 else ():
        of_end = np.column_stack([_DECADES_SD * e * its, off * its, left])
        found.append(_Pattern("end", of_end, each * its, plane))
    return found


def _fit(y: FloatArray, variance: FloatArray, pattern: _Pattern) -> tuple[float, float, float]:
    """Log evidence, size along the first column with its sd; a mode may have gone astray."""
    n = len(y)
    errant = [np.zeros(n), *(_ASTRAY_SD**2 * np.eye(n) if n > 2 else ())]
    both = [
        _normal(y - pattern.mean, variance + pattern.sd**2 + more, pattern.columns)
        for more in errant
    ]
    log_each = np.array([each[0] for each in both]) + np.where(
        np.arange(len(both)) > 0, math.log(_ASTRAY), 0.0
    )
    best = int(log_each.argmax())
    evidence = float(np.logaddexp.reduce(log_each))
    return evidence + math.log(_prior(pattern)), both[best][1], both[best][2]


def _prior(pattern: _Pattern) -> float:
    return _PRIORS[pattern.name] / (2 if pattern.plane else 1)


def _normal(y: FloatArray, variance: FloatArray, columns: FloatArray) -> tuple[float, float, float]:
    covariance = columns @ columns.T + np.diag(variance)
    solved = np.linalg.solve(covariance, np.column_stack([y, columns[:, 0]]))
    log = -(np.linalg.slogdet(covariance)[1] + float(y @ solved[:, 0])) / 2
    return (
        log,
        float(columns[:, 0] @ solved[:, 0]),
        math.sqrt(max(1 - float(columns[:, 0] @ solved[:, 1]), 0.0)),
    )


def _moved_quantities(
    patterns: Sequence[_Pattern], fits: Sequence[tuple[float, float, float]], chance: FloatArray
) -> tuple[Moved, ...]:
    """Return what may have moved, in the words that alerts have for it; the likeliest first."""
    order = np.argsort(-chance)
    bayes = chance / [_prior(each) for each in patterns]
    similar = tuple(
        name
        for i in order[1:]
        if bayes[i] > bayes[order[0]] / _ALIKE
        for name in _names(patterns[i])[:1]
    )
    found: dict[str, Moved] = {}
    for rank, i in enumerate(order):
        names = _names(patterns[i])
        unit = {"tension": _TENSION_SD, TIME_BASE: _BASE_SD}.get(patterns[i].name, _DECADES_SD)
        for name in names:
            together = tuple(each for each in names if each != name)
            plane = next((each for each in PLANES if name.startswith(each)), None)
            size, sd = (unit * each for each in fits[i][1:])
            each = Moved(
                name, float(chance[i]), size, sd, None, plane, () if rank else similar, together
            )
            found.setdefault(name, each)
    return tuple(found.values())


def _names(pattern: _Pattern) -> tuple[str, ...]:
    if pattern.name == "ends":
        return ("transverse_end_stiffness", "longitudinal_end_stiffness")
    return (f"{pattern.plane}_end_stiffness",) if pattern.name == "end" else (pattern.name,)


_HINTS = ("logger", "swapped", "saturated", "drifting", "dead", "lost modes", "clock step")
"""Kinds of events that may be behind frequencies that move, the likeliest first."""
BESIDE = timedelta(hours=3)
"""Judgement: before a change and behind it: who exchanges a sensor works for an hour or two, and
when a change began is known to about as much."""
_LATELY = timedelta(hours=1)  # the hour of the alert itself


def led_by(alert: Alert, events: Sequence[StreamEvent]) -> Alert:
    """The alert, led by what was noticed at the time of its change, and by that its temperature is
    not known; as it is where nothing was.
    """
    if alert.change is None:
        return alert
    words = " ".join(filter(None, (_near(alert.change, events), _unknown(alert, events))))
    if not words:
        return alert
    hanger, _, rest = alert.message.partition(": ")
    return replace(alert, message=f"{hanger}: {words} {rest[:1].upper()}{rest[1:]}")


def _near(change: Change, events: Sequence[StreamEvent]) -> str:
    first, last = change.began_after - BESIDE, change.began_by + BESIDE
    near = [
        event
        for event in events
        if event.kind in _HINTS and event.start <= last and event.end >= first
    ]
    if not near:
        return ""
    event = min(near, key=lambda each: _HINTS.index(each.kind))
    reported = f"{event.channel}: {event.detail}" if event.channel else event.detail
    whose = "the logger said" if event.kind == "logger" else f"event '{event.kind}':"
    return (
        f"check the sensors first, at {event.start:%Y-%m-%d %H:%M} {whose} {reported.rstrip('.')}."
    )


def _unknown(alert: Alert, events: Sequence[StreamEvent]) -> str:
    reported = [e for e in events if e.kind == "thermometer" and e.end > alert.time - _LATELY]
    if not reported:
        return ""
    why = reported[-1].detail.partition(": ")[0]
    return f"the temperature is not known ({why}): part of this may be the weather's."
