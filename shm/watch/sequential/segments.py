"""What goes on after a call: the called change is part of the state, and the next is looked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.values import BoolArray, FloatArray, IntArray
from shm.watch.sequential.bank import KINDS, RAMP, Bank
from shm.watch.sequential.design import Design
from shm.watch.sequential.filtering import Filters

_PLACE_FOR_A_JUMP = 1e-4
_PLACE_FOR_A_RATE = 1e-2


def taken_over(bank: Bank) -> Bank:
    """The bank once its change is called: no further change, for each scatter.

    All changes that may have been the called one are merged by their moments. Jump and level stay
    apart in the state, so that later tests still sharpen both, and which quantity it was.
    """
    share = bank.shares
    design = _design(bank, share)
    rows = bank.scatters + np.arange(share.size).reshape(share.shape)
    states = [
        _merged(bank, design, rows[:, k].ravel(), share[:, k].ravel()) for k in range(bank.scatters)
    ]
    filters = Filters(
        np.array([mean for mean, _ in states]),
        np.array([covariance for _, covariance in states]),
        bank.filters.scatter[: bank.scatters],
    )
    log_mass = np.log(np.maximum(share.sum(axis=(0, 2, 3)), 1e-300))
    return replace(
        bank,
        design=design,
        filters=filters,
        log_mass=log_mass,
        called=1 - (1 - bank.called) * (1 - share.sum(axis=(0, 1, 2)) @ bank.members),
        beginnings=(),
        outlier=np.zeros(0),
    )


def _design(bank: Bank, share: FloatArray) -> Design:
    """With a place for each quantity that may have changed, and for what may be going on."""
    jumped = _members(bank, share.sum(axis=(0, 1, 2)) > _PLACE_FOR_A_JUMP)
    going_on = _members(bank, share[:, :, RAMP].sum(axis=(0, 1)) > _PLACE_FOR_A_RATE)
    return bank.design.after(bank.years, jumped, going_on)


def _members(bank: Bank, chosen: BoolArray) -> set[int]:
    """The quantities that move in the directions `chosen` (D,)."""
    pairs = zip(bank.directions, chosen.tolist(), strict=True)
    return {j for direction, taken in pairs if taken for j in direction.members}


def _merged(
    bank: Bank, design: Design, rows: IntArray, share: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean (n,) and covariance (n, n) of one scatter's changes in the later design."""
    kept = share > 1e-6 * share.max()
    rows, weights = rows[kept], share[kept] / share[kept].sum()
    progress = bank.progress
    means, covariances = [], []
    for row in rows:
        kind = (row - bank.scatters) // len(bank.directions) % KINDS
        carry = bank.design.carried(design, float(progress[row]), kind == RAMP)
        means.append(carry @ bank.filters.mean[row])
        covariances.append(carry @ bank.filters.covariance[row] @ carry.T)
    mean = weights @ np.array(means)
    apart = np.array(means) - mean
    within = np.einsum("b,bij->ij", weights, np.array(covariances))
    return mean, within + np.einsum("b,bi,bj->ij", weights, apart, apart)
