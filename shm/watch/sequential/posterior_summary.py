"""What the bank says after a test: what changed, since when, and how far each quantity is.

Shifts in the units that people read, of mixtures of normal distributions in the coordinate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np
import scipy

from shm.values import (
    NAN,
    TENSION,
    Change,
    Drift,
    FloatArray,
    Hanger,
    Moved,
    Reading,
    WatchedQuantity,
)
from shm.watch.options import WatchOptions
from shm.watch.quantities import coordinate_of, shift_of, value_at
from shm.watch.sequential.bank import STEP, Bank, log_total
from shm.watch.sequential.design import DAYS_PER_YEAR

_ALIKE_NATS = 3.0  # 20 to 1: what is as likely is named beside
_TAIL = 0.05  # 90 % lie between
_DIGITS = 3  # probabilities that read alike are ordered by tension first


@dataclass(frozen=True, eq=False)
class Subject:
    """What all tests of one hanger share; `start` is the time of the first reading."""

    quantities: tuple[WatchedQuantity, ...]
    hanger: Hanger
    options: WatchOptions
    start: datetime

    def at(self, years: float) -> datetime:
        """The time so many years from the start."""
        return self.start + timedelta(days=years * DAYS_PER_YEAR)


def probability_of_change(bank: Bank, options: WatchOptions) -> float:
    """That something has changed since the last call, if changes come at the rate assumed."""
    odds = bank.log_statistic + math.log(options.change_rate_per_year)
    return 1 / (1 + math.exp(min(-odds, 700.0)))


def changed(subject: Subject, bank: Bank, reading: Reading, before: float) -> Change:
    """The change since the last call; `before` is the probability that there was one earlier."""
    now = probability_of_change(bank, subject.options)
    began_after, began_by = _began(subject, bank, reading)
    return Change(
        evidence_years=math.exp(min(bank.log_evidence, 700.0)),
        limit_years=subject.options.limit_years,
        probability=1 - (1 - before) * (1 - now),
        sudden=_sudden(bank),
        began_after=began_after,
        began_by=began_by,
        moved=_moved(subject.quantities, bank),
        outlier_probability=float(_weights(bank, now) @ bank.outlier),
    )


def _weights(bank: Bank, probability: float) -> FloatArray:
    """The probability of each filter (B,), given that of a change."""
    none = (1 - probability) * np.exp(bank.log_mass[: bank.scatters])
    return np.concatenate([none, probability * bank.shares.ravel()])


def _sudden(bank: Bank) -> float:
    return float(bank.shares[:, :, STEP].sum()) if bank.beginnings else NAN


def _began(subject: Subject, bank: Bank, reading: Reading) -> tuple[datetime, datetime]:
    """Between which times the change began, with 90 % probability; the test's own if none can."""
    if not bank.beginnings:
        return reading.time, reading.time
    reached = np.cumsum(bank.shares.sum(axis=(1, 2, 3)))
    last = len(bank.beginnings) - 1
    first, final = (min(int(np.searchsorted(reached, p)), last) for p in (_TAIL, 1 - _TAIL))
    return (
        subject.at(bank.beginnings[first].after_years),
        subject.at(bank.beginnings[final].by_years),
    )


def _moved(quantities: Sequence[WatchedQuantity], bank: Bank) -> tuple[Moved, ...]:
    """Each quantity as one that changed, the likeliest first.

    A spring precedes the tension that is as likely: a part of its loss may be read as tension.
    """
    if not bank.beginnings:
        return ()
    log_mass = np.logaddexp.reduce(bank.changes.reshape(-1, len(bank.directions)), axis=0)
    probability = np.minimum(np.exp(log_mass - log_total(log_mass)) @ bank.members, 1.0)
    is_tension = [quantity.name == TENSION for quantity in quantities]
    return tuple(
        _as_changed(quantities, bank, j, log_mass, float(probability[j]))
        for j in np.lexsort([is_tension, -probability.round(_DIGITS)]).tolist()
    )


def _as_changed(
    quantities: Sequence[WatchedQuantity],
    bank: Bank,
    j: int,
    log_mass: FloatArray,
    probability: float,
) -> Moved:
    """Quantity `j`, given that it changed; `log_mass` (D,) is what speaks for each direction."""
    quantity = quantities[j]
    weights = _given(bank, bank.shares * bank.members[:, j])[bank.scatters :]
    at = bank.design.known + j
    size = bank.filters.mean[bank.scatters :, at]
    variance = np.maximum(bank.filters.covariance[bank.scatters :, at, at], 0)
    progress = bank.progress[bank.scatters :]
    shift = shift_of_mixture(quantity, weights, progress * size, progress * np.sqrt(variance))
    together, alike = _company(bank, j, log_mass)
    return Moved(
        quantity=quantity.name,
        probability=probability,
        shift_mean=shift.mean,
        shift_sd=shift.sd,
        end=quantity.end,
        plane=quantity.plane,
        alike=tuple(quantities[i].name for i in alike),
        together=tuple(quantities[i].name for i in together),
    )


def _company(bank: Bank, j: int, log_mass: FloatArray) -> tuple[list[int], list[int]]:
    """What moves with quantity `j` in the likeliest direction with it; what does as well without.

    The latter are the quantities of the directions without `j` whose evidence is as good, those
    aside that only add to another such.
    """
    members = bank.members
    likeliest = int(np.argmax(np.where(members[:, j], log_mass, -np.inf)))
    close = np.abs(log_mass - log_mass[likeliest]) < _ALIKE_NATS
    others = [set(np.flatnonzero(each).tolist()) for each in members[close & ~members[:, j]]]
    fewest = [each for each in others if not any(other < each for other in others)]
    together = set(np.flatnonzero(members[likeliest]).tolist())
    return sorted(together - {j}), sorted(set().union(*fewest) - together)


def _given(bank: Bank, shares: FloatArray) -> FloatArray:
    """The probability of each filter (B,), given one of the changes with `shares`."""
    return np.concatenate([np.zeros(bank.scatters), (shares / shares.sum()).ravel()])


def drifted(subject: Subject, bank: Bank, reading: Reading) -> tuple[Drift, ...]:
    """The shift of each quantity since the baseline, called changes and a possible new one.

    Mean and sd are those of a quantity that has changed: averaged over "nothing has", a small shift
    would pass for none, and be surer the smaller it is. The probability of a shift beyond the
    threshold is averaged over all.
    """
    weights = _weights(bank, probability_of_change(bank, subject.options))
    mean, sd = _shifts(bank)
    found = []
    for j, quantity in enumerate(subject.quantities):
        given_change = _given_any_change(bank, j, weights)
        shift = shift_of_mixture(quantity, given_change, mean[:, j], sd[:, j])
        moving = (sd[:, j] > 0) | (mean[:, j] != 0)
        threshold = threshold_of(quantity, subject.hanger)
        chance = beyond(quantity, weights[moving], mean[moving, j], sd[moving, j], threshold)
        found.append(_drift(subject, quantity, reading, shift, threshold, chance))
    return tuple(found)


def _given_any_change(bank: Bank, j: int, weights: FloatArray) -> FloatArray:
    """The probability of each filter (B,), given that quantity `j` changed since the baseline.

    What a call said to have moved has changed, whatever came since; `weights` are not given that.
    A change that the last test alone speaks for counts only where no other can have been, as after
    the first test since the baseline: it may be a blunder.
    """
    shares = bank.shares * bank.members[:, j]
    if shares[:-1].any():
        shares[-1] = 0
    if not shares.any():
        return weights
    called = float(bank.called[j])
    return called * weights + (1 - called) * _given(bank, shares)


def _shifts(bank: Bank) -> tuple[FloatArray, FloatArray]:
    """Mean and sd of each quantity's shift by each filter (B, q), in steps."""
    filters, q, known = bank.filters, bank.design.q, bank.design.known
    loadings = np.zeros((len(filters), q, bank.design.size))
    loadings[:, :, :known] = bank.design.change_loadings(bank.years)
    loadings[:, range(q), range(known, known + q)] = bank.progress[:, None]
    moving = slice(2 * q, None)
    loadings = loadings[:, :, moving]
    reached = loadings @ filters.covariance[:, moving, moving]
    variance = np.einsum("bqn,bqn->bq", reached, loadings)
    mean = np.einsum("bqn,bn->bq", loadings, filters.mean[:, moving])
    return mean, np.sqrt(np.maximum(variance, 0))


def threshold_of(quantity: WatchedQuantity, hanger: Hanger) -> float:
    """The shift of which its owner must know: a fraction of the tension, or decades."""
    limits = hanger.thresholds
    if quantity.name == TENSION:
        return limits.tension_shift_fraction
    return limits.stiffness_shift_decades


def _drift(
    subject: Subject,
    quantity: WatchedQuantity,
    reading: Reading,
    shift: Shift,
    threshold: float,
    probability: float,
) -> Drift:
    at_rest = value_at(quantity, 0.0)
    is_tension = quantity.name == TENSION
    return Drift(
        hanger=subject.hanger.id,
        test=reading.test,
        time=reading.time,
        quantity=quantity.name,
        baseline=quantity.baseline,
        value=at_rest * (1 + shift.mean) if is_tension else at_rest + shift.mean,
        shift_mean=shift.mean,
        shift_sd=shift.sd,
        threshold=threshold,
        probability=probability,
    )


# Technical: exact for polynomials of degree 13.
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(7)
_WEIGHTS = _WEIGHTS / _WEIGHTS.sum()
_NEGLIGIBLE = 1e-7  # technical: less than the least probability that is told


@dataclass(frozen=True)
class Shift:
    """Mean and sd of a shift."""

    mean: float
    sd: float


def shift_of_mixture(
    quantity: WatchedQuantity, weights: FloatArray, mean: FloatArray, sd: FloatArray
) -> Shift:
    """Of normal distributions (B,) in units of a step; no shift at all with what `weights` leave.

    By Gauss-Hermite quadrature of seven nodes in each.
    """
    kept = weights > _NEGLIGIBLE
    weights = weights[kept]
    mean, sd = mean[kept] * quantity.step_sd, sd[kept] * quantity.step_sd
    shifts = shift_of(quantity, mean[:, None] + sd[:, None] * _NODES)
    first = float(weights @ shifts @ _WEIGHTS)
    second = float(weights @ (shifts - first) ** 2 @ _WEIGHTS)
    second += (1 - float(weights.sum())) * first**2
    return Shift(first, math.sqrt(max(second, 0.0)))


def beyond(
    quantity: WatchedQuantity,
    weights: FloatArray,
    mean: FloatArray,
    sd: FloatArray,
    threshold: float,
) -> float:
    """Probability of a shift beyond a threshold, the likelier way, by the same mixture."""
    kept = weights > _NEGLIGIBLE
    weights, mean = weights[kept], mean[kept] * quantity.step_sd
    sd = np.maximum(sd[kept] * quantity.step_sd, 1e-12)
    low, high = (_coordinate(quantity, sign * threshold) for sign in (-1, 1))
    down = float(weights @ scipy.special.ndtr((low - mean) / sd))
    up = float(weights @ scipy.special.ndtr((mean - high) / sd))
    return min(max(down, up), 1.0)


def _coordinate(quantity: WatchedQuantity, shift: float) -> float:
    """The coordinate of a shift; infinite where the quantity's table ends before it."""
    tension = quantity.name == TENSION
    value = quantity.baseline * (1 + shift) if tension else quantity.baseline + shift
    if not min(quantity.values) < value < max(quantity.values):
        return math.copysign(math.inf, shift)
    return coordinate_of(quantity, value)
