"""Answers, their documents and their seal."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.documents import dump
from shm.errors import BadInput, NothingThere
from tests.benchmarks.blind.layout import (
    Trial,
    answer_document,
    answered,
    answers_sha256,
    read_answers,
    seal_answers,
    verified_sha256,
    write_answer,
)
from tests.benchmarks.blind.truth import Answer
from tests.helpers.diagnoses import a_diagnosis

ANSWERS = (
    Answer("c0001", (), None, "no test has a mode."),
    Answer("c0002", ("sag",), None, "unexpected ZeroDivisionError: by zero (fit.py, line 3)"),
)


@pytest.fixture
def trial(tmp_path: Path) -> Trial:
    """A trial of two cases whose answers are written, but not sealed."""
    made = Trial(tmp_path, ("c0001", "c0002"), "")
    made.answers("answers").mkdir()
    for answer in ANSWERS:
        write_answer(answer, made.answers("answers"))
    return made


def test_answers_come_back_in_the_order_of_their_cases(trial: Trial) -> None:
    assert read_answers(trial.answers("answers")) == ANSWERS
    assert answered(trial.answers("answers")) == {"c0001", "c0002"}


def test_a_sealed_round_is_verified(trial: Trial) -> None:
    assert seal_answers(trial, "answers") == verified_sha256(trial, "answers")


@pytest.mark.parametrize("change", ["content", "name", "one less", "one more"])
def test_any_change_after_sealing_is_found_out(trial: Trial, change: str) -> None:
    seal_answers(trial, "answers")
    path = trial.answers("answers") / "c0001.json"
    if change == "content":
        path.write_text(path.read_text().replace("no test", "No test"))
    elif change == "name":
        path.rename(path.with_name("c0003.json"))
    elif change == "one less":
        path.unlink()
    else:
        path.with_name("c0003.json").write_text(path.read_text())
    with pytest.raises(BadInput, match="changed after they were sealed"):
        verified_sha256(trial, "answers")


def test_moving_a_byte_from_one_file_to_the_next_changes_the_sha256(tmp_path: Path) -> None:
    for name, contents in (("a", ("xy", "z")), ("b", ("x", "yz"))):
        (tmp_path / name).mkdir()
        for case, content in zip(("1", "2"), contents, strict=True):
            (tmp_path / name / f"{case}.json").write_text(content)
    assert answers_sha256(tmp_path / "a") != answers_sha256(tmp_path / "b")


def test_what_a_stop_left_half_written_does_not_count(trial: Trial) -> None:
    before = answers_sha256(trial.answers("answers"))
    (trial.answers("answers") / ".c0003.json").write_text("{")
    assert answers_sha256(trial.answers("answers")) == before


def test_a_round_that_is_not_sealed_says_how_far_it_is(trial: Trial) -> None:
    (trial.answers("answers") / "c0002.json").unlink()
    with pytest.raises(NothingThere, match=r"1 of 2 cases.*goes on where it stopped"):
        verified_sha256(trial, "answers")


def test_a_broken_answer_is_named(trial: Trial) -> None:
    (trial.answers("answers") / "c0001.json").write_text('{"schema": "shm.blind_answer/1"}')
    with pytest.raises(BadInput, match=r"c0001\.json"):
        read_answers(trial.answers("answers"))


def test_a_diagnosis_comes_back_whole(tmp_path: Path) -> None:
    answer = Answer("c0001", ("sag",), a_diagnosis())
    write_answer(answer, tmp_path)
    (back,) = read_answers(tmp_path)
    assert dump(answer_document(back)) == dump(answer_document(answer))
