"""What the bank says after a test: what changed, since when, and how far each quantity is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

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
from shm.watch.quantities import value_at
from shm.watch.sequential.bank import STEP, Bank, log_total
from shm.watch.sequential.measurement import DAYS_PER_YEAR
from shm.watch.sequential.shifts import shift_of_mixture

_ALIKE_NATS = 3.0
_TAIL = 0.05


@dataclass(frozen=True, eq=False)
class Watcher:
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


def changed(watcher: Watcher, bank: Bank, reading: Reading, before: float) -> Change:
    """The change since the last call; `before` is the probability that there was one earlier."""
    now = probability_of_change(bank, watcher.options)
    began_after, began_by = _began(watcher, bank, reading)
    return Change(
        evidence_years=math.exp(min(bank.log_evidence, 700.0)),
        limit_years=watcher.options.limit_years,
        probability=1 - (1 - before) * (1 - now),
        sudden=_sudden(bank),
        began_after=began_after,
        began_by=began_by,
        moved=_moved(watcher.quantities, bank),
        outlier_probability=float(_weights(bank, now) @ bank.outlier),
    )


def _weights(bank: Bank, probability: float) -> FloatArray:
    """The probability of each filter (B,), given that of a change."""
    none = (1 - probability) * np.exp(bank.log_mass[: bank.scatters])
    return np.concatenate([none, probability * _shares(bank).ravel()])


def _shares(bank: Bank) -> FloatArray:
    """Probabilities given a change (beginnings, K, kinds, q)."""
    if not bank.beginnings:
        return bank.changes
    return np.exp(bank.changes - log_total(bank.changes))


def _sudden(bank: Bank) -> float:
    return float(_shares(bank)[:, :, STEP].sum()) if bank.beginnings else NAN


def _began(watcher: Watcher, bank: Bank, reading: Reading) -> tuple[datetime, datetime]:
    """Between which times the change began, with 90 % probability; the test's own if none can."""
    if not bank.beginnings:
        return reading.time, reading.time
    reached = np.cumsum(_shares(bank).sum(axis=(1, 2, 3)))
    last = len(bank.beginnings) - 1
    first, final = (min(int(np.searchsorted(reached, p)), last) for p in (_TAIL, 1 - _TAIL))
    return (
        watcher.at(bank.beginnings[first].after_years),
        watcher.at(bank.beginnings[final].by_years),
    )


def _moved(quantities: Sequence[WatchedQuantity], bank: Bank) -> tuple[Moved, ...]:
    """Each quantity as the only one that changed, the likeliest first."""
    if not bank.beginnings:
        return ()
    log_mass = np.logaddexp.reduce(bank.changes.reshape(-1, len(quantities)), axis=0)
    return tuple(_alone(quantities, bank, j, log_mass) for j in np.argsort(-log_mass).tolist())


def _alone(
    quantities: Sequence[WatchedQuantity], bank: Bank, j: int, log_mass: FloatArray
) -> Moved:
    """Quantity `j` as the only one that changed; `log_mass` (q,) is what speaks for each."""
    quantity, mine = quantities[j], bank.filters.quantity[bank.scatters :] == j
    size = bank.filters.mean[bank.scatters :][mine, -1]
    variance = np.maximum(bank.filters.covariance[bank.scatters :][mine, -1, -1], 0)
    progress = bank.progress[bank.scatters :][mine]
    weights = np.exp(bank.changes[..., j].ravel() - log_mass[j])
    shift = shift_of_mixture(quantity, weights, progress * size, progress * np.sqrt(variance))
    close = np.abs(log_mass - log_mass[j]) < _ALIKE_NATS
    return Moved(
        quantity=quantity.name,
        probability=float(np.exp(log_mass[j] - log_total(log_mass))),
        shift_mean=shift.mean,
        shift_sd=shift.sd,
        end=quantity.end,
        plane=quantity.plane,
        alike=tuple(
            other.name for i, other in enumerate(quantities) if close[i] and other is not quantity
        ),
    )


def drifted(watcher: Watcher, bank: Bank, reading: Reading) -> tuple[Drift, ...]:
    """The shift of each quantity since the baseline, called changes and a possible new one."""
    weights = _weights(bank, probability_of_change(bank, watcher.options))
    mean, sd = _shifts(bank)
    return tuple(
        _drift(watcher, quantity, reading, weights, mean[:, j], sd[:, j])
        for j, quantity in enumerate(watcher.quantities)
    )


def _shifts(bank: Bank) -> tuple[FloatArray, FloatArray]:
    """Mean and sd of each quantity's shift by each filter (B, q), in steps."""
    filters, q = bank.filters, bank.design.q
    loadings = np.zeros((len(filters), q, bank.design.size))
    loadings[:, :, :-1] = bank.design.change_loadings(bank.years)
    loadings[np.arange(len(filters)), filters.quantity, -1] = bank.progress
    moving = slice(2 * q, None)
    loadings = loadings[:, :, moving]
    reached = loadings @ filters.covariance[:, moving, moving]
    variance = np.einsum("bqn,bqn->bq", reached, loadings)
    mean = np.einsum("bqn,bn->bq", loadings, filters.mean[:, moving])
    return mean, np.sqrt(np.maximum(variance, 0))


def _drift(
    watcher: Watcher,
    quantity: WatchedQuantity,
    reading: Reading,
    weights: FloatArray,
    mean: FloatArray,
    sd: FloatArray,
) -> Drift:
    limits = watcher.hanger.thresholds
    tension = quantity.name == TENSION
    threshold = limits.tension_shift_fraction if tension else limits.stiffness_shift_decades
    moving = (sd > 0) | (mean != 0)
    shift = shift_of_mixture(quantity, weights[moving], mean[moving], sd[moving], threshold)
    at_rest = value_at(quantity, 0.0)
    return Drift(
        hanger=watcher.hanger.id,
        test=reading.test,
        time=reading.time,
        quantity=quantity.name,
        baseline=quantity.baseline,
        value=at_rest * (1 + shift.mean) if tension else at_rest + shift.mean,
        shift_mean=shift.mean,
        shift_sd=shift.sd,
        threshold=threshold,
        probability=shift.beyond,
    )
