"""Questions of `shm import` at a terminal; a wrong answer is asked for again."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

import rich_click as click

from shm.errors import BadInput, UsageError
from shm.pipeline.importing import OF_TEST, Answers, Question, answer_of_test
from shm.store import Workspace

T = TypeVar("T")
OfChannel = Callable[[Question, str], dict[str, object]]
"""An answer about a channel as keys of a sidecar; raises UsageError with what may be said."""


def asked(
    questions: Sequence[Question], answers: Answers, workspace: Workspace, of_channel: OfChannel
) -> Answers:
    """Return the answers with those of the person at the terminal."""
    tables = {name: dict(given) for name, given in answers.channels.items()}
    for question in questions:
        if question.about == "hanger":
            answers = replace(answers, hanger=_prompt(question, lambda t: _hanger(t, workspace)))
        elif question.about == "rate":
            answers = replace(answers, sampling_rate_hz=_prompt(question, _rate_hz))
        elif question.about in OF_TEST:
            answers = _of_test(question, answers)
        else:
            given = _prompt(question, partial(of_channel, question))
            tables.setdefault(question.channel, {}).update(given)
    return replace(answers, channels=tables)


def _of_test(question: Question, answers: Answers) -> Answers:
    return _prompt(question, lambda text: answer_of_test(question.about, text, answers))


def asked_if_it_stays(answers: Answers, *, is_known: bool) -> Answers:
    """Ask if the profile of a new logger may name its hanger; a known one is not asked."""
    if is_known or answers.hanger is None or answers.each_time:
        return answers
    text = f"Are all later files of this logger of hanger {answers.hanger}, too?"
    return replace(answers, each_time=not click.confirm(text, default=False))


def _prompt(question: Question, take: Callable[[str], T]) -> T:
    def taken(text: str) -> T:
        try:
            return take(text.strip())
        except (UsageError, BadInput) as error:
            raise click.UsageError(str(error)) from error

    choices_words = f" [{', '.join(question.choices)}]" if question.choices else ""
    answer: T = click.prompt(f"{question.text}{choices_words}", value_proc=taken)
    return answer


def _hanger(text: str, workspace: Workspace) -> int:
    if not text.isdecimal():
        raise UsageError(f"{text!r} is no number of a hanger.", remedy="Give a whole number.")
    return workspace.bridge.tested(int(text)).id


def _rate_hz(text: str) -> float:
    try:
        rate_hz = float(text.replace(",", "."))
    except ValueError:
        rate_hz = math.nan
    if not 0 < rate_hz < math.inf:
        raise UsageError(f"{text!r} is no rate.", remedy="Give samples a second, such as 512.")
    return rate_hz
