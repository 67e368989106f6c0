"""Fit bars to modes, and weigh shifts of them.

Each hanger that a test may come from is fitted to its modes (`shm.models.bar_fit`), and misfits are
weighed with what may have changed and with what tests and bars err by.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from shm.models.bar_fit import LIMITS as FIT
from shm.models.bar_fit import PARAMETERS, Fit, Seen, refit, shift_by_mass
from shm.plausibility.limits import LIMITS
from shm.values import NAN, BoolArray, FloatArray

OriginKind: TypeAlias = Literal["hanger", "unknown bar", "time base", "planes"]

LATEST = 5
"""Of a hanger's earlier tests, how many say where its modes lie now."""

LEAST_MODES = 3
"""Two frequencies fit any bar, by its tension and its ends."""

#         weight  ln T  ln c  log10 k  time base
ORDINARY = 0.93, 0.02, 3e-4, 0.05, 0.0
TIGHTER = 0.04, 0.25, 3e-4, 0.05, 0.0
OTHER_CLOCK = 1.0, 0.02, 3e-4, 0.05, 1.5
OTHER_BAR = 1.0, 2.0, 0.7, 0.05, 0.0
"""What tests of one hanger differ by, standard deviations: temperature; a tension that was lost or
restored; end springs of a third or three times; all of it. And a time base of any factor; a
bar of any tension and section."""


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
class Evidence:
    """Misfits `off` (2, orders) of ln f and what may be behind them.

    `sensitivity` (2, orders, 8); `changes` are weights with standard deviations (8,), `errors`
    weights with a standard deviation of each mode; `masses`: something may have been hung on it;
    `restored`: the same against its baseline, as often as a tension is lost or restored.
    """

    off: Seen
    sensitivity: FloatArray
    changes: tuple[tuple[float, FloatArray], ...]
    errors: tuple[tuple[float, float], ...] = LIMITS.test_errors
    masses: bool = False
    restored: Evidence | None = None

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
        if self.restored is not None and not (mask & ~self.restored.mask).any():
            back = self.restored.log_density(mask) + math.log(TIGHTER[0])
            found = np.append(found, back)
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
        shift = np.repeat(shift_by_mass(share, place)[:, None], 2, axis=1)[:, mask]
        way, (_, sds) = self.sensitivity[mask], self.changes[0]
        covariance = (way * sds**2) @ way.T + np.diag(
            self.off.variance[mask] + LIMITS.mass_error**2
        )
        wide = covariance + (FIT.rayleigh * shift)[:, :, None] ** 2 * np.eye(shift.shape[1])
        rest = self.off.log_f[mask] - shift
        _, size = np.linalg.slogdet(wide)
        along = np.linalg.solve(wide, rest[..., None])[..., 0]
        log = -0.5 * ((rest * along).sum(axis=1) + size + len(rest.T) * math.log(2 * math.pi))
        return log_sum(log) + math.log(LIMITS.mass / len(log))


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


def weigh_description(fit: Fit) -> Evidence:
    """Return the modes by the priors of the description."""
    bar = fit.bar
    away = fit.theta - bar.mean
    off = bar.seen.log_f - fit.log_f + fit.way[..., :PARAMETERS] @ away
    more = 3.0 if bar.hanger.turnbuckles else 1.0
    errors = tuple((weight, more * sd) for weight, sd in LIMITS.bar_errors)
    changes = ((1.0, np.append(bar.sd, 0.0)),)
    return Evidence(replace(bar.seen, log_f=off), fit.way, changes, errors)


def weigh_change(before: Fit, shift: Seen) -> Evidence:
    """Return the hanger of earlier tests with whatever may have changed since."""
    changes = changes_of(ORDINARY, TIGHTER, LIMITS.looser, LIMITS.altered)
    fit = refit(before, shift, changes[-1][1][:PARAMETERS])
    expected = fit.log_f - before.log_f
    off = shift.log_f - expected + fit.way[..., :PARAMETERS] @ (fit.theta - before.theta)
    variance = shift.variance + np.nan_to_num(LIMITS.off_shift * expected) ** 2
    return Evidence(Seen(off, variance), fit.way, changes, masses=True)
