"""The modal-tests document (`shm.modes/1`): what was identified, or what anybody measured.

Unknown numbers are null in JSON and NaN in memory. Reading checks everything and names the test,
mode and key at fault.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from datetime import datetime
from pathlib import Path
from typing import Any, TypeGuard

from shm.documents import key_meant, parse_time
from shm.errors import BadInput
from shm.values import (
    LONGEST_TEST_ID,
    NAN,
    PLANES,
    AddedMass,
    ModalTest,
    Mode,
    ShapePoint,
    is_test_id,
)

MODES_SCHEMA = "shm.modes/1"
_LARGEST = 1e300  # technical: a square root or two of what follows from it must not overflow
_HIGHEST_ORDER = 200  # technical: models solve for every order below; no hammer reaches it
_TEST_KEYS = (
    "id", "time", "temperature_c", "amplitude", "added_mass", "tension_read_n",
    "tension_read_sd_n", "modes",
)  # fmt: skip
_MODE_KEYS = tuple(field.name for field in fields(Mode))
_SPELT = {"added_mass": 'Write added_mass = {"mass_kg": ..., "x_m": ...}, in kg and m.'}
_LARGEST_DOCUMENT_BYTES = 32 << 20  # some thousand tests; it grows thirtyfold when read


def modes_document(tests: Sequence[ModalTest]) -> dict[str, Any]:
    """The `shm.modes/1` document of tests of one hanger."""
    hanger = tests[0].hanger if tests else None
    return {
        "schema": MODES_SCHEMA,
        "hanger": hanger,
        "tests": [test_document(test) for test in tests],
    }


def test_document(test: ModalTest) -> dict[str, Any]:
    """One entry of a modal-tests document."""
    document = asdict(test)
    document.pop("hanger")
    if test.added_mass is None:
        document.pop("added_mass")
    if math.isnan(test.tension_read_n):
        document.pop("tension_read_n")
        document.pop("tension_read_sd_n")
    for mode in document["modes"]:
        if not mode["irregular"]:
            mode.pop("irregular")
    return document


def load_modes(path: Path) -> tuple[ModalTest, ...]:
    """The tests of a `*.modes.json` file; raises BadInput with file, test, mode and remedy."""
    try:
        _refuse_large(path)
        document = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise BadInput(
            f"not JSON: {error.msg}.", file=path, line=error.lineno, remedy="Write it anew."
        ) from error
    except OSError as error:
        raise BadInput(f"cannot be read: {error}.", file=path, remedy="Check the path.") from error
    except (ValueError, RecursionError) as error:
        # No text, a number of thousands of digits, or nested without end.
        raise BadInput(f"cannot be read: {error}.", file=path, remedy="Write it anew.") from error
    return parse_modes(document, path)


def _refuse_large(path: Path) -> None:
    if path.stat().st_size > _LARGEST_DOCUMENT_BYTES:
        raise BadInput(
            f"a document of more than {_LARGEST_DOCUMENT_BYTES >> 20} MB is not read.",
            file=path,
            remedy="Give its tests in several documents.",
        )


def parse_modes(document: Any, file: str | Path = "") -> tuple[ModalTest, ...]:
    """The tests of a modal-tests document already parsed from JSON; raises BadInput."""
    if not isinstance(document, dict) or document.get("schema") != MODES_SCHEMA:
        raise BadInput(
            f"not a modal-tests document of schema {MODES_SCHEMA}.",
            file=file,
            remedy="Make one with `shm identify FILE --json`.",
        )
    hanger = document.get("hanger")
    if hanger is not None and not _is_whole(hanger, 0):
        raise BadInput(
            f"hanger = {hanger!r} is not a whole number.", file=file, remedy="Give its number."
        )
    tests = document.get("tests")
    if not isinstance(tests, list) or not tests:
        raise BadInput(
            "the list `tests` is missing or empty.", file=file, remedy="Give at least one test."
        )
    return tuple(_parse_test(test, hanger, index, file) for index, test in enumerate(tests))


def _parse_test(test: Any, hanger: int | None, index: int, file: str | Path) -> ModalTest:
    label = f"tests[{index}]"
    if not isinstance(test, dict) or not isinstance(test.get("modes"), list) or not test["modes"]:
        raise BadInput(
            f"{label} has no list `modes`.", file=file, remedy="Give its modes or drop the test."
        )
    _refuse_misspelt(test, _TEST_KEYS, label, file)
    modes = tuple(
        _parse_mode(mode, f"{label}.modes[{i}]", file) for i, mode in enumerate(test["modes"])
    )
    keys = [(mode.plane, mode.order) for mode in modes]
    for plane, order in keys:
        if keys.count((plane, order)) > 1:
            raise BadInput(
                f"{label}: {plane} mode {order} is given twice.", file=file, remedy="Keep one."
            )
    return ModalTest(
        id=_id(test.get("id", f"t{index + 1}"), label, file),
        modes=modes,
        hanger=hanger,
        time=_time(test.get("time"), label, file),
        temperature_c=_number(test, "temperature_c", label, file),
        amplitude=_number(test, "amplitude", label, file),
        added_mass=_added_mass(test.get("added_mass"), label, file),
        **_tension_read(test, label, file),
    )


def _id(value: Any, label: str, file: str | Path) -> str:
    text = str(value) if isinstance(value, str | int) else ""
    if not is_test_id(text):
        raise BadInput(
            f"{label}: id is not a text of 1 to {LONGEST_TEST_ID} printable characters.",
            file=file,
            remedy="Give a short one, or leave it out.",
        )
    return text


def _tension_read(test: Mapping[str, Any], label: str, file: str | Path) -> dict[str, float]:
    keys = ("tension_read_n", "tension_read_sd_n")
    values = {key: _number(test, key, label, file) for key in keys}
    read, sd = values.values()
    if read <= 0 or sd <= 0 or (math.isnan(read) and math.isfinite(sd)):
        raise BadInput(
            f"{label}: tension_read_n and tension_read_sd_n are a tension and its standard "
            f"deviation, above 0.",
            file=file,
            remedy="Give the tension in N, and its standard deviation where you know it.",
        )
    return values


def _refuse_misspelt(
    table: Mapping[str, Any], known: Sequence[str], label: str, file: str | Path
) -> None:
    for key in table:
        meant = key_meant(str(key), known)
        if meant:
            raise BadInput(
                f"{label}: unknown key {key}.",
                file=file,
                remedy=_SPELT.get(meant, f"Write {meant}, or leave it out."),
            )


def _parse_mode(mode: Any, label: str, file: str | Path) -> Mode:
    if not isinstance(mode, dict) or mode.get("plane") not in PLANES:
        raise BadInput(
            f"{label}: plane must be one of {', '.join(PLANES)}.", file=file, remedy="Correct it."
        )
    _refuse_misspelt(mode, _MODE_KEYS, label, file)
    order = mode.get("order")
    if not _is_whole(order, 1) or order > _HIGHEST_ORDER:
        raise BadInput(
            f"{label}: order must be 1, 2, 3, ... up to {_HIGHEST_ORDER}.",
            file=file,
            remedy="Correct it.",
        )
    frequency = _number(mode, "frequency_hz", label, file)
    if not frequency > 0:
        raise BadInput(f"{label}: frequency_hz must be positive.", file=file, remedy="Correct it.")
    frequency_sd = _number(mode, "frequency_sd_hz", label, file)
    if frequency_sd < 0:
        raise BadInput(
            f"{label}: frequency_sd_hz is negative.",
            file=file,
            remedy="Leave it out where unknown.",
        )
    irregular = mode.get("irregular", False)
    if not isinstance(irregular, bool):
        raise BadInput(f"{label}: irregular is true or false.", file=file, remedy="Correct it.")
    return Mode(
        plane=mode["plane"],
        order=order,
        frequency_hz=frequency,
        frequency_sd_hz=frequency_sd,
        damping_ratio=_number(mode, "damping_ratio", label, file),
        damping_sd=_number(mode, "damping_sd", label, file),
        shape=_shape(mode.get("shape"), label, file),
        acceleration_m_s2=_number(mode, "acceleration_m_s2", label, file),
        irregular=irregular,
    )


def _shape(points: Any, label: str, file: str | Path) -> tuple[ShapePoint, ...]:
    if points is None:
        return ()
    if not isinstance(points, list):
        raise BadInput(f"{label}: shape is not a list.", file=file, remedy="Give a list of points.")
    return tuple(_shape_point(p, f"{label}.shape[{i}]", file) for i, p in enumerate(points))


def _shape_point(point: Any, label: str, file: str | Path) -> ShapePoint:
    if not isinstance(point, dict):
        raise BadInput(f"{label} is not an object.", file=file, remedy="Give x_m and value.")
    return ShapePoint(
        **{key: _number(point, key, label, file) for key in ("x_m", "value", "cross", "sd")}
    )


def _added_mass(mass: Any, label: str, file: str | Path) -> AddedMass | None:
    if mass is None:
        return None
    label = f"{label}.added_mass"
    if not isinstance(mass, dict):
        raise BadInput(f"{label} is not an object.", file=file, remedy="Give mass_kg and x_m.")
    values = {key: _number(mass, key, label, file) for key in ("mass_kg", "x_m")}
    if not values["mass_kg"] > 0 or not values["x_m"] >= 0:
        raise BadInput(
            f"{label} needs a positive mass_kg and an x_m.",
            file=file,
            remedy="Give both, in kg and m.",
        )
    return AddedMass(**values)


def _number(table: Mapping[str, Any], key: str, label: str, file: str | Path) -> float:
    value = table.get(key)
    if value is None:
        return NAN
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < _LARGEST:
        return float(value)
    raise BadInput(
        f"{label}: {key} = {value!r} is not a number.",
        file=file,
        remedy="Leave it out where unknown.",
    )


def _is_whole(value: Any, least: int) -> TypeGuard[int]:
    """Whether a value is a whole number from `least` that any database holds."""
    return type(value) is int and least <= value < 2**31


def _time(text: Any, label: str, file: str | Path) -> datetime | None:
    if text is None:
        return None
    try:
        return parse_time(text)
    except (TypeError, ValueError, OverflowError):
        raise BadInput(
            f"{label}: time = {text!r} is not an ISO 8601 time.",
            file=file,
            remedy="Write 2026-05-01T10:00:00Z.",
        ) from None
