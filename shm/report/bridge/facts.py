"""The figures on top of a bridge's report."""

from __future__ import annotations

from shm.report import words
from shm.report.bridge.content import BridgeReport
from shm.report.bridge.summary import named, of_status
from shm.report.content import Status


def facts(data: BridgeReport) -> tuple[tuple[str, str, str], ...]:
    """What, value, what stands beside it."""
    tested = [line for line in data.hangers if line.latest is not None]
    alert, watch = (of_status(data.hangers, each) for each in (Status.ALERT, Status.WATCH))
    opened = sum(line.open_alerts for line in data.hangers)
    latest = max((line.latest for line in tested if line.latest), default=None)
    oldest = min((line.latest for line in tested if line.latest), default=None)
    return (
        ("Hangers", str(len(data.hangers)), f"{len(tested)} of them tested"),
        ("In alert", str(len(alert)), named(alert) if alert else "no hanger"),
        ("To watch", str(len(watch)), named(watch) if watch else "no hanger"),
        ("Open alerts", str(opened), "nobody took note of them yet" if opened else "none waits"),
        (
            "Latest test",
            f"{latest:%Y-%m-%d}" if latest else "none",
            f"oldest of the latest {words.moment(oldest)[:10]}" if oldest else "no test yet",
        ),
    )
