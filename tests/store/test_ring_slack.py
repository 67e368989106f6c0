"""How far a chunk may begin from the end of the one before and still follow without a gap."""

from __future__ import annotations

import pytest

from shm.store.ring_pieces import _DRIFT, _JITTER_S, _OF_A_SAMPLE, BY_TIME, slack_s


@pytest.mark.parametrize(
    ("before", "sequence", "rate_hz", "length_s", "expected"),
    [
        (4, 5, 100.0, 10.0, _JITTER_S + 10 * _DRIFT),  # no sample is missing: stamps alone
        (4, 5, 1.0, 10.0, 1.5 + 10 * _DRIFT),  # of a slow stream more than the jitter
        (4, 6, 100.0, 10.0, _OF_A_SAMPLE / 100),
        (5, 4, 50.0, 10.0, _OF_A_SAMPLE / 50),
        (BY_TIME, BY_TIME + 7, 100.0, 10.0, _JITTER_S + 10 * _DRIFT),
        (BY_TIME - 1, BY_TIME + 7, 100.0, 10.0, _OF_A_SAMPLE / 100),
    ],
)
def test_numbers_that_follow_allow_for_stamps_and_others_for_part_of_a_sample(
    before: int, sequence: int, rate_hz: float, length_s: float, expected: float
) -> None:
    assert slack_s(before, sequence, rate_hz, length_s) == pytest.approx(expected, rel=1e-12)
