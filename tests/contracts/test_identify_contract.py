"""Hold what identification reports of fixed recordings: modes, quality, hits and what is foreign.

Golden files are by `write_identify_golden.py`. Another computation of the same models moves
numbers: a frequency may move by half of its standard deviation, as no interval would notice; a
standard deviation by a third; a damping ratio and a shape by one of theirs. Planes, orders, hits
and their reasons, names and verdicts of checks, kinds of foreign modes and exit codes are compared
as they are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.contracts import identify_calls as calls

_HALF, _THIRD = 0.5, 1.34
_UNKNOWN_SD = 1e-3
"""Of a frequency whose standard deviation is not known, as a fraction."""


@cache
def _front(name: str) -> Any:
    if name == calls.UNDESCRIBED:
        return calls.identify_record(*calls.FRONTS["plain"], is_described=False)
    return calls.identify_record(*calls.FRONTS[name])


def _compare_modes(made: Sequence[Mapping[str, Any]], held: Sequence[Mapping[str, Any]]) -> None:
    names = [(mode["plane"], mode["order"]) for mode in made]
    assert names == [(mode["plane"], mode["order"]) for mode in held]
    for one, other in zip(made, held, strict=True):
        assert one.keys() == other.keys()
        sd = other["frequency_sd_hz"] or _UNKNOWN_SD * other["frequency_hz"]
        assert one["frequency_hz"] == pytest.approx(other["frequency_hz"], abs=_HALF * sd)
        assert (one["frequency_sd_hz"] is None) == (other["frequency_sd_hz"] is None)
        assert 1 / _THIRD < (one["frequency_sd_hz"] or 1) / (other["frequency_sd_hz"] or 1) < _THIRD
        damping_sd = other["damping_sd"] or 0.1 * other["damping_ratio"]
        assert one["damping_ratio"] == pytest.approx(other["damping_ratio"], abs=damping_sd)
        _compare_shapes(one["shape"], other["shape"])
        assert one.get("irregular") == other.get("irregular")


def _compare_shapes(made: Sequence[Mapping[str, Any]], held: Sequence[Mapping[str, Any]]) -> None:
    for one, other in zip(made, held, strict=True):
        assert one["x_m"] == pytest.approx(other["x_m"], rel=1e-5)
        sd = max(other["sd"] or 0.05, 0.01)
        for key in ("value", "cross"):
            assert (one[key] is None) == (other[key] is None)
            assert one[key] is None or one[key] == pytest.approx(other[key], abs=sd)


def _compare_quality(made: Sequence[Mapping[str, Any]], held: Sequence[Mapping[str, Any]]) -> None:
    verdicts = [(check["name"], check["verdict"]) for check in made]
    assert verdicts == [(check["name"], check["verdict"]) for check in held]
    for check in made:
        assert check["found"]
        assert bool(check["remedy"]) == (check["verdict"] != "good")


def _compare_foreign(made: Sequence[Mapping[str, Any]], held: Sequence[Mapping[str, Any]]) -> None:
    assert [mode["kind"] for mode in made] == [mode["kind"] for mode in held]
    for one, other in zip(made, held, strict=True):
        assert one["frequency_hz"] == pytest.approx(other["frequency_hz"], rel=2e-3)
        assert one["reason"]


@pytest.mark.parametrize("name", [*calls.FRONTS, calls.UNDESCRIBED])
def test_front_gives_what_the_golden_file_holds(name: str) -> None:
    made, held = _front(name), calls.golden(name)
    _compare_modes(made["modes"], held["modes"])
    _compare_quality(made["quality"], held["quality"])
    _compare_foreign(made["set_aside"], held["set_aside"])
    for key in ("notes", "has_response", "has_fit", "has_poles"):
        assert made[key] == held[key]
    for key in ("amplitude", "rattles_above"):
        assert made[key] == held[key] or made[key] == pytest.approx(held[key], rel=1e-5)
    assert len(made["hits"]) == len(held["hits"])
    for one, other in zip(made["hits"], held["hits"], strict=True):
        assert one == {**other, "start_s": one["start_s"], "peak_force_n": one["peak_force_n"]}
        assert one["start_s"] == pytest.approx(other["start_s"], rel=1e-5)


@pytest.mark.parametrize("name", calls.COMMANDS)
def test_command_gives_what_the_golden_file_holds(name: str, tmp_path: Path) -> None:
    made, held = calls.identify_file(*calls.COMMANDS[name], tmp_path), calls.golden(name)
    assert made["exit_code"] == held["exit_code"] == 0
    one, other = made["document"], held["document"]
    assert one.keys() == other.keys()
    assert one["schema"] == other["schema"]
    (test,), (known,) = one["tests"], other["tests"]
    assert test.keys() == known.keys()
    _compare_modes(test["modes"], known["modes"])
    _compare_foreign(test["set_aside"], known["set_aside"])
    _compare_quality(test["quality"], known["quality"])


def test_records_without_a_mode_are_refused_with_a_remedy() -> None:
    assert calls.refuse_records() == calls.golden(calls.REFUSED)


def test_golden_files_hold_what_was_made() -> None:
    """Look at the golden files: a wrong document would be held for ever."""
    plain = calls.golden("plain")
    assert [(mode["plane"], mode["order"]) for mode in plain["modes"]] == [
        (plane, order) for plane in ("transverse", "longitudinal") for order in (1, 2, 3, 4)
    ]
    assert math.isfinite(plain["amplitude"])
    assert {mode["plane"] for mode in calls.golden("one_axis")["modes"]} == {"transverse"}
    assert calls.golden("structure")["notes"][0].startswith("no model describes the structure")
