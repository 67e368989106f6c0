"""The bank of filters: no change, and a change in each direction from each possible beginning.

Each change has a mass in years, whose sum over the bank is the Shiryaev-Roberts statistic: the time
in which it may have begun times its likelihood ratio to no change. Under no change each mass stays
the same on average, and all masses together are the time watched. A statistic of which that is true
exceeds L years within Y years with probability Y/L at most, and not before L years on average
(Shiryaev 1963, Roberts 1966, Pollak 1985).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace

import numpy as np

from shm.values import BoolArray, FloatArray, IntArray
from shm.watch.options import WatchOptions
from shm.watch.sequential.design import Design, Direction, Measurement
from shm.watch.sequential.filtering import Filters, Sight, update, update_new

STEP, RAMP = 0, 1
KINDS = 2  # steps and ramps
_KEPT_DENSE = 12  # technical: beginnings of the last so many tests are all kept, older ones thinned
_LEVEL_SD = 10.0  # of a step: flat beside any reading
_HOPELESS_NATS = 10.0  # 1 in 22,000


@dataclass(frozen=True)
class Beginning:
    """When a change may have begun: a step between the two tests, a ramp from `ramp_years`."""

    after_years: float
    by_years: float
    ramp_years: float


@dataclass(frozen=True, eq=False)
class Bank:
    """Filters (B): first no change, one for each scatter (K), then a block for each beginning.

    Blocks run over K x kinds x `directions` (D); `beginnings` are in the order of time. `log_mass`
    (B,) is the logarithm of the probability of each scatter without change (they add to 1), then of
    each change's mass in years; `log_choices` is that of the number of scatters at first. `years`
    is the time of the last reading, `outlier` (B,) the probability by each filter that this was
    one. `called` (q,) is the probability that what was called before moved each quantity.
    """

    design: Design
    directions: tuple[Direction, ...]
    scatters: int
    filters: Filters
    log_mass: FloatArray
    years: float
    log_choices: float
    called: FloatArray
    beginnings: tuple[Beginning, ...] = ()
    outlier: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def changes(self) -> FloatArray:
        """Log mass of all changes (beginnings, K, kinds, D)."""
        shape = (len(self.beginnings), self.scatters, KINDS, len(self.directions))
        return self.log_mass[self.scatters :].reshape(shape)

    @property
    def progress(self) -> FloatArray:
        """How much of the change each filter takes for done (B,): of a ramp the years since."""
        since = np.array([self.years - each.ramp_years for each in self.beginnings])
        kinds = np.ones((len(since), self.scatters, KINDS, len(self.directions)))
        kinds[:, :, RAMP] = since[:, None, None]
        return np.concatenate([np.zeros(self.scatters), kinds.ravel()])

    @property
    def log_evidence(self) -> float:
        """Log of the statistic in years, without the changes that one test alone speaks for.

        It is held against that scatter by which no change is likeliest, so that its rate of false
        calls holds for each scatter, and not on the average of all.
        """
        likeliest = float(self.log_mass[: self.scatters].max())
        return log_total(self.changes[:-1]) - max(likeliest + self.log_choices, 0.0)

    @property
    def members(self) -> BoolArray:
        """Which quantities move in each direction (D, q)."""
        numbers = np.arange(self.design.q)
        return np.array([np.isin(numbers, each.members) for each in self.directions])

    @property
    def shares(self) -> FloatArray:
        """Probability of each change, given that there is one (beginnings, K, kinds, D)."""
        changes = self.changes
        return np.exp(changes - log_total(changes)) if self.beginnings else changes

    @property
    def log_statistic(self) -> float:
        """Log of the statistic in years, a change before the last test included."""
        return log_total(self.changes)


def log_total(log_mass: FloatArray) -> float:
    """Log of the sum; -inf of nothing."""
    return float(np.logaddexp.reduce(log_mass.ravel())) if log_mass.size else -math.inf


def first_bank(
    directions: tuple[Direction, ...], scatter: FloatArray, coefficient_sd: FloatArray
) -> Bank:
    """Before any reading; `scatter` (K, q) and `coefficient_sd` (q,) per kelvin in steps.

    The level is left to the baseline's tests. They lie about 0, but not at the same temperature.
    """
    n_scatters, q = scatter.shape
    variances = np.concatenate([np.full(q, _LEVEL_SD**2), coefficient_sd**2, np.zeros(q)])
    filters = Filters(
        np.zeros((n_scatters, len(variances))),
        np.tile(np.diag(variances), (n_scatters, 1, 1)),
        scatter**2,
    )
    choices = math.log(n_scatters)
    log_mass = np.full(n_scatters, -choices)
    return Bank(Design(q), directions, n_scatters, filters, log_mass, 0.0, choices, np.zeros(q))


def read(bank: Bank, measurement: Measurement, options: WatchOptions, *, may_change: bool) -> Bank:
    """The bank after one more reading, before which a change may have begun."""
    old = len(bank.filters)
    if may_change:
        bank = _begun(bank, measurement.years)
    bank = replace(bank, years=measurement.years)
    bank = _pruned(_updated(bank, measurement, options.outlier_probability, old))
    return _thinned(bank) if len(bank.beginnings) > options.beginnings else bank


def _updated(bank: Bank, measurement: Measurement, outlier_probability: float, old: int) -> Bank:
    """After a reading; the changes of all filters but the first `old` begin with it."""
    loadings = bank.design.loadings(measurement.years, measurement.kelvin)
    sight = Sight(loadings, measurement, outlier_probability, bank.directions)
    rows, progress = np.arange(len(bank.filters)), bank.progress
    found = update(bank.filters.taken(rows[:old]), progress[:old], sight)
    prior = np.array([each.covariance for each in bank.directions])
    which = (rows[old:] - bank.scatters) % len(prior)
    new = update_new(bank.filters.taken(rows[old:]), prior[which], progress[old:], sight)
    log_mass = bank.log_mass + np.concatenate([found.log_density, new.log_density])
    return replace(
        bank,
        filters=found.filters.with_more(new.filters),
        log_mass=log_mass - log_total(log_mass[: bank.scatters]),
        outlier=np.concatenate([found.outlier, new.outlier]),
    )


def _begun(bank: Bank, years: float) -> Bank:
    """With changes that begin between the last reading and one at `years`."""
    choices = KINDS * len(bank.directions)
    rows = np.repeat(np.arange(bank.scatters), choices)
    waited = math.log(max(years - bank.years, 1e-12) / choices)
    return replace(
        bank,
        filters=bank.filters.with_more(bank.filters.taken(rows)),
        log_mass=np.concatenate([bank.log_mass, bank.log_mass[rows] + waited]),
        beginnings=(*bank.beginnings, Beginning(bank.years, years, bank.years)),
    )


def _pruned(bank: Bank) -> Bank:
    """Without the scatters that all tests speak against, be there a change or none."""
    none, changes = bank.log_mass[: bank.scatters], bank.changes
    kept = none > none.max() - _HOPELESS_NATS
    if bank.beginnings:
        by_scatter = np.logaddexp.reduce(np.moveaxis(changes, 1, 0).reshape(len(kept), -1), axis=1)
        kept |= by_scatter > by_scatter.max() - _HOPELESS_NATS
    if kept.all():
        return bank
    rows = _rows(kept, changes)
    log_mass = bank.log_mass[rows] - log_total(none[kept])
    return replace(
        bank,
        scatters=int(kept.sum()),
        filters=bank.filters.taken(rows),
        log_mass=log_mass,
        outlier=bank.outlier[rows],
    )


def _rows(kept: BoolArray, changes: FloatArray) -> IntArray:
    """The filters of the scatters `kept` (K,)."""
    alike = np.broadcast_to(kept[:, None, None], changes.shape)
    return np.flatnonzero(np.concatenate([kept, alike.ravel()]))


def _thinned(bank: Bank) -> Bank:
    """With two neighbouring beginnings as one, whose masses are added.

    Which two depends on the times alone: those that lie closest for their age. The filters of the
    likelier one stay.
    """
    first = _closest(bank)
    changes = bank.changes.copy()
    keep, drop = first, first + 1
    if log_total(changes[drop]) > log_total(changes[keep]):
        keep, drop = drop, keep
    changes[keep] = np.logaddexp(changes[keep], changes[drop])
    merged = replace(
        bank.beginnings[keep],
        after_years=bank.beginnings[first].after_years,
        by_years=bank.beginnings[first + 1].by_years,
    )
    size = changes[0].size
    start = bank.scatters + drop * size
    rows = np.delete(np.arange(len(bank.filters)), slice(start, start + size))
    log_mass = np.concatenate([bank.log_mass[: bank.scatters], changes.ravel()])
    return replace(
        bank,
        filters=bank.filters.taken(rows),
        log_mass=log_mass[rows],
        beginnings=(*bank.beginnings[:first], merged, *bank.beginnings[first + 2 :]),
        outlier=bank.outlier[rows],
    )


def _closest(bank: Bank) -> int:
    """The earlier of the two beginnings to be merged."""
    old = bank.beginnings[: -min(_KEPT_DENSE, len(bank.beginnings) - 2)]
    width = np.array([b.by_years - a.after_years for a, b in itertools.pairwise(old)])
    age = np.array([bank.years - a.after_years for a in old[:-1]])
    return int(np.argmin(width / np.maximum(age, 1e-12)))
