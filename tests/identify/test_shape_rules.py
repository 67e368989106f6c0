"""What a steady shape proves of a mode whose frequency is vague, and how parts are left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.identify.estimation.poles import Candidate, Pole, Repeats
from shm.identify.estimation.ssi import _few_sums
from shm.identify.estimation.validation import doubt
from shm.identify.options import IdentifyOptions
from shm.values import FloatArray

OPTIONS = IdentifyOptions(2.0, 50.0)
SHAPE = np.array([1.0, 0.1, -0.8, 0.1])
OTHER = np.array([1.0, 0.1, 0.3, 0.9])
ALONE = np.array([1.0, 0.01, 0.01, 0.01])
NAN = float("nan")


def _candidate(spread: float = 0.0, shape: FloatArray = SHAPE, turned: float = 0.0) -> Candidate:
    """Five orders; two of them off by `spread` to either side, the last shape `turned`."""
    off = spread * np.array([0, 1, 0, -1, 0])
    shapes = [shape] * 4 + [shape + turned * OTHER]
    track = tuple(
        Pole(40 + 4 * n, 20 * (1 + each), 0.002, (own / np.linalg.norm(own)).astype(complex))
        for n, (each, own) in enumerate(zip(off, shapes, strict=True))
    )
    return Candidate(track, track)


def _repeats(off: list[float], shape: FloatArray = SHAPE, last: FloatArray = SHAPE) -> Repeats:
    """One for each hit left out; the frequency is `off` as a fraction, the last shape another."""
    shapes = np.array([shape] * (len(off) - 1) + [last])
    return Repeats(20 * (1 + np.array(off)), np.full(len(off), 0.002), shapes)


def _vague(times: float) -> list[float]:
    """Six hits whose frequencies have `times` the largest standard deviation."""
    one = times * OPTIONS.max_frequency_sd / (np.sqrt(5) * 1.2249)  # Student, five degrees
    return [one, -one] * 3


@pytest.mark.parametrize(
    ("times", "shape", "last", "trusted"),
    [
        (0.9, SHAPE, OTHER, True),
        (1.5, SHAPE, SHAPE, True),
        (1.5, SHAPE, OTHER, False),
        (1.5, ALONE, ALONE, False),
        (2.2, SHAPE, SHAPE, False),
    ],
)
def test_the_same_shape_at_three_points_bears_twice_the_scatter(
    times: float, shape: FloatArray, last: FloatArray, trusted: bool
) -> None:
    candidate = _candidate(shape=shape)
    assert (doubt(candidate, _repeats(_vague(times), shape, last), OPTIONS) == "") == trusted


def test_in_ambient_motion_no_shape_bears_it() -> None:
    ambient = replace(OPTIONS, ambient_s=600.0, ambient_width=0.0)
    assert doubt(_candidate(), _repeats(_vague(1.5)), ambient)


@pytest.mark.parametrize(
    ("off", "last", "trusted"),
    [
        ([0.0, NAN], SHAPE, True),
        ([0.0, 0.0, NAN], SHAPE, True),
        ([0.0, NAN, 0.0], OTHER, False),
        ([0.0, NAN, NAN], SHAPE, False),
        ([0.0, 0.0, 0.0, NAN], SHAPE, False),
    ],
)
def test_one_of_three_hits_at_most_may_be_the_only_one_that_excites_it(
    off: list[float], last: FloatArray, trusted: bool
) -> None:
    assert (doubt(_candidate(), _repeats(off, SHAPE, last), OPTIONS) == "") == trusted


@pytest.mark.parametrize(("turned", "trusted"), [(0.0, True), (0.1, False)])
def test_of_few_hits_a_shape_that_stays_from_order_to_order_bears_its_scatter(
    turned: float, trusted: bool
) -> None:
    spread = 0.5 * OPTIONS.max_frequency_spread
    shape = np.array([1.0, 0.9, -0.8, 0.7])
    found = doubt(_candidate(spread, shape, turned), _repeats([0.0, 0.0], shape, shape), OPTIONS)
    assert (found == "") == trusted


@pytest.mark.parametrize(("parts", "sums"), [(3, 3), (10, 10), (25, 10)])
def test_parts_are_left_out_as_ten_sums_at_most(parts: int, sums: int) -> None:
    matrices = [np.full((2, 3), float(n)) for n in range(parts)]
    found = _few_sums(matrices)
    assert len(found) == sums
    np.testing.assert_array_equal(sum(found), sum(matrices))
    assert found[0][0, 0] == sum(range(0, parts, 10))
