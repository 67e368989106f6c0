"""The report of a structure without a model: its frequencies against its own first tests."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from shm.documents import alert_document, drift_document
from shm.report.paper import Paper, Part, Table, filled
from shm.values import Alert, Drift, Hanger
from shm.values.rounding import NINETY_PERCENT, rounded_percent
from shm.watch.change_words import structure_words

_NOT_WATCHED = "No test was watched yet: its first tests make the baseline."


@dataclass(frozen=True, eq=False)
class StructureReport:
    """What is known of a structure; `baseline_hz` are its first frequencies by name, `said` is what
    the watch says after the latest of its tests, empty before one was watched."""

    bridge: str
    structure: Hanger
    tests: int
    latest: datetime | None
    baseline_since: datetime | None
    baseline_hz: dict[str, float]
    said: str
    drifts: tuple[Drift, ...]
    alerts: tuple[Alert, ...]
    open_alerts: int
    generated_at: datetime
    version: str


def structure_paper(data: StructureReport) -> Paper:
    """What the watch says, each frequency, the alerts."""
    latest = f"{data.latest:%Y-%m-%d %H:%M}" if data.latest else "none"
    since = f"{data.baseline_since:%Y-%m-%d}" if data.baseline_since else "none yet"
    facts = (
        ("Tests", str(data.tests), f"the latest {latest}"),
        ("Baseline since", since, "its own first tests; no model, no tension"),
        ("Open alerts", str(data.open_alerts), f"of {len(data.alerts)}"),
    )
    return Paper(
        title=structure_words(data.structure),
        bridge=data.bridge,
        status="Alert" if data.open_alerts else "",
        style="alert" if data.open_alerts else "first",
        parts=(
            Part("In short", summary=data.said or _NOT_WATCHED, facts=facts),
            Part("Numbers", tables=filled(_frequencies(data), _alerts(data))),
        ),
        generated_at=data.generated_at,
        version=data.version,
        closing="± is half the 90 % interval; times are UTC.",
    )


def _frequencies(data: StructureReport) -> Table:
    by_name = {each.quantity: each for each in data.drifts}
    rows = tuple(
        (name, f"{hz:.4g} Hz", *_shift(by_name.get(name))) for name, hz in data.baseline_hz.items()
    )
    return Table(
        "Frequencies",
        ("frequency", "baseline", "shift if it changed", "probability beyond threshold"),
        rows,
        note="Temperature, frost and excitation are taken off.",
    )


def _shift(drift: Drift | None) -> tuple[str, str]:
    if drift is None:
        return "not watched yet", ""
    shift = rounded_percent(drift.shift_mean, NINETY_PERCENT * drift.shift_sd, "+")
    return shift, f"{drift.probability:.2f} (of {100 * drift.threshold:.3g} %)"


def _alerts(data: StructureReport) -> Table:
    rows = tuple((f"{each.time:%Y-%m-%d}", each.message) for each in data.alerts)
    return Table("Alerts", ("test of", "message"), rows)


def structure_json(data: StructureReport) -> dict[str, Any]:
    """The same as one document."""
    return {
        "bridge": data.bridge,
        "structure": data.structure.id,
        "name": data.structure.name,
        "tests": data.tests,
        "latest_test": data.latest,
        "baseline_since": data.baseline_since,
        "baseline_hz": data.baseline_hz,
        "said": data.said,
        "drifts": [drift_document(each) for each in data.drifts],
        "alerts": [alert_document(each) for each in data.alerts],
        "open_alerts": data.open_alerts,
        "generated_at": data.generated_at,
        "version": data.version,
    }
