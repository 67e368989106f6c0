"""The tables of a bridge: one source for terminal, page and paper."""

from __future__ import annotations

from shm.report import words
from shm.report.bridge.content import BridgeReport, Course, HangerLine, hangers_unit
from shm.report.origin import lineage, settings
from shm.report.paper import Table, filled
from shm.report.shifts import _day, pattern_tables, shift_cells
from shm.values import Drift
from shm.values.force_units import ForceUnit
from shm.values.stated_tension import stated

_BESIDE = {"repeatability": "repeatability", "above": "above limit", "slack": "slack"}
"""What stands beside a tension where it is known, with its heading."""


def tables(data: BridgeReport) -> tuple[Table, ...]:
    """All tables that this report can fill."""
    return filled(
        _hangers(data),
        _since_baseline(data),
        _courses(data),
        *(pattern_tables(data.pattern) if data.pattern else ()),
        _tests(data),
        _origin(data),
        settings(data.settings),
    )


def _hangers(data: BridgeReport) -> Table:
    unit = hangers_unit(data.hangers)
    beside = {name: [_said(line, name, unit) for line in data.hangers] for name in _BESIDE}
    shown = {name: cells for name, cells in beside.items() if any(cells)}
    cells = list(zip(*shown.values(), strict=True)) or [()] * len(data.hangers)
    return Table(
        "Hangers",
        (
            "hanger", "state", f"tension, {unit.name} (90 %)", *(_BESIDE[name] for name in shown),
            "% of nominal (90 %)", "open alerts", "latest test",
        ),
        tuple(_hanger(*each, unit) for each in zip(data.hangers, cells, strict=True)),
        note="With absolute 90 % intervals. Repeatability: the standard deviation between tests of "
        "one state. Alert: beyond a threshold. Watch: a change was called, or a "
        "shift beyond a threshold is likelier than not. More: shm report --hanger N.",
    )  # fmt: skip


def _said(line: HangerLine, name: str, unit: ForceUnit) -> str:
    """One of `_BESIDE` of a hanger; empty where it is not known."""
    return str(getattr(stated(line.averaged, unit), name)) if line.averaged else ""


def _hanger(line: HangerLine, beside: tuple[str, ...], unit: ForceUnit) -> tuple[str, ...]:
    name = f"{line.hanger.id} {line.hanger.name}".strip()
    opened = str(line.open_alerts or "none")
    if line.tension_n is None or line.status is None:
        unknown = ["not known"] * (2 + len(beside))
        return (name, "no test", *unknown, opened, "none")
    share = line.of_nominal
    return (
        name,
        line.status.value,
        words.with_span(line.tension_n.in_unit(unit)),
        *(text or "not known" for text in beside),
        words.with_span(share) if share else "no nominal",
        opened,
        _day(line.latest),
    )


def _since_baseline(data: BridgeReport) -> Table:
    return Table(
        "Since the baseline",
        (
            "hanger",
            "shift of the tension",
            "90 % interval",
            "probability beyond threshold",
            "called",
        ),
        tuple(
            (str(line.hanger.id), *_shifted(line.drift), line.called or "nothing")
            for line in data.hangers
            if line.drift
        ),
        note="Shift of the tension at the latest test, if there is any, the swing with the "
        "temperature taken out; how probable it is that it lies beyond the hanger's threshold; "
        "what was called since. Hangers that have nothing but their baseline are left out.",
    )


def _shifted(drift: Drift) -> tuple[str, str, str]:
    _, size, span, threshold, probability = shift_cells(drift)
    return (size, span, f"{probability} ({threshold})")


def _courses(data: BridgeReport) -> Table:
    """What lay in the period; empty where the report has none."""
    return Table(
        f"In the period {data.period}",
        ("hanger", "tests", "alerts", "change of the tension, % (90 %)"),
        tuple(
            _course(line, line.course)
            for line in data.hangers
            if line.course and (line.course.tests or line.course.alerts)
        ),
        note="Change from the first test of the period to the last, by these two alone, taken as "
        "independent; the swing with the temperature is in it. Hangers without a test in the "
        "period are left out.",
    )


def _course(line: HangerLine, course: Course) -> tuple[str, ...]:
    change = course.change
    return (
        str(line.hanger.id),
        str(course.tests or "none"),
        str(course.alerts or "none"),
        words.with_span(change.scaled(100), signed=True) if change else "fewer than two tests",
    )


def _tests(data: BridgeReport) -> Table:
    return Table(
        "Tests that these tensions come from",
        ("hanger", "latest test", "taken", "model class"),
        tuple(
            (
                str(line.hanger.id),
                line.test,
                words.moment(line.latest),
                words.model_class(line.model),
            )
            for line in data.hangers
            if line.test
        ),
        note="Their files and checksums: shm report --hanger N.",
    )


def _origin(data: BridgeReport) -> Table:
    facts = {
        **lineage(data.lineage),
        "report made": f"{words.moment(data.generated_at)} by shm version {data.version}",
    }
    return Table("Where these numbers come from", ("what", "value"), tuple(facts.items()))
