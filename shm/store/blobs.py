"""Arrays as compressed npz bytes (never pickle) and values back from their documents."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from datetime import datetime
from typing import Any, cast

import numpy as np

from shm.documents import averaged_from, parse_time
from shm.modes_document import MODES_SCHEMA, parse_modes
from shm.values import (
    NAN,
    Alert,
    AlertKind,
    Change,
    Drift,
    ForeignMode,
    FrequencyResponse,
    ModalTest,
    Moved,
    Posterior,
    PredictedFrequency,
    QualityCheck,
    ResponsePoint,
    WatchedTest,
)

_POSTERIOR_PLAIN = ("model", "hanger", "seed", "evaluations")
_POSTERIOR_NUMBERS = (
    "nominal_tension_n",
    "log_evidence",
    "log_evidence_sd",
    "effective_sample_size",
    "r_hat",
    "seconds",
)
_POSTERIOR_ARRAYS = ("samples", "log_likelihood", "most_probable")


def pack(**arrays: Any) -> bytes:
    """Named arrays as npz bytes."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def unpack(blob: bytes) -> dict[str, Any]:
    """The named arrays of npz bytes; refuses pickled objects."""
    with np.load(io.BytesIO(blob), allow_pickle=False) as archive:
        return dict(archive)


# ---------------------------------------------------------------- frequency responses


def pack_response(response: FrequencyResponse) -> bytes:
    """A frequency response as npz bytes, in single precision: it is kept to be looked at."""
    arrays: dict[str, Any] = {
        "frequency_hz": response.frequency_hz,
        "accelerance": response.accelerance.astype(np.complex64),
        "point_names": np.array([point.name for point in response.points], dtype=np.str_),
        "point_planes": np.array([point.plane or "" for point in response.points], dtype=np.str_),
        "point_x_m": np.array([point.x_m for point in response.points], dtype=float),
    }
    if response.coherence is not None:
        arrays["coherence"] = response.coherence.astype(np.float32)
    return pack(**arrays)


def unpack_response(blob: bytes, source: str, test: ModalTest) -> FrequencyResponse:
    """The frequency response of `test` back from its bytes."""
    arrays = unpack(blob)
    points = zip(arrays["point_names"], arrays["point_planes"], arrays["point_x_m"], strict=True)
    coherence = arrays.get("coherence")
    return FrequencyResponse(
        source=source,
        points=tuple(ResponsePoint(str(n), str(p) or None, float(x)) for n, p, x in points),  # type: ignore[arg-type]
        frequency_hz=arrays["frequency_hz"],
        accelerance=arrays["accelerance"].astype(np.complex128),
        coherence=None if coherence is None else coherence.astype(float),
        hanger=test.hanger,
        time=test.time,
        temperature_c=test.temperature_c,
    )


# ---------------------------------------------------------------- tests


def test_from_document(document: Mapping[str, Any], hanger: int) -> ModalTest:
    """A test back from its entry of a modal-tests document."""
    return parse_modes({"schema": MODES_SCHEMA, "hanger": hanger, "tests": [document]})[0]


def quality_from(entry: Mapping[str, Any]) -> QualityCheck:
    """A quality figure back from its document."""
    numbers = {name: number(entry[name]) for name in ("value", "limit")}
    return QualityCheck(**{**entry, **numbers})


def foreign_from(entry: Mapping[str, Any]) -> ForeignMode:
    """What was set aside, back from its document."""
    numbers = {name: number(entry[name]) for name in ("frequency_hz", "damping_ratio")}
    return ForeignMode(**{**entry, **numbers})


# ---------------------------------------------------------------- posteriors


def pack_samples(posterior: Posterior) -> bytes:
    """The arrays of a posterior as npz bytes, in full precision."""
    return pack(**{name: getattr(posterior, name) for name in _POSTERIOR_ARRAYS})


def posterior_from(document: Mapping[str, Any], blob: bytes) -> Posterior:
    """A posterior, complete with samples, back from its document and bytes."""
    arrays = unpack(blob)
    values: dict[str, Any] = {name: document[name] for name in _POSTERIOR_PLAIN}
    values |= {name: number(document[name]) for name in _POSTERIOR_NUMBERS}
    values |= {name: arrays[name] for name in _POSTERIOR_ARRAYS}
    return Posterior(
        names=tuple(document["parameters"]),
        predicted=tuple(_predicted(entry) for entry in document["predicted"]),
        tests=tuple(document["tests"]),
        method=document.get("method", "tmcmc"),  # absent before there was another
        **_since_described(document),
        **values,
    )


def _since_described(document: Mapping[str, Any]) -> dict[str, Any]:
    """What documents of before there were priors of a description lack: these were the thesis's."""
    numbers = (
        "repeatability_sd_n",
        "misfit_percent",
        "log_occam",
        "tension_of_other_ends_n",
        "tension_of_other_orders_n",
        "description_off_sd",
        "reading_off_sd",
    )
    return {
        "priors": document.get("priors", "thesis"),
        "at_bounds": tuple(document.get("at_bounds", ())),
        **{name: number(document.get(name)) for name in numbers},
    }


def _predicted(entry: Mapping[str, Any]) -> PredictedFrequency:
    frequency = entry["frequency_hz"]
    return PredictedFrequency(
        plane=entry["plane"],
        order=entry["order"],
        mean_hz=number(frequency["mean"]),
        sd_hz=number(frequency["sd"]),
        measured_hz=number(entry["measured_hz"]),
    )


def number(value: float | None) -> float:
    """A number of a document, where null is what is not known."""
    return NAN if value is None else float(value)


# ---------------------------------------------------------------- alerts


def alert_from_document(document: Mapping[str, Any]) -> Alert:
    """An alert back from its document; one of the first schemas has no kinds and no change."""
    change, tension = document.get("change"), document.get("tension")
    return Alert(
        **{name: document[name] for name in ("key", "hanger", "test", "message")},
        time=parse_time(document["time"]),
        drifts=tuple(_drift(entry) for entry in document["drifts"]),
        kinds=cast(tuple[AlertKind, ...], tuple(document.get("kinds", ()))),
        change=None if change is None else _change(change),
        tension=None if tension is None else averaged_from(tension),
    )


def watch_document(watched: WatchedTest) -> dict[str, Any]:
    """What the sequential test says after a test; its drifts are kept by themselves."""
    return {"temperature_c": watched.temperature_c, "change": asdict(watched.change)}


def watch_from(
    document: Mapping[str, Any], test: str, time: datetime, drifts: Sequence[Drift]
) -> WatchedTest:
    """The watch after a test back from its document and its drifts."""
    return WatchedTest(
        test=test,
        time=time,
        temperature_c=number(document["temperature_c"]),
        drifts=tuple(drifts),
        change=change_from(document),
    )


def change_from(document: Mapping[str, Any]) -> Change:
    """What the sequential test says after a test back from the document of its watch."""
    return _change(document["change"])


def _change(entry: Mapping[str, Any]) -> Change:
    numbers = {name: number(entry[name]) for name in _CHANGE_NUMBERS}
    return Change(
        began_after=parse_time(entry["began_after"]),
        began_by=parse_time(entry["began_by"]),
        moved=tuple(_moved(each) for each in entry["moved"]),
        **numbers,
    )


def _moved(entry: Mapping[str, Any]) -> Moved:
    numbers = {name: number(entry[name]) for name in _MOVED_NUMBERS}
    others = {name: tuple(entry[name]) for name in ("alike", "together") if name in entry}
    return Moved(**{**entry, **numbers, **others})


def _drift(entry: Mapping[str, Any]) -> Drift:
    values = {field.name: entry[field.name] for field in fields(Drift)}
    numbers = {name: number(values[name]) for name in _DRIFT_NUMBERS}
    return Drift(**{**values, **numbers, "time": parse_time(entry["time"])})


_CHANGE_NUMBERS = (
    "evidence_years",
    "limit_years",
    "probability",
    "sudden",
    "outlier_probability",
)
_MOVED_NUMBERS = ("probability", "shift_mean", "shift_sd")
_DRIFT_NUMBERS = ("baseline", "value", "shift_mean", "shift_sd", "threshold", "probability")
