"""Doubtful modes at the missing orders of a bar whose other modes are sure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from shm.identify import IdentifyOptions
from shm.identify.contract import FoundMode
from shm.identify.mode_ordering.bars import Description, log_factor
from shm.identify.mode_ordering.placement import place_modes
from shm.identify.quality import Inspection
from shm.identify.quality.of_modes import LOWEST
from shm.values import PLANES, Plane, QualityCheck, ResponsePoint
from tests.helpers.beam_shapes import mode_shape
from tests.helpers.hangers import HANGER_3

HANGER = replace(HANGER_3, plate=None)
PLACES_M = (1.2, 2.9)
POINTS = tuple(ResponsePoint(f"{x} {plane}", plane, x) for plane in PLANES for x in PLACES_M)
FIXITY = dict(zip(PLANES, (0.8, 0.6), strict=True))


def mode(plane: Plane, order: int, off: float = 0.0) -> FoundMode:
    """Of the described hanger, its frequency off by a fraction."""
    told = Description.of(HANGER)
    log_hz = told.log_unit + log_factor(
        told.log_xi, np.array([FIXITY[plane]]), np.array([float(order)])
    )
    hz = float(np.exp(log_hz[0])) * (1 + off)
    xi = float(np.exp(told.log_xi))
    own = mode_shape(xi, 8, 8, order, np.array(PLACES_M) / HANGER.length_m)
    own = own / np.max(np.abs(own))
    both = np.concatenate([own, 0 * own] if plane == PLANES[0] else [0 * own, own])
    return FoundMode(hz, 1e-4 * hz, 0.001, 1e-4, both, np.full(both.shape, 0.01))


GAP = (PLANES[0], 3)
SURE = sorted(
    (mode(plane, order) for plane in PLANES for order in range(1, 7) if (plane, order) != GAP),
    key=lambda each: each.frequency_hz,
)


@pytest.mark.parametrize(
    ("doubtful", "is_taken"),
    [
        (mode(PLANES[0], 3, 0.001), True),
        (mode(PLANES[0], 3, 0.01), False),
        (replace(mode(PLANES[0], 3), shape=mode(PLANES[1], 3).shape), False),
        (replace(mode(PLANES[0], 3), frequency_sd_hz=1.0), False),
    ],
    ids=["at the gap", "beside it", "in the other plane", "unsure by more than that"],
)
def test_a_doubtful_mode_is_taken_only_where_the_bar_lacks_one(
    doubtful: FoundMode, is_taken: bool
) -> None:
    asked: list[float] = []

    def look(at_hz: Sequence[float]) -> tuple[list[FoundMode], list[FoundMode]]:
        asked.extend(at_hz)
        return [], [doubtful]

    placement = place_modes(SURE, POINTS, HANGER, look=look)
    given = {(each.plane, each.order): each.frequency_hz for each in placement.modes}
    assert asked == pytest.approx([mode(*GAP).frequency_hz], rel=1e-3)
    assert (given.get(GAP) == doubtful.frequency_hz) is is_taken
    assert len(given) == len(SURE) + is_taken


@pytest.mark.parametrize("in_doubt", [False, True])
def test_of_a_hanger_that_is_no_plain_bar_only_what_is_proven_is_taken(in_doubt: bool) -> None:
    rough = [
        replace(each, frequency_hz=each.frequency_hz * (1 + 0.004 * (-1) ** number))
        for number, each in enumerate(SURE)
    ]
    more = [mode(*GAP, 0.006)]
    seen = ([], more) if in_doubt else (more, [])
    placement = place_modes(rough, POINTS, HANGER, look=lambda _: seen)
    assert len(placement.modes) == len(SURE) + (not in_doubt)


def test_without_a_description_nothing_is_asked_for() -> None:
    def never(_: object) -> tuple[list[FoundMode], list[FoundMode]]:
        raise AssertionError

    assert place_modes(SURE, POINTS, None, look=never).modes


def test_a_first_order_below_the_band_is_not_missed() -> None:
    placement = place_modes(SURE[1:], POINTS, HANGER, look=lambda _: ([], []))
    lowest, next_hz = (mode(PLANES[0], order).frequency_hz for order in (1, 2))
    lost = min(PLANES, key=lambda plane: mode(plane, 1).frequency_hz)

    def check(low_hz: float) -> QualityCheck | None:
        options = IdentifyOptions(band_low_hz=low_hz)
        return LOWEST.check(
            Inspection([], [], options, points=POINTS, modes=placement.modes, hanger=HANGER)
        )

    told = check(0.8 * lowest)
    assert told is not None
    assert (told.verdict, told.found) == ("warning", f"{lost} order 1 not found")
    fine = check((lowest + next_hz) / 2)
    assert fine is not None
    assert fine.verdict == "good"
