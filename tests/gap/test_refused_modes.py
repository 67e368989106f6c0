"""Which modes nothing is diagnosed from: those that are no modes of this hanger."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from shm.errors import BadInput
from shm.gap.observations import _refuse_mode
from shm.values import Mode, ShapePoint
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import a_test

MODE = Mode("transverse", 1, 5.8)
END = HANGER_3.length_m


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"frequency_hz": 0.0}, "0.0 Hz is no frequency"),
        ({"frequency_hz": -5.0}, "-5.0 Hz is no frequency"),
        ({"frequency_hz": math.nan}, "nan Hz is no frequency"),
        ({"frequency_hz": math.inf}, "inf Hz is no frequency"),
        ({"order": 0}, "orders count from 1"),
        ({"shape": (ShapePoint(-0.01, 1.0),)}, "a sensor at -0.01 m is not on this hanger"),
        (
            {"shape": (ShapePoint(1.0, 1.0), ShapePoint(END + 0.5, 1.0))},
            "a sensor at 12.5 m is not on this",
        ),
    ],
)
def test_what_is_no_mode_of_the_hanger_is_refused(changes: dict[str, object], said: str) -> None:
    with pytest.raises(BadInput, match=f"test t1, transverse mode .: {said}") as refused:
        _refuse_mode(a_test(), replace(MODE, **changes), HANGER_3)  # type: ignore[arg-type]
    assert refused.value.remedy


@pytest.mark.parametrize(
    "changes", [{"frequency_hz": 0.01}, {"shape": (ShapePoint(0.0, 1.0), ShapePoint(END, 1.0))}]
)
def test_the_bounds_belong_to_what_is_taken(changes: dict[str, object]) -> None:
    _refuse_mode(a_test(), replace(MODE, **changes), HANGER_3)  # type: ignore[arg-type]
