"""A file of any logger, the first time: what is understood of it, and what only a person knows.

What the file says itself is not asked. What was answered once holds for all files of the same
logger (`shm.read.profiles`); where nothing is open any more the file goes into the spool.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime, tzinfo
from datetime import time as clock_time
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from shm.bridge import example_words
from shm.documents import parse_time
from shm.errors import BadInput, UsageError
from shm.identify.measuring.setups import fault_of_place
from shm.pipeline.lineage import read_limits
from shm.read import logger_words as words
from shm.read.assemble import assemble
from shm.read.base import Survey, SurveyedColumn
from shm.read.describe import describe
from shm.read.header import CHANNEL_KEYS, Entry
from shm.read.logger_words import KNOWN, seconds_of, sensitivity_of, unit_of, volts_of
from shm.read.profiles import Profile, completed, profile_for, save_profile, with_day_order
from shm.read.sandbox import survey
from shm.read.sidecar import Described, sidecar_document
from shm.read.stamps import DayOrder, in_zone, order_of_choice
from shm.read.table import Column, Table
from shm.read.time_axis import REMEDY, rate_of
from shm.store import Workspace
from shm.values import NAN, PLANES, Channel, FloatArray, Plane, Quantity, Recording, outdoor_c


def with_times(described: dict[str, Any], found: Survey) -> dict[str, Any]:
    """A column that is named as times in s, which its format's reader does not take for such."""
    if not math.isnan(found.sampling_rate_hz) or "sampling_rate_hz" in described:
        return described
    if any(table.get("unit") == "s" for table in described.get("channel", {}).values()):
        return described
    for column in found.columns:
        if column.quantity is None and words.means_time(column.name) and not column.unit:
            tables = {**described.get("channel", {}), column.name: {"unit": "s"}}
            return {**described, "channel": tables}
    return described


def known_rate(found: Survey, described: Described) -> tuple[float, str]:
    """The sampling rate, in Hz: as said, else by the column in s; and why that has none.

    NaN where nothing tells it.
    """
    stated = float(described.get("sampling_rate_hz", found.sampling_rate_hz))
    tables = described.get("channel", {})
    for column in found.columns:
        table = tables.get(column.name, {})
        if math.isnan(stated) and table.get("unit") == "s" and column.values is not None:
            try:
                return rate_of(column.values, _uneven(found, column.name)), ""
            except BadInput as error:
                return NAN, str(error)
    return stated, ""


def _uneven(found: Survey, channel: str) -> Callable[[int, str], BadInput]:
    return lambda row, what: BadInput(
        f"{what} at sample {row + 1}.", file=Path(found.source), channel=channel, remedy=REMEDY
    )


OUTLINE_BINS = 32
"""Into how many parts of equal length the picture of a channel divides it."""


def outline(values: FloatArray | None) -> tuple[float, ...]:
    """The largest departure from the middle in each part, as a share of the largest of all."""
    if values is None or len(values) < OUTLINE_BINS or not np.isfinite(values).any():
        return ()
    middle = float(np.nanmedian(values))
    away = np.nan_to_num(np.abs(values - middle), posinf=0.0)
    parts = np.array([part.max() for part in np.array_split(away, OUTLINE_BINS)])
    top = float(parts.max())
    return tuple(float(part) for part in (parts / top if top > 0 else parts))


WORTHS = {
    "full scale": ("the full scale", ("50 g", "2000 N")),
    "counts": ("one count", ("2.4e-6 m/s2", "0.001 N")),
}
"""Units of which only the sensor's owner knows what one is worth."""
_WILD_M_S2 = 4903.0  # judgement: 500 g, the range of accelerometers of 10 mV/g and 5 V
_ASKED_UNITS = ("", "full scale", "1", "-", "counts", "digits", "lsb")


@dataclass(frozen=True)
class Answers:
    """The answers of a person about a file; NaN and None where there are none.

    `channels` are keys of a sidecar's table of a channel, by its name. `each_time`: the logger
    goes from hanger to hanger, and its profile is to name none. `unknown` are those of `OF_TEST`
    that nobody knows, such as which of two days the file means.
    """

    hanger: int | None = None
    sampling_rate_hz: float = NAN
    time: datetime | None = None
    temperature_c: float = NAN
    operator: str = ""
    channels: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    each_time: bool = False
    unknown: frozenset[str] = frozenset()

    @property
    def stated(self) -> dict[str, Any]:
        """The same as the keys of a sidecar."""
        document: dict[str, Any] = {
            "hanger": self.hanger,
            "time": self.time,
            "temperature_c": self.temperature_c,
            "operator": self.operator or None,
            "sampling_rate_hz": self.sampling_rate_hz,
        }
        known = {k: v for k, v in document.items() if v is not None and v == v}
        tables = {name: dict(table) for name, table in self.channels.items() if table}
        return {**known, "channel": tables} if tables else known


@dataclass(frozen=True)
class Question:
    """Hold what only a person knows: of a channel, or of the whole file where `channel` is empty.

    A file can be taken in without what is not `needed`. `choices` are the usual answers.
    """

    about: str
    channel: str
    text: str
    option: str
    needed: bool = True
    choices: tuple[str, ...] = ()


@dataclass(frozen=True)
class Understood:
    """A column as it will be read: `least` and `largest` in SI, NaN where it is left out.

    `outline` is its largest absolute value in each of `OUTLINE_BINS` parts, as a share of the
    largest of all; `hits` is None of anything but a force.
    """

    name: str
    unit: str
    quantity: Quantity | None
    plane: Plane | None
    x_m: float
    least: float
    largest: float
    overloads: int
    is_clipped: bool
    hits: int | None
    outline: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Import:
    """A file as it is understood. `described` is its sidecar, `profiled` what its logger's profile
    is to say; `problems` are what nobody can answer. `of_test` asks when it was and how warm, which
    is asked once where anything is, and of one file alone. `caveat` doubts the hanger's
    description.
    """

    survey: Survey
    described: Described
    profiled: Described
    profile: Profile | None
    columns: tuple[Understood, ...]
    sampling_rate_hz: float
    hanger: int | None
    questions: tuple[Question, ...]
    problems: tuple[str, ...]
    of_test: tuple[Question, ...] = ()
    caveat: str = ""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Return what a person should look at, though nothing is refused for it."""
        wild = [
            f"{c.name} reaches {max(-c.least, c.largest):.3g} m/s2, beyond most accelerometers"
            f" ({_WILD_M_S2:.0f}): is its unit right?"
            for c in self.columns
            if c.quantity == "acceleration" and max(-c.least, c.largest) > _WILD_M_S2
        ]
        return (*([self.caveat] if self.caveat else []), *self.survey.remarks, *wild)

    @property
    def is_ready(self) -> bool:
        return not self.problems and not any(question.needed for question in self.questions)


def look_into(path: Path, workspace: Workspace, answers: Answers) -> Import:
    """Return what a file holds, with all that is known of it.

    Raises BadInput where that is nothing.
    """
    with ThreadPoolExecutor(1) as executor:
        found = executor.submit(survey, path, read_limits(workspace.settings))
        import_module("shm.identify.measuring")  # a second, while another process reads
        return understand(found.result(), workspace, answers)


def understand(found: Survey, workspace: Workspace, answers: Answers) -> Import:
    """The same of a file that was looked into before."""
    path = Path(found.source)
    profile = profile_for(found.layout, workspace.folder)
    sidecar = _joined(sidecar_document(path), answers.stated)
    sidecar, order = _with_chosen_time(sidecar, found, workspace.bridge.time_zone)
    _refuse_unknown(sidecar, found, path)
    known = profile.described if profile is not None else {}
    zone = workspace.bridge.time_zone
    described = with_times(completed(known, found.layout, sidecar, path.name, zone), found)
    hanger = described.get("hanger", found.hanger)
    rate, uneven = known_rate(found, described)
    surveyed = [_with_description(column, described) for column in found.columns]
    questions = _questions(found, surveyed, described, hanger, rate, workspace)
    of_test = _of_test(found, described, answers)
    if found.layout.possible_times:  # two days in question are asked of each file
        questions += [each for each in of_test if each.about == "time"]
    problems = (
        *_hanger_problem(hanger, workspace),
        *_place_problems(surveyed, hanger, workspace),
    )
    record, fault = _recording(surveyed, rate, path)
    fault = uneven or fault
    if found.lines or any(question.about in ("unit", "rate") for question in questions):
        fault = ""  # the answers may mend it
    is_measured = any(each.quantity == "acceleration" for each in surveyed)
    if not is_measured and all(question.about != "unit" for question in questions):
        # No answer can make it a recording.
        questions, fault = [], "; ".join(found.problems) or fault
    profiled = with_day_order(_to_keep(known, answers.stated, found), order)
    channels = {} if record is None else {c.name: c for c in record.channels}
    columns = tuple(
        _understood(raw, column, channels.get(column.name), rate)
        for raw, column in zip(found.columns, surveyed, strict=True)
    )
    problems = (*problems, *((fault,) if fault else ()))
    return Import(
        found, described, profiled, profile, columns, rate, hanger, tuple(questions), problems,
        tuple(each for each in of_test if each not in questions), _caveat(hanger, workspace),
    )  # fmt: skip


def keep_profile(found: Import, workspace: Workspace, *, each_time: bool = False) -> Profile | None:
    """Keeps what was said for the next file of this logger, but no hanger where that is asked
    `each_time`; None where nothing had to be."""
    before = found.profile.described if found.profile is not None else {}
    if not each_time and (not found.profiled or found.profiled == before):
        return found.profile
    return save_profile(found.profiled, found.survey.layout, workspace.folder, roams=each_time)


def _with_chosen_time(
    sidecar: dict[str, Any], found: Survey, zone: tzinfo
) -> tuple[dict[str, Any], DayOrder | None]:
    """Return the sidecar with the complete time, and the order of day and month that is known now.

    A person may name one of the possible times by its day alone.
    """
    possible, time = found.layout.possible_times, sidecar.get("time")
    if not isinstance(time, datetime):
        return sidecar, found.layout.day_order
    order = order_of_choice(time, possible) or found.layout.day_order
    same = [each.time for each in possible if each.time.date() == time.date()]
    is_day = bool(same) and time.time() == clock_time.min
    return {**sidecar, "time": in_zone(same[0], zone)} if is_day else sidecar, order


def _joined(first: Described, then: Described) -> dict[str, Any]:
    """Two sidecars as one; the second goes before the first."""
    tables = {
        name: {**first.get("channel", {}).get(name, {}), **then.get("channel", {}).get(name, {})}
        for name in [*first.get("channel", {}), *then.get("channel", {})]
    }
    return {**first, **then, "channel": tables} if tables else {**first, **then}


def _refuse_unknown(sidecar: Described, found: Survey, path: Path) -> None:
    names = [column.name for column in found.columns]
    for name in sidecar.get("channel", {}):
        if name not in names:
            raise BadInput(
                "the file has no such column.",
                file=path,
                channel=name,
                remedy=f"It has {', '.join(names)}.",
            )


OF_TEST = {"time": "time", "temperature": "temperature_c", "operator": "operator"}
"""What is asked of one test alone, and the key of a sidecar that says it."""


def _to_keep(known: Described, stated: Described, found: Survey) -> dict[str, Any]:
    """Return what holds for every file of the logger: not the hanger that the file itself says."""
    profiled = _joined(known, {k: v for k, v in stated.items() if k not in OF_TEST.values()})
    if found.layout.hanger is not None:
        profiled.pop("hanger", None)
    return profiled


def _hanger_problem(hanger: object, workspace: Workspace) -> tuple[str, ...]:
    if not isinstance(hanger, int):
        return ()
    try:
        workspace.bridge.tested(hanger)
    except BadInput as error:
        return (str(error),)
    return ()


def _caveat(hanger: object, workspace: Workspace) -> str:
    tested = (each for each in workspace.bridge.hangers if each.id == hanger)
    return next(map(example_words, tested), "")


def _place_problems(
    columns: Sequence[SurveyedColumn], hanger: object, workspace: Workspace
) -> list[str]:
    """Sensors that are said to be off the hanger, where it is one of the bridge."""
    tested = next((each for each in workspace.bridge.bars if each.id == hanger), None)
    if tested is None:
        return []
    of_sensors = [each for each in columns if each.quantity == "acceleration"]
    faults = {each.name: fault_of_place(each.x_m, tested) for each in of_sensors}
    return [f"{name}: {fault}" for name, fault in faults.items() if fault]


# ---------------------------------------------------------------- what is open


_UNITS = ("N", "kN", "lbf", "m/s2", "mm/s2", "g", "mg", "s", "none")


def _questions(
    found: Survey,
    columns: Sequence[SurveyedColumn],
    described: Described,
    hanger: object,
    rate: float,
    workspace: Workspace,
) -> list[Question]:
    asked: list[Question] = []
    if hanger is None:
        known = tuple(str(each.id) for each in workspace.bridge.watched)
        text, option = "Which hanger was tested?", "--hanger N"
        asked.append(Question("hanger", "", text, option, choices=known))
    if math.isnan(rate) and not found.lines:
        asked.append(Question("rate", "", "How many samples a second?", "--rate HZ"))
    asked += [_of_unit(column) for column in _open(columns)]
    return asked + [each for column in columns for each in _of_sensor(column, described)]


def _of_test(found: Survey, described: Described, answers: Answers) -> list[Question]:
    """Return the questions about one test alone, without which a file can be taken in."""
    warmth = "How warm was the steel, in degrees Celsius (or 'unknown')?"
    asked = {
        "time": _of_time(found),
        "temperature": Question("temperature", "", warmth, "--temperature C", needed=False),
        "operator": Question(
            "operator", "", "Who measured (or 'unknown')?", "--operator NAME", needed=False
        ),
    }
    stated = {"time": found.time, "temperature_c": found.temperature_c, "operator": found.operator}
    return [
        question
        for about, question in asked.items()
        if about not in answers.unknown
        and OF_TEST[about] not in described
        and ((value := stated[OF_TEST[about]]) in (None, "") or value != value)
    ]


def _of_time(found: Survey) -> Question:
    possible = found.layout.possible_times
    days = tuple(dict.fromkeys(f"{each.time:%Y-%m-%d}" for each in possible))
    if not days:
        text = "When was the test (such as 2026-05-01T10:00Z, or 'unknown')?"
        return Question("time", "", text, "--time TIME", needed=False)
    text = f"Was the test on {' or on '.join(days)} (or 'unknown')?"
    return Question("time", "", text, f"--time {'|'.join(days)}", False, days)


def _with_description(column: SurveyedColumn, described: Described) -> SurveyedColumn:
    """A column with what the sidecar says of it."""
    table = described.get("channel", {}).get(column.name, {})
    unit = str(table.get("unit", column.described_unit))
    measured = words.unit_of(unit)
    quantity = measured.quantity if measured is not None else None
    if "unit" not in table and quantity is None:
        quantity = column.quantity
    if table.get("leave_out"):
        quantity = None
    return replace(
        column,
        quantity=quantity,
        described_unit=unit,
        plane=table.get("plane", column.plane) or None,
        x_m=_number(table.get("x_m", column.x_m)),
        calibration=_number(table.get("calibration", column.calibration)),
        full_scale=_number(table.get("full_scale", column.full_scale)),
        meant=None if "leave_out" in table or "unit" in table else column.meant,
        unit="(answered)" if "leave_out" in table or "unit" in table else column.unit,
    )


def _number(value: object) -> float:
    try:
        return float(str(value))
    except ValueError:
        return NAN


def _open(columns: Sequence[SurveyedColumn]) -> list[SurveyedColumn]:
    """Columns that may be a force or an acceleration, of which nothing says in what unit."""
    has = {column.quantity for column in columns}
    unclear = [c for c in columns if not (c.quantity and c.unit) and c.unit != "(answered)"]
    in_volts = [c for c in unclear if words.volts_of(c.unit) is not None]
    plain = [c for c in unclear if c.unit.lower() in _ASKED_UNITS or _is_in_doubt(c)]
    named = [c for c in plain if c.quantity or c.meant]
    if "acceleration" not in has and not named and not in_volts:
        named = plain
    return [c for c in columns if c in in_volts or c in named]


def _is_in_doubt(column: SurveyedColumn) -> bool:
    """Return True if nobody knows the unit, or it is not one of what the name says."""
    return not words.is_unit(column.unit) or words.unit_of(column.unit) is not None


def _of_unit(column: SurveyedColumn) -> Question:
    quoted = shlex.quote(column.name)
    if words.volts_of(column.unit) is None and column.unit not in WORTHS:
        message = f"; {column.unit!r} is unknown or unlike its name" if column.unit else ""
        units = f"N, kN, m/s2, g, s; 'none' leaves it out{message}"
        text = f"In what unit is {column.name} recorded ({units})?"
        option = f"--unit {quoted}=UNIT or --leave-out {quoted}"
    else:
        text = f"What does the sensor of {column.name} give (such as 100 mV/g, 2.25 mV/N)?"
        option = f"--sensitivity {quoted}='100 mV/g' or --leave-out {quoted}"
        if column.unit in WORTHS:
            one, examples = WORTHS[column.unit]
            text = f"What is {one} of {column.name} worth (such as {', '.join(examples)})?"
            option = f"--sensitivity {quoted}='{examples[0]}' or --leave-out {quoted}"
    choices = _UNITS if option.startswith("--unit") else ()
    return Question("unit", column.name, text, option, choices=choices)


def _of_sensor(column: SurveyedColumn, described: Described) -> list[Question]:
    name, quoted, asked = column.name, shlex.quote(column.name), []
    stated = {*described.get("channel", {}).get(name, {}), *described}
    moves = column.quantity == "acceleration"
    if column.quantity and math.isnan(column.x_m) and "x_m" not in stated:
        what = f"Where is {name}" if moves else f"Where did the hammer hit (column {name})"
        text = f"{what}, in m from the deck end (or 'unknown')?"
        asked.append(Question("place", name, text, f"--place {quoted}=M", needed=moves))
    if moves and column.plane is None and "plane" not in described:
        text = f"In which plane does {name} measure (transverse or longitudinal)?"
        option = f"--plane {quoted}=transverse|longitudinal"
        asked.append(Question("plane", name, text, option, choices=PLANES))
    return asked


# ---------------------------------------------------------------- what is shown


def _recording(
    surveyed: Sequence[SurveyedColumn], rate: float, path: Path
) -> tuple[Recording | None, str]:
    """The recording as it will be read, or why it will be refused."""
    try:
        columns = [
            Column(c.name, len(c.values), partial(np.asarray, c.values), role="channel",
                   stated=_entries(c, path))
            for c in surveyed
            if c.quantity is not None and c.values is not None
        ]  # fmt: skip
        rates = {} if math.isnan(rate) else {"sampling_rate_hz": Entry(rate, path)}
        table = Table(path, tuple(columns), rates)
        made = assemble(describe(table, with_sidecars=False))
        assert isinstance(made, Recording)
        return made, ""
    except BadInput as error:
        return None, str(error)


def _entries(column: SurveyedColumn, path: Path) -> dict[str, Entry]:
    document = {
        "unit": column.described_unit,
        "plane": column.plane,
        "x_m": column.x_m,
        "calibration": column.calibration,
        "full_scale": column.full_scale,
    }
    known = {k: v for k, v in document.items() if v is not None and v == v and k in CHANNEL_KEYS}
    return {key: Entry(value, path) for key, value in known.items()}


def _understood(
    raw: SurveyedColumn, column: SurveyedColumn, channel: Channel | None, rate: float
) -> Understood:
    from shm.identify.measuring.hits import find_pulses
    from shm.identify.measuring.signal_faults import clipped

    values = raw.values if channel is None else channel.values
    good = np.zeros(0) if values is None else values[np.isfinite(values)]
    measured = column.quantity is not None and channel is not None and len(good) > 0
    hits = None
    if column.quantity == "force" and values is not None and rate > 0:
        hits = len(find_pulses(values, rate))
    limit = NAN if channel is None else channel.full_scale
    return Understood(
        name=raw.name,
        unit=raw.unit or raw.described_unit,
        quantity=column.quantity,
        plane=column.plane,
        x_m=column.x_m,
        least=float(good.min()) if measured else NAN,
        largest=float(good.max()) if measured else NAN,
        overloads=raw.overloads,
        is_clipped=raw.overloads > 0 or (measured and bool(clipped([good], limit)[0])),
        hits=hits,
        outline=outline(values),
    )


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
        return {"x_m": "" if text.lower() in _UNKNOWN else _metres(text)}
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


def answer_of_test(about: str, text: str, answers: Answers) -> Answers:
    """Return the answers with the time, temperature or operator of a test, or that it is unknown.

    A time is an ISO 8601 time or day, a temperature in degrees Celsius; raises UsageError.
    """
    plain = text.strip()
    if plain.lower() in _UNKNOWN or (about == "operator" and not plain):
        return replace(answers, unknown=answers.unknown | {about})
    if about == "operator":
        return replace(answers, operator=plain)
    if about == "time":
        try:
            return replace(answers, time=parse_time(plain))
        except (ValueError, OverflowError):
            raise UsageError(f"{text!r} is no day.", remedy="Write it as 2026-05-01.") from None
    number = _number(plain.replace(",", "."))
    if math.isnan(outdoor_c(number)):
        raise UsageError(f"{text!r} is no temperature outdoors.", remedy="Give degrees Celsius.")
    return replace(answers, temperature_c=number)


def unit_recorded(name: str, found: Import) -> str:
    """The unit in which a file says that a column is recorded."""
    return next(column.unit for column in found.survey.columns if column.name == name)


def plane_named(text: str) -> Plane:
    """The plane that a person means; raises UsageError."""
    plane = _PLANES.get(text.lower())
    if plane is None:
        raise UsageError(f"{text!r} is no plane.", remedy=f"Give {' or '.join(PLANES)}.")
    return plane


def _metres(text: str) -> float:
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
        return {"unit": unit, "calibration": _metres(number)}
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
        "columns": [asdict(column) for column in found.columns],
        "questions": [question_document(question) for question in found.questions],
        "of_test": [question_document(question) for question in found.of_test],
        "problems": list(found.problems),
        "remarks": list(found.remarks),
    }


def question_document(question: Question) -> dict[str, object]:
    """A question, and the option of `shm import` that answers it."""
    return {name: value for name, value in asdict(question).items() if name != "needed"}
