"""The tables of a test's sheet: one source for terminal and page."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from shm.report import words
from shm.report.origin import added_mass, lineage, settings
from shm.report.paper import Table, filled
from shm.report.quality import quality_table
from shm.report.sheet.content import TestSheet
from shm.values import FrequencyResponse, Mode, Recording
from shm.values.force_units import force_unit


def results(sheet: TestSheet) -> tuple[Table, ...]:
    """What came of the test, as far as there is any of it."""
    return filled(modes(sheet), _doubts_first(quality(sheet)), set_aside(sheet))


def _doubts_first(checks: Table) -> Table:
    """In a terminal the checks that are not good, and how many are."""
    doubts = tuple(row for row, verdict in enumerate(checks.marks) if verdict != "good")
    good = len(checks.rows) - len(doubts)
    what = f"{'further ' if doubts else ''}{'check' if good == 1 else 'checks'}"
    return replace(checks, brief=doubts, rest=f"{{}} {what} good.") if good else checks


def details(sheet: TestSheet) -> tuple[Table, ...]:
    """How it came about, as far as there is any of it."""
    told = (hits(sheet), conditions(sheet), settings(sheet.settings))
    hit, *others = (table.without_terminal() for table in told)
    return filled(notes(sheet), hit, dropped(sheet), *others)


def modes(sheet: TestSheet) -> Table:
    return Table(
        "Modes",
        ("plane", "order", "frequency, Hz", "sd, Hz", "damping, %", "sd, %", "amplitude, m/s²"),
        tuple(_mode_row(mode) for mode in sheet.modes),
        note="sd: standard deviation. Amplitude: with which the mode rings right after a hit, at "
        "the sensor that moves most; as measured, without interval.",
    )


def _mode_row(mode: Mode) -> tuple[str, ...]:
    places = min(6, max(3, words.decimals(2 * mode.frequency_sd_hz)))
    return (
        mode.plane,
        str(mode.order),
        f"{mode.frequency_hz:.{places}f}",
        words.plain(mode.frequency_sd_hz, 2),
        words.number(100 * mode.damping_ratio, ".4f"),
        words.plain(100 * mode.damping_sd, 2),
        words.plain(mode.acceleration_m_s2),
    )


def quality(sheet: TestSheet) -> Table:
    return quality_table(sheet.identification.quality)


def set_aside(sheet: TestSheet) -> Table:
    return Table(
        "Set aside: not modes of the hanger",
        ("what", "frequency, Hz", "damping, %", "why"),
        tuple(
            (
                each.kind,
                f"{each.frequency_hz:.3f}",
                words.number(100 * each.damping_ratio, ".4f"),
                each.reason,
            )
            for each in sheet.identification.set_aside
        ),
    )


def dropped(sheet: TestSheet) -> Table:
    """What the identification left out of the records, and why."""
    return Table(
        "Left out",
        ("what", "how many", "why"),
        tuple((each.what, str(each.count), each.reason) for each in sheet.dropped),
    )


def hits(sheet: TestSheet) -> Table:
    """Each hit with its time in s and peak force in N, and whether it was used."""
    records = sheet.recordings
    return Table(
        "Hits",
        ("hit", "record", "time, s", "peak force, N", "used"),
        tuple(
            (
                str(number),
                _file(records[hit.record]) if hit.record < len(records) else str(hit.record + 1),
                f"{hit.start_s:.3f}",
                words.plain(hit.peak_force_n, 4),
                "yes" if hit.used else f"no: {hit.reason}",
            )
            for number, hit in enumerate(sheet.hits, 1)
        ),
        note="As recorded, without interval.",
    )


def notes(sheet: TestSheet) -> Table:
    rows = [(str(number), note) for number, note in enumerate(sheet.identification.notes, 1)]
    return Table("Decisions to know of", ("no.", "note"), tuple(rows))


def conditions(sheet: TestSheet) -> Table:
    """Which test it is, and what was noted with it."""
    test = sheet.identification.test
    facts = {
        "test": test.id,
        "hanger": _hanger(sheet),
        "time": words.moment(test.time),
        "temperature": words.temperature(test.temperature_c),
        "hit level over reference level": words.plain(test.amplitude),
        "added mass": added_mass(test),
        "band": _band(sheet),
        "exponential window on the responses": _window(sheet),
        "records": _records(sheet),
        **lineage(sheet.lineage),
    }
    return Table("Conditions", ("what", "value"), tuple(facts.items()))


def _hanger(sheet: TestSheet) -> str:
    number = sheet.identification.test.hanger
    if sheet.hanger is None:
        return "not stated" if number is None else f"{number}, not described"
    hanger = sheet.hanger
    called = words.hanger_name(hanger.id, hanger.name)
    unit = force_unit(hanger.nominal_tension_n)
    nominal = f"{unit.of(hanger.nominal_tension_n):g} {unit.name}"
    return f"{called}, {hanger.length_m:g} m, nominal tension {nominal}"


def _band(sheet: TestSheet) -> str:
    if sheet.band_hz is None:
        return "not stated"
    return f"{sheet.band_hz[0]:g} to {sheet.band_hz[1]:g} Hz"


def _window(sheet: TestSheet) -> str:
    seconds = sheet.identification.window_time_constant_s
    return f"time constant {seconds:.3g} s" if math.isfinite(seconds) else "none"


def _records(sheet: TestSheet) -> str:
    if not sheet.records:
        return "not at hand"
    return "; ".join(_record(record) for record in sheet.records)


def _record(record: Recording | FrequencyResponse) -> str:
    if isinstance(record, Recording):
        return f"{_file(record)}, {record.duration_s:.4g} s at {record.sampling_rate_hz:g} Hz"
    return f"{_file(record)}, {len(record.frequency_hz)} lines"


def _file(record: Recording | FrequencyResponse) -> str:
    """The file's name: where it lay is nothing for a report."""
    return Path(record.source).name
