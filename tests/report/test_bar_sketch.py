"""The sketch of the bar: fittings at its ends, sensors by plane, where it was hit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes

from shm.report.figures.bar_sketch import FIGURE
from shm.values import NAN, ResponsePoint
from shm.values.bar_description import BarDescription, describe_bar
from tests.helpers.hangers import HANGER_3

SENSORS = (
    ResponsePoint("acc_1", "transverse", 2.5),
    ResponsePoint("acc_2", "longitudinal", 2.5),
    ResponsePoint("acc_3", "transverse", 4.4),
)
HITS = (ResponsePoint("hit", None, 1.9),)


@pytest.fixture
def bar() -> BarDescription:
    return describe_bar(replace(HANGER_3, fittings_m=(0.6, 0.4)), SENSORS, HITS)


def drawn(bar: BarDescription) -> Axes:
    figure = FIGURE.figure(bar)
    assert figure is not None
    (axes,) = figure.axes
    return axes


def places(axes: Axes, name: str) -> list[float]:
    (line,) = [line for line in axes.lines if line.get_label() == name]
    return np.asarray(line.get_xdata()).tolist()


def test_sensors_stand_where_they_are_by_plane(bar: BarDescription) -> None:
    axes = drawn(bar)
    assert places(axes, "sensor, transverse") == [2.5, 4.4]
    assert places(axes, "sensor, longitudinal") == [2.5]
    assert places(axes, "hit") == [1.9]
    low, high = axes.get_xlim()
    assert low < 0 < bar.length_m < high


def test_fittings_reach_as_far_as_described(bar: BarDescription) -> None:
    ends = [
        np.asarray(line.get_xdata()).tolist()
        for line in drawn(bar).lines
        if line.get_linewidth() == 9.0
    ]
    assert ends == [[0.0, 0.6], [bar.length_m - 0.4, bar.length_m]]


def test_hits_that_are_not_stated_are_said_so(bar: BarDescription) -> None:
    unknown = replace(bar, hits=(replace(HITS[0], x_m=NAN),))
    assert "hits is not stated" in FIGURE.caption(unknown)
    assert "not stated" not in FIGURE.caption(bar)
    assert "3 sensors and 1 place of hits" in FIGURE.alt(bar)


def test_without_any_place_nothing_is_drawn(bar: BarDescription) -> None:
    assert FIGURE.figure(replace(bar, sensors=(), hits=())) is None
