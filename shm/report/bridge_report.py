"""The report of a whole bridge: the state of all hangers, what moved, what explains it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

from shm.report import formatting
from shm.report.bar_table import bar_document, bars_table
from shm.report.contents import BridgeReport, hangers_unit
from shm.report.control_report import chart_document
from shm.report.figures.along_the_bridge import SHIFTS, TENSIONS
from shm.report.figures.control_chart import FIGURE as CONTROL
from shm.report.figures.specification import Illustration, drawn
from shm.report.hanger_status import Status, control_lead
from shm.report.hanger_summary import HangerSummary, PeriodSummary
from shm.report.paper import CREDIBLE, Fact, Paper, Section, Table, appendices, filled
from shm.report.shared_tables import lineage, settings
from shm.report.shifts import _day, pattern_json, pattern_tables
from shm.report.states import period_json
from shm.values.messages import NEXT_TEST
from shm.values.rounding import ForceUnit, rounded_percent
from shm.values.stated_tension import stated
from shm.watch.control_chart import ControlChart


def bridge_paper(data: BridgeReport) -> Paper:
    """Return the report of a bridge: summary, figures along the bridge, numbers."""
    hangers = _hangers(data).with_units_in_headings()
    return Paper(
        title=data.bridge,
        period=str(data.period) if data.period else "",
        status=data.worst.value if data.worst else "",
        style=data.worst.name.lower() if data.worst else "first",
        parts=(
            Section(
                "In short",
                lead=data.message.words,
                summary=details(data),
                facts=facts(data),
                tables=filled(hangers, bars_table([line.bar for line in data.hangers])),
                brief=filled(replace(hangers, title="", note="")),
            ),
            Section("Along the bridge", figures=lambda: _figures(data)),
            *(_control_part(each) for each in data.controls),
            Section("Numbers", tables=_other_tables(data)),
            *appendices(Section("Settings", tables=filled(settings(data.settings)))),
        ),
        generated_at=data.generated_at,
        version=data.version,
        closing=f"{CREDIBLE}; times are UTC.",
        more="All of it: `shm report --bridge --full`, or `--out bridge.pdf`.",
    )


def _figures(data: BridgeReport) -> tuple[Illustration, ...]:
    """Draw what moved, where it was compared, and what each hanger carries."""
    shifts = drawn((SHIFTS,), data.pattern) if data.pattern else ()
    return (*shifts, *drawn((TENSIONS,), data))


def _control_part(chart: ControlChart) -> Section:
    """Return the state of a control hanger and its chart."""
    return Section(
        f"Control hanger {chart.hanger.id}",
        paragraphs=[control_lead(chart).words],
        figures=lambda: drawn((CONTROL,), chart),
    )


def _change(line: HangerSummary) -> str:
    change = line.change
    return rounded_percent(change.mean, change.width / 2, "+") if change else ""


def _short_tension(line: HangerSummary, unit: ForceUnit) -> str:
    if line.tension_n is None:
        return ""
    if not line.is_determined:
        return "not determined"
    return formatting.with_half(line.tension_n, unit).removesuffix(f" {unit.name}")


def facts(data: BridgeReport) -> tuple[Fact, ...]:
    """Return what, value, and what belongs to it."""
    tested = [line for line in data.hangers if line.latest is not None]
    alert, watch = (of_status(data.hangers, each) for each in (Status.ALERT, Status.WATCH))
    opened = sum(line.open_alerts for line in data.hangers)
    times = [line.latest.time for line in tested if line.latest]
    latest, oldest = max(times, default=None), min(times, default=None)
    return (
        ("Hangers", str(len(data.hangers)), f"{len(tested)} of them tested"),
        ("In alert", str(len(alert)), named(alert) if alert else "no hanger"),
        ("To watch", str(len(watch)), named(watch) if watch else "no hanger"),
        ("Open alerts", str(opened), "not acknowledged yet" if opened else "none waits"),
        (
            "Latest test",
            f"{latest:%Y-%m-%d}" if latest else "none",
            f"oldest of the latest {formatting.moment(oldest)[:10]}" if oldest else "no test yet",
        ),
    )


def summary(data: BridgeReport) -> str:
    """Return state and action of the bridge, then the details."""
    return f"{data.message.words} {details(data)}".rstrip()


def details(data: BridgeReport) -> str:
    """Return the reasons, and how sure they are."""
    pattern = data.pattern.sentence if data.pattern else data.why_no_pattern
    controls = (control_lead(each).words for each in data.controls)
    sentences = (*controls, _in_period(data), pattern, *advice(data)[1:])
    return " ".join(sentence for sentence in sentences if sentence)


def advice(data: BridgeReport) -> tuple[str, ...]:
    """Return what to do next, most urgent first; never empty."""
    found = [data.message.lead.action]
    if opened := [line for line in data.hangers if line.open_alerts]:
        found.append(f"Acknowledge the open alerts of {named(opened)} (`shm alerts ack`).")
    if wide := [e for e in data.hangers if e.latest and not e.is_determined]:
        found.append(
            f"Identify more modes of {named(wide)}: the interval of the tension is wider than half "
            "the tension itself."
        )
    if untested := [line for line in data.hangers if line.latest is None]:
        found.append(f"Test {named(untested)} {NEXT_TEST}.")
    return tuple(found)


def of_status(lines: Sequence[HangerSummary], status: Status | None) -> list[HangerSummary]:
    return [line for line in lines if line.status is status]


def named(lines: Sequence[HangerSummary]) -> str:
    """Return `hanger 3` or `hangers 3, 4 and 7`."""
    numbers = formatting.listed([str(line.hanger.id) for line in lines])
    return f"hanger {numbers}" if len(lines) == 1 else f"hangers {numbers}"


def _in_period(data: BridgeReport) -> str:
    if data.period is None:
        return ""
    courses = [(line, line.course) for line in data.hangers if line.course]
    tested = [line for line, course in courses if course.tests]
    alerts = sum(course.alerts for _, course in courses)
    tests = formatting.counted(sum(course.tests for _, course in courses), "test")
    wording = (
        f"In the period {data.period}: {tests} of {formatting.counted(len(tested), 'hanger')}, "
        f"{formatting.counted(alerts, 'alert')}"
    )
    return f"{wording}."


_NEXT_TO = {"repeatability": "repeatability", "above": "above limit", "slack": "slack"}
"""What stands beside a tension where it is known, with its heading."""


def tables(data: BridgeReport) -> tuple[Table, ...]:
    """Return all tables that this report can fill."""
    return (*filled(_hangers(data)), *_other_tables(data))


def _other_tables(data: BridgeReport) -> tuple[Table, ...]:
    """Return what stands behind the table of the hangers."""
    return filled(
        _courses(data),
        *(pattern_tables(data.pattern) if data.pattern else ()),
        _origin(data),
    )


def _hangers(data: BridgeReport) -> Table:
    unit = hangers_unit(data.hangers)
    besides = {name: [_stated(line, name, unit) for line in data.hangers] for name in _NEXT_TO}
    shown = {name: cells for name, cells in besides.items() if any(cells)}
    cells = list(zip(*shown.values(), strict=True)) or [()] * len(data.hangers)
    return Table(
        "Hangers",
        (
            "hanger", "state", f"tension, {unit.name}", *(_NEXT_TO[name] for name in shown),
            "since the baseline", "of nominal", "open alerts", "latest test",
        ),
        tuple(_hanger(*each, unit) for each in zip(data.hangers, cells, strict=True)),
        note="± is half the 90 % interval, of tensions absolute, of changes since the baseline at "
        "equal temperature. Repeatability: the standard deviation between tests of one state. "
        "Alert: beyond a threshold. Watch: a change was detected, or a shift beyond a threshold "
        "is more probable than not. More: shm report --hanger N.",
        may_break=True,
    )  # fmt: skip


def _stated(line: HangerSummary, name: str, unit: ForceUnit) -> str:
    """Return one of `_BESIDE` of a hanger; empty where it is not known."""
    return str(getattr(stated(line.tension, unit), name)) if line.tension else ""


def _hanger(line: HangerSummary, besides: tuple[str, ...], unit: ForceUnit) -> tuple[str, ...]:
    name = f"{line.hanger.id} {line.hanger.name}".strip()
    opened = str(line.open_alerts or "")
    if line.latest is None or line.tension_n is None or line.status is None:
        return (name, "no test", *[""] * (3 + len(besides)), opened, "")
    return (
        name,
        line.status.value,
        _short_tension(line, unit),
        *besides,
        _change(line),
        line.of_nominal_words,
        opened,
        _day(line.latest.time),
    )


def _courses(data: BridgeReport) -> Table:
    """Return tests and alerts of the period; empty where the report has none."""
    return Table(
        f"In the period {data.period}",
        ("hanger", "tests", "alerts", "change of the tension, % (90 %)"),
        tuple(
            _course(line, line.course)
            for line in data.hangers
            if line.course and (line.course.tests or line.course.alerts)
        ),
        note="Change from the first test of the period to the last, by these two alone, taken as "
        "independent; the effect of the temperature is in it. Hangers without a test in the "
        "period are left out.",
    )


def _course(line: HangerSummary, course: PeriodSummary) -> tuple[str, ...]:
    change = course.change
    return (
        str(line.hanger.id),
        str(course.tests or "none"),
        str(course.alerts or "none"),
        formatting.with_span(change.scaled(100), signed=True) if change else "fewer than two tests",
    )


def _origin(data: BridgeReport) -> Table:
    facts = {
        **lineage(data.lineage),
        "report made": f"{formatting.moment(data.generated_at)} by shm version {data.version}",
    }
    return Table("Where these numbers come from", ("what", "value"), tuple(facts.items()))


REPORT_SCHEMA = "shm.bridge_report/1"


def bridge_json(data: BridgeReport) -> dict[str, Any]:
    """Return a document for `shm.documents.dump`."""
    return {
        "schema": REPORT_SCHEMA,
        "bridge": data.bridge,
        "summary": summary(data),
        "message": data.message.document,
        "advice": list(advice(data)),
        "period": period_json(data.period),
        "hangers": [
            {
                "hanger": line.hanger.id,
                "name": line.hanger.name,
                "bar": bar_document(line.bar),
                **line.document,
                "warnings": list(line.warnings),
                "latest": line.latest and line.latest.time,
                "tension_n": asdict(line.tension_n) if line.tension_n else None,
                "drift": asdict(line.drift) if line.drift else None,
                "test": line.latest and line.latest.name,
                "model": line.latest and (line.latest.model or None),
                "called": line.detected,
                "open_alerts": line.open_alerts,
                "in_period": asdict(line.course) if line.course else None,
            }
            for line in data.hangers
        ],
        "controls": [chart_document(each) for each in data.controls],
        "pattern": pattern_json(data.pattern) if data.pattern else None,
        "why_no_pattern": data.why_no_pattern,
        "lineage": dict(data.lineage),
        "settings": dict(data.settings),
        "version": data.version,
        "generated_at": data.generated_at,
    }
