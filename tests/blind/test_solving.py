"""Solving without the key: the guard, the order of rounds, faults as answers."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shm.errors import BadInput, NothingThere, ShmError
from shm.modes_document import load_modes
from tests.benchmarks.blind import layout
from tests.benchmarks.blind.case import Draft, make_case
from tests.benchmarks.blind.layout import Trial, read_answers, write_answer
from tests.benchmarks.blind.solving import Refused, guard, solve_left_out, solve_trial, solved
from tests.benchmarks.blind.truth import Answer
from tests.benchmarks.blind.workers import workers
from tests.helpers.blind_workers import in_this_process
from tests.helpers.imports import imported_names

FAILED = "no test has a mode."


def make_one(folder: Path, case: str) -> None:
    draft = Draft(case, "one", "one plane", 0.9, ("bending_stiffness",))
    make_case(folder / case, draft, np.random.SeedSequence(4))


@pytest.fixture
def trial(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Trial:
    """Two cases that cannot be read, so that they are answered at once, in this process."""
    monkeypatch.setattr("tests.benchmarks.blind.solving.workers", in_this_process)
    made = Trial(tmp_path / "trial", ("c0001", "c0002"), "")
    for case in made.cases:
        made.case_directory(case).mkdir(parents=True)
        (made.case_directory(case) / "hanger.toml").write_text("[[hanger]]\n")
    return made


@pytest.fixture(scope="module")
def secrets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with cases, a key elsewhere, and links from the cases to the key."""
    folder = tmp_path_factory.mktemp("guarded")
    (folder / "cases").mkdir()
    (folder / "cases" / "told").write_text("told")
    (folder / "trial.key.json").write_text("secret")
    (folder / "cases" / "soft").symlink_to(folder / "trial.key.json")
    os.link(folder / "trial.key.json", folder / "cases" / "hard")
    (folder / "cases" / "copy.key.json").write_text("secret")
    return folder


@pytest.fixture(scope="module")
def guarded(secrets: Path) -> Iterator[Callable[..., object]]:
    """Calls a function in a guarded process."""
    with workers(1, guard, ([secrets / "cases"], [secrets / "trial.key.json"])) as pool:
        yield lambda verb, *given: pool.submit(verb, *given).result()


def test_a_guarded_process_reads_its_cases(guarded: Callable[..., object], secrets: Path) -> None:
    assert guarded(Path.read_text, secrets / "cases" / "told") == "told"


@pytest.mark.parametrize(
    "name",
    [
        "trial.key.json",
        "cases/../trial.key.json",
        "cases/soft",
        "cases/hard",
        "cases/copy.key.json",
        "elsewhere",
    ],
)
def test_a_guarded_process_told_to_read_the_key_raises(
    guarded: Callable[..., object], secrets: Path, name: str
) -> None:
    with pytest.raises(Refused, match="may not open"):
        guarded(Path.read_text, secrets / name)
    with pytest.raises(Refused):
        guarded(os.open, str(secrets / name).encode(), os.O_RDONLY)


def test_a_guarded_process_makes_no_new_name_for_the_key(
    guarded: Callable[..., object], secrets: Path
) -> None:
    for verb in (os.link, os.rename):
        with pytest.raises(Refused):
            guarded(verb, str(secrets / "trial.key.json"), str(secrets / "cases" / "new"))
    assert (secrets / "trial.key.json").exists()


def test_a_guarded_process_lets_nobody_else_read_for_it(guarded: Callable[..., object]) -> None:
    with pytest.raises(Refused, match="does without"):
        guarded(os.system, "true")


def test_a_process_that_is_ended_from_outside_is_said_with_a_remedy() -> None:
    with workers(1) as pool, pytest.raises(BrokenProcessPool):
        pool.submit(os._exit, 3).result()
    with pytest.raises(ShmError, match="ended from outside"), workers(1) as pool:
        raise BrokenProcessPool


@pytest.mark.slow
def test_a_case_is_diagnosed_in_a_guarded_process(tmp_path: Path) -> None:
    made = Trial(tmp_path, ("c0001",), "")
    make_one(tmp_path / "cases", "c0001")
    solve_trial(made)
    (answer,) = read_answers(made.answers("answers"))
    assert answer.failure == ""
    assert answer.diagnosis is not None
    assert answer.diagnosis.baseline == "beam1"


def test_a_case_is_diagnosed_without_what_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_one(tmp_path, "c0001")
    asked: list[tuple[Any, ...]] = []
    monkeypatch.setattr(
        "tests.benchmarks.blind.solving.diagnose", lambda *given: asked.append(given)
    )
    solved(tmp_path / "c0001", ("sag",))
    tests, _, options = asked[0]
    assert tests == load_modes(tmp_path / "c0001" / "tests.modes.json")
    assert options.without == ("sag",)


def test_a_fault_of_shm_is_an_answer_that_says_where(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_one(tmp_path, "c0001")

    def broken(*_: object) -> None:
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr("tests.benchmarks.blind.solving.diagnose", broken)
    failure = solved(tmp_path / "c0001").failure
    assert failure.startswith("unexpected ZeroDivisionError: by zero (test_solving.py, line ")


def test_answers_that_are_there_are_kept_and_only_the_rest_is_solved(trial: Trial) -> None:
    trial.answers("answers").mkdir()
    earlier = Answer("c0002", (), None, FAILED)
    write_answer(earlier, trial.answers("answers"))
    solve_trial(trial)
    first, second = read_answers(trial.answers("answers"))
    assert second == earlier
    assert "length_m is missing" in first.failure
    assert not first.failure.startswith("unexpected")


def test_a_sealed_trial_is_not_solved_again_nor_after_a_change(trial: Trial) -> None:
    trial.answers("answers").mkdir()
    for case in trial.cases:
        write_answer(Answer(case, (), None, FAILED), trial.answers("answers"))
    sealed = solve_trial(trial)
    assert solve_trial(trial) == sealed
    write_answer(Answer("c0001", (), None, "other"), trial.answers("answers"))
    with pytest.raises(BadInput, match="changed after they were sealed"):
        solve_trial(trial)


def test_the_second_round_waits_for_the_first_to_be_sealed(trial: Trial) -> None:
    with pytest.raises(NothingThere, match="not complete"):
        solve_left_out(trial, {"c0001": ("sag",)})
    trial.answers("answers").mkdir()
    for case in trial.cases:
        write_answer(Answer(case, (), None, FAILED), trial.answers("answers"))
    solve_trial(trial)
    solve_left_out(trial, {"c0001": ("sag",)})
    again = read_answers(trial.answers("left_out"))
    assert [(each.case, each.left_out) for each in again] == [("c0001", ("sag",))]
    assert len(read_answers(trial.answers("answers"))) == 2


def test_who_solves_imports_nothing_of_who_made_it_nor_its_key() -> None:
    folder = Path(layout.__file__).parent
    known = tuple(f"tests.benchmarks.blind.{name}." for name in ("layout", "truth", "workers"))
    for name in ("layout", "solving", "truth", "workers"):
        found = imported_names(folder / f"{name}.py")
        foreign = {each for each in found if each.startswith(("tests", "shm.simulate"))}
        assert not {each for each in foreign if not each.startswith(known)}, name
