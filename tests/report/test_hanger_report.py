"""A hanger's report: its first paragraph, tables, page, document, and the report of a period."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import pairwise

import numpy as np
import pytest

from shm import documents
from shm.errors import UsageError
from shm.report.as_html import as_html, with_code
from shm.report.as_text import as_text, laid_out
from shm.report.contents import HangerReport
from shm.report.formatting import Interval
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.report.hanger_sentences import advice, in_period, summary
from shm.report.hanger_tables import frequencies, temperature_documents, temperature_table
from shm.report.paper import Table
from shm.report.states import Period, StatesOverTime, period_since
from shm.values import (
    Drift,
    Hanger,
    Mode,
    PredictedFrequency,
    QualityCheck,
    TemperatureCoefficient,
    Thresholds,
)
from tests.helpers.nouns import averaged, with_now
from tests.report.conftest import START
from tests.report.diagnoses import LED
from tests.report.outline import Outline, page_words, text_words

# ------------------------------------------------------------ page and document


def test_page_is_whole_and_fetches_nothing(season: HangerReport) -> None:
    """It nests, has one language, unique ids, captions, scoped headings; the summary leads."""
    page = as_html(hanger_paper(season))
    outline = Outline.of(page)
    assert dict(outline.tags)["html"] == {"lang": "en"}
    for tag, attributes in outline.tags:
        assert tag not in {"script", "link", "iframe"}
        assert not {"src", "srcset", "data", "action"} & attributes.keys()
    assert not re.search(r"url\((?!#)|@import", page)
    count = outline.names.count
    assert count("figure") == count("figcaption") == count("svg") == 5
    assert count("table") == count("caption") == 11
    scopes = {attributes.get("scope") for tag, attributes in outline.tags if tag == "th"}
    assert scopes == {"col", "row"}
    ids = [attributes["id"] for _, attributes in outline.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    levels = [int(tag[1]) for tag in outline.names if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    told = outline.told
    assert told.index("tension fell by 7.2 ± 2.0 %") < told.index("Tension over time")
    assert "Alert" in told


def test_names_from_outside_cannot_inject_markup(bare: HangerReport) -> None:
    sly = "<script>alert(1)</script>"
    named = replace(with_now(bare, hanger=replace(bare.hanger, name=sly)), bridge=sly)
    page = as_html(hanger_paper(named))
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert with_code("Run `shm ingest <file>`, <b>then</b> look; a ` alone stays.") == (
        "Run <code>shm ingest &lt;file&gt;</code>, &lt;b&gt;then&lt;/b&gt; look; a ` alone stays."
    )


def test_document_holds_contract_and_null(season: HangerReport, bare: HangerReport) -> None:
    document = json.loads(documents.dump(hanger_json(season)))
    posterior = documents.dump(documents.posterior_document(season.posterior))
    assert (document["schema"], document["status"]) == ("shm.report/1", "alert")
    assert document["posterior"] == json.loads(posterior)
    assert len(document["trend"]) == 10
    assert set(document["trend"][0]["tension_n"]) == {"mean", "low", "high", "repeatability_sd"}
    assert document["selection"]["selected"] == "beam2"
    assert document["drifts"][0]["quantity"] == "tension"
    assert document["generated_at"] == "2026-09-08T10:00:00Z"
    unknown = json.loads(documents.dump(hanger_json(bare)))
    assert (unknown["baseline"], unknown["selection"]) == (None, None)
    assert (unknown["posterior"]["r_hat"], unknown["test"]["temperature_c"]) == (None, None)


def test_quality_stands_in_page_text_document_and_advice(bare: HangerReport) -> None:
    check = QualityCheck("clipping", "warning", 0.99, 0.95, "", "acc_1 clips", "Lower the gain.")
    judged = replace(bare, quality=(check,))
    outline = Outline.of(as_html(hanger_paper(judged)))
    for page in (outline.told, text_words(hanger_paper(judged))):
        assert "clipping ! warning 0.99 0.95 acc_1 clips Lower the gain." in page
        assert "Test quality, to improve at the next test: clipping." in page
    assert ("tr", {"class": "warning"}) in outline.tags
    (quality,) = json.loads(documents.dump(hanger_json(judged)))["quality"]
    assert (quality["name"], quality["verdict"]) == ("clipping", "warning")


# ------------------------------------------------------------ the first paragraph


def misfitted(data: HangerReport, parts: list[float], sd: float, **changes: float) -> HangerReport:
    """Its modes predicted so much off, as a part of themselves, with so large a deviation."""
    predicted = tuple(
        replace(row, mean_hz=row.measured_hz * (1 + part), sd_hz=row.measured_hz * sd)
        for row, part in zip(data.posterior.predicted, parts, strict=True)
    )
    return replace(data, posterior=replace(data.posterior, predicted=predicted, **changes))


def loser(data: HangerReport) -> HangerReport:
    assert data.selection is not None
    return replace(data, posterior=data.selection.posteriors[1])


def stiffened(data: HangerReport) -> HangerReport:
    rise = Drift(3, "t009", START, "longitudinal_end_stiffness", 7, 8, 1.0, 0.2, 0.5, 0.99)
    return with_now(data, drifts=(rise,))


def still(data: HangerReport) -> HangerReport:
    return with_now(data, drifts=(replace(data.drifts[0], probability=0.01),))


def undetermined(data: HangerReport) -> HangerReport:
    return with_now(still(data), baseline=averaged(Interval(650e3, 450e3, 1100e3)))


EXPLAINS = "the model explains what was measured"


@pytest.mark.parametrize(
    ("change", "said", "unsaid"),
    [
        (loser, "beam1, less probable than beam2", "the most probable"),
        (stiffened, "end stiffness rose to about 10 times its former value, beyond its threshold.",
         "tension fell"),
        (lambda data: misfitted(data, [0.001] * 12, 0.002),
         "Each lies within its 90 % interval: the model explains what was measured.", "outside"),
        (lambda data: misfitted(data, [0.006, *[0.0] * 11], 0.001),
         "Transverse 1 lies outside the 90 % interval, no more than by chance", "not explain"),
        (lambda data: misfitted(data, [0.01] * 6 + [0.0] * 6, 0.001),
         "6 modes lie outside the 90 % interval: the model does not explain these", EXPLAINS),
        (lambda data: misfitted(data, [0.0] * 12, 0.002, misfit_percent=1.2),
         "It misses 12 measured frequencies by 1.2 % (root mean square)", EXPLAINS),
        (lambda data: misfitted(data, [0.01] * 12, 0.02), "so wide that they may hide a misfit",
         EXPLAINS),
        (undetermined, "These modes do not determine the tension (90 % interval", "nominal"),
        (still, "Its tension is", "do not determine"),
    ],
)  # fmt: skip
def test_summary_chooses_its_sentences(
    season: HangerReport, change: object, said: str, unsaid: str
) -> None:
    told = summary(change(season))  # type: ignore[operator]
    assert said in told
    assert unsaid not in told


def test_summary_reads_so_from_beginning_to_end(season: HangerReport, bare: HangerReport) -> None:
    """Every sentence and their order; what the other tests hold is the choice between them."""
    assert summary(replace(season, diagnosis=LED)) == (
        "Hanger 3: tension fell by 7.2 ± 2.0 %, beyond its threshold. Repeat the hammer test "
        "today and decide on traffic until then; if the loss stays, inspect its anchorages "
        "and the rod, and compare the hangers beside it (`shm drift bridge`). Its tension is "
        "now 650 ± 19 kN. The model class is beam2, the most probable (compared with beam1). It "
        "predicts 12 measured frequencies to 0.4 % (root mean square). To tell point mass from "
        "section loss, measure next: known mass of 25 kg at 3.6 m."
    )
    assert summary(bare) == (
        "Hanger 3: tension 711 ± 14 kN, and no test after its baseline. No action is needed "
        "before the next planned test: choose a warmer or colder day for it, so that the baseline "
        "covers temperature. Its tension is "
        "711 ± 14 kN by test only. The model class is beam1. It predicts one measured frequency "
        "to 0.34 % (root mean square). Each lies within its 90 % interval: the model explains "
        "what was measured. Record the temperature with the next test: it moves the tension."
    )


def test_advice_names_sampling_and_a_wide_interval(season: HangerReport, hanger: Hanger) -> None:
    unsettled = replace(season, posterior=replace(season.posterior, r_hat=1.4))
    assert any("R-hat 1.40" in text for text in advice(unsettled))
    sharp = replace(hanger, thresholds=Thresholds(tension_shift_fraction=0.01))
    told = advice(with_now(season, hanger=sharp))
    assert any("no better than the threshold of 1 %" in text for text in told)


def test_change_without_a_drift_comes_from_both_posteriors(season: HangerReport) -> None:
    """Compare with two independent normal tensions, ratio 650/700, sd of each 0.012 * 711 kN.

    The interval of the relative change has half width 1.645 * sqrt(1 + r^2) * 8.53/700.
    """
    change = with_now(season, drifts=()).now.change
    assert change is not None
    ratio = 650 / 700
    assert change.mean == pytest.approx(ratio - 1, abs=0.002)
    half = 1.645 * np.sqrt(1 + ratio**2) * 0.012 * 711 / 700
    assert change.width / 2 == pytest.approx(half, rel=0.1)


# ------------------------------------------------------------ tables


def tables(data: HangerReport) -> tuple[Table, ...]:
    return tuple(table for part in hanger_paper(data).parts for table in part.tables)


def test_report_has_every_table_it_has_data_for(season: HangerReport, bare: HangerReport) -> None:
    assert [table.title for table in tables(season)] == [
        "The bar as described", "Formulas of practice", "Changes since the baseline of test t000",
        "Frequencies", "Alerts, latest first", "Where these numbers come from",
        "Parameters of the model class beam2", "Model classes", "Tests, latest first",
        "Alerts, latest first", "How the posterior was computed",
    ]  # fmt: skip
    titles = [table.title for table in tables(bare)]
    assert not {"Model classes", "Alerts, latest first"} & set(titles)
    for table in (*tables(season), *tables(bare)):
        assert {len(row) for row in table.rows} == {len(table.headings)}
    long = replace(season, trend=season.trend * 3)
    assert "... and 18 earlier ones" in as_text(hanger_paper(long))


def test_frequencies_not_measured_or_followed(season: HangerReport, bare: HangerReport) -> None:
    table = frequencies(bare)
    assert (table.rows[1][2], table.rows[1][-1]) == ("not measured", "not measured")
    assert "shm gap diagnose" not in table.note
    irregular = Mode("transverse", 9, 99.0, 0.1, irregular=True)
    latest = replace(bare.latest, modes=(*bare.latest.modes, irregular))
    shown = frequencies(replace(bare, tests=(*bare.tests[:-1], latest)))
    assert shown.rows[0][:5] == ("transverse", "9", "99.000", "0.1000", "not followed")
    assert "shm gap diagnose" in shown.note
    # Of a pooled posterior the latest test is compared.
    earlier = PredictedFrequency("transverse", 1, 5.8, 0.05, 5.99)
    pooled = replace(season.posterior, predicted=(earlier, *season.posterior.predicted))
    assert replace(season, posterior=pooled).predicted == season.posterior.predicted


def test_formulas_of_practice_stand_beside_ours(season: HangerReport) -> None:
    """The taut string by hand: T = 4 m (f L)^2."""
    (made,) = [t for t in tables(season) if t.title == "Formulas of practice"]
    hanger = season.hanger
    first = next(m for m in season.latest.modes if (m.plane, m.order) == ("transverse", 1))
    string_n = 4 * hanger.mass_per_length_kg_m * (first.frequency_hz * hanger.length_m) ** 2
    assert made.rows[0][:2] == ("taut string, mode 1", f"{season.tension_unit.of(string_n):.0f}")
    ends = ["equal springs, all modes", "ours, by all modes of the same test"]
    assert [row[0] for row in made.rows[-2:]] == ends


def test_table_folds_its_widest_columns_and_cuts_no_word() -> None:
    """First columns fold, then names of tests break; without room for its words it is a list."""
    long = Table(
        "Where the gap lies",
        ("mode", "test", "measured, Hz", "off, %"),
        (("transverse 3", "hanger03_20260413", "25.452 (25.441 to 25.463)", "-2.37"),),
    )
    folded, broken, listed = (laid_out(long, width) for width in (52, 46, 34))
    assert max(map(len, folded.splitlines())) <= 52
    assert {"transverse", "hanger03_20260413", "25.463)", "-2.37"} <= set(folded.split())
    assert max(map(len, broken.splitlines())) <= 46
    assert "hanger03_20260413" not in broken
    assert {"transverse", "measured,", "25.463)"} <= set(broken.split())
    lines = [line.split() for line in listed.splitlines()]
    assert ["mode", "transverse", "3"] in lines
    assert ["off,", "%", "-2.37"] in lines


# ------------------------------------------------------------ change with the temperature

TENSION = TemperatureCoefficient("tension", -0.0012, 0.0003, 0.004)
SPRING = TemperatureCoefficient("transverse_end_stiffness", 0.002, 0.0005, 0.05)
UNSEEN = TemperatureCoefficient("tension", -0.0001, 0.0039, 0.004)


def states(
    *coefficients: TemperatureCoefficient, temperatures_c: tuple[float, ...] = (3.0, 12.0, 21.0)
) -> StatesOverTime:
    times = tuple(datetime(2026, month + 1, 1, tzinfo=UTC) for month in range(len(temperatures_c)))
    outlier = np.zeros(len(times), bool)
    warmth = np.array(temperatures_c)
    return StatesOverTime(times, warmth, 12.0, outlier, (), temperature_coefficients=coefficients)


def test_quantity_has_its_change_per_kelvin_in_percent(season: HangerReport) -> None:
    assert temperature_table(states(TENSION, SPRING)).rows == (
        ("tension", "-0.120 ± 0.030 % per K", "-0.169 to -0.071 % per K"),
        ("transverse end stiffness", "+0.46 ± 0.12 % per K", "+0.27 to +0.65 % per K"),
    )
    data = replace(season, states=states(TENSION))
    assert "CHANGE WITH THE TEMPERATURE" in as_text(hanger_paper(data))
    assert "-0.120 ± 0.030 % per K" in as_text(hanger_paper(data))
    assert hanger_json(data)["temperature_coefficients"] == [{
        "quantity": "tension", "unit": "fraction per K", "mean": -0.0012, "sd": 0.0003,
        "prior_sd": 0.004, "known": True, "why_not_known": "",
    }]  # fmt: skip
    assert "CHANGE WITH THE TEMPERATURE" not in as_text(hanger_paper(season))


@pytest.mark.parametrize(
    ("coefficient", "temperatures_c", "why"),
    [
        (UNSEEN, (11.0, 12.0, 12.5), "the temperatures of the tests differ by 1.5 K only"),
        (UNSEEN, (np.nan, np.nan), "no test with a temperature"),
        (UNSEEN, (12.0, np.nan), "1 test with a temperature"),
        (UNSEEN, (0.0, 25.0), "2 tests over 25 K are too few to tell it from other changes"),
        (TENSION, (8.0, 20.0), "2 tests over 12 K are too few to tell it from other changes"),
    ],
)
def test_temperature_effect_unknown_says_why(
    coefficient: TemperatureCoefficient, temperatures_c: tuple[float, ...], why: str
) -> None:
    """Two tests tell no swing from a change, however sharp they are."""
    found = states(coefficient, temperatures_c=temperatures_c)
    assert temperature_table(found).rows == (("tension", f"not known: {why}", ""),)
    (document,) = temperature_documents(found)
    assert (document["known"], document["why_not_known"]) == (False, why)


# ------------------------------------------------------------ the report of a period

NOW = datetime(2026, 9, 10, 12, tzinfo=UTC)


@pytest.mark.parametrize(
    ("told", "since"),
    [
        ("2026-03-01", datetime(2026, 3, 1, tzinfo=UTC)),
        ("2026-03-01T10:30:00+02:00", datetime(2026, 3, 1, 8, 30, tzinfo=UTC)),
        ("90d", NOW - timedelta(days=90)),
        (" 2w ", NOW - timedelta(days=14)),
        ("12m", NOW - timedelta(days=365.25)),
        ("1Y", NOW - timedelta(days=365.25)),
    ],
)
def test_period_is_a_date_or_a_span(told: str, since: datetime) -> None:
    assert period_since(told, NOW) == Period(since, NOW)


@pytest.mark.parametrize("told", ["", "yesterday", "90", "d", "2026-13-01", "-3d", "99999y", "0d"])
def test_period_of_neither_is_refused_with_an_example(told: str) -> None:
    with pytest.raises(UsageError) as refused:
        period_since(told, NOW)
    assert "90d" in refused.value.remedy
    with pytest.raises(UsageError, match="has not begun"):
        period_since("2027-01-01", NOW)


def test_change_of_independent_estimates_adds_in_squares() -> None:
    """(90 +- 3) of (100 +- 4): -10 %, with half width sqrt(3^2 + (0.9 * 4)^2) / 100."""
    change = Interval(90, 87, 93).since(Interval(100, 96, 104))
    assert change.mean == pytest.approx(-0.10)
    assert change.width / 2 == pytest.approx((3**2 + 3.6**2) ** 0.5 / 100)


def test_every_form_names_the_period_and_what_changed_in_it(season: HangerReport) -> None:
    period, named = Period(START + timedelta(days=30), NOW), "2026-05-31 to 2026-09-10"
    trend = tuple(row for row in season.trend if period.holds(row.time))
    recent = replace(season, period=period, trend=trend)
    told = summary(recent)
    assert f"In the period {named}: 7 tests, 1 alert" in told
    assert "from its first test (t003) to its last the tension moved by -7." in told
    one = replace(recent, trend=recent.trend[-1:])
    assert "with one test in it nothing in it can be compared" in in_period(one)
    assert as_text(hanger_paper(recent)).splitlines()[0] == f"Hanger 3, Arch bridge, {named}: Alert"
    assert f"period {named}" in page_words(hanger_paper(recent))
    assert hanger_json(recent)["period"] == {"since": START + timedelta(days=30), "until": NOW}
    titles = [table.title for table in tables(recent)]
    assert f"Tests in the period {named}, latest first" in titles
    assert f"Alerts in the period {named}, latest first" in titles
