"""The comparison of values by their fields, which other tests rely on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shm.values import AddedMass
from tests.helpers.comparing import assert_same, differences
from tests.helpers.nouns import a_posterior, a_test

NAN = float("nan")


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("temperature_c", 31.0),
        ("amplitude", 0.3),
        ("added_mass", AddedMass(25.0, 3.6)),
        ("added_mass", AddedMass(25.0, NAN)),
    ],
)
def test_differences_beyond_repr(field: str, value: Any) -> None:
    """Fields that the line of a test leaves out still count."""
    one = a_test()
    other = replace(one, **{field: value})
    assert repr(one) == repr(other)
    (line,) = differences(other, one)
    assert line.startswith(f"value.{field}: ")
    with pytest.raises(AssertionError, match=field):
        assert_same(other, one)


def test_differences_name_nested_place() -> None:
    one = a_test()
    changed = replace(one.modes[1], damping_ratio=0.5)
    other = replace(one, modes=(one.modes[0], changed, *one.modes[2:]))
    (line,) = differences({"a": [other]}, {"a": [one]})
    assert line.startswith("value['a'][0].modes[1].damping_ratio: 0.5, ")


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (1, 1.0),
        (0.0, NAN),
        ((1, 2), [1, 2]),
        ((1,), (1, 2)),
        ({"a": 1}, {"b": 1}),
        (np.zeros(2), np.zeros(3)),
        (np.zeros(2), np.array([0.0, NAN])),
        (np.zeros(2, int), np.zeros(2)),
        (np.zeros(2), [0.0, 0.0]),
        (a_posterior(seed=7), a_posterior(seed=8)),
    ],
)
def test_differences_found(found: Any, expected: Any) -> None:
    assert differences(found, expected)
    assert differences(expected, found)


@pytest.mark.parametrize("make", [a_test, a_posterior, lambda: (NAN, np.array([NAN, 1.0]), "a")])
def test_differences_none(make: Any) -> None:
    assert differences(make(), make()) == []
