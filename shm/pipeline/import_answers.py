"""Answers of a person about a file, as text, and what is shown of the file, as a document."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from shm.documents import parse_time
from shm.errors import UsageError
from shm.pipeline.importing import WORTHS, Answers, Import, Question, Understood
from shm.read.logger_words import KNOWN, seconds_of, sensitivity_of, unit_of, volts_of
from shm.values import NAN, PLANES, Plane, outdoor_c

_PLANES: dict[str, Plane] = {
    "transverse": "transverse", "t": "transverse", "quer": "transverse",
    "longitudinal": "longitudinal", "l": "longitudinal", "längs": "longitudinal",
    "laengs": "longitudinal",
}  # fmt: skip
_UNKNOWN = ("unknown", "-", "?")
_NOTHING = ("", "none", "leave out")


def channel_answer(about: str, text: str, recorded_in: str = "") -> dict[str, object]:
    """An answer about a channel as keys of a sidecar; raises UsageError with what may be said.

    `about` is place, plane, unit or sensitivity; `recorded_in` is the unit of the column.
    """
    if about == "place":
        return {"x_m": "" if text.lower() in _UNKNOWN else _number(text)}
    if about == "plane":
        return {"plane": plane_named(text)}
    if about == "unit":
        if unit_of(text) is None and seconds_of(text) is None:
            raise UsageError(f"{text!r} is no unit that is read.", remedy=f"Give one of {KNOWN}.")
        return {"unit": text}
    return _calibrated(text, recorded_in)


def answer_to(question: Question, text: str, found: Import) -> dict[str, object]:
    """An answer to a question about a channel; to one about its unit, nothing leaves it out."""
    plain = text.strip()
    if question.about != "unit":
        return channel_answer(question.about, plain)
    if plain.lower() in _NOTHING:
        return {"leave_out": True}
    unit = unit_recorded(question.channel, found)
    is_raw = volts_of(unit) is not None or unit in WORTHS
    return channel_answer("sensitivity" if is_raw else "unit", plain, unit)


def answer_time(text: str, answers: Answers) -> Answers:
    """Return the answers with the time of the test, by an ISO 8601 time or day, or 'unknown'."""
    if text.strip().lower() in _UNKNOWN:
        return replace(answers, is_time_unknown=True)
    try:
        return replace(answers, time=parse_time(text.strip()))
    except (ValueError, OverflowError):
        raise UsageError(f"{text!r} is no day.", remedy="Write it as 2026-05-01.") from None


def answer_temperature(text: str, answers: Answers) -> Answers:
    """Return the answers with the temperature of the steel, by degrees Celsius or 'unknown'."""
    if text.strip().lower() in _UNKNOWN:
        return replace(answers, is_temperature_unknown=True)
    try:
        number = float(text.replace(",", "."))
    except ValueError:
        number = NAN
    if math.isnan(outdoor_c(number)):
        raise UsageError(f"{text!r} is no temperature outdoors.", remedy="Give degrees Celsius.")
    return replace(answers, temperature_c=number)


def answer_operator(text: str, answers: Answers) -> Answers:
    """Return the answers with who measured, by a name or 'unknown'."""
    if text.strip().lower() in (*_UNKNOWN, ""):
        return replace(answers, is_operator_unknown=True)
    return replace(answers, operator=text.strip())


ANSWERS_OF_TEST: dict[str, Callable[[str, Answers], Answers]] = {
    "time": answer_time, "temperature": answer_temperature, "operator": answer_operator,
}  # fmt: skip
"""What takes the answer to a question about one test, by what it is about."""


def unit_recorded(name: str, found: Import) -> str:
    """The unit in which a file says that a column is recorded."""
    return next(column.unit for column in found.survey.columns if column.name == name)


def plane_named(text: str) -> Plane:
    """The plane that a person means; raises UsageError."""
    plane = _PLANES.get(text.lower())
    if plane is None:
        raise UsageError(f"{text!r} is no plane.", remedy=f"Give {' or '.join(PLANES)}.")
    return plane


def _number(text: str) -> float:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        raise UsageError(
            f"{text!r} is no place.", remedy="Give metres from the deck end, or 'unknown'."
        ) from None


def _calibrated(text: str, recorded_in: str) -> dict[str, object]:
    """Unit and calibration: by a sensitivity, or by what one recorded unit is worth."""
    # A sensitivity of a column without unit says that it is in volts.
    found, volts = sensitivity_of(text), volts_of(recorded_in)
    if found is not None and not recorded_in:
        volts = 1.0
    if found is not None and volts is not None:
        return {"unit": found.unit, "calibration": found.unit_per_volt * volts}
    number, _, unit = text.strip().partition(" ")
    if unit_of(unit) is not None and volts is None:
        return {"unit": unit, "calibration": _number(number)}
    raise UsageError(
        f"{text!r} is no sensitivity of a column in {recorded_in or 'no unit'}.",
        remedy="Give '100 mV/g' or '2.25 mV/N' of a column in volts, else what one recorded unit"
        " is worth: '50 g'.",
    )


def import_document(found: Import) -> dict[str, Any]:
    """Return what is understood of a file and what is open; unknown numbers are NaN."""
    survey = found.survey
    return {
        "format": survey.format,
        "fingerprint": survey.layout.fingerprint,
        "hanger": found.hanger,
        "time": found.described.get("time", survey.time),
        "temperature_c": found.described.get("temperature_c", survey.temperature_c),
        "operator": found.described.get("operator", survey.operator),
        "sampling_rate_hz": found.sampling_rate_hz,
        "samples": survey.samples,
        "columns": [_column(column) for column in found.columns],
        "questions": [question_document(question) for question in found.questions],
        "of_test": [question_document(question) for question in found.of_test],
        "problems": list(found.problems),
        "remarks": list(found.remarks),
    }


def question_document(question: Question) -> dict[str, object]:
    """A question, and the option of `shm import` that answers it."""
    return {
        "about": question.about,
        "channel": question.channel,
        "text": question.text,
        "option": question.option,
        "choices": list(question.choices),
    }


def _column(column: Understood) -> dict[str, Any]:
    names = (
        "name", "unit", "quantity", "plane", "x_m", "least", "largest", "overloads", "is_clipped",
        "hits",
    )  # fmt: skip
    return {**{name: getattr(column, name) for name in names}, "outline": list(column.outline)}
