"""bridge.toml on how the ends are held, a bar without tension, and a load that was weighed."""

from __future__ import annotations

from math import inf
from pathlib import Path

import pytest

from shm.bridge import load_hanger
from shm.errors import BadInput
from shm.values import Hanger, Supports
from tests.spine.test_bridge import ROUND, written


def loaded(folder: Path, text: str, tension_n: str = "711e3") -> Hanger:
    return load_hanger(written(folder, ROUND.replace("711e3", tension_n) + text))


def test_ends_are_clamped_unless_said_otherwise(tmp_path: Path) -> None:
    hanger = loaded(tmp_path, "")
    assert hanger.supports == Supports("clamped", "clamped")
    assert hanger.as_hanger


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('both = "free"', Supports("free", "free")),
        ('deck = "pinned"', Supports("pinned", "clamped")),
        (
            'deck = "free"\narch = "pinned"\nhanging_mass_kg = 488',
            Supports("free", "pinned", 488.0),
        ),
    ],
)
def test_supports_are_read(tmp_path: Path, text: str, expected: Supports) -> None:
    hanger = loaded(tmp_path, f"[hanger.supports]\n{text}")
    assert hanger.supports == expected
    assert not hanger.as_hanger


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('both = "welded"', "no way to hold an end"),
        ('deck = ["free"]', "no way to hold an end"),
        ('both = "free"\narch = "pinned"', "beside deck or arch"),
        ("hanging_mass_kg = 10", "one free end"),
        ('both = "free"\nhanging_mass_kg = 10', "one free end"),
        ('deck = "free"\nhanging_mass_kg = -1', "not a positive number"),
        ('left = "free"', "unknown key left"),
    ],
)
def test_what_cannot_be_is_refused_by_its_key(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        loaded(tmp_path, f"[hanger.supports]\n{text}")


def test_a_bar_may_carry_no_tension_but_no_compression(tmp_path: Path) -> None:
    hanger = loaded(tmp_path, "", tension_n="0.0")
    assert hanger.nominal_tension_n == 0
    assert not hanger.as_hanger
    with pytest.raises(BadInput, match="from 0 up"):
        loaded(tmp_path, "", tension_n="-1.0")


def test_a_tension_is_known_only_where_somebody_says_how_exactly(tmp_path: Path) -> None:
    assert loaded(tmp_path, "").scatter.tension == inf
    assert loaded(tmp_path, "[hanger.scatter]\ntension = 0.01").scatter.tension == 0.01
    with pytest.raises(BadInput, match="tension"):
        loaded(tmp_path, "[hanger.scatter]\ntension = 0.9")
