"""A blind trial as a page, in a terminal, as a document and as figures."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from shm import documents
from shm.blind.scoring import trial_score
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.figures.every_figure import trial_figures
from shm.report.figures.specification import Illustration
from shm.report.trial_report import trial_json, trial_paper
from shm.values import TrialScore
from tests.helpers.trial_answers import a_truth, an_answer, oracle, plausible, some_truths
from tests.report.outline import Outline

ALL = [
    "trial_detection", "trial_confusion", "trial_reliability", "trial_log_score",
    "trial_left_out", "trial_tension", "trial_coverage", "trial_held_out",
]  # fmt: skip
SHA = ("a" * 64, "b" * 64)


@cache
def make_score(who: str) -> TrialScore:
    truths, rng = some_truths(), np.random.default_rng(3)
    if who == "one case":
        truths = (a_truth(),)
        return trial_score(truths, [an_answer({"point_mass": 1.0})], [], SHA, 7, rng)
    if who == "oracle":
        second = [oracle(truth, left_out=True) for truth in truths if truth.left_out]
        return trial_score(truths, [oracle(t) for t in truths], second, SHA, 7, rng)
    first = [plausible(truth, rng) for truth in truths]
    second = [plausible(truth, rng, left_out=True) for truth in truths if truth.left_out]
    return trial_score(truths, first, second, SHA, 7, rng)


WHO = ("plausible", "oracle", "one case")


@pytest.fixture(scope="module")
def scores() -> dict[str, TrialScore]:
    return {who: make_score(who) for who in WHO}


@pytest.fixture(scope="module")
def pages(scores: dict[str, TrialScore]) -> dict[str, Outline]:
    found = {}
    for who, score in scores.items():
        found[who] = Outline()
        found[who].feed(as_html(trial_paper(score)))
    return found


@pytest.fixture(scope="module")
def drawn(scores: dict[str, TrialScore]) -> dict[str, dict[str, Illustration]]:
    return {
        who: {item.name: item for item in trial_figures(score)} for who, score in scores.items()
    }


def told(outline: Outline) -> str:
    return " ".join(" ".join(outline.words).split())


@pytest.mark.parametrize("who", WHO)
def test_pages_nest_fetch_nothing_and_have_sound_headings(
    who: str, pages: dict[str, Outline]
) -> None:
    outline = pages[who]
    assert outline.open == []
    for tag, attributes in outline.tags:
        assert tag not in {"script", "link", "iframe"}
        assert not {"src", "srcset", "data", "action"} & attributes.keys()
    ids = [attributes["id"] for _, attributes in outline.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    levels = [int(tag[1]) for tag, _ in outline.tags if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))


@pytest.mark.parametrize("who", WHO)
def test_pages_and_texts_say_nan_nowhere(
    who: str, pages: dict[str, Outline], scores: dict[str, TrialScore]
) -> None:
    for words in (told(pages[who]), as_text(trial_paper(scores[who]))):
        assert not re.search(r"\b(nan|inf|None(?! (of|is)))\b", words)


@pytest.mark.parametrize("who", WHO)
def test_texts_fit_a_terminal(who: str, scores: dict[str, TrialScore]) -> None:
    assert max(map(len, as_text(trial_paper(scores[who])).splitlines())) <= 100


def test_the_summary_says_what_was_tried_and_what_came_out(pages: dict[str, Outline]) -> None:
    page = told(pages["oracle"])
    assert "384 simulated hangers were put before the diagnosis" in page
    assert "nothing in 96, one effect of the catalogue in 192, two in 48" in page
    assert re.search(r"It saw (\d+) of \1 gaps larger than 4 standard deviations", page)
    assert "gave false alarm at 0 of 96 sound hangers" in page
    assert "The tension was off by 5.00 % before and 0.10 % after" in page
    assert "Marks that are missed" not in page
    assert re.search(r"marks met \(\d+ with the whole interval\), none missed; of", page)


def test_every_missed_mark_stands_on_top_and_every_wrong_case_in_a_table(
    pages: dict[str, Outline], scores: dict[str, TrialScore]
) -> None:
    page, score = told(pages["plausible"]), scores["plausible"]
    missed = [mark for mark in score.marks if mark.met is False]
    assert len(missed) > 5
    top = page[: page.index("Figures")]
    assert top.count(", asked at ") == len(missed)
    surely = [m for m in missed if m.score.high < m.lower or m.score.low > m.upper]
    assert 0 < len(surely) < len(missed)
    assert top.count(", missed with the whole interval; ") == len(surely)
    assert f"{len(missed)} are missed ({len(surely)} with the whole interval), listed" in page
    wrong = [c.case for c in score.first_round if c.kind == "none" and not c.right]
    assert wrong
    assert all(case in page for case in wrong)
    assert "failed: no mode was found" in page


def test_the_seals_and_the_seed_stand_on_the_page(pages: dict[str, Outline]) -> None:
    page = told(pages["plausible"])
    assert f"seed 7. SHA-256 of the key {SHA[0]}, of the answers {SHA[1]}" in page


def test_a_trial_without_second_round_says_so(pages: dict[str, Outline]) -> None:
    assert "was not run" in told(pages["one case"])
    assert "was not run" not in told(pages["oracle"])


def test_values_close_to_their_bound_show_on_which_side_they_lie(
    scores: dict[str, TrialScore],
) -> None:
    score = scores["oracle"]
    close = replace(score.marks[0], score=replace(score.marks[0].score, value=0.9499), met=False)
    text = as_text(trial_paper(replace(score, marks=(close, *score.marks[1:]))))
    assert "Gaps seen (size above 4): 0.9499 " in text


def test_words_from_outside_cannot_inject_markup(scores: dict[str, TrialScore]) -> None:
    sly = "<script>alert(1)</script>"
    score = scores["one case"]
    case = replace(score.first_round[0], failure=sly, right=False, in_group=False)
    page = as_html(trial_paper(replace(score, first_round=(case,))))
    assert "<script" not in page
    assert "&lt;script&gt;" in page


def test_the_document_holds_marks_cases_and_both_seals(scores: dict[str, TrialScore]) -> None:
    document = json.loads(documents.dump(trial_json(scores["plausible"])))
    assert document["schema"] == "shm.blind_score/1"
    assert (document["cases"], document["seed"]) == (384, 7)
    assert len(document["first_round"]) == 384
    assert {mark["outcome"] for mark in document["marks"]} == {"", "met", "missed", "too few"}
    assert document["marks"][0]["upper"] is None
    assert (document["key_sha256"], document["answers_sha256"]) == SHA


def test_figures_are_drawn_where_their_numbers_exist(
    drawn: dict[str, dict[str, Illustration]],
) -> None:
    assert list(drawn["plausible"]) == list(drawn["oracle"]) == ALL
    missing = {"trial_left_out", "trial_log_score"}
    assert list(drawn["one case"]) == [name for name in ALL if name not in missing]


def test_captions_and_alternative_texts_are_whole_sentences_without_nan(
    drawn: dict[str, dict[str, Illustration]],
) -> None:
    for item in (item for items in drawn.values() for item in items.values()):
        assert item.caption.endswith(".")
        assert len(item.alt) > 40
        assert not re.search(r"\b(nan|inf)\b", item.caption + item.alt)


def test_the_confusion_matrix_counts_every_judged_case_once(
    drawn: dict[str, dict[str, Illustration]], scores: dict[str, TrialScore]
) -> None:
    figure = drawn["plausible"]["trial_confusion"].figure
    counted = sum(int(text.get_text()) for text in figure.axes[0].texts)
    first = scores["plausible"].first_round
    assert counted == sum(case.kind == "none" or case.size > 4 for case in first)


def test_held_out_ratios_are_drawn_as_the_share_of_cases_below(
    drawn: dict[str, dict[str, Illustration]],
) -> None:
    """Every ratio of the oracle is 0.25: the share jumps from 0 to 1 there."""
    line = drawn["oracle"]["trial_held_out"].figure.axes[0].lines[0]
    assert set(np.round(line.get_xdata(), 6)) == {0.25}
    assert (min(line.get_ydata()), max(line.get_ydata())) == (0.0, 1.0)
