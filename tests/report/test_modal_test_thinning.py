"""Thinned signals lose no peak and invent no value."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shm.report.figures.specification import envelope_places, peak_places
from shm.report.figures.time_axes import places as thinned_places
from shm.values import FloatArray

VALUES = st.lists(st.floats(-1e6, 1e6) | st.just(float("nan")), min_size=1, max_size=300)


@given(VALUES, st.integers(1, 40))
def test_the_largest_and_the_smallest_value_stay_and_places_ascend(
    values: list[float], bins: int
) -> None:
    signal = np.array(values)
    places = envelope_places(signal, bins)
    assert np.all(np.diff(places) > 0)
    assert len(places) <= max(2 * bins, 1)
    known = signal[np.isfinite(signal)]
    if len(known):
        assert np.nanmax(signal[places]) == known.max()
        assert np.nanmin(signal[places]) == known.min()


def test_a_gap_longer_than_a_bin_breaks_the_line() -> None:
    signal = np.sin(np.arange(10_000) / 50)
    signal[4000:5000] = np.nan
    drawn = signal[envelope_places(signal, 100)]
    assert np.sum(np.isnan(drawn)) >= 9
    assert len(drawn) <= 200


def test_a_short_signal_stays_as_it_is() -> None:
    assert list(envelope_places(np.arange(5.0), 3)) == [0, 1, 2, 3, 4]


@given(VALUES, st.integers(1, 40))
def test_of_each_bin_the_largest_stays(values: list[float], bins: int) -> None:
    signal = np.array(values)
    places = peak_places(signal, min(bins, len(signal)))
    known = signal[np.isfinite(signal)]
    if len(known):
        assert np.nanmax(signal[places]) == known.max()


@pytest.mark.parametrize("seed", range(3))
def test_places_keep_the_extremes_of_every_curve(seed: int) -> None:
    rng = np.random.default_rng(seed)
    curves: list[FloatArray] = [rng.normal(size=20_000) for _ in range(3)]
    chosen = thinned_places(*curves, always=(7, 11))
    for curve in curves:
        assert curve[chosen].max() == curve.max()
        assert curve[chosen].min() == curve.min()
    assert {0, 7, 11, 19_999} <= set(chosen.tolist())
    assert np.all(np.diff(chosen) > 0)
