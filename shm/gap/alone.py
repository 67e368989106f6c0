"""A frequency that stands alone: a slip, or a part that this mode's swing alone reaches.

A guide with play, or a crack that a swing opens, acts on a mode only above an amplitude. In one
test at one level that is one frequency off by up to tenths while all others are right, which looks
like a gross error. It is none where another test, hit as hard, shows the mode where it belongs.

Nor is it chance where a hanger at first does not ring as a bar does, and does once its swing has
died away (`ModalTest.rattles_above`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.gap.attribution import Attribution
from shm.gap.contract import Design
from shm.gap.model_probabilities import NO_GAP, UNKNOWN
from shm.gap.outliers import GROSS_ERROR, WIDE_FROM, WIDE_TO
from shm.values import FloatArray, ModalTest

_SHARE = 3 / 48
"""Of unknown effects in docs/trials/blind_trial.md those, guides with play, that moved one mode."""
_LARGEST = 0.3
"""Judgement: of the logarithm of the frequency. A stiff guide raises a first mode by so much."""
_THAT_KNOCK = 2 / 7  # of the kinds of unknown effects there: guides with play and cracks
_SOUND_RATTLES = 1 / 200
"""Judgement: a sound hanger all of whose hits are disturbed at first and none later. It was none of
78 awkward records of `tests/worlds/recordings.py` (seeds from 9000 on)."""
_SAME_LEVEL = 1.1  # as `shm.gap.data_checks` says: no hand hits more alike


def acts_alone(design: Design, kept: Design, row: int, deviation: float) -> float:
    """The probability that the frequency `row` of `design`, off by `deviation` of its logarithm,
    is no slip but moved by something unknown that acts on this mode alone.

    `kept` are the frequencies that were not set aside.
    """
    if abs(deviation) > _LARGEST or _right_elsewhere(design, kept, row):
        return 0.0
    modes = len(
        {*zip(design.frequency_plane.tolist(), design.frequency_order.tolist(), strict=True)}
    )
    slip = GROSS_ERROR / np.log(WIDE_TO / WIDE_FROM)
    acts = UNKNOWN / NO_GAP * _SHARE / modes / np.log(_LARGEST / WIDE_FROM)
    return float(acts / (acts + slip))


def rattling(tests: Sequence[ModalTest]) -> float:
    """The probability, of a hanger without any other gap, that something knocks, slips or opens
    while it swings far."""
    if not any(math.isfinite(test.rattles_above) for test in tests):
        return 0.0
    acts = UNKNOWN / NO_GAP * _THAT_KNOCK
    return acts / (acts + _SOUND_RATTLES)


def with_what_acts(found: Attribution, probability: float) -> Attribution:
    """No gap stands only as far as nothing acts of this `probability` beyond what was tried."""
    moved = probability * found.no_gap_probability
    return replace(
        found,
        no_gap_probability=found.no_gap_probability - moved,
        unexplained_probability=found.unexplained_probability + moved,
    )


def _right_elsewhere(design: Design, kept: Design, row: int) -> bool:
    same = (kept.frequency_plane == design.frequency_plane[row]) & (
        kept.frequency_order == design.frequency_order[row]
    )
    return bool((_levels(kept)[same] * _SAME_LEVEL >= _levels(design)[row]).any())


def _levels(design: Design) -> FloatArray:
    return np.array([each.amplitude for each in design.conditions])[design.frequency_test]
