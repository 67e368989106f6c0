"""A pooled reading of a permanent sensor as one number: how far the tension has moved.

The change of each mode's log frequency over its sensitivity d ln f / d ln T is a change of tension;
all modes together give it by robust weighted least squares, so that one that went astray (close
planes exchanged, a peak of the deck) moves nothing. What a mode differs by from the others is
learnt, for days: a reading that lacks a mode must not look like a step.

Frequencies of a bar on springs are homogeneous of degree 1/2 in tension, bending stiffness and
springs. So what a kelvin does by softening steel is -3e-4 (1/2 - d ln f / d ln T).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shm.models import class_of
from shm.models.tensioned_beam import frequencies_hz
from shm.values import BoolArray, FloatArray, Hanger, Mode, Moved, Plane, Posterior
from shm.values.stream import PooledReading
from shm.watch.quantities import MeasuredMode, base_point, log_frequencies, moved
from shm.watch.steel_softening import MODULUS_PER_KELVIN

LEAST_SD = 3e-5
"""Of an hourly log frequency: 1 Hz is read to 1/30 mHz at best, and clocks wander by as much."""
_UNKNOWN_SD = 1e-3  # as of a hammer test without stated errors (`readings`)
_MEMORY_READINGS = 120.0  # judgement: five days of what modes differ by, ten times a night's
_DEGREES = 4.0  # judgement: of Student's t, as robust regressions take (Lange et al. 1989)
_ROUNDS = 4  # technical: of reweighting, from the weighted median on
_CLIP = 4.0  # sds: what a mode may add to its spread at once
_STEP = 0.01  # technical: of the tension, for a slope by central differences
_DECADES = 0.1  # technical: of the springs, likewise
# What is tried where there is no baseline: xi = L sqrt(T/EI) from slack to a slender cable, springs
# k L/EI from pinned to clamped, and the share of the solid stiffness that a strand may have.
_XI = np.geomspace(0.5, 300.0, 240)
_SPRINGS = np.geomspace(0.03, 1000.0, 10)
# Of a sum of misfits: modes fit a beam to 0.3 % each, nominal tensions are good to 15 %. Judgement.
_NOMINAL = 0.003 * 3 / 0.15
_STRAND_SHARES = np.array([0.3, 0.45, 0.65, 1.0])


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Of n modes: d ln f / d ln T, and by a decade of all end springs; `tension_n` they are at."""

    tension: FloatArray
    ends: FloatArray
    tension_n: float


def sensitivities(
    baseline: Posterior | None, hanger: Hanger, modes: Sequence[Mode]
) -> Sensitivities:
    """By the baseline's model class; without one, by the beam on springs that fits `modes` best."""
    keys = [(mode.plane, mode.order) for mode in modes]
    if baseline is not None:
        return _of_baseline(baseline, hanger, keys)
    return _of_beam(hanger, keys, np.log([mode.frequency_hz for mode in modes]))


def _of_baseline(
    baseline: Posterior, hanger: Hanger, keys: Sequence[MeasuredMode]
) -> Sensitivities:
    model = class_of(baseline, hanger)
    base = base_point(baseline, model)
    theta = np.tile(base, (2, 1))
    theta[:, model.parameter_names.index("theta_F")] *= np.exp([_STEP, -_STEP])
    up, down = log_frequencies(model, theta, keys)
    springs = [i for i, each in enumerate(model.parameter_names) if each.startswith("log10_k")]
    ends = np.array([_DECADES, -_DECADES])
    stiff, soft = log_frequencies(model, moved(model, base, springs, ends), keys)
    return Sensitivities(
        (up - down) / (2 * _STEP), (stiff - soft) / (2 * _DECADES), float(baseline.tension_n.mean())
    )


def _of_beam(hanger: Hanger, keys: Sequence[MeasuredMode], log_hz: FloatArray) -> Sensitivities:
    """By the least sum of absolute misfits, springs by plane: a mode with a wrong order counts for
    little. The nominal tension tells a slack bar on stiff springs from a taut one on soft ones."""
    order = np.array([each for _, each in keys]) - 1
    shares = _STRAND_SHARES if hanger.kind == "strand" else np.ones(1)
    length_m, mass = np.asarray(hanger.length_m), np.asarray(hanger.mass_per_length_kg_m)

    def log_f(xi: FloatArray, k: FloatArray, share: FloatArray) -> FloatArray:
        bending = hanger.bending_stiffness_n_m2 * share
        spring = k * bending / length_m
        tension = bending * (xi / length_m) ** 2
        found = frequencies_hz(length_m, tension, bending, mass, spring, spring, order.max() + 1)
        return np.asarray(np.log(found[..., order]))

    xi, k, share = np.meshgrid(_XI, _SPRINGS, shares, indexing="ij")
    misfit, planes = np.abs(log_f(xi, k, share) - log_hz), planes_of(keys).values()
    by_plane = [misfit[..., own].sum(axis=-1) for own in planes]
    tension_n = hanger.bending_stiffness_n_m2 * share * (xi / length_m) ** 2
    total = sum(each.min(axis=1) for each in by_plane)
    if hanger.nominal_tension_n > 0:
        total = total + _NOMINAL * np.abs(np.log(tension_n[:, 0] / hanger.nominal_tension_n))
    at, of = np.unravel_index(int(np.argmin(total)), total.shape)
    springs = np.zeros(len(keys))
    for own, each in zip(planes, by_plane, strict=True):
        springs[own] = _SPRINGS[each[at, :, of].argmin()]
    mode = np.arange(len(keys))

    def each_mode(xi_by: float, k_by: float) -> FloatArray:
        return log_f(_XI[at] * xi_by, springs * k_by, shares[of])[mode, mode]

    up, down = (each_mode(math.exp(way * _STEP / 2), 1.0) for way in (1, -1))
    stiff, soft = (each_mode(1.0, 10 ** (way * _DECADES)) for way in (1, -1))
    return Sensitivities(
        (up - down) / (2 * _STEP), (stiff - soft) / (2 * _DECADES), float(tension_n[at, 0, of])
    )


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
        found = sensitivities(baseline, hanger, modes)
        keys = tuple((mode.plane, mode.order) for mode in modes)
        level, sd = _measured(modes)
        zero = np.zeros(len(keys))
        return cls(keys, found.tension, found.ends, level, sd**2, zero, found.tension_n)

    def with_new(
        self, baseline: Posterior | None, hanger: Hanger, modes: Sequence[Mode], shift: float
    ) -> ModeTable:
        """With modes that were not seen before, at a tension moved by `shift`."""
        new = [mode for mode in modes if (mode.plane, mode.order) not in self.modes]
        if not new:
            return self
        more = ModeTable.of(baseline, hanger, new)
        parts: dict[str, Any] = {
            name: np.append(getattr(self, name), getattr(more, name))
            for name in ("tension", "ends", "spread", "readings")
        }
        level = np.append(self.level, more.level - more.tension * shift)
        return replace(self, modes=(*self.modes, *more.modes), level=level, **parts)

    @property
    def softer(self) -> FloatArray:
        """By what ln f goes with a kelvin, as steel softens."""
        return np.asarray(MODULUS_PER_KELVIN * (0.5 - self.tension))

    def seen(self, modes: Sequence[Mode], warmth_k: float) -> SeenReading:
        """A reading in the places of the table's modes, NaN where it lacks one."""
        off, variance = np.full(len(self.modes), np.nan), np.full(len(self.modes), np.inf)
        own = [self.modes.index((mode.plane, mode.order)) for mode in modes]
        log_hz, sd = _measured(modes)
        off[own] = log_hz - self.level[own] - warmth_k * self.softer[own]
        variance[own] = np.maximum(sd**2, self.spread[own])
        return _read(off, variance, self.tension)

    def learnt(self, seen: SeenReading) -> ModeTable:
        """With what a reading adds to each mode's level and spread.

        What is left over once the tension is taken off adds up to 0 in the tension's direction:
        the levels cannot take up what the tension does.
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

    `off` (n,) are the modes' own changes of ln f, warmth of steel taken off.
    """

    shift: float
    variance: float
    off: FloatArray
    left: FloatArray


def usable(reading: PooledReading) -> tuple[Mode, ...]:
    """The modes that say something of the tension, each once."""
    found: dict[MeasuredMode, Mode] = {}
    for mode in reading.modes:
        is_measured = np.isfinite(mode.frequency_hz) and mode.frequency_hz > 0
        if is_measured and not mode.irregular and not np.isinf(mode.frequency_sd_hz):
            found.setdefault((mode.plane, mode.order), mode)
    return tuple(found.values())


def _measured(modes: Sequence[Mode]) -> tuple[FloatArray, FloatArray]:
    hz = np.array([mode.frequency_hz for mode in modes])
    sd = np.array([mode.frequency_sd_hz for mode in modes]) / hz
    return np.log(hz), np.where(sd > 0, np.maximum(sd, LEAST_SD), _UNKNOWN_SD)


def _read(off: FloatArray, variance: FloatArray, slope: FloatArray) -> SeenReading:
    """Reweighted least squares from the weighted median on; errors grow where the modes differ."""
    known = np.isfinite(off)
    y, v, s = off[known], variance[known], slope[known]
    shift = _weighted_median(y / s, s / np.sqrt(v))
    for _ in range(_ROUNDS):
        weight = (_DEGREES + 1) / (_DEGREES + (y - s * shift) ** 2 / v) / v
        weight = np.minimum(weight, 1 / v)  # no mode is better than it says
        information = float(weight @ s**2)
        shift = float(weight @ (s * y)) / information
    misfit = float(weight @ (y - s * shift) ** 2) / max(len(y) - 1, 1)
    return SeenReading(shift, max(misfit, 1.0) / information, off, off - slope * shift)


def _weighted_median(values: FloatArray, weight: FloatArray) -> float:
    order = np.argsort(values)
    share = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(share, share[-1] / 2)])


def planes_of(modes: Sequence[MeasuredMode]) -> dict[str, BoolArray]:
    """Which modes (n,) are of each plane, for the planes that have any."""
    found = [plane for plane, _ in modes]
    return {plane: np.array([each == plane for each in found]) for plane in dict.fromkeys(found)}


# ---------------------------------------------------------------- what moved the modes

TIME_BASE = "timebase"
_SENSOR, _UNEXPLAINED = "sensor_mass", "unexplained"
_MEASUREMENT = (TIME_BASE, _SENSOR, _UNEXPLAINED)
# Prior sds: 3 % of ln T, 0.3 decades (`quantities`), 1 % of a time base and of single modes.
_TENSION_SD, _DECADES_SD, _BASE_SD, _MODE_SD = 0.03, 0.3, 0.01, 0.01
_ALIKE = 20.0  # a log Bayes factor of 3, as `Moved.alike` has it
_HOURS_TOGETHER = 3.0  # judgement: of that many readings the errors are one
MODEL_OFF = 0.2  # judgement: of bending's share in a sensitivity, and of springs'
_EACH_OFF = 0.05  # judgement: likewise, of each mode by itself
_LEFT_SD = 1e-3  # of ln T: what the conditions leave while something else changes
_ASTRAY_SD, _ASTRAY = 0.03, 0.02  # judgement: how far and how often a single mode goes astray
# Judgement: tensions, ends in both planes, ends in one, a time base, one plane's sensors, others.
_PRIORS = {"tension": 0.5, "ends": 0.1, "end": 0.1, TIME_BASE: 0.1, _SENSOR: 0.1, _UNEXPLAINED: 0.1}


@dataclass(frozen=True, eq=False)
class _Pattern:
    """A hypothesis of what moved n modes: along columns (n, k) of prior sd 1, modes off by `sd`."""

    name: str
    columns: FloatArray
    sd: FloatArray
    plane: str = ""


@dataclass(frozen=True, eq=False)
class Cause:
    """What moved the modes most likely, all that may have `moved`, and how each mode did."""

    name: str
    moved: tuple[Moved, ...]
    by_mode: FloatArray
    size: float
    plane: str = ""

    @property
    def is_measurement(self) -> bool:
        """Whether it is none of the hanger, so that nobody need go there today."""
        return self.name in _MEASUREMENT

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
        return (
            "The modes moved, each by its own fraction, as no tension moves them. "
            "Check sensors, channels and the orders of modes."
        )


def cause_of(moved: FloatArray, table: ModeTable, readings: FloatArray) -> Cause:
    """Of mean log frequencies that moved (n,), NaN where unknown, over so many `readings` each."""
    known = np.isfinite(moved) & (readings > 0)
    sub = replace(
        table,
        modes=tuple(mode for mode, own in zip(table.modes, known, strict=True) if own),
        **{name: getattr(table, name)[known] for name in ("tension", "ends", "spread")},
    )
    y, count = moved[known], np.maximum(readings[known] / _HOURS_TOGETHER, 1)
    variance = sub.spread / count + LEAST_SD**2
    patterns = _patterns(sub, y)
    fits = [_fit(y, variance, each) for each in patterns]
    log_each = np.array([fit[0] for fit in fits])
    chance = np.exp(log_each - log_each.max())
    chance = chance / chance.sum()
    best = int(chance.argmax())
    total = _moved_quantities(patterns, fits, chance)
    size = fits[best][1]
    if patterns[best].name == TIME_BASE:  # of all modes, those too that sleep at night
        size = float(np.median(y))
        moved = np.full(len(known), size)
    return Cause(patterns[best].name, total, moved, size, patterns[best].plane)


def _patterns(table: ModeTable, y: FloatArray) -> list[_Pattern]:
    """All hypotheses; the larger a change, the more it is off by what the patterns are off."""
    s, e, n = table.tension, table.ends, len(table.tension)
    left, none = _LEFT_SD * s[:, None], np.zeros(n)
    bent = (0.5 - s) * abs(float(s @ y) / float(s @ s))
    loose = e * abs(float(e @ y) / float(e @ e))
    order = np.array([each for _, each in table.modes])
    tilt = (order - order.mean()) / max(order.max() - 1, 1)
    of_ends = np.column_stack([_DECADES_SD * e, MODEL_OFF * loose * tilt, left])
    found = [
        _Pattern("tension", np.column_stack([_TENSION_SD * s, MODEL_OFF * bent]), _EACH_OFF * bent),
        _Pattern("ends", of_ends, _EACH_OFF * loose),
        _Pattern(TIME_BASE, np.column_stack([np.full(n, _BASE_SD), left]), none),
        _Pattern(_UNEXPLAINED, left, np.full(n, _MODE_SD)),
    ]
    planes = planes_of(table.modes)
    for plane, own in planes.items() if len(planes) > 1 else ():
        of_end = of_ends * np.column_stack([own, own, np.ones(n)])
        found += [
            _Pattern("end", of_end, _EACH_OFF * loose * own, plane),
            _Pattern(_SENSOR, left, np.where(own, _MODE_SD, 0.0), plane),
        ]
    return found


def _fit(y: FloatArray, variance: FloatArray, pattern: _Pattern) -> tuple[float, float, float]:
    """Log evidence, size along the first column with its sd; a mode may have gone astray."""
    n = len(y)
    astray = [np.zeros(n), *(_ASTRAY_SD**2 * np.eye(n) if n > 2 else ())]
    both = [_normal(y, variance + pattern.sd**2 + more, pattern.columns) for more in astray]
    log_each = np.array([each[0] for each in both]) + np.where(
        np.arange(len(both)) > 0, math.log(_ASTRAY), 0.0
    )
    best = int(log_each.argmax())
    prior = _PRIORS[pattern.name] / (2 if pattern.plane else 1)
    return float(np.logaddexp.reduce(log_each)) + math.log(prior), both[best][1], both[best][2]


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
    """What may have moved, in the words that alerts have for it; the likeliest first."""
    order = np.argsort(-chance)
    alike = tuple(
        name
        for i in order[1:]
        if chance[i] > chance[order[0]] / _ALIKE
        for name in _names(patterns[i])[:1]
    )
    found: dict[str, Moved] = {}
    for rank, i in enumerate(order):
        names = _names(patterns[i])
        unit = {"tension": _TENSION_SD, TIME_BASE: _BASE_SD}.get(patterns[i].name, _DECADES_SD)
        for name in names:
            together = tuple(each for each in names if each != name)
            plane: Plane | None = name.partition("_end_")[0] if "_end_" in name else None  # type: ignore[assignment]
            size, sd = (unit * each for each in fits[i][1:])
            each = Moved(
                name, float(chance[i]), size, sd, None, plane, () if rank else alike, together
            )
            found.setdefault(name, each)
    return tuple(found.values())


def _names(pattern: _Pattern) -> tuple[str, ...]:
    if pattern.name == "ends":
        return ("transverse_end_stiffness", "longitudinal_end_stiffness")
    return (f"{pattern.plane}_end_stiffness",) if pattern.name == "end" else (pattern.name,)
