"""The JSON document of a gap diagnosis (`shm.diagnosis/1`), there and back.

As all documents it holds NaN until `shm.documents.dump` writes null; reading takes either.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any, TypeVar

from shm.values import (
    NAN,
    Cause,
    Diagnosis,
    EffectEstimate,
    GapPlace,
    NextMeasurement,
    Outlier,
    Residual,
    Shrinkage,
    TensionEstimate,
    Trend,
)

DIAGNOSIS_SCHEMA = "shm.diagnosis/1"

T = TypeVar("T")
_PLAIN = (
    "hanger", "baseline", "no_gap_probability", "unexplained_probability", "fit_p_value",
    "model_error_percent", "seed", "seconds",
)  # fmt: skip


def diagnosis_document(diagnosis: Diagnosis) -> dict[str, Any]:
    """The document of `shm gap diagnose --json`."""
    return {
        "schema": DIAGNOSIS_SCHEMA,
        **{name: getattr(diagnosis, name) for name in _PLAIN},
        "tests": list(diagnosis.tests),
        "where": [asdict(residual) for residual in diagnosis.where],
        "trends": [asdict(trend) for trend in diagnosis.trends],
        "places": [asdict(place) for place in diagnosis.places],
        "causes": [_cause_document(cause) for cause in diagnosis.causes],
        "groups": [list(group) for group in diagnosis.groups],
        "shrinkage": asdict(diagnosis.shrinkage),
        "tension_n": {
            "before": asdict(diagnosis.tension_before_n),
            "after": asdict(diagnosis.tension_after_n),
        },
        "next_measurement": [asdict(each) for each in diagnosis.next_measurements],
        "invisible": [{"effect": name, "why": why} for name, why in diagnosis.invisible],
        "left_out": list(diagnosis.left_out),
        "remarks": list(diagnosis.remarks),
        "outliers": [asdict(outlier) for outlier in diagnosis.outliers],
    }


def _cause_document(cause: Cause) -> dict[str, Any]:
    parameters = {}
    for estimate in cause.parameters:
        parameters[estimate.name] = asdict(estimate)
        del parameters[estimate.name]["name"]
    return {**asdict(cause), "parameters": parameters}


def diagnosis_of(document: Mapping[str, Any]) -> Diagnosis:
    """A diagnosis back from its document.

    One from before outliers and 95 % intervals were told has none of them.
    """
    return Diagnosis(
        **_values(Diagnosis, {name: document[name] for name in _PLAIN}),
        tests=tuple(document["tests"]),
        where=tuple(_noun(Residual, each) for each in document["where"]),
        trends=tuple(_noun(Trend, each) for each in document["trends"]),
        places=tuple(_place(each) for each in document["places"]),
        causes=tuple(_cause(each) for each in document["causes"]),
        groups=tuple(tuple(group) for group in document["groups"]),
        shrinkage=_noun(Shrinkage, document["shrinkage"]),
        tension_before_n=_noun(TensionEstimate, document["tension_n"]["before"]),
        tension_after_n=_noun(TensionEstimate, document["tension_n"]["after"]),
        next_measurements=tuple(_next(each) for each in document["next_measurement"]),
        invisible=tuple((each["effect"], each["why"]) for each in document["invisible"]),
        left_out=tuple(document["left_out"]),
        remarks=tuple(document["remarks"]),
        outliers=tuple(_noun(Outlier, each) for each in document.get("outliers", ())),
    )


def _place(document: Mapping[str, Any]) -> GapPlace:
    profile = tuple((float(x_m), _number(density)) for x_m, density in document["profile"])
    return _noun(GapPlace, {**document, "profile": profile})


def _cause(document: Mapping[str, Any]) -> Cause:
    parameters = tuple(
        _noun(EffectEstimate, {**estimate, "name": name})
        for name, estimate in document["parameters"].items()
    )
    elsewhere = tuple(document["also_at"])
    return _noun(Cause, {**document, "parameters": parameters, "also_at": elsewhere})


def _next(document: Mapping[str, Any]) -> NextMeasurement:
    return _noun(NextMeasurement, {**document, "separates": tuple(document["separates"])})


def _noun(kind: type[T], document: Mapping[str, Any]) -> T:
    return kind(**_values(kind, document))


def _values(kind: type[Any], document: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of `kind` that `document` holds, with NaN for the numbers that are null."""
    numbers = {each.name for each in fields(kind) if each.type == "float"}
    known = {each.name for each in fields(kind)} & document.keys()
    return {name: _number(document[name]) if name in numbers else document[name] for name in known}


def _number(value: float | None) -> float:
    return NAN if value is None else float(value)
