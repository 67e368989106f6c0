"""Which modes of several set-ups are one, which are kept, and what is said of the rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from shm.identify import Dropped, IdentifyOptions, Poles
from shm.identify.contract import Finding, FoundMode, Measurement
from shm.identify.setup_merging.join_set_ups import (
    LARGEST_SHIFT,
    JoinedFinding,
    join_set_ups,
    matched,
)
from shm.values import NAN, Plane, ResponsePoint

OPTIONS = IdentifyOptions()


def _point(x_m: float, plane: Plane = "transverse") -> ResponsePoint:
    return ResponsePoint(f"{plane} {x_m}", plane, x_m)


def _ambient(*points: ResponsePoint) -> Measurement:
    return Measurement("wind.csv", points, (np.zeros((len(points), 9)),), 100.0, None)


def _mode(
    frequency_hz: float, shape: Sequence[float], sd_hz: float = 1e-3, damping_sd: float = 1e-4
) -> FoundMode:
    values = np.array(shape, float)
    return FoundMode(frequency_hz, sd_hz, 0.002, damping_sd, values, np.full(len(values), 0.01))


def _finding(*modes: FoundMode, poles: int = 2) -> Finding:
    numbers = np.arange(float(poles))
    dropped = (Dropped("poles", 10, "outside of the band"),)
    return Finding(modes, dropped, Poles(numbers, numbers, numbers, numbers > 0))


def _groups(
    measurements: Sequence[Measurement], *found: Sequence[FoundMode]
) -> list[list[tuple[int, float]]]:
    return [
        [(seen.set_up, seen.mode.frequency_hz) for seen in group]
        for group in matched(measurements, found)
    ]


ONE, OTHER = _ambient(_point(1.0), _point(2.0)), _ambient(_point(1.0), _point(3.0))


def _joined(one: Finding, other: Finding, options: IdentifyOptions = OPTIONS) -> JoinedFinding:
    return join_set_ups([ONE, OTHER], [one, other], options)


def test_modes_further_apart_than_set_ups_differ_are_two() -> None:
    far = 6.0 * (1 + 1.5 * LARGEST_SHIFT)
    assert _groups([ONE, OTHER], [_mode(6.0, (1, 1))], [_mode(far, (1, 1))]) == [
        [(0, 6.0)],
        [(1, far)],
    ]


def test_close_modes_are_told_apart_by_their_shape_on_common_points() -> None:
    """Two modes 0.05 % apart that a change of 0.05 % between set-ups would confuse."""
    both = (_point(1.0), _point(1.0, "longitudinal"))
    measurements = [_ambient(*both, _point(2.0)), _ambient(*both, _point(3.0))]
    groups = _groups(
        measurements,
        [_mode(6.000, (1, 0, 1)), _mode(6.003, (0, 1, 0))],
        [_mode(6.003, (1, 0.1, 1)), _mode(6.006, (-0.1, 1, 0))],
    )
    assert groups == [[(0, 6.0), (1, 6.003)], [(0, 6.003), (1, 6.006)]]


def test_without_common_points_the_direction_tells_close_modes_apart() -> None:
    measurements = [_ambient(_point(x), _point(x, "longitudinal")) for x in (1.0, 2.0)]
    groups = _groups(measurements, [_mode(6.000, (1, 0.1))], [_mode(6.001, (0.1, 1))])
    assert groups == [[(0, 6.0)], [(1, 6.001)]]


def test_shapes_are_brought_to_one_scale_by_the_common_sensor() -> None:
    result = _joined(_finding(_mode(6.0, (0.5, 1.0))), _finding(_mode(6.0, (-1.0, 0.5))))
    assert [point.x_m for point in result.points] == [1.0, 2.0, 3.0]
    (mode,) = result.finding.modes
    shape = mode.shape / mode.shape[0]
    np.testing.assert_allclose(shape, [1.0, 2.0, -0.5])
    assert np.max(mode.shape) == 1.0
    assert np.all(mode.shape_sd > 0)


def test_what_set_ups_differ_by_is_in_the_standard_deviation() -> None:
    same = _joined(_finding(_mode(6.0, (1, 1))), _finding(_mode(6.0, (1, 1))))
    apart = _joined(_finding(_mode(6.0, (1, 1))), _finding(_mode(6.01, (1, 1))))
    assert same.finding.modes[0].frequency_sd_hz == pytest.approx(1e-3 / np.sqrt(2))
    assert apart.finding.modes[0].frequency_hz == pytest.approx(6.005)
    assert apart.finding.modes[0].frequency_sd_hz > 0.005


def test_the_allowance_between_tests_is_added_once() -> None:
    options = IdentifyOptions(frequency_allowance=0.001)
    found = _finding(_mode(6.0, (1, 1)))
    (mode,) = _joined(found, found, options).finding.modes
    assert mode.frequency_sd_hz == pytest.approx(np.hypot(1e-3 / np.sqrt(2), 0.006))


def test_with_few_hits_the_frequency_keeps_the_stated_floor() -> None:
    found = _finding(_mode(6.0, (1, 1), 0.006, NAN))
    (mode,) = _joined(found, found).finding.modes
    assert mode.frequency_sd_hz == pytest.approx(0.006)
    assert np.isnan(mode.damping_sd)


def test_without_a_force_a_mode_that_one_set_up_misses_is_dropped_and_said_so() -> None:
    result = _joined(_finding(_mode(6.0, (1, 1)), _mode(9.0, (1, 1))), _finding(_mode(6.0, (1, 1))))
    assert len(result.finding.modes) == 1
    assert result.finding.dropped[-1].what == "mode at 9 Hz"
    assert "not seen in all set-ups" in result.finding.dropped[-1].reason
