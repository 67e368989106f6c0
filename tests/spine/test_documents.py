"""The exchange documents: what is written is read back, and what is wrong is named."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shm.documents import dump, parse_time, summary
from shm.errors import BadInput
from shm.modes_document import load_modes, modes_document, parse_modes
from shm.values import AddedMass, ModalTest, Mode, ShapePoint
from tests.helpers.comparing import assert_same

FULL = ModalTest(
    id="t1",
    hanger=3,
    time=datetime(2026, 5, 1, 10, tzinfo=UTC),
    temperature_c=12.0,
    amplitude=1.0,
    added_mass=AddedMass(25.0, 3.6),
    modes=(
        Mode("transverse", 1, 5.82, 0.006, 0.004, math.nan, (ShapePoint(1.2, 0.31, 0.01, 0.01),)),
        Mode("longitudinal", 1, 6.09, irregular=True),
        Mode("longitudinal", 2, 12.7, amplitude_slope=-4e-4, amplitude_slope_sd=2e-5),
    ),
)


def minimal() -> dict[str, Any]:
    mode = {"plane": "transverse", "order": 1, "frequency_hz": 5.82}
    return {"schema": "shm.modes/1", "hanger": 3, "tests": [{"modes": [mode]}]}


def test_a_document_is_read_back_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "t.modes.json"
    path.write_text(dump(modes_document([FULL])), encoding="utf-8")
    (back,) = load_modes(path)
    assert_same(back, FULL)


def test_a_radius_of_gyration_is_written_where_it_is_known() -> None:
    known = replace(FULL, added_mass=AddedMass(25.0, 3.6, 0.08))
    document = json.loads(dump(modes_document([known, FULL])))
    said = [test["added_mass"] for test in document["tests"]]
    assert said[0] == {"mass_kg": 25.0, "x_m": 3.6, "radius_of_gyration_m": 0.08}
    assert said[1] == {"mass_kg": 25.0, "x_m": 3.6}
    for back, test in zip(parse_modes(document), (known, FULL), strict=True):
        assert_same(back, test)


def test_unknown_is_null_in_json_and_nan_in_memory() -> None:
    text = dump(modes_document([FULL]))
    assert "NaN" not in text
    document = json.loads(text)
    assert document["tests"][0]["modes"][0]["damping_sd"] is None
    assert document["tests"][0]["time"] == "2026-05-01T10:00:00Z"


def test_only_plane_order_and_frequency_are_required() -> None:
    (test,) = parse_modes(minimal())
    (mode,) = test.modes
    assert (mode.plane, mode.order, mode.frequency_hz) == ("transverse", 1, 5.82)
    assert math.isnan(mode.frequency_sd_hz)
    assert test.time is None


def test_a_time_without_zone_is_utc_and_others_are_converted() -> None:
    assert parse_time("2026-05-01T10:00:00") == datetime(2026, 5, 1, 10, tzinfo=UTC)
    assert parse_time("2026-05-01T12:00:00+02:00") == datetime(2026, 5, 1, 10, tzinfo=UTC)


def changed(path: list[Any], value: Any) -> dict[str, Any]:
    document = minimal()
    node: Any = document
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    return document


MODE = ["tests", 0, "modes", 0]


@pytest.mark.parametrize(
    ("document", "complaint"),
    [
        ([], "not a modal-tests document"),
        (changed(["schema"], "shm.modes/9"), "not a modal-tests document"),
        (changed(["hanger"], "three"), "hanger = 'three'"),
        (changed(["tests"], []), "`tests` is missing or empty"),
        (changed(["tests", 0], {"modes": []}), r"tests\[0\] has no list `modes`"),
        (changed([*MODE, "plane"], "vertical"), r"tests\[0\]\.modes\[0\]: plane"),
        (changed([*MODE, "order"], 0), "order must be 1, 2, 3"),
        (changed([*MODE, "order"], True), "order = True is not a whole number"),
        (changed(["tests", 0, "modes"], [3]), r"tests\[0\]: modes\[0\] is not an object"),
        (changed([*MODE, "shape"], [{"x_m": True}]), r"modes\[0\]\.shape\[0\]: x_m = True is not"),
        (changed([*MODE, "frequency_hz"], -5.0), "frequency_hz must be positive"),
        (changed([*MODE, "frequency_hz"], None), "frequency_hz must be positive"),
        (changed([*MODE, "frequency_hz"], "5.8"), "frequency_hz = '5.8' is not a number"),
        (changed([*MODE, "frequency_hz"], 10**400), "0 is not a number"),
        (changed([*MODE, "frequency_sd_hz"], -0.1), "frequency_sd_hz is negative"),
        (changed([*MODE, "shape"], [3]), r"shape\[0\] is not an object"),
        (changed([*MODE, "shape"], True), "shape is not a list"),
        (changed(["tests", 0, "time"], "yesterday"), "not an ISO 8601 time"),
        (changed(["tests", 0, "added_mass"], {"mass_kg": -1, "x_m": 2}), "positive mass_kg"),
        (
            changed(
                ["tests", 0, "added_mass"], {"mass_kg": 1, "x_m": 2, "radius_of_gyration_m": -1}
            ),
            "radius_of_gyration_m is negative",
        ),
        (
            changed(["tests", 0, "added_mass"], {"mass_kg": 1, "x_m": 2, "radius_of_gyration": 1}),
            r"tests\[0\]\.added_mass: unknown key radius_of_gyration",
        ),
        (changed(["tests", 0, "added_mass"], 25), "added_mass is not an object"),
        (changed(["tests", 0, "added_mass_kg"], 25), r"tests\[0\]: unknown key added_mass_kg"),
        (changed(["tests", 0, "temperature"], 12), "unknown key temperature"),
        (changed([*MODE, "frequency_sd"], 0.01), r"modes\[0\]: unknown key frequency_sd"),
        (changed([*MODE, "order"], 10**9), "up to 200"),
        (changed(["tests", 0, "tension_read_n"], -5.0), "above 0"),
        (changed(["tests", 0, "tension_read_sd_n"], 5.0), "Give the tension in N"),
    ],
)
def test_what_is_wrong_is_named_with_a_remedy(document: Any, complaint: str) -> None:
    with pytest.raises(BadInput, match=complaint) as refusal:
        parse_modes(document, "x.modes.json")
    assert "x.modes.json" in str(refusal.value)
    assert refusal.value.remedy


def test_keys_of_others_and_a_reading_without_sd_are_let_in() -> None:
    document = changed(["tests", 0, "operator"], "Ada")
    document["tests"][0]["tension_read_n"] = 5e5
    (test,) = parse_modes(document)
    assert test.tension_read_n == 5e5
    assert math.isnan(test.tension_read_sd_n)


def test_a_mode_given_twice_is_refused() -> None:
    document = minimal()
    document["tests"][0]["modes"] *= 2
    with pytest.raises(BadInput, match="transverse mode 1 is given twice"):
        parse_modes(document)


def test_broken_json_is_refused_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "t.modes.json"
    path.write_text('{"schema": 1,\n oops}', encoding="utf-8")
    with pytest.raises(BadInput, match="line 2"):
        load_modes(path)
    with pytest.raises(BadInput, match="cannot be read"):
        load_modes(tmp_path / "absent.modes.json")


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=8,
)


@settings(suppress_health_check=[HealthCheck.too_slow])  # a machine that does other work
@given(value=json_values, key=st.sampled_from(["plane", "order", "frequency_hz", "shape"]))
def test_no_document_raises_anything_but_bad_input(value: Any, key: str) -> None:
    try:
        (test,) = parse_modes(changed([*MODE, key], value))
    except BadInput:
        return
    assert test.modes[0].frequency_hz > 0


def test_a_summary_has_the_contract_keys() -> None:
    figures = summary(np.arange(101.0), 42.0)
    assert figures == {
        "mean": 50.0,
        "sd": pytest.approx(29.3, abs=0.01),
        "q05": 5.0,
        "q50": 50.0,
        "q95": 95.0,
        "map": 42.0,
    }
