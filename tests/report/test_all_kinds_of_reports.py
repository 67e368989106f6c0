"""Of every kind of hanger, bridge and test each form says numbers or words, never nan or None."""

from __future__ import annotations

import json as standard_json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from shm import documents
from shm.report.bridge_report import bridge_json, bridge_paper
from shm.report.contents import (
    BridgeReport,
    HangerReport,
    TrendRow,
)
from shm.report.formatting import Interval
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.report.hanger_status import Status
from shm.report.hanger_summary import PeriodSummary
from shm.report.modal_test_report import modal_test_json, modal_test_paper
from shm.report.paper import Paper
from shm.report.states import CalledChange, Period, QuantityOverTime, StatesOverTime
from shm.values import NAN, Drift, FloatArray, QualityCheck, TemperatureCoefficient
from shm.watch.engine.state import Band
from tests.helpers.nouns import a_change, a_summary, with_now
from tests.report.conftest import START
from tests.report.diagnoses import CASES
from tests.report.outline import page_words, pdf_words, text_words
from tests.report.sheets import SHEETS

UNSPOKEN = re.compile(r"(?<![\w.])[+-]?(?:nan|inf|infinity|None|NaN)(?!\w)")
Change = Callable[[HangerReport], HangerReport]


pytestmark = pytest.mark.usefixtures("unpainted", "drawn_once")


def watched(data: HangerReport) -> StatesOverTime:
    times = tuple(row.time for row in data.trend if row.time is not None)
    level: FloatArray = np.full(len(times), 700e3)
    band = Band(level - 5e3, level, level + 5e3)
    tension = QuantityOverTime("tension", "tension", band, band, band, 700e3)
    unknown = np.full(len(times), NAN)
    stiff = Band(*(np.full(len(times), level) for level in (6.8, 7.0, 7.2)))
    spring = QuantityOverTime(
        "log10_k1", "spring k1", Band(unknown, unknown, unknown), stiff, stiff, 7.0
    )
    return StatesOverTime(
        times, np.full(len(times), NAN), NAN, np.zeros(len(times), bool), (tension, spring),
        (CalledChange(times[-2], times[-1], "sudden: tension -7.2 %"),),
        (TemperatureCoefficient("tension", 0.0, 0.001, 0.001),),
    )  # fmt: skip


def without_sds(data: HangerReport) -> HangerReport:
    modes = tuple(replace(mode, frequency_sd_hz=NAN) for mode in data.latest.modes)
    posterior = replace(data.posterior, log_evidence_sd=NAN, r_hat=NAN, seconds=NAN)
    check = QualityCheck("noise", "unknown", NAN, NAN, "dB", "not measured", "")
    drift = Drift(3, "t009", START, "tension", NAN, NAN, NAN, NAN, 0.05, NAN)
    tests = (replace(data.latest, modes=modes, amplitude=NAN, time=None),)
    known = with_now(data, drifts=(drift,))
    return replace(known, tests=tests, posterior=posterior, quality=(check,))


def of_period(data: HangerReport) -> HangerReport:
    period = Period(START + timedelta(days=30), data.generated_at)
    return replace(
        data,
        period=period,
        trend=tuple(row for row in data.trend if period.holds(row.time)),
        states=watched(data),
    )


def unrecorded(row: TrendRow) -> TrendRow:
    return replace(row, time=None, temperature_c=NAN)


KINDS: dict[str, Change] = {
    "whole": lambda data: data,
    "no baseline": lambda data: replace(
        with_now(data, baseline=None, is_first=True, drifts=()), baseline=None, alerts=()
    ),
    "one test": lambda data: replace(
        with_now(data, is_first=True, drifts=()),
        trend=data.trend[-1:],
        baseline=data.posterior,
        alerts=(),
        selection=None,
    ),
    "no temperature": lambda data: replace(
        data,
        tests=(replace(data.latest, temperature_c=NAN),),
        trend=tuple(unrecorded(row) for row in data.trend),
    ),
    "called drift": lambda data: replace(
        with_now(data, called=(a_change(),)),
        states=watched(data),
        drift_watch="Tension fell by 7 %.",
    ),
    "adopted class": lambda data: replace(
        data,
        posterior=replace(data.posterior, model="beam2+point_mass@deck_end:0.1,2"),
        gap_watch="Since the point mass was adopted the gap has stayed below 0.3 %.",
    ),
    "no standard deviations": without_sds,
    "period": of_period,
    "period with one test": lambda data: replace(
        of_period(data), trend=data.trend[-1:], alerts=()
    ),
    "settings": lambda data: replace(data, settings={"band_low_hz": "2.0 Hz"}),
    "diagnosis": lambda data: replace(data, diagnosis=CASES["led"]),
    "diagnosis of nothing": lambda data: replace(data, diagnosis=CASES["nothing known"]),
}  # fmt: skip


DRAWN = ("called drift", "no standard deviations", "period", "diagnosis of nothing", "bare")


def assert_spoken(told: str) -> None:
    assert told.strip()
    found = UNSPOKEN.search(told)
    assert found is None, told[max(0, found.start() - 60) : found.end() + 60]


def document_words(document: object) -> str:
    """Every text of a document, which must be strict JSON."""

    def strict(constant: str) -> None:
        raise AssertionError(constant)

    def texts(value: object) -> Iterator[str]:
        if isinstance(value, str):
            yield value
        elif isinstance(value, dict):
            for each in value.values():
                yield from texts(each)
        elif isinstance(value, list):
            for each in value:
                yield from texts(each)

    return "\n".join(texts(standard_json.loads(documents.dump(document), parse_constant=strict)))


def assert_forms_spoken(paper: Paper, document: object) -> None:
    for told in (text_words(paper), page_words(paper), pdf_words(paper), document_words(document)):
        assert_spoken(told)


@pytest.mark.parametrize("kind", [*KINDS, "bare"])
def test_hanger_of_any_kind_is_spoken(kind: str, season: HangerReport, bare: HangerReport) -> None:
    data = bare if kind == "bare" else KINDS[kind](season)
    if kind in DRAWN:
        assert_forms_spoken(hanger_paper(data), hanger_json(data))
    else:  # who has no figure or table of its own is told by the others' words: drawing takes time
        assert_spoken(text_words(hanger_paper(data)))
        assert_spoken(document_words(hanger_json(data)))


@pytest.mark.parametrize("with_period", [False, True])
def test_bridge_is_spoken(season: HangerReport, with_period: bool) -> None:
    drift = replace(season.drifts[0], shift_mean=NAN, shift_sd=NAN, probability=NAN)
    tension = Interval(650e3, 640e3, 660e3)
    course = PeriodSummary(2, 1, Interval(-0.07, -0.08, -0.06)) if with_period else None
    lines = (
        a_summary(season.hanger, Status.ALERT, tension, open_alerts=1, drifts=season.drifts,
                  course=course),
        a_summary(replace(season.hanger, id=4), Status.FIRST, tension, drifts=(drift,),
                  course=PeriodSummary(1) if with_period else None),
        a_summary(replace(season.hanger, id=5, nominal_tension_n=0.0), Status.STEADY, tension),
        a_summary(replace(season.hanger, id=6), course=PeriodSummary() if with_period else None),
    )  # fmt: skip
    period = Period(START, season.generated_at) if with_period else None
    data = BridgeReport(
        "Arch", lines, None, "Nothing can be compared.", START, "0.1.0", period,
        settings={"seed": "1"},
    )  # fmt: skip
    assert_forms_spoken(bridge_paper(data), bridge_json(data))


@pytest.mark.parametrize("kind", ["refused", "given responses", "one sensor", "ambient"])
def test_test_of_any_kind_is_spoken(kind: str) -> None:
    sheet = SHEETS[kind]()
    assert_forms_spoken(modal_test_paper(sheet), modal_test_json(sheet))
    assert ("Do not use" in pdf_words(modal_test_paper(sheet))) == (kind == "refused")


def test_unspoken_words_are_found() -> None:
    for told in ("is nan kN", "+inf %", "None", "(nan to nan)"):
        assert UNSPOKEN.search(told), told
    for told in ("none", "-0.01 %", "2026-05-01", "information", "No change"):
        assert UNSPOKEN.search(told) is None, told
