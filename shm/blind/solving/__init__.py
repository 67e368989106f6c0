"""Solves a blind trial: every case in a process that can read nothing but its cases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass

from shm.blind.answers import (
    answered,
    read_answers,
    seal_answers,
    verified_sha256,
    write_answer,
)
from shm.blind.layout import Round, Told, Trial, key_beside, nobody
from shm.blind.solving.case import UNEXPECTED, Solved, solved
from shm.blind.solving.guard import guard
from shm.blind.workers import workers
from shm.documents import dump
from shm.read.atomic import replace_text
from shm.values import Answer

__all__ = ["SolvedRound", "solve_left_out", "solve_trial", "solved"]


@dataclass(frozen=True)
class SolvedRound:
    """The answers of a round and their SHA-256; `earlier` of them were there before."""

    answers: tuple[Answer, ...]
    sha256: str
    earlier: int

    @property
    def failed(self) -> tuple[Answer, ...]:
        """Those that hold no diagnosis."""
        return tuple(answer for answer in self.answers if answer.diagnosis is None)

    @property
    def unexpected(self) -> tuple[Answer, ...]:
        """Those that failed by a fault of shm."""
        return tuple(answer for answer in self.failed if answer.failure.startswith(UNEXPECTED))


def solve_trial(trial: Trial, *, jobs: int = 1, told: Told = nobody) -> SolvedRound:
    """Diagnoses all cases that have no answer yet, then seals the answers.

    Each answer is written as it comes; where it stops, the next call goes on. Raises BadInput where
    answers were changed after they were sealed.
    """
    return _solve(trial, "answers", dict.fromkeys(trial.cases, ()), jobs, told)


def solve_left_out(
    trial: Trial, left_out: Mapping[str, Sequence[str]], *, jobs: int = 1, told: Told = nobody
) -> SolvedRound:
    """The second round: the cases named, each without some effects in the catalogue.

    Raises NothingThere before the first round is sealed, BadInput where its answers were changed.
    """
    verified_sha256(trial, "answers")
    return _solve(trial, "left_out", left_out, jobs, told)


def _solve(
    trial: Trial, which: Round, wanted: Mapping[str, Sequence[str]], jobs: int, told: Told
) -> SolvedRound:
    directory = trial.answers(which)
    if trial.seal(which).exists():
        verified_sha256(trial, which)
    directory.mkdir(exist_ok=True)
    earlier = answered(directory)
    missing = {case: effects for case, effects in wanted.items() if case not in earlier}
    if missing:
        known = len(wanted) - len(missing)
        _solve_missing(trial, which, missing, jobs, lambda new: told(known + new, len(wanted)))
    sha256 = seal_answers(trial, which)
    return SolvedRound(read_answers(directory), sha256, len(wanted) - len(missing))


def _solve_missing(
    trial: Trial,
    which: Round,
    missing: Mapping[str, Sequence[str]],
    jobs: int,
    done: Callable[[int], None],
) -> None:
    """Lets guarded workers solve cases, and writes each answer as it comes."""
    readable = [trial.directory / "cases", trial.answers("answers")]
    hidden = [key_beside(trial.directory)]
    with workers(jobs, guard, (readable, hidden)) as pool:
        running = [
            pool.submit(solved, trial.case_directory(case), effects, trial.identified(case))
            for case, effects in missing.items()
        ]
        for count, each in enumerate(as_completed(running), 1):
            _write(each.result(), trial, which)
            done(count)


def _write(found: Solved, trial: Trial, which: Round) -> None:
    if found.identified is not None:
        text = dump(found.identified.document()) + "\n"
        replace_text(trial.identified(found.answer.case), text)
    write_answer(found.answer, trial.answers(which))
