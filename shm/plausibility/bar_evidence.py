"""Fit bars to modes, and weigh shifts of them.

Each hanger that a test may come from is fitted to its modes (`shm.plausibility.bars`), and misfits
are weighed with what may have changed and with what tests and bars err by.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from shm.models.classes.tensioned_beam import frequencies_hz
from shm.plausibility.limits import LIMITS
from shm.values import NAN, PLANES, BoolArray, FloatArray, Hanger, ModalTest

OriginKind: TypeAlias = Literal["hanger", "unknown bar", "time base", "planes"]

LATEST = 5
"""Of a hanger's earlier tests, how many say where its modes lie now."""

_MOST_ORDER, LEAST_MODES = 20, 3
"""Two frequencies fit any bar, by its tension and its ends."""

_PARAMETERS, _SPRINGS, _SHARE = 7, slice(2, 6), 6
"""ln of the tension ratio, ln c (`HangerModel`), log10 k L/EI of springs k1 to k4, and shear
over that of a solid section."""
_LIMITS = np.array([(-7, 4), (-3, 3), *[(-2.5, 4)] * 4, (0.01, 3)]).T
"""Technical: of the parameters in a fit."""


_TENSION = (math.log(0.6), 1.0)
"""Of ln(tension over nominal): of the assumed `tension_ratio`, mostly a third to 1.5."""


#         weight  ln T  ln c  log10 k  time base
ORDINARY = 0.93, 0.02, 3e-4, 0.05, 0.0
TIGHTER = 0.04, 0.25, 3e-4, 0.05, 0.0
OTHER_CLOCK = 1.0, 0.02, 3e-4, 0.05, 1.5
"""What tests of one hanger differ by, standard deviations: temperature; a tension that was lost or
restored; end springs of a third or three times; all of it. And a time base of any factor."""


# Of the bar's own mass, from what moves a mode by 0.1 % to a clamp of twice the bar; places up to
# the middle, as a mass acts alike from both ends.
_MASS_SHARES = np.geomspace(0.003, 2.0, 11)
_MASS_PLACES = np.linspace(0.05, 0.5, 10)


@dataclass(frozen=True)
class Origin:
    """An origin of a test; the hanger it is filed under where `kind` is empty."""

    kind: OriginKind | Literal[""] = ""
    hanger: int | None = None
    factor: float = NAN


@dataclass(frozen=True, eq=False)
class Seen:
    """ln f (2, orders) by plane and order, NaN where not measured, and the variance of each."""

    log_f: FloatArray
    variance: FloatArray

    @property
    def mask(self) -> BoolArray:
        return np.isfinite(self.log_f)

    def over(self, other: Seen) -> Seen:
        return Seen(self.log_f - other.log_f, self.variance + other.variance)

    def times(self, factor: float) -> Seen:
        return replace(self, log_f=self.log_f + math.log(factor))

    def exchanged(self) -> Seen:
        return Seen(self.log_f[::-1], self.variance[::-1])


def seen_in(tests: Sequence[ModalTest], hanger: Hanger) -> Seen:
    """The modes of tests of a hanger, the mean of several, without masses clamped on for a test."""
    shape, assumed = (len(tests), len(PLANES), _MOST_ORDER), hanger.assumptions
    log_f, variance = np.full(shape, NAN), np.zeros(shape)
    for row, test in enumerate(tests):
        for mode in test.regular_modes:
            if mode.order > _MOST_ORDER:
                continue
            at = row, PLANES.index(mode.plane), mode.order - 1
            sd, unstated = mode.frequency_sd_hz / mode.frequency_hz, assumed.unstated_frequency_sd
            log_f[at] = math.log(mode.frequency_hz)
            variance[at] = (sd if math.isfinite(sd) else unstated.value) ** 2
        if test.added_mass is not None:
            whole = hanger.mass_per_length_kg_m * hanger.length_m
            place = test.added_mass.x_m / hanger.length_m
            shift = _by_mass(np.array(test.added_mass.mass_kg / whole), np.array(place))
            log_f[row] -= shift
            variance[row] += (LIMITS.masses[1] * shift) ** 2
    count = np.isfinite(log_f).sum(axis=0)
    some = np.maximum(count, 1)
    mean = np.where(count, np.nansum(log_f, axis=0) / some, NAN)
    its = np.where(np.isfinite(log_f), variance, 0.0).sum(axis=0)
    return Seen(mean, its / some**2)


def _by_mass(share: FloatArray, place: FloatArray) -> FloatArray:
    """Return what a mass, as a share of the bar's, at a place does to ln f (..., orders)."""
    moves = np.sin(np.pi * np.arange(1, _MOST_ORDER + 1) * place[..., None]) ** 2
    return np.asarray(-0.5 * np.log1p(2 * share[..., None] * moves))


@dataclass(frozen=True, eq=False)
class Evidence:
    """Misfits `off` (2, orders) of ln f and what may be behind them.

    `sensitivity` (2, orders, 8); `changes` are weights with standard deviations (8,), `errors`
    weights with a standard deviation of each mode; `masses`: something may have been hung on it.
    """

    off: Seen
    sensitivity: FloatArray
    changes: tuple[tuple[float, FloatArray], ...]
    errors: tuple[tuple[float, float], ...] = LIMITS.test_errors
    masses: bool = False

    @property
    def mask(self) -> BoolArray:
        return self.off.mask

    def log_density(self, mask: BoolArray) -> float:
        """Log density of ln f of the modes in `mask` (2, orders), all of them measured."""
        off, way = self.off.log_f[mask], self.sensitivity[mask]
        weights, sds = zip(*self.changes, strict=True)
        shares, errors = np.array(self.errors).T
        shared = np.einsum("mi,ci,ni->cmn", way, np.array(sds) ** 2, way)
        covariance = shared[:, None] + np.diag(self.off.variance[mask])
        covariance = covariance + errors[:, None, None] ** 2 * self._error_correlation(mask)
        covariance = covariance.reshape(-1, len(off), len(off))
        found = _log_normal(off, covariance) + np.log(np.outer(weights, shares)).ravel()
        if self.masses:
            found = np.append(found, self._with_mass(mask))
        return log_sum(found)

    def _error_correlation(self, mask: BoolArray) -> FloatArray:
        """Correlation (modes, modes) of the errors: what a bar model lacks is of no mode alone."""
        its = np.eye(int(mask.sum()))
        if self.errors is LIMITS.test_errors:
            return its
        plane, order = mask.nonzero()
        log = np.log(order + 1.0)
        along = np.exp(-0.5 * (np.subtract.outer(log, log) / LIMITS.along_orders) ** 2)
        across = np.where(np.equal.outer(plane, plane), 1.0, 0.5)
        return np.asarray((1 - LIMITS.together) * its + LIMITS.together * along * across)

    def _with_mass(self, mask: BoolArray) -> float:
        """With something of any mass at any place hung on it."""
        share, place = (a.ravel() for a in np.meshgrid(_MASS_SHARES, _MASS_PLACES))
        shift = np.repeat(_by_mass(share, place)[:, None], 2, axis=1)[:, mask]
        way, (_, sds) = self.sensitivity[mask], self.changes[0]
        covariance = (way * sds**2) @ way.T + np.diag(
            self.off.variance[mask] + LIMITS.mass_error**2
        )
        wide = covariance + (LIMITS.masses[1] * shift)[:, :, None] ** 2 * np.eye(shift.shape[1])
        rest = self.off.log_f[mask] - shift
        _, size = np.linalg.slogdet(wide)
        along = np.linalg.solve(wide, rest[..., None])[..., 0]
        log = -0.5 * ((rest * along).sum(axis=1) + size + len(rest.T) * math.log(2 * math.pi))
        return log_sum(log) + math.log(LIMITS.masses[0] / len(log))


def _log_normal(off: FloatArray, covariance: FloatArray) -> FloatArray:
    """Log densities (k,) of `off` (modes,) by covariances (k, modes, modes).

    One or two of its modes may be mistaken.
    """
    inverse = np.linalg.inv(covariance)
    _, size = np.linalg.slogdet(covariance)
    every, modes = np.arange(len(covariance)), len(off)
    log = -0.5 * (inverse @ off @ off + size + modes * math.log(2 * math.pi))
    found, left = [log], np.ones((len(covariance), modes), dtype=bool)
    for _ in range(min(LIMITS.most_mistaken, modes - LEAST_MODES)):
        # Without a mode: less its density given the others, which the inverse holds.
        weight = np.where(left, np.diagonal(inverse, axis1=1, axis2=2), 1.0)
        given = 0.5 * np.log(weight / (2 * math.pi)) - 0.5 * (inverse @ off) ** 2 / weight
        worst = np.where(left, given, np.inf).argmin(axis=1)
        log = log - given[every, worst] + math.log(LIMITS.mistaken * LIMITS.mistaken_density)
        found.append(log)
        left[every, worst] = False
        row = inverse[every, worst]
        inverse = inverse - row[:, :, None] * row[:, None, :] / row[every, worst][:, None, None]
    return np.asarray(np.logaddexp.reduce(found))


def log_sum(values: FloatArray) -> float:
    return float(np.logaddexp.reduce(values))


def changes_of(*classes: tuple[float, ...]) -> tuple[tuple[float, FloatArray], ...]:
    return tuple((w, np.array([t, c, *(k,) * 4, 1e-3, clock])) for w, t, c, k, clock in classes)


@dataclass(frozen=True, eq=False)
class Bar:
    """A bar to be fitted to the modes `seen`, with its parameters' means and sds (7,) before."""

    hanger: Hanger
    seen: Seen
    mean: FloatArray
    sd: FloatArray

    @classmethod
    def described(cls, hanger: Hanger, seen: Seen, *, any_bar: bool = False) -> Bar:
        """Return the bar of a description; its tension and section may be any."""
        mean, sd = _prior(hanger)
        if any_bar:
            sd[:2] = LIMITS.any_bar
        return cls(hanger, seen, mean, sd)


@dataclass(frozen=True, eq=False)
class Fit:
    """A bar's likeliest parameters `theta` (7,), their ln f (2, orders) and slopes.

    `way` (2, orders, 8) is how ln f goes with the parameters and the time base.
    """

    bar: Bar
    theta: FloatArray
    log_f: FloatArray
    way: FloatArray

    def described(self) -> Evidence:
        """Return the modes by the priors of the description."""
        bar = self.bar
        away = self.theta - bar.mean
        off = bar.seen.log_f - self.log_f + self.way[..., :_PARAMETERS] @ away
        more = 3.0 if bar.hanger.turnbuckles else 1.0
        errors = tuple((weight, more * sd) for weight, sd in LIMITS.bar_errors)
        changes = ((1.0, np.append(bar.sd, 0.0)),)
        return Evidence(replace(bar.seen, log_f=off), self.way, changes, errors)

    def changed(self, shift: Seen) -> Evidence:
        """Return the hanger of earlier tests with whatever may have changed since."""
        changes = changes_of(ORDINARY, TIGHTER, LIMITS.looser, LIMITS.altered)
        moved = replace(shift, log_f=self.log_f + shift.log_f)
        sd = changes[-1][1][:_PARAMETERS]
        (fit,) = fit_bars([Bar(self.bar.hanger, moved, self.theta, sd)], self.theta)
        expected = fit.log_f - self.log_f
        off = shift.log_f - expected + fit.way[..., :_PARAMETERS] @ (fit.theta - self.theta)
        variance = shift.variance + np.nan_to_num(LIMITS.off_shift * expected) ** 2
        return Evidence(Seen(off, variance), fit.way, changes, masses=True)


def fit_bars(bars: Sequence[Bar], start: FloatArray | None = None) -> list[Fit]:
    """Fit each bar by Gauss-Newton steps with Student's weights, from `start` (7,) or three."""
    starts, rows = 1 if start is not None else len(LIMITS.starts), len(bars)
    log_f, stated, mean, sd = (
        np.repeat(each, starts, axis=0)
        for each in (
            [bar.seen.log_f for bar in bars],
            [bar.seen.variance for bar in bars],
            [bar.mean for bar in bars],
            [bar.sd for bar in bars],
        )
    )
    orders = int(np.flatnonzero(np.isfinite(log_f).any(axis=(0, 1))).max()) + 1
    solver = _Solver([bar.hanger for bar in bars for _ in range(starts)], orders)
    y = log_f[..., :orders].reshape(len(mean), -1)
    stated = stated[..., :orders].reshape(y.shape)
    measured = np.isfinite(y)
    theta = mean.copy()
    if start is None:
        theta[:, _SPRINGS] = np.tile(LIMITS.starts, rows)[:, None]
        theta[:, 0] = solver.string_tension(log_f)
    else:
        theta[:] = start
    for step in range(LIMITS.steps):
        variance = stated + max(LIMITS.fit_sd, LIMITS.wide * LIMITS.narrows**step) ** 2
        found, way = solver.with_slopes(theta)
        off = np.where(measured, y - found, 0.0)
        weight = measured * 4 / (3 + off**2 / variance) / variance
        normal = np.einsum("nki,nk,nkj->nij", way, weight, way)
        normal += np.eye(_PARAMETERS) / sd[:, None, :] ** 2
        slope = np.einsum("nki,nk->ni", way, weight * off) + (mean - theta) / sd**2
        move = np.linalg.solve(normal, slope[..., None])[..., 0]
        theta = np.clip(theta + move.clip(-1, 1), *_LIMITS)
    found, way = solver.with_slopes(theta)
    off = np.where(measured, y - found, 0.0)
    cost = 2 * np.log1p(off**2 / (stated + LIMITS.fit_sd**2) / 3).sum(axis=1)
    cost += 0.5 * (((theta - mean) / sd) ** 2).sum(axis=1)
    best = cost.reshape(rows, starts).argmin(axis=1) + starts * np.arange(rows)
    full_f = np.full((rows, 2, _MOST_ORDER), NAN)
    full_f[..., :orders] = found[best].reshape(rows, 2, orders)
    full_way = np.zeros((rows, 2, _MOST_ORDER, _PARAMETERS + 1))
    full_way[..., :orders, :_PARAMETERS] = way[best].reshape(rows, 2, orders, _PARAMETERS)
    full_way[..., _PARAMETERS] = 1.0
    return [Fit(*each) for each in zip(bars, theta[best], full_f, full_way, strict=True)]


class _Solver:
    """Frequencies of several Timoshenko beams on end springs at once, a parameter set (7,) each."""

    def __init__(self, hangers: Sequence[Hanger], orders: int):
        self._orders = orders
        self._length = np.array([h.length_m for h in hangers])
        self._nominal = np.array([h.nominal_tension_n for h in hangers])
        self._stiffness = np.array([h.bending_stiffness_n_m2 for h in hangers])
        self._mass = np.array([h.mass_per_length_kg_m for h in hangers])
        self._shear = np.array([h.shear_stiffness_n for h in hangers])
        self._gyration = np.sqrt([h.second_moment_m4 / h.area_m2 for h in hangers])

    def string_tension(self, log_f: FloatArray) -> FloatArray:
        """Return ln of the tension ratio (bars,) by the lowest mode of each, as of a string."""
        either = np.nanmin(np.where(np.isfinite(log_f), log_f, np.inf), axis=1)
        lowest = np.isfinite(either).argmax(axis=1)
        hz = np.exp(either[np.arange(len(either)), lowest])
        pull = self._mass * (2 * self._length * hz / (lowest + 1)) ** 2
        bends = self._stiffness * ((lowest + 1) * np.pi / self._length) ** 2
        ratio = np.maximum(pull - bends, 0.1 * pull) / self._nominal
        return np.asarray(np.log(ratio.clip(0.02, 5)))

    def with_slopes(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ln f (bars, 2 orders) and its derivatives (bars, 2 orders, 7)."""
        steps = np.array([1e-4, 1e-4, *(1e-3,) * 5])
        found = self._log_f(np.stack([theta, *(theta + step for step in np.diag(steps))]))
        slopes = (found[1:] - found[0]) / steps[:, None, None]
        return found[0], np.moveaxis(slopes, 0, -1)

    def _log_f(self, theta: FloatArray) -> FloatArray:
        """Return ln f (sets, bars, 2 orders) of parameters (sets, bars, 7)."""
        stiffer = np.exp(2 * theta[..., 1])
        stiffness = self._stiffness * stiffer
        springs = 10 ** theta[..., _SPRINGS] * (stiffness / self._length)[..., None]
        hz = frequencies_hz(
            self._length[:, None],
            (self._nominal * np.exp(theta[..., 0]))[..., None],
            stiffness[..., None],
            self._mass[:, None],
            springs[..., :2],
            springs[..., 2:],
            self._orders,
            (theta[..., _SHARE] / (self._shear * stiffer))[..., None],
            self._gyration[:, None],
        )
        return np.asarray(np.log(hz).reshape(*theta.shape[:2], -1))


def _uniform(lower: float, upper: float) -> tuple[float, float]:
    """Return mean and standard deviation of a uniform distribution."""
    return (lower + upper) / 2, (upper - lower) / math.sqrt(12)


def _prior(hanger: Hanger) -> tuple[FloatArray, FloatArray]:
    """Means and standard deviations (7,) of the parameters by the description."""
    scatter, assumed = hanger.scatter, hanger.assumptions
    shear, shear_sd = LIMITS.rod_shear
    if hanger.kind == "strand":
        shear, shear_sd = _uniform(*assumed.strand_shear_share.bounds)
    end, end_sd = _uniform(*(math.log10(each) for each in assumed.end_restraint.bounds))
    mean = np.array([_TENSION[0], 0.0, *(end,) * 4, shear])
    sd = np.array([_TENSION[1], LIMITS.model_c, *(end_sd,) * 4, shear_sd])
    if math.isfinite(scatter.tension):
        mean[0], sd[0] = 0.0, math.hypot(scatter.tension, scatter.section)
    its = [scatter.section / 2, scatter.density / 2, scatter.modulus / 2, 2 * scatter.length]
    plates_m = 2 * hanger.plate.length_m if hanger.plate is not None else 0.0
    # The length that swings lies anywhere between the taped one and that without fittings.
    open_share = (sum(hanger.fittings_m) + plates_m) / hanger.length_m
    mean[1] += open_share
    its.append(2 * open_share / math.sqrt(12))
    if math.isfinite(scatter.effective_length):
        its.append(2 * scatter.effective_length)
    if hanger.kind == "strand":
        if math.isfinite(scatter.bending_factor):
            its.append(scatter.bending_factor / 2)
        else:
            slip, slip_sd = _uniform(*map(math.log, assumed.strand_bending_factor.bounds))
            mean[1] += (slip - math.log(hanger.bending_stiffness_factor)) / 2
            its.append(slip_sd / 2)
    sd[1] = math.hypot(sd[1], *its)
    return mean, sd
