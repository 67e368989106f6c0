"""A season of tests of one hanger that loses 8 % tension at its last test, made without models."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from shm.models import class_units
from shm.report.contents import HangerReport, summary_of, trend_row
from shm.report.figures import specification
from shm.report.figures.specification import FigureSpec, Illustration, illustration
from shm.values import (
    Alert,
    Drift,
    FrequencyResponse,
    Hanger,
    ModalTest,
    Mode,
    Posterior,
    PredictedFrequency,
    ResponsePoint,
    Selection,
)
from tests.helpers.painting import unpaint

NOMINAL_N = 711e3
START = datetime(2026, 5, 1, 10, tzinfo=UTC)
MEASURED = {
    "transverse": (5.82, 13.85, 26.17, 40.47, 59.3, 81.3),
    "longitudinal": (6.09, 14.8, 27.0, 41.8, 61.5, 83.68),
}


def make_test(number: int, temperature_c: float = 12.0) -> ModalTest:
    modes = tuple(
        Mode(plane, order, frequency_hz, frequency_sd_hz=0.001 * frequency_hz)
        for plane, frequencies_hz in MEASURED.items()
        for order, frequency_hz in enumerate(frequencies_hz, start=1)
    )
    time = START + timedelta(days=14 * number)
    return ModalTest(f"t{number:03d}", modes, 3, time, temperature_c, amplitude=1.0)


def make_posterior(test: str, model: str, tension_n: float, seed: int) -> Posterior:
    springs = 4 if model == "beam2" else 0
    names = ("theta_F", "theta_L", *(f"log10_k{i + 1}" for i in range(springs)), "sigma")
    centre = np.array([tension_n / NOMINAL_N, 0.99, *[8.2] * springs, 0.012])
    sd = np.array([0.012, 0.004, *[0.3] * springs, 0.002])
    samples = np.random.default_rng(seed).normal(centre, sd, size=(1000, len(names)))
    predicted = tuple(
        PredictedFrequency(plane, order, value * (1 + 0.004 * (-1) ** order), 0.006 * value, value)
        for plane, values in MEASURED.items()
        for order, value in enumerate(values, start=1)
    )
    return Posterior(
        model=model, hanger=3, names=names, samples=samples, log_likelihood=np.zeros(1000),
        most_probable=centre, nominal_tension_n=NOMINAL_N, log_evidence=-12.3 - 4 * (springs == 0),
        log_evidence_sd=0.08, effective_sample_size=840.0, r_hat=1.01, evaluations=30_000,
        predicted=predicted, tests=(test,), seed=1, seconds=1.4,
        units=tuple(class_units(model)[name] for name in names),
    )  # fmt: skip


def make_response() -> FrequencyResponse:
    frequency_hz = np.arange(0, 128, 0.05)
    lines = np.zeros((2, len(frequency_hz)), complex)
    for row, plane in enumerate(MEASURED):
        for other, share in ((plane, 1.0), *((p, 0.15) for p in MEASURED if p != plane)):
            for pole in MEASURED[other]:
                ratio = frequency_hz / pole
                lines[row] += share * 0.004 * ratio**2 / (1 - ratio**2 + 0.004j * ratio)
    noise = np.random.default_rng(5).normal(0, 2e-3, (2, *lines.shape))
    lines += noise[0] + 1j * noise[1]
    coherence = np.clip(1 - 4e-5 / np.abs(lines) ** 2, 0.02, 1)
    points = tuple(
        ResponsePoint(f"acc_{2 * number + row + 1}", plane, x_m)
        for number, x_m in enumerate((2.52, 4.44))
        for row, plane in enumerate(MEASURED)
    )
    lines, coherence = np.tile(lines, (2, 1)), np.tile(coherence, (2, 1))
    return FrequencyResponse("t009.csv", points, frequency_hz, lines, coherence, 3)


@pytest.fixture(scope="session")
def hanger() -> Hanger:
    return Hanger(3, 12.0, 200e9, 0.013273, 1.4019e-5, 103.5, NOMINAL_N)


@pytest.fixture(scope="session")
def season(hanger: Hanger) -> HangerReport:
    """Ten tests; the last one 8 % down, with its alert."""
    tensions = [*(700e3 + 3e3 * np.sin(np.arange(9))), 650e3]
    tests = tuple(make_test(number) for number in range(10))
    posteriors = [
        make_posterior(test.id, "beam2", tension, seed)
        for seed, (test, tension) in enumerate(zip(tests, tensions, strict=True))
    ]
    time = tests[-1].time or START
    drifts = (
        Drift(3, "t009", time, "tension", 700e3, 650e3, -0.072, 0.012, 0.05, 0.966),
        Drift(3, "t009", time, "transverse_end_stiffness", 8.2, 8.15, -0.05, 0.4, 0.5, 0.22),
    )
    rival = make_posterior("t009", "beam1", 690e3, 99)
    compared = Selection((posteriors[-1], rival), (0.982, 0.018))
    now = replace(
        summary_of(hanger, tests[-1], posteriors[-1], posteriors[0], compared), drifts=drifts
    )
    return HangerReport(
        bridge="Arch bridge", now=now, tests=tests, posterior=posteriors[-1],
        generated_at=START + timedelta(days=130), version="0.1.0",
        trend=tuple(
            trend_row(p, t, hanger, compared) for p, t in zip(posteriors, tests, strict=True)
        ),
        baseline=posteriors[0], selection=compared,
        alerts=(Alert("3-t009", 3, "t009", time, "tension fell by 7.2 %", drifts[:1]),),
        frequency_response=make_response(),
        lineage={"recording": "t009.csv, SHA-256 ab12cd34"},
    )  # fmt: skip


@pytest.fixture(scope="session")
def bare(hanger: Hanger) -> HangerReport:
    """Return a first test of which hardly anything is known: one mode, no time, no temperature."""
    test = ModalTest("only", (Mode("transverse", 1, 5.82),), 3)
    posterior = replace(
        make_posterior("only", "beam1", 711e3, 3),
        predicted=(
            PredictedFrequency("transverse", 1, 5.8, 0.05, 5.82),
            PredictedFrequency("transverse", 2, 14.1, 0.1, float("nan")),
        ),
        log_evidence_sd=float("nan"), effective_sample_size=float("nan"), r_hat=float("nan"),
    )  # fmt: skip
    return HangerReport(
        "Arch bridge",
        summary_of(hanger, test, posterior),
        (test,),
        posterior,
        START,
        "0.1.0",
        (trend_row(posterior, test, hanger),),
    )


@pytest.fixture
def unpainted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are drawn but not painted, which takes most of a report's time."""
    unpaint(monkeypatch)


@pytest.fixture
def drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Return the forms of one report share their figures, instead of drawing them anew."""
    kept: dict[tuple[int, str], tuple[object, Illustration | None]] = {}

    def shared(of: FigureSpec[object], data: object) -> Illustration | None:
        key = (id(getattr(data, "sheet", data)), of.name)
        if key not in kept:
            kept[key] = (data, illustration(of, data))
        return kept[key][1]

    monkeypatch.setattr(specification, "illustration", shared)
