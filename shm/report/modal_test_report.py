"""The sheet of one hammer test, by which a person checks how it was identified."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from shm import modes_document
from shm.report import formatting, shared_tables
from shm.report.bar_table import bar_document, bar_table
from shm.report.contents import ModalTestReport
from shm.report.figures.bar_sketch import FIGURE as SKETCH
from shm.report.figures.modal_test_axes import ResponseCurves
from shm.report.figures.modal_test_hits import FIGURE as HITS
from shm.report.figures.modal_test_modes import SHAPES, STABILISATION
from shm.report.figures.modal_test_response import FIGURE as RESPONSE
from shm.report.figures.modal_test_time_history import FIGURE as TIME_HISTORY
from shm.report.figures.specification import FigureSpec, Illustration, drawn
from shm.report.figures.style import VERDICT_STYLES
from shm.report.paper import Fact, Paper, Section, Table, filled
from shm.report.shared_tables import headline, lineage, overall, quality_table, settings
from shm.values import FrequencyResponse, Mode, QualityCheck, Recording, Verdict
from shm.values.rounding import force_unit

FIGURES: tuple[FigureSpec[ResponseCurves], ...] = (
    TIME_HISTORY, HITS, RESPONSE, STABILISATION, SHAPES
)  # fmt: skip


def modal_test_figures(sheet: ModalTestReport) -> tuple[Illustration, ...]:
    """Draw all of one hammer test."""
    return drawn(FIGURES, ResponseCurves.of(sheet))


def modal_test_paper(sheet: ModalTestReport) -> Paper:
    """Return the report of a test: summary, modes and quality, figures, origin."""
    verdict = overall(sheet.identification.quality)
    return Paper(
        title=name(sheet),
        bridge=sheet.bridge,
        status=headline(sheet.identification.quality),
        style=VERDICT_STYLES[verdict],
        parts=(
            Section(
                "In short",
                summary=summary(sheet),
                facts=facts(sheet),
                tables=(bar_table(sheet.bar),),
                brief=filled(replace(modes(sheet), note="")),
            ),
            Section("Modes and quality", tables=results(sheet)),
            Section(
                "Figures",
                figures=lambda: (*drawn((SKETCH,), sheet.bar), *modal_test_figures(sheet)),
            ),
            Section("How it came about", tables=details(sheet)),
        ),
        generated_at=sheet.generated_at,
        version=sheet.version,
        closing="Intervals are central 90 %; standard deviations are of one test; times are UTC.",
    )


def facts(sheet: ModalTestReport) -> tuple[Fact, ...]:
    """Return the figures on top: what, value, what stands beside it."""
    test, hits = sheet.identification.test, sheet.hits
    planes = {mode.plane for mode in sheet.modes}
    return (
        ("Modes", str(len(sheet.modes)), f"in {formatting.counted(len(planes), 'plane')}"),
        ("Hits used", f"{len(sheet.used_hits)} of {len(hits)}" if hits else "none", _force(sheet)),
        ("Tested", formatting.moment(test.time), formatting.temperature(test.temperature_c)),
        ("Excluded", str(len(sheet.identification.set_aside)), "resonances without an order"),
    )


def _force(sheet: ModalTestReport) -> str:
    forces = [hit.peak_force_n for hit in sheet.used_hits if math.isfinite(hit.peak_force_n)]
    if not forces:
        return "no force was recorded"
    return f"peak force {formatting.plain(min(forces))} to {formatting.plain(max(forces))} N"


_MOST_REMEDIES = 3  # layout: more are not read


def name(sheet: ModalTestReport) -> str:
    """`Test t7, Hanger 3`, as far as it is known."""
    test = sheet.identification.test
    if sheet.hanger is not None:
        return f"Test {test.id}, {formatting.hanger_name(sheet.hanger.id, sheet.hanger.name)}"
    return f"Test {test.id}" if test.hanger is None else f"Test {test.id}, Hanger {test.hanger}"


def summary(sheet: ModalTestReport) -> str:
    """Return how far the modes can be used, what has no order, and what to do next."""
    sentences = (_trust(sheet), _without_order(sheet), _what_is_no_mode(sheet), _advice(sheet))
    return " ".join(sentence for sentence in sentences if sentence)


def _without_order(sheet: ModalTestReport) -> str:
    """Return how many modes are known whose orders are not."""
    found_hz = [m.frequency_hz for m in sheet.identification.set_aside if m.kind == "unnumbered"]
    if not found_hz:
        return ""
    count = formatting.counted(len(found_hz), "mode")
    return f"The order of {count} is not known ({min(found_hz):.4g} to {max(found_hz):.4g} Hz)."


def _what_is_no_mode(sheet: ModalTestReport) -> str:
    found = [each for each in sheet.identification.set_aside if each.kind != "unnumbered"]
    if not found:
        return ""
    listed = formatting.listed([f"{each.kind} at {each.frequency_hz:.4g} Hz" for each in found])
    return f"Excluded, as they are no modes of the hanger: {listed}."


def _trust(sheet: ModalTestReport) -> str:
    """Return a sentence on how far the modes can be used."""
    checks = sheet.identification.quality
    made = [check for check in checks if check.verdict != "unknown"]
    match overall(checks):
        case "refused":
            return f"Do not use it: refused by {_names(checks, 'refused')}."
        case "warning":
            count = len([check for check in made if check.verdict == "warning"])
            verb = "warns" if count == 1 else "warn"
            of = formatting.counted(len(made), "check")
            named = _names(checks, "warning")
            return f"The modes can be used with care: {count} of {of} {verb} ({named})."
        case "good":
            which = f"all {len(made)} checks" if len(made) > 1 else "the one check"
            verb = "are" if len(made) > 1 else "is"
            return f"The modes can be trusted: {which} that could be made {verb} good."
        case "unknown":
            return "Its quality was not checked: judge by the figures before using the modes."


def _names(checks: Sequence[QualityCheck], verdict: Verdict) -> str:
    return formatting.listed([check.name for check in checks if check.verdict == verdict])


def _advice(sheet: ModalTestReport) -> str:
    """Return what to do next, gravest first."""
    checks = sheet.identification.quality
    graves = sorted(
        (c for c in checks if c.verdict in ("refused", "warning") and c.remedy),
        key=lambda check: check.verdict != "refused",
    )
    if graves:
        more = len(graves) - _MOST_REMEDIES
        rest = f" See the quality for {more} more." if more > 0 else ""
        return f"Next: {' '.join(c.remedy for c in graves[:_MOST_REMEDIES])}{rest}"
    return "Nothing needs doing before using them." if overall(checks) == "good" else ""


def results(sheet: ModalTestReport) -> tuple[Table, ...]:
    """Return the tables of the results, as far as there are any."""
    return filled(modes(sheet), _doubts_in_terminal(quality(sheet)), foreign_modes(sheet))


def _doubts_in_terminal(checks: Table) -> Table:
    """Return for a terminal the checks that are not good, and the number of good ones."""
    doubts = tuple(row for row, verdict in enumerate(checks.marks) if verdict != "good")
    good = len(checks.rows) - len(doubts)
    note = f"{{}} {'further ' if doubts else ''}{'check' if good == 1 else 'checks'} good."
    return replace(checks, terminal_rows=doubts, hidden_note=note) if good else checks


def details(sheet: ModalTestReport) -> tuple[Table, ...]:
    """Return the tables of how the results came about, as far as there are any."""
    wording = (hits(sheet), conditions(sheet), settings(sheet.settings))
    hit, *others = (table.not_in_terminal() for table in wording)
    return filled(notes(sheet), hit, dropped(sheet), *others)


def modes(sheet: ModalTestReport) -> Table:
    return Table(
        "Modes",
        MODE_HEADINGS,
        tuple(mode_row(mode) for mode in sheet.modes),
        note="sd: standard deviation. Amplitude: with which the mode rings right after a hit, at "
        "the sensor that moves most; as measured, without interval.",
        may_break=True,
    )


MODE_HEADINGS = (
    "plane", "order", "frequency, Hz", "sd, Hz", "damping, %", "sd, %", "amplitude, m/s²",
)  # fmt: skip


def mode_row(mode: Mode) -> tuple[str, ...]:
    """Return one mode under `MODE_HEADINGS`."""
    places = min(6, max(3, formatting.decimals(2 * mode.frequency_sd_hz)))
    damping_places = min(4, max(2, formatting.decimals(200 * mode.damping_sd)))
    return (
        mode.plane,
        str(mode.order),
        f"{mode.frequency_hz:.{places}f}",
        formatting.plain(mode.frequency_sd_hz, 2),
        formatting.number(100 * mode.damping_ratio, f".{damping_places}f"),
        formatting.plain(100 * mode.damping_sd, 2),
        formatting.plain(mode.acceleration_m_s2),
    )


def quality(sheet: ModalTestReport) -> Table:
    return quality_table(sheet.identification.quality)


def foreign_modes(sheet: ModalTestReport) -> Table:
    return Table(
        "Excluded: not known as modes of the hanger",
        ("what", "frequency, Hz", "sd, Hz", "damping, %", "why"),
        tuple(
            (
                f"{each.kind} {each.plane or ''}".rstrip(),
                f"{each.frequency_hz:.3f}",
                formatting.plain(each.frequency_sd_hz, 2) if each.kind == "unnumbered" else "",
                formatting.number(100 * each.damping_ratio, ".4f"),
                each.reason,
            )
            for each in sheet.identification.set_aside
        ),
    )


def dropped(sheet: ModalTestReport) -> Table:
    """Return what the identification left out of the records, and why."""
    return Table(
        "Left out",
        ("what", "how many", "why"),
        tuple((each.what, str(each.count), each.reason) for each in sheet.dropped),
    )


def hits(sheet: ModalTestReport) -> Table:
    """Return each hit with its time in s and peak force in N, and whether it was used."""
    records = sheet.recordings
    return Table(
        "Hits",
        ("hit", "record", "time, s", "peak force, N", "used"),
        tuple(
            (
                str(number),
                _file(records[hit.record]) if hit.record < len(records) else str(hit.record + 1),
                f"{hit.start_s:.3f}",
                formatting.plain(hit.peak_force_n, 4),
                "yes" if hit.used else f"no: {hit.reason}",
            )
            for number, hit in enumerate(sheet.hits, 1)
        ),
        note="As recorded, without interval.",
    )


def notes(sheet: ModalTestReport) -> Table:
    rows = [(str(number), note) for number, note in enumerate(sheet.identification.notes, 1)]
    return Table("Decisions to know of", ("no.", "note"), tuple(rows))


def conditions(sheet: ModalTestReport) -> Table:
    """Return which test it is, and what was noted with it."""
    test = sheet.identification.test
    facts = {
        "test": test.id,
        "hanger": _hanger(sheet),
        "time": formatting.moment(test.time),
        **shared_tables.conditions(test),
        "band": _band(sheet),
        "exponential window on the responses": _window(sheet),
        "records": _records(sheet),
        **lineage(sheet.lineage),
    }
    return Table("Conditions", ("what", "value"), tuple(facts.items()))


def _hanger(sheet: ModalTestReport) -> str:
    number = sheet.identification.test.hanger
    if sheet.hanger is None:
        return "not stated" if number is None else f"{number}, not described"
    hanger = sheet.hanger
    called = formatting.hanger_name(hanger.id, hanger.name)
    unit = force_unit(hanger.nominal_tension_n)
    nominal = f"{unit.of(hanger.nominal_tension_n):g} {unit.name}"
    return f"{called}, {hanger.length_m:g} m, nominal tension {nominal}"


def _band(sheet: ModalTestReport) -> str:
    if sheet.band_hz is None:
        return "not stated"
    return f"{sheet.band_hz[0]:g} to {sheet.band_hz[1]:g} Hz"


def _window(sheet: ModalTestReport) -> str:
    seconds = sheet.identification.window_time_constant_s
    return f"time constant {seconds:.3g} s" if math.isfinite(seconds) else "none"


def _records(sheet: ModalTestReport) -> str:
    if not sheet.records:
        return "not at hand"
    return "; ".join(_record(record) for record in sheet.records)


def _record(record: Recording | FrequencyResponse) -> str:
    if isinstance(record, Recording):
        return f"{_file(record)}, {record.duration_s:.4g} s at {record.sampling_rate_hz:g} Hz"
    return f"{_file(record)}, {len(record.frequency_hz)} lines"


def _file(record: Recording | FrequencyResponse) -> str:
    """Return the file's name: where it lay is nothing for a report."""
    return Path(record.source).name


SHEET_SCHEMA = "shm.test-sheet/1"


def modal_test_json(sheet: ModalTestReport) -> dict[str, Any]:
    """Return a document for `shm.documents.dump`; signals and curves stay in the records."""
    found = sheet.identification
    return {
        "schema": SHEET_SCHEMA,
        "hanger": found.test.hanger,
        "bar": bar_document(sheet.bar),
        "verdict": overall(found.quality),
        "summary": summary(sheet),
        "test": modes_document.test_document(found.test),
        "quality": [asdict(check) for check in found.quality],
        "set_aside": [asdict(each) for each in found.set_aside],
        "hits": [asdict(hit) for hit in found.hits],
        "dropped": [asdict(each) for each in found.dropped],
        "notes": list(found.notes),
        "records": [Path(record.source).name for record in sheet.records],
        "lineage": dict(sheet.lineage),
        "settings": dict(sheet.settings),
        "generated_at": sheet.generated_at,
        "version": sheet.version or None,
        "band_hz": list(sheet.band_hz) if sheet.band_hz else None,
    }
