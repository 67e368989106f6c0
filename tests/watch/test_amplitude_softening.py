"""Joints that slip: a harder hit lowers frequencies, and no tension is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.values import NAN, FloatArray, ModalTest
from shm.watch.readings import SHARE, SHARE_SD, Reader
from tests.helpers.hangers import HANGER_3
from tests.helpers.modelled_tests import (
    ALLOWANCE,
    EVERYTHING,
    SD,
    WHEN,
    frequencies,
    measured,
    posterior,
)

STRING = replace(HANGER_3, second_moment_m4=1e-9 * HANGER_3.second_moment_m4)
"""A bar that is all tension: frequencies go as its root."""
THETA = (1.1, 0.97)
SLOPE, SLOPE_SD, REFERENCE, HARD = -3e-3, 1e-4, 0.5, 1.5
AT_REST = frequencies(THETA, "beam1", STRING)


def _test(frequency_hz: FloatArray, amplitude: float, slope: float = NAN) -> ModalTest:
    test = measured(frequency_hz)
    modes = [replace(m, amplitude_slope=slope, amplitude_slope_sd=SLOPE_SD) for m in test.modes]
    return replace(test, amplitude=amplitude, modes=tuple(modes))


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader(posterior(THETA, "beam1", STRING), [_test(AT_REST, REFERENCE, SLOPE)], STRING)


def test_of_a_string_the_slope_is_taken_off_in_closed_form(reader: Reader) -> None:
    """A slope of c at amplitude 1/2 is 3 c at 3/2; `SHARE` of it is taken off, and T goes as f^2:
    ln(T/T0) = 2 (ln(f/f0) - 3 c SHARE). Its error counts in every mode: N/4 over the variance."""
    fallen = AT_REST * np.exp(SHARE * HARD / REFERENCE * SLOPE)
    reading = reader.reading(_test(fallen, HARD), WHEN)
    assert reading.mean == pytest.approx([0.0], abs=1e-6)
    times = HARD / REFERENCE
    off = np.hypot(SHARE * times * SLOPE_SD, SHARE_SD * times * np.hypot(SLOPE, SLOPE_SD))
    variance = SD**2 + ALLOWANCE**2 + off**2
    assert reading.information[0, 0] == pytest.approx(len(EVERYTHING) / 4 / variance, rel=1e-3)


def test_a_frequency_of_small_amplitude_is_compared_as_it_is(reader: Reader) -> None:
    lost = reader.reading(_test(0.99 * AT_REST, HARD, 3 * SLOPE), WHEN)
    assert lost.mean == pytest.approx([2 * np.log(0.99)], abs=2e-5)
    assert lost.information[0, 0] == pytest.approx(
        len(EVERYTHING) / 4 / (SD**2 + ALLOWANCE**2), rel=1e-3
    )


def test_without_its_amplitude_a_test_is_taken_at_that_of_the_baseline(reader: Reader) -> None:
    fallen = AT_REST * np.exp(SHARE * SLOPE)
    assert reader.reading(_test(fallen, NAN), WHEN).mean == pytest.approx([0.0], abs=1e-6)


def test_of_a_linear_hanger_nothing_is_taken_off() -> None:
    plain = Reader(posterior(THETA, "beam1", STRING), [_test(AT_REST, REFERENCE)], STRING)
    reading = plain.reading(_test(0.99 * AT_REST, HARD), WHEN)
    assert reading.mean == pytest.approx([2 * np.log(0.99)], abs=2e-5)
