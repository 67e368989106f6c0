"""The modal-tests document (`shm.modes/1`): what was identified, or what anybody measured.

Unknown numbers are null in JSON and NaN in memory. Reading checks everything and names the test,
mode and key at fault.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from cattrs import Converter
from cattrs.gen import make_dict_structure_fn

from shm.documents import ValidationError, finite, key_meant, reader, value_of
from shm.errors import BadInput
from shm.values import LONGEST_TEST_ID, AddedMass, ModalTest, Mode, is_test_id, outdoor_c

MODES_SCHEMA = "shm.modes/1"
_HIGHEST_ORDER = 200  # technical: models solve for every order below; no hammer reaches it
_ORDERS = f"1, 2, 3, ... up to {_HIGHEST_ORDER}"
_LEAVE_OUT = "Leave it out where unknown."
_REMEDIES = {
    "plane": "Correct it.", "order": f"Give {_ORDERS}.", "frequency_hz": "Correct it.",
    "time": "Write 2026-05-01T10:00:00Z.", "shape": "Give a list of points, with x_m and value.",
    "added_mass": "Give mass_kg and x_m.", "irregular": "Correct it.",
    "modes": "Give plane, order and frequency_hz of each.",
}  # fmt: skip
_TEST_KEYS = tuple(field.name for field in fields(ModalTest) if field.name != "hanger")
_ALWAYS = ("id", "modes", "time", "temperature_c", "amplitude")
"""Keys of a test that stand in its document where they are unknown, too."""
_MODE_KEYS = tuple(field.name for field in fields(Mode))
_MASS_KEYS = tuple(field.name for field in fields(AddedMass))
_SPELT = {"added_mass": 'Write added_mass = {"mass_kg": ..., "x_m": ...}, in kg and m.'}
_MAKE = "Make one of recordings: `shm identify FILE --out t.modes.json`."
_LARGEST_DOCUMENT_BYTES = 32 << 20  # some thousand tests; it grows thirtyfold when read


def modes_document(tests: Sequence[ModalTest]) -> dict[str, Any]:
    """Return the `shm.modes/1` document of tests of one hanger."""
    hanger = tests[0].hanger if tests else None
    return {
        "schema": MODES_SCHEMA,
        "hanger": hanger,
        "tests": [test_document(test) for test in tests],
    }


def test_document(test: ModalTest) -> dict[str, Any]:
    """Return one entry of a modal-tests document."""
    document = asdict(test)
    document.pop("hanger")
    optional = document.keys() - {*_ALWAYS, "tension_read_sd_n"}
    for key in optional:
        if document[key] in (None, "") or document[key] != document[key]:
            document.pop(key)
    if "tension_read_n" not in document:
        document.pop("tension_read_sd_n")
    if test.added_mass is not None and test.added_mass.radius_of_gyration_m is None:
        document["added_mass"].pop("radius_of_gyration_m")
    for mode in document["modes"]:
        if not mode["irregular"]:
            mode.pop("irregular")
        if math.isnan(mode["amplitude_slope"]):
            mode.pop("amplitude_slope")
            mode.pop("amplitude_slope_sd")
    return document


def load_modes(path: Path) -> tuple[ModalTest, ...]:
    """Read the tests of a `*.modes.json` file; raises BadInput with file, test, mode, remedy."""
    try:
        _refuse_large(path)
        document = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise BadInput(
            f"not JSON: {error.msg}.", file=path, line=error.lineno, remedy=_MAKE
        ) from error
    except OSError as error:
        raise BadInput(f"cannot be read: {error}.", file=path, remedy="Check the path.") from error
    except (ValueError, RecursionError) as error:
        # No text, a number of thousands of digits, or nested without end.
        raise BadInput(f"cannot be read: {error}.", file=path, remedy="Write it again.") from error
    return parse_modes(document, path)


def _refuse_large(path: Path) -> None:
    if path.stat().st_size > _LARGEST_DOCUMENT_BYTES:
        raise BadInput(
            f"a document of more than {_LARGEST_DOCUMENT_BYTES >> 20} MB is not read.",
            file=path,
            remedy="Give its tests in several documents.",
        )


def parse_modes(document: Any, file: str | Path = "") -> tuple[ModalTest, ...]:
    """Read the tests of a modal-tests document already parsed from JSON; raises BadInput."""
    if not isinstance(document, dict) or document.get("schema") != MODES_SCHEMA:
        raise BadInput(
            f"not a modal-tests document of schema {MODES_SCHEMA}.",
            file=file,
            remedy=_MAKE,
        )
    hanger = document.get("hanger")
    if hanger is not None and (type(hanger) is not int or not 0 <= hanger < 2**31):
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
    _refuse_misspelt(test.get("added_mass"), _MASS_KEYS, f"{label}.added_mass", file)
    for i, mode in enumerate(test["modes"]):
        _refuse_misspelt(mode, _MODE_KEYS, f"{label}.modes[{i}]", file)
    filled = {**test, "hanger": hanger, "id": _id(test.get("id", f"t{index + 1}"), label, file)}
    try:
        found = value_of(ModalTest, filled, label, _READER)
    except ValidationError as error:
        remedy = _REMEDIES.get(error.key, _LEAVE_OUT)
        raise BadInput(f"{error}.", file=file, remedy=remedy) from error
    for wrong, problem, remedy in _faults(found):
        if wrong:
            raise BadInput(f"{label}{problem}.", file=file, remedy=remedy)
    return found


def _id(value: Any, label: str, file: str | Path) -> str:
    text = str(value) if isinstance(value, str | int) else ""
    if not is_test_id(text):
        raise BadInput(
            f"{label}: id is not a text of 1 to {LONGEST_TEST_ID} printable characters.",
            file=file,
            remedy="Give a short one, or leave it out.",
        )
    return text


def _refuse_misspelt(table: Any, known: Sequence[str], label: str, file: str | Path) -> None:
    for key in table if isinstance(table, dict) else ():
        meant = key_meant(str(key), known)
        if meant:
            raise BadInput(
                f"{label}: unknown key {key}.",
                file=file,
                remedy=_SPELT.get(meant, f"Write {meant}, or leave it out."),
            )


def _faults(test: ModalTest) -> Iterator[tuple[bool, str, str]]:
    """Yield a condition, its message and its remedy for each value out of range."""
    places = [(mode.plane, mode.order) for mode in test.modes]
    for i, mode in enumerate(test.modes):
        at = f".modes[{i}]:"
        yield not 1 <= mode.order <= _HIGHEST_ORDER, f"{at} order must be {_ORDERS}", "Correct it."
        yield not mode.frequency_hz > 0, f"{at} frequency_hz must be positive", "Correct it."
        yield mode.frequency_sd_hz < 0, f"{at} frequency_sd_hz is negative", _LEAVE_OUT
        slope_is_wrong = mode.amplitude_slope_sd < 0 or abs(mode.amplitude_slope) >= 1
        yield slope_is_wrong, f"{at} amplitude_slope is no fraction with a deviation", _LEAVE_OUT
        twice = places.count(places[i]) > 1
        yield twice, f": {mode.plane} mode {mode.order} is given twice", "Keep one."
    mass = test.added_mass
    yield (
        mass is not None and not (mass.mass_kg > 0 and mass.x_m >= 0),
        ".added_mass needs a positive mass_kg and an x_m",
        "Give both, in kg and m.",
    )
    radius_m = None if mass is None else mass.radius_of_gyration_m
    is_wrong = radius_m is not None and radius_m < 0
    yield is_wrong, ".added_mass: radius_of_gyration_m is negative", _LEAVE_OUT
    warm = test.temperature_c
    is_odd = math.isfinite(warm) and math.isnan(outdoor_c(warm))
    yield is_odd, f": temperature_c = {warm:g} is no temperature outdoors", _LEAVE_OUT
    read, sd = test.tension_read_n, test.tension_read_sd_n
    yield (
        read <= 0 or sd <= 0 or (math.isnan(read) and math.isfinite(sd)),
        ": tension_read_n and tension_read_sd_n are a tension and its standard deviation, above 0",
        "Give the tension in N, and its standard deviation where you know it.",
    )


def _sparse(kind: Any, by: Converter) -> Callable[[Any, Any], Any]:
    """Drop keys that are null, and set numbers that were left out to NaN."""
    take = make_dict_structure_fn(kind, by)
    numbers = dict.fromkeys(each.name for each in fields(kind) if each.type == "float")
    return lambda node, _: take(
        {**numbers, **{key: value for key, value in node.items() if value is not None}}, kind
    )


_READER = reader(finite, _sparse)
