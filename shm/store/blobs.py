"""Arrays as npz bytes (never pickle) and values back from their documents."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from shm.documents import value_of
from shm.modes_document import MODES_SCHEMA, parse_modes
from shm.store.columns import value_from
from shm.values import (
    NAN,
    Alert,
    Change,
    CreepRate,
    FrequencyResponse,
    ModalTest,
    Posterior,
    RepeatedMistake,
    ResponsePoint,
    WatchedTest,
    collect_conditions,
)

_NO_TIME = datetime.min.replace(tzinfo=UTC)
_POSTERIOR_ARRAYS = ("samples", "log_likelihood", "most_probable")


def pack(**arrays: Any) -> bytes:
    """Return named arrays as compressed npz bytes."""
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
        **collect_conditions(test),
    )


# ---------------------------------------------------------------- tests


def test_from_document(document: Mapping[str, Any], hanger: int) -> ModalTest:
    """A test back from its entry of a modal-tests document."""
    return parse_modes({"schema": MODES_SCHEMA, "hanger": hanger, "tests": [document]})[0]


# ---------------------------------------------------------------- posteriors


def pack_samples(posterior: Posterior) -> bytes:
    """Return the arrays of a posterior as npz bytes, in full precision.

    Not compressed: samples become 10 % smaller by that, in half of the time of an insert.
    """
    buffer = io.BytesIO()
    np.savez(buffer, **{name: getattr(posterior, name) for name in _POSTERIOR_ARRAYS})
    return buffer.getvalue()


def posterior_from(document: Mapping[str, Any], blob: bytes) -> Posterior:
    """A posterior, complete with samples, back from its document and bytes.

    What documents of former versions lack was then as it is where nothing is said.
    """
    from shm.models import class_units  # who reads no posterior needs no models

    predicted = [
        {**entry, "mean_hz": entry["frequency_hz"]["mean"], "sd_hz": entry["frequency_hz"]["sd"]}
        for entry in document["predicted"]
    ]
    known = class_units(document["model"])
    units = {
        name: entry.get("unit", known.get(name, ""))
        for name, entry in document["parameters"].items()
    }
    named = {"names": list(units), "units": list(units.values())}
    return value_of(Posterior, {**document, **unpack(blob), **named, "predicted": predicted})


# ---------------------------------------------------------------- watches


def watch_document(watched: WatchedTest) -> dict[str, Any]:
    """Return the document of a watched test without its drifts, which have rows."""
    creep = watched.creep_per_year
    return {
        "temperature_c": watched.temperature_c,
        "change": asdict(watched.change),
        "creep_per_year": creep and asdict(creep),
        "mistaken": [asdict(each) for each in watched.mistaken],
    }


@dataclass(frozen=True)
class _Watch:
    """The document of a watch; those of former versions tell less."""

    temperature_c: float
    change: Change
    creep_per_year: CreepRate | None = None
    mistaken: tuple[RepeatedMistake, ...] = ()
    alert_probability: float = NAN
    calls_for: Alert | None = None


def watch_in(text: str) -> tuple[WatchedTest, float, Alert | None]:
    """The watch after a test back from its document, for its test, time and drifts to be put in,
    the alert probability that it was judged with, and the alert that it called for.
    """
    found = value_from(_Watch, text)
    of_test = found.temperature_c, (), found.change, found.creep_per_year, found.mistaken
    return WatchedTest("", _NO_TIME, *of_test), found.alert_probability, found.calls_for


def change_in(text: str) -> Change:
    """Return the change from the document of a watch."""
    change: Change = value_from(_Watch, text).change
    return change
