"""Fit a Timoshenko beam on end springs to measured modes, as its description allows.

Whoever asks what bar a test shows asks here: is it this hanger's, which of a baseline's modes are
mistaken, what tension does a held test imply. Gauss-Newton steps from three kinds of ends, with
Student's weights (Lange et al. 1989): a mode of a wrong order counts for little.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.models.classes.tensioned_beam import frequencies_hz
from shm.values import NAN, PLANES, BoolArray, FloatArray, Hanger, ModalTest, Plane


@dataclass(frozen=True)
class FitLimits:
    """Hold the limits of a fit; where no source is named it is a judgement."""

    # log10 k L/EI near a pin, in the middle and near a clamp, from where fits begin.
    starts: tuple[float, ...] = (-1.0, 0.75, 2.5)
    # Misfits of 10 % count at first, those of 0.2 % in the end.
    steps: int = 14
    wide: float = 0.1
    narrows: float = 0.5
    fit_sd: float = 2e-3
    # Of ln c: what end zones and sensors do to a bar that is taken as uniform.
    model_c: float = 0.005
    # Of the share of shear of a rod: that of theory.
    rod_shear: tuple[float, float] = (1.0, 0.02)
    # Of ln(tension over nominal): of the assumed `tension_ratio`, mostly a third to 1.5.
    tension: tuple[float, float] = (math.log(0.6), 1.0)
    # Standard deviations of ln tension and ln c of a bar that nobody described: c from a quarter to
    # four times as large, as that of a bar of half or twice the length is.
    any_bar: tuple[float, float] = (2.0, 0.7)
    # Share by which Rayleigh's quotient of a bar with a mass errs.
    rayleigh: float = 0.15


LIMITS = FitLimits()
MOST_ORDER = 20  # higher ones say next to nothing of the tension
PARAMETERS, SPRINGS = 7, slice(2, 6)
"""ln of the tension ratio, ln c (`HangerModel`), log10 k L/EI of springs k1 to k4, and shear
over that of a solid section."""
_SHARE = 6
_BOUNDS = np.array([(-7, 4), (-3, 3), *[(-2.5, 4)] * 4, (0.01, 3)]).T
"""Technical: of the parameters in a fit."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Hold measured modes: ln f by plane and order, and the variance of each.

    Both are (2, MOST_ORDER); `log_f` is NaN where a mode was not measured.
    """

    log_f: FloatArray
    variance: FloatArray

    @classmethod
    def of(cls, modes: Sequence[tuple[Plane, int]], log_f: FloatArray) -> Seen:
        """Return modes (n,) that are known exactly; those above the highest order are left out."""
        made = cls(np.full((len(PLANES), MOST_ORDER), NAN), np.zeros((len(PLANES), MOST_ORDER)))
        for (plane, order), its in zip(modes, log_f.tolist(), strict=True):
            if order <= MOST_ORDER:
                made.log_f[PLANES.index(plane), order - 1] = its
        return made

    @property
    def mask(self) -> BoolArray:
        return np.isfinite(self.log_f)

    def over(self, other: Seen) -> Seen:
        """Return the ratios of these frequencies to others."""
        return Seen(self.log_f - other.log_f, self.variance + other.variance)

    def times(self, factor: float) -> Seen:
        """Return the frequencies so many times as high."""
        return replace(self, log_f=self.log_f + math.log(factor))

    def exchanged(self) -> Seen:
        """Return the modes with the planes exchanged."""
        return Seen(self.log_f[::-1], self.variance[::-1])


def seen_in(tests: Sequence[ModalTest], hanger: Hanger) -> Seen:
    """Return the modes of tests, the mean of several, without masses clamped on for a test."""
    shape, assumed = (len(tests), len(PLANES), MOST_ORDER), hanger.assumptions
    log_f, variance = np.full(shape, NAN), np.zeros(shape)
    for row, test in enumerate(tests):
        for mode in test.regular_modes:
            if mode.order > MOST_ORDER or not mode.frequency_hz > 0:
                continue
            at = row, PLANES.index(mode.plane), mode.order - 1
            sd, unstated = mode.frequency_sd_hz / mode.frequency_hz, assumed.unstated_frequency_sd
            log_f[at] = math.log(mode.frequency_hz)
            variance[at] = (sd if 0 < sd < math.inf else unstated.value) ** 2
        if test.added_mass is not None:
            whole = hanger.mass_per_length_kg_m * hanger.length_m
            place = test.added_mass.x_m / hanger.length_m
            shift = shift_by_mass(np.array(test.added_mass.mass_kg / whole), np.array(place))
            log_f[row] -= shift
            variance[row] += (LIMITS.rayleigh * shift) ** 2
    count = np.isfinite(log_f).sum(axis=0)
    some = np.maximum(count, 1)
    mean = np.where(count, np.nansum(log_f, axis=0) / some, NAN)
    its = np.where(np.isfinite(log_f), variance, 0.0).sum(axis=0)
    return Seen(mean, its / some**2)


def shift_by_mass(share: FloatArray, place: FloatArray) -> FloatArray:
    """Return what a mass, as a share of the bar's, at a place does to ln f (..., orders)."""
    moves = np.sin(np.pi * np.arange(1, MOST_ORDER + 1) * place[..., None]) ** 2
    return np.asarray(-0.5 * np.log1p(2 * share[..., None] * moves))


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


def refit(before: Fit, shift: Seen, sd: FloatArray) -> Fit:
    """Fit a bar whose modes have shifted, its parameters off those of `before` by `sd` (7,)."""
    moved = replace(shift, log_f=before.log_f + shift.log_f)
    return fit_bars([Bar(before.bar.hanger, moved, before.theta, sd)], before.theta)[0]


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
        theta[:, SPRINGS] = np.tile(LIMITS.starts, rows)[:, None]
        theta[:, 0] = solver.string_tension(log_f)
    else:
        theta[:] = start
    for step in range(LIMITS.steps):
        variance = stated + max(LIMITS.fit_sd, LIMITS.wide * LIMITS.narrows**step) ** 2
        found, way = solver.with_slopes(theta)
        off = np.where(measured, y - found, 0.0)
        weight = measured * 4 / (3 + off**2 / variance) / variance
        normal = np.einsum("nki,nk,nkj->nij", way, weight, way)
        normal += np.eye(PARAMETERS) / sd[:, None, :] ** 2
        slope = np.einsum("nki,nk->ni", way, weight * off) + (mean - theta) / sd**2
        move = np.linalg.solve(normal, slope[..., None])[..., 0]
        theta = np.clip(theta + move.clip(-1, 1), *_BOUNDS)
    found, way = solver.with_slopes(theta)
    off = np.where(measured, y - found, 0.0)
    cost = 2 * np.log1p(off**2 / (stated + LIMITS.fit_sd**2) / 3).sum(axis=1)
    cost += 0.5 * (((theta - mean) / sd) ** 2).sum(axis=1)
    best = cost.reshape(rows, starts).argmin(axis=1) + starts * np.arange(rows)
    full_f = np.full((rows, 2, MOST_ORDER), NAN)
    full_f[..., :orders] = found[best].reshape(rows, 2, orders)
    full_way = np.zeros((rows, 2, MOST_ORDER, PARAMETERS + 1))
    full_way[..., :orders, :PARAMETERS] = way[best].reshape(rows, 2, orders, PARAMETERS)
    full_way[..., PARAMETERS] = 1.0
    return [Fit(*each) for each in zip(bars, theta[best], full_f, full_way, strict=True)]


class _Solver:
    """Frequencies of several Timoshenko beams on end springs at once, a parameter set (7,) each."""

    def __init__(self, hangers: Sequence[Hanger], orders: int):
        self._orders = orders
        self._length = np.array([h.length_m for h in hangers])
        self._nominal = np.array(list(map(nominal_n, hangers)))
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
        springs = 10 ** theta[..., SPRINGS] * (stiffness / self._length)[..., None]
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


def nominal_n(hanger: Hanger) -> float:
    """Return the nominal tension; where none is stated, Euler's load."""
    if hanger.nominal_tension_n > 0:
        return hanger.nominal_tension_n
    return math.pi**2 * hanger.bending_stiffness_n_m2 / hanger.length_m**2


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
    mean = np.array([LIMITS.tension[0], 0.0, *(end,) * 4, shear])
    sd = np.array([LIMITS.tension[1], LIMITS.model_c, *(end_sd,) * 4, shear_sd])
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
