"""Small nouns for tests: a posterior, a test, a drift, an alert, cheap and plausible."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from shm.report.contents import HangerReport
from shm.report.formatting import Interval
from shm.report.hanger_status import Status
from shm.report.hanger_summary import HangerSummary, LatestTest
from shm.store import ReceivedFile
from shm.values import (
    Alert,
    Averaged,
    Change,
    Drift,
    ForeignMode,
    FrequencyResponse,
    Hanger,
    ModalTest,
    Mode,
    Moved,
    Posterior,
    PredictedFrequency,
    QualityCheck,
    ResponsePoint,
    ShapePoint,
    Summary,
    WatchedTest,
)

NOW = datetime(2026, 5, 1, 12, 0, tzinfo=UTC)


def a_file(number: int = 1, **changes: object) -> ReceivedFile:
    values: dict[str, object] = {
        "sha256": f"{number:064x}",
        "file_name": f"h3-{number}.csv",
        "size_bytes": 10,
        "arrival": f"entry-{number}",
        "archived_as": f"00/{number:064x}.csv",
        **changes,
    }
    return ReceivedFile(**values)  # type: ignore[arg-type]


def a_test(name: str = "t1", days: float = 0.0, **changes: object) -> ModalTest:
    values: dict[str, object] = {
        "id": name,
        "hanger": 3,
        "time": NOW + timedelta(days=days),
        "temperature_c": 11.5,
        "modes": (
            Mode("transverse", 1, 5.8, 0.006, shape=(ShapePoint(1.2, 0.31, sd=0.01),)),
            Mode("longitudinal", 1, 5.9),
        ),
        **changes,
    }
    return ModalTest(**values)  # type: ignore[arg-type]


def a_check(**changes: object) -> QualityCheck:
    values: dict[str, object] = {
        "name": "double hits",
        "verdict": "warning",
        "value": 2.0,
        "limit": 0.0,
        "unit": "",
        "found": "hits 2 and 5 struck twice",
        "remedy": "Let the hammer bounce off freely.",
        **changes,
    }
    return QualityCheck(**values)  # type: ignore[arg-type]


def a_foreign_mode() -> ForeignMode:
    return ForeignMode("tone", 50.0, 0.0001, "mains: it is there before the hits")


def a_posterior(model: str = "beam1", tests: tuple[str, ...] = ("t1",), seed: int = 7) -> Posterior:
    rng = np.random.default_rng(seed)
    return Posterior(
        model=model,
        hanger=3,
        names=("theta_F", "theta_L", "sigma"),
        units=("1", "1", "1"),
        samples=rng.normal([1.0, 0.98, 0.01], [0.02, 0.005, 0.001], (50, 3)),
        log_likelihood=rng.normal(size=50),
        most_probable=np.array([1.0, 0.98, 0.01]),
        nominal_tension_n=711e3,
        log_evidence=-12.5,
        log_evidence_sd=float("nan"),
        effective_sample_size=48.0,
        r_hat=1.01,
        evaluations=2000,
        predicted=(PredictedFrequency("transverse", 1, 5.8, 0.01, float("nan")),),
        tests=tests,
        seed=seed,
        seconds=0.25,
    )


def a_response(points: int = 2, lines: int = 5) -> FrequencyResponse:
    rng = np.random.default_rng(1)
    shape = (points, lines)
    return FrequencyResponse(
        source="h3-1.csv",
        points=(ResponsePoint("acc_1", "transverse", 1.2), ResponsePoint("acc_2")),
        frequency_hz=np.linspace(0, 100, lines),
        accelerance=rng.normal(size=shape) + 1j * rng.normal(size=shape),
        coherence=rng.uniform(size=shape),
        hanger=3,
    )


def a_drift(test: str = "t2", probability: float = 0.99) -> Drift:
    return Drift(3, test, NOW, "tension", 711e3, 650e3, -0.08, 0.01, 0.05, probability)


def a_change(**changes: object) -> Change:
    deck = Moved("log10_k1", 0.3, -0.2, 0.1, "deck", "transverse", ("tension",))
    values: dict[str, object] = {
        "evidence_years": 350.0,
        "limit_years": 100.0,
        "probability": 0.98,
        "sudden": 0.9,
        "began_after": NOW - timedelta(days=9),
        "began_by": NOW,
        "moved": (Moved("tension", 0.7, -0.08, 0.01, alike=("log10_k1",)), deck),
        "outlier_probability": 0.01,
        **changes,
    }
    return Change(**values)  # type: ignore[arg-type]


def a_watched_test(test: str = "t2", **changes: object) -> WatchedTest:
    return WatchedTest(test, NOW, 11.5, (a_drift(test),), a_change(**changes))


def an_alert(key: str = "hanger-3:tension-down", test: str = "t2") -> Alert:
    return Alert(key, 3, test, NOW, "Hanger 3: tension moved.", (a_drift(test),))


def averaged(tension_n: Interval) -> Averaged:
    """Return a tension over all classes with this interval, its repeatability unknown."""
    low, mean, high = tension_n.low, tension_n.mean, tension_n.high
    return Averaged(Summary(mean, (high - low) / 3.29, low, mean, high), float("nan"))


def a_summary(
    hanger: Hanger, status: Status | None = None, tension_n: Interval | None = None, **more: Any
) -> HangerSummary:
    """Return a tested hanger in a state, without a baseline; of no status it was never tested."""
    if status is None or tension_n is None:
        return HangerSummary(hanger, **more)
    shift, probability = (-0.1, 0.99) if status is Status.ALERT else (0.0, 0.01)
    drift = Drift(hanger.id, "t2", NOW, "tension", 1.0, 1.0, shift, 0.004, 0.05, probability)
    given = {
        "latest": LatestTest("t2", NOW, averaged(tension_n), "beam1"),
        "is_first": status is Status.FIRST,
        "drifts": () if status is Status.FIRST else (drift,),
    }
    return HangerSummary(hanger, **{**given, **more})


def with_now(report: HangerReport, **changes: Any) -> HangerReport:
    """Return a report of a hanger whose state now is another."""
    return replace(report, now=replace(report.now, **changes))
