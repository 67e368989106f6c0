"""Modes of another program, set by set: what is taken of each, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shm.errors import BadInput
from shm.read import modal_sets
from shm.read.modal_sets import ForeignModalMode, ForeignModes
from shm.values import NAN, ShapePoint

PATH = Path("modes.unv")
UNITS = {"type": 164, "length": 1000.0}  # a node in millimetres
NODES = {
    "type": 2411,
    "node_nums": [1, 2, 3, 4],
    "x": [0.0, 10.0, 0.0, 0.0],
    "y": [0.0, 0.0, 0.0, 0.0],
    "z": [3000.0, 1000.0, 2000.0, 4000.0],
}


def a_set(**changes: Any) -> dict[str, Any]:
    """Return a normal mode of 5 Hz that moves along x most, along y half as much against it."""
    return {
        "type": 55,
        "id1": " ACME modal 3 ",
        "analysis_type": 2,
        "freq": 5.0,
        "modal_damp_vis": 0.01,
        "modal_damp_his": 0.06,
        "node_nums": [1, 2, 3, 9],
        "r1": [2.0, 1.0, -4.0, 7.0],
        "r2": [-1.0, 0.5, 2.0, 7.0],
        "r3": [9.0, 9.0, 9.0, 9.0],
        **changes,
    }


def read(*sets: dict[str, Any]) -> ForeignModes:
    return modal_sets._modes(dict(enumerate(sets)), PATH)


def only(**changes: Any) -> ForeignModalMode:
    (mode,) = read(UNITS, NODES, a_set(**changes)).modes
    return mode


def test_a_mode_is_told_by_place_along_the_hanger_and_by_the_axis_that_moves_most() -> None:
    """Nodes that the file does not place are left out; the largest motion across is 1."""
    found = read(UNITS, NODES, a_set())
    assert (found.source, found.program) == ("modes.unv", "ACME modal 3")
    assert found.modes == (
        ForeignModalMode(
            5.0,
            0.01,
            "x",
            (ShapePoint(1.0, 0.25, 0.125), ShapePoint(2.0, -1.0, 0.5), ShapePoint(3.0, 0.5, -0.25)),
        ),
    )
    assert found.modes[0].half_waves == 3


@pytest.mark.parametrize(
    ("units", "first_m"),
    [(UNITS, 1.0), ({"type": 164}, 1000.0), ({"type": 164, "length": 0.0}, 1000.0),
     ({"type": 164, "length": -2.0}, 1000.0), ({"type": 164, "length": math.inf}, 1000.0)],
)  # fmt: skip
def test_lengths_are_in_the_units_that_the_file_says(units: dict[str, Any], first_m: float) -> None:
    (mode,) = read(units, NODES, a_set()).modes
    assert mode.points[0].x_m == first_m


@pytest.mark.parametrize(
    ("changes", "damping"),
    [
        ({}, 0.01),
        ({"modal_damp_vis": 0.0}, 0.03),  # hysteretic: half of it, at resonance
        ({"modal_damp_vis": None}, 0.03),
        ({"modal_damp_vis": 0.0, "modal_damp_his": 0.0}, NAN),
        ({"modal_damp_vis": 5.0}, NAN),
        ({"modal_damp_vis": -0.1, "modal_damp_his": -0.1}, NAN),
    ],
)
def test_damping_is_the_ratio_that_is_said(changes: dict[str, Any], damping: float) -> None:
    assert only(**changes).damping_ratio == pytest.approx(damping, nan_ok=True)


@pytest.mark.parametrize("analysis", [3, 7])
def test_of_a_complex_eigenvalue_the_size_is_the_frequency_and_the_real_part_the_damping(
    analysis: int,
) -> None:
    omega, ratio = 2 * math.pi * 7.0, 0.02
    value = omega * complex(-ratio, math.sqrt(1 - ratio**2))
    mode = only(analysis_type=analysis, eig=value)
    assert mode.frequency_hz == pytest.approx(7.0)
    assert mode.damping_ratio == pytest.approx(ratio)
    growing = only(analysis_type=analysis, eig=-value.conjugate())
    assert math.isnan(growing.damping_ratio)


def test_a_complex_shape_is_turned_so_that_its_largest_part_is_real() -> None:
    turn = np.exp(0.7j)
    turned = only(r1=turn * np.array(a_set()["r1"]), r2=turn * np.array(a_set()["r2"]),
                  r3=np.zeros(4))  # fmt: skip
    for point, expected in zip(turned.points, only(r3=np.zeros(4)).points, strict=True):
        assert (point.value, point.cross) == pytest.approx((expected.value, expected.cross))


@pytest.mark.parametrize("frequency", [0.0, None, -1.0, 1e5, math.nan])
def test_a_mode_without_a_frequency_is_refused_by_its_number(frequency: float | None) -> None:
    with pytest.raises(BadInput, match="data set 3 gives no frequency of a mode") as refused:
        only(freq=frequency)
    assert refused.value.remedy == "Export or send it again."


def test_what_are_no_modes_and_too_many_are_refused() -> None:
    with pytest.raises(BadInput, match="data sets of type 55 are no modes"):
        read(NODES, a_set(analysis_type=4), a_set(analysis_type=None))
    most = modal_sets._MOST_MODES
    assert len(read(*[a_set()] * most).modes) == most
    with pytest.raises(BadInput, match="more modes than a hanger has"):
        read(*[a_set()] * (most + 1))
