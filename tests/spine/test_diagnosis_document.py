"""The document of a gap diagnosis: what is written is read back, and it keeps the contract."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, fields
from typing import Any

import pytest

from shm.diagnosis_document import diagnosis_document, diagnosis_of
from shm.documents import dump
from shm.values import Diagnosis
from tests.helpers.comparing import assert_same
from tests.report.diagnoses import BLUNDER, CASES, LED


@pytest.mark.parametrize("name", CASES)
def test_a_diagnosis_is_read_back_as_it_was(name: str) -> None:
    text = dump(diagnosis_document(CASES[name]))
    assert "NaN" not in text
    assert_same(diagnosis_of(json.loads(text)), CASES[name])


def test_the_document_has_the_names_and_nesting_of_the_contract() -> None:
    document = diagnosis_document(LED)
    assert document["baseline"] == "beam1"
    assert {"plane", "order", "test", "residual_percent", "z", "share"} <= set(document["where"][0])
    cause = document["causes"][0]
    assert {"effect", "probability", "log_bayes_factor", "group", "at"} <= set(cause)
    assert cause["parameters"]["mass_kg"] == {
        "unit": "kg", "mean": 12.1, "sd": 1.8, "q05": 9.2, "q95": 15.1,
    }  # fmt: skip
    assert set(document["shrinkage"]) == {
        "rms_before_percent", "rms_after_percent", "held_out_before_percent",
        "held_out_after_percent",
    }  # fmt: skip
    assert {"mean", "sd"} <= set(document["tension_n"]["before"])
    assert {"mean", "sd"} <= set(document["tension_n"]["after"])
    assert document["next_measurement"][0] == {
        "what": "known mass of 25 kg at 3.6 m", "separates": ("point_mass", "section_loss"),
        "expected_log_bayes_factor": 6.04,
    }  # fmt: skip
    assert document["no_gap_probability"] == 0.0004
    assert document["unexplained_probability"] == 0.03


def test_no_field_of_a_diagnosis_is_left_out() -> None:
    renamed = {"tension_before_n", "tension_after_n", "next_measurements"}
    assert {field.name for field in fields(Diagnosis)} - renamed <= set(diagnosis_document(LED))


def test_outliers_and_95_percent_intervals_are_in_the_document() -> None:
    document = diagnosis_document(BLUNDER)
    assert document["outliers"] == (asdict(BLUNDER.outliers[0]),)
    assert document["tension_n"]["after"]["q025"] == 687.9e3
    assert document["tension_n"]["after"]["q975"] == 716.8e3


def test_a_document_from_before_outliers_were_told_still_reads() -> None:
    document = json.loads(dump(diagnosis_document(BLUNDER)))
    del document["outliers"]
    for tension in document["tension_n"].values():
        del tension["q025"], tension["q975"]
    found = diagnosis_of(document)
    assert found.outliers == ()
    assert math.isnan(found.tension_after_n.q025)
    assert found.tension_after_n.q95 == BLUNDER.tension_after_n.q95


@pytest.mark.parametrize(
    ("path", "wrong", "said"),
    [
        (["where", 0, "plane"], "up", r"where\[0\]: plane = 'up' is not one of transverse"),
        (
            ["causes", 0, "parameters", "mass_kg", "sd"],
            "x",
            r"parameters\[0\]: sd = 'x' is not a num",
        ),
        (["places", 0, "profile"], [3], r"places\[0\]: profile\[0\] is not a list"),
        (["tension_n", "before", "mean"], ..., "tension_before_n: mean is missing"),
        (["hanger"], True, "hanger = True is not a whole number"),
        (["shrinkage"], 5, "shrinkage is not an object"),
    ],
)
def test_what_is_no_diagnosis_is_named_by_its_place(path: list[Any], wrong: Any, said: str) -> None:
    document = json.loads(dump(diagnosis_document(LED)))
    node: Any = document
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = wrong
    if wrong is ...:
        del node[path[-1]]
    with pytest.raises(ValueError, match=said):
        diagnosis_of(document)
