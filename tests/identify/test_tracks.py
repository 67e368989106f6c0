from __future__ import annotations

import numpy as np

from shm.identify.estimation.poles import (
    Candidate,
    Pole,
    PoleSet,
    continued,
    link,
    resolved,
    stable_candidates,
)
from shm.identify.options import IdentifyOptions

X, Y = np.array([1.0 + 0j, 0.0]), np.array([0.0 + 0j, 1.0])


def _set(order: int, *poles: tuple[float, np.ndarray], damping: float = 0.01) -> PoleSet:
    return PoleSet(
        order,
        np.array([frequency for frequency, _ in poles]),
        np.full(len(poles), damping),
        np.array([shape for _, shape in poles]).T.reshape(2, len(poles)),
    )


def _candidate(frequencies: list[float], shape: np.ndarray = X) -> Candidate:
    track = tuple(Pole(n, f, 0.01, shape) for n, f in enumerate(frequencies))
    return Candidate(track, track)


def test_a_pole_that_stays_makes_one_track() -> None:
    tracks = link([_set(order, (10.0, X)) for order in range(2, 42, 4)])
    assert [len(track) for track in tracks] == [10]


def test_poles_of_one_frequency_and_two_shapes_make_two_tracks() -> None:
    """Two close modes of the two planes."""
    tracks = link([_set(order, (10.0, X), (10.01, Y)) for order in range(2, 42, 4)])
    assert sorted(len(track) for track in tracks) == [10, 10]
    for track in tracks:
        assert len({tuple(pole.shape.tolist()) for pole in track}) == 1


def test_a_pole_that_jumps_begins_anew() -> None:
    tracks = link([_set(2, (10.0, X)), _set(4, (10.1, X)), _set(6, (10.1, Y))])
    assert sorted(len(track) for track in tracks) == [1, 1, 1]


def test_a_track_may_miss_an_order_but_not_many() -> None:
    sets = [_set(2, (10.0, X)), _set(6), _set(10, (10.0, X)), _set(30, (10.0, X))]
    assert sorted(len(track) for track in link(sets)) == [1, 2]


def test_a_pole_is_found_again_only_near_in_frequency_and_shape() -> None:
    known = [Pole(20, 10.0, 0.01, X), Pole(20, 30.0, 0.01, Y)]
    again = continued(known, _set(20, (10.05, X), (30.5, Y), (10.0, Y)))
    assert again[0] is not None
    assert again[0].frequency_hz == 10.05
    assert again[1] is None
    assert continued(known, _set(20)) == [None, None]
    assert continued([], _set(20, (10.0, X))) == []


def test_every_dropped_pole_is_counted_with_its_reason() -> None:
    options = IdentifyOptions(2.0, 50.0)
    sets = [_set(order, (10.0, X), (70.0, X), (20.0 + order, Y)) for order in range(2, 42, 4)] + [
        _set(42, (11.0, X), damping=0.2)
    ]
    candidates, dropped = stable_candidates(sets, [34, 38], options)
    assert [candidate.frequency_hz for candidate in candidates] == [10.0]
    counts = {entry.reason: entry.count for entry in dropped}
    assert list(counts.values()) == [10 + 2, 1, 8]


def test_two_like_modes_nearer_than_the_record_can_tell_are_one() -> None:
    steady, split = _candidate([212.1] * 5), _candidate([212.2, 212.21, 212.22, 212.2, 212.19])
    kept, dropped = resolved([split, steady], seconds=3.2)
    assert kept == [steady]
    assert "double" in dropped[0].reason
    assert len(resolved([split, steady], seconds=30.0)[0]) == 2


def test_two_near_modes_of_different_shape_are_two() -> None:
    pair = [_candidate([10.0] * 5, X), _candidate([10.01] * 5, Y)]
    assert len(resolved(pair, seconds=5.0)[0]) == 2


def test_one_stray_order_does_not_spoil_a_candidate() -> None:
    assert _candidate([10.0, 10.0, 10.9, 10.0, 10.0]).frequency_spread == 0
    assert _candidate([10.0, 10.0, 10.9, 10.9, 10.0]).frequency_spread > 0.05
    assert _candidate([10.0, 10.9, 10.0, 10.0, 10.0]).frequency_hz == 10.0
