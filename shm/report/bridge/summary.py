"""The paragraph on top of a bridge's report: states, tensions, what moved, what to do."""

from __future__ import annotations

from collections.abc import Sequence

from shm.report import words
from shm.report.bridge.content import BridgeReport, HangerLine
from shm.report.content import Status
from shm.report.intervals import Interval


def summary(data: BridgeReport) -> str:
    """One paragraph in plain words."""
    told = data.pattern.sentence if data.pattern else data.why_no_pattern
    remarks = data.pattern.remarks if data.pattern else ()
    sentences = (
        f"{_counts(data.hangers)}.", _extremes(data), _in_period(data), told, *remarks,
        *advice(data),
    )  # fmt: skip
    return " ".join(sentence for sentence in sentences if sentence)


def advice(data: BridgeReport) -> tuple[str, ...]:
    """What to do next, most urgent first; never empty."""
    alert, watch = (of_status(data.hangers, each) for each in (Status.ALERT, Status.WATCH))
    opened = [line for line in data.hangers if line.open_alerts]
    found = []
    if alert:
        found.append(f"Repeat the test of {named(alert)} within days, and inspect what stays.")
    if watch:
        found.append(f"Test {named(watch)} again soon.")
    if opened:
        found.append(f"Take note of the open alerts of {named(opened)} (shm alerts ack).")
    if wide := [line for line in data.hangers if line.is_hardly_known]:
        found.append(
            f"Find more modes of {named(wide)}: the interval of the tension is wider than half the "
            "tension itself, and what percentage of it a shift is, is as little known."
        )
    if untested := [line for line in data.hangers if line.status is None]:
        found.append(f"Test {named(untested)}, of which nothing is known.")
    return tuple(found) or ("Nothing needs doing before the next planned tests.",)


def of_status(lines: Sequence[HangerLine], status: Status | None) -> list[HangerLine]:
    return [line for line in lines if line.status is status]


def named(lines: Sequence[HangerLine]) -> str:
    """`hanger 3`, `hangers 3, 4 and 7`."""
    numbers = words.listed([str(line.hanger.id) for line in lines])
    return f"hanger {numbers}" if len(lines) == 1 else f"hangers {numbers}"


def _counts(lines: Sequence[HangerLine]) -> str:
    told = []
    for status in Status:
        found = of_status(lines, status)
        if found:
            which = f" ({words.listed([str(line.hanger.id) for line in found])})"
            shown = which if status in (Status.ALERT, Status.WATCH) else ""
            told.append(f"{status.value}: {words.counted(len(found), 'hanger')}{shown}")
    missing = of_status(lines, None)
    told += [f"without a test: {words.counted(len(missing), 'hanger')}"] if missing else []
    return "; ".join(told)


def _extremes(data: BridgeReport) -> str:
    """Who carries most and least of the nominal tension."""
    shares = [(line, share) for line in data.hangers if (share := line.of_nominal) is not None]
    if len(shares) < 2:
        return ""
    by_share = sorted(shares, key=lambda each: each[1].mean)
    least, most = by_share[0], by_share[-1]
    return (
        f"Of its nominal tension hanger {most[0].hanger.id} carries most, {_percent(most[1])}, and "
        f"hanger {least[0].hanger.id} least, {_percent(least[1])}."
    )


def _percent(share: Interval) -> str:
    return f"{words.mean(share)} % (90 % interval {words.span(share)} %)"


def _in_period(data: BridgeReport) -> str:
    if data.period is None:
        return ""
    courses = [(line, line.course) for line in data.hangers if line.course]
    tested = [line for line, course in courses if course.tests]
    alerts = sum(course.alerts for _, course in courses)
    tests = words.counted(sum(course.tests for _, course in courses), "test")
    told = (
        f"In the period {data.period}: {tests} of {words.counted(len(tested), 'hanger')}, "
        f"{words.counted(alerts, 'alert')}"
    )
    return f"{told}{_most_moved(data)}."


def _most_moved(data: BridgeReport) -> str:
    """The hanger whose tension moved most from the period's first test of it to the last."""
    moved = [
        (line, line.course.change)
        for line in data.hangers
        if line.course and line.course.change is not None
    ]
    if not moved:
        return "; no hanger was tested twice in it"
    line, change = max(moved, key=lambda each: abs(each[1].mean))
    return (
        f"; the tension of hanger {line.hanger.id} moved most in it, by "
        f"{words.signed_percent(change)}"
    )
