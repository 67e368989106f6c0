"""What a check of plausibility looks at: plain values, collected before it is asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import Protocol

import numpy as np

from shm.models.tensioned_beam import frequencies_hz
from shm.values import (
    NAN,
    Doubt,
    Fingerprint,
    FloatArray,
    Hanger,
    KnownSamples,
    ModalTest,
    Posterior,
)


@dataclass(frozen=True, eq=False)
class Candidate:
    """An identified test before it counts, and what is known to judge it by.

    `file_times` are those of all files or records of this one test, `neighbours` those of other
    tests in the same file, `same_time` are tests of the same hanger in other recordings with the
    very same time. `modified_at` is when the file was last written, which copying resets.
    `built` is when the bridge was; `tolerance` how far ahead of the receipt a clock may be.
    `reference` are the tests of the hanger's baseline in force, the latest taken at
    `reference_at`; `earlier` its latest tests that count, by time, `arrived` those that came in
    last, whatever their time; `baseline` the posterior that later tests are compared with.
    `copies` are recordings that may hold the same samples, `others` the other hangers of the bridge
    with their latest tests that count. `signals` says which of its channels are doubtful.
    """

    hanger: Hanger
    test: ModalTest
    received_at: datetime
    tolerance: timedelta
    modified_at: datetime | None = None
    built: date | None = None
    file_times: Sequence[datetime] = ()
    neighbours: Sequence[datetime] = ()
    same_time: Sequence[ModalTest] = ()
    reference: Sequence[ModalTest] = ()
    reference_at: datetime | None = None
    earlier: Sequence[ModalTest] = ()
    arrived: Sequence[ModalTest] = ()
    baseline: Posterior | None = None
    fingerprint: Fingerprint | None = None
    copies: Sequence[KnownSamples] = ()
    others: Sequence[tuple[Hanger, Sequence[ModalTest]]] = ()
    signals: Sequence[str] = ()


_MOST_ORDERS = 20  # higher ones say next to nothing of the tension
_STEP = 0.02  # of ln T: small against its curvature, large against the solver's error


class Check(Protocol):
    """Gives one reason to hold a test; None where there is none, or nothing to judge by."""

    def __call__(self, candidate: Candidate) -> Doubt | None: ...


_ORDERS_OF_TWO = 3  # two unknowns, and one mode that may speak against them


def implied_shift(test: ModalTest, reference: Sequence[ModalTest], hanger: Hanger) -> float:
    """By which fraction the tension differs from the reference's, going by the modes.

    Least squares over the modes that both have, each with d ln f / d ln T of the described bar at
    its nominal tension, ends clamped, or pinned where they are described so. From three orders on
    the bending stiffness may differ, too: stiffer ends lift the high modes alone, and a tension by
    itself would have to rise for that, though it has fallen. A rough figure is all that is wanted
    of a test that may be of another bar. NaN where they share no mode, or where the bar carries no
    tension.
    """
    change = _shared(test, reference)
    if not change or not hanger.nominal_tension_n > 0:
        return NAN
    slopes = _slopes(hanger, max(order for _, order in change))
    gain = np.array([slopes[order - 1] for _, order in change])
    shift = np.array(list(change.values()))
    if len({order for _, order in change}) < _ORDERS_OF_TWO:
        return float(np.expm1(gain @ shift / (gain @ gain)))
    # f^2 goes with a T + b EI, so both logarithmic slopes add up to a half.
    both = np.column_stack([gain, 0.5 - gain])
    return float(np.expm1(np.linalg.lstsq(both, shift, rcond=None)[0][0]))


def _slopes(hanger: Hanger, modes: int) -> FloatArray:
    """d ln f / d ln T of the first modes."""
    end = np.full(2, 0.0 if hanger.supports.ends("pinned") else np.inf)
    tension_n = hanger.nominal_tension_n * np.exp([-_STEP / 2, _STEP / 2])
    length_m = np.full(2, hanger.length_m)
    stiffness = np.asarray(hanger.bending_stiffness_n_m2)
    mass = np.asarray(hanger.mass_per_length_kg_m)
    below, above = frequencies_hz(length_m, tension_n, stiffness, mass, end, end, modes)
    return np.asarray(np.log(above / below) / _STEP)


def frequency_change(test: ModalTest, reference: Sequence[ModalTest]) -> float:
    """By which fraction the lowest frequencies differ from the reference's; NaN: none shared.

    Those of the lowest order that both have, which tells most of the tension.
    """
    change = _shared(test, reference)
    lowest = min((order for _, order in change), default=0)
    shift = [value for (_, order), value in change.items() if order == lowest]
    return float(np.expm1(np.mean(shift))) if shift else NAN


def _shared(test: ModalTest, reference: Sequence[ModalTest]) -> dict[tuple[str, int], float]:
    """The change of the log frequency of each mode that both have, from the reference's mean."""
    before: dict[tuple[str, int], list[float]] = {}
    for each in reference:
        for mode in each.modes:
            before.setdefault((mode.plane, mode.order), []).append(mode.frequency_hz)
    return {
        key: float(np.log(mode.frequency_hz / np.mean(before[key])))
        for mode in test.regular_modes
        if mode.order <= _MOST_ORDERS and (key := (mode.plane, mode.order)) in before
    }
