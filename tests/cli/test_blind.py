"""`shm gap blind`: make, solve and score a trial."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from shm.blind.making import make_trial
from tests.cli.conftest import Shm
from tests.helpers.blind_workers import in_this_process


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A trial of two cases whose tests nobody can read, so that each answer is a failure."""
    folder = tmp_path_factory.mktemp("blind") / "trial"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("shm.blind.making.workers", in_this_process)
        make_trial(folder, folder.with_name("trial.key.json"), 2, seed=3, ways=["modes"])
    for path in folder.rglob("tests.modes.json"):
        path.write_text("{}")
    return folder


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """No fresh processes: tests/blind tries those."""
    monkeypatch.setattr("shm.blind.making.workers", in_this_process)
    monkeypatch.setattr("shm.blind.solving.workers", in_this_process)


@pytest.fixture
def trial(made: Path, tmp_path: Path) -> Path:
    shutil.copy(made.with_name("trial.key.json"), tmp_path / "trial.key.json")
    return shutil.copytree(made, tmp_path / "trial")


def test_make_says_what_it_made_and_to_keep_the_key_away(shm: Shm, tmp_path: Path) -> None:
    ended = shm(
        "gap", "blind", "make", tmp_path / "t", "--cases", 1, "--seed", 3, "--way", "modes",
        "--jobs", 1, "--key", tmp_path / "apart" / "k.json",
    )  # fmt: skip
    assert ended.code == 0
    sha256 = json.loads((tmp_path / "t" / "trial.json").read_text())["key_sha256"]
    assert f"Its SHA-256: {sha256}" in ended.out
    assert "Keep the key away" in ended.out
    assert "one effect" in ended.out
    assert (tmp_path / "apart" / "k.json").exists()


def test_a_trial_is_solved_in_two_rounds_and_scored(shm: Shm, trial: Path) -> None:
    key = trial.with_name("trial.key.json")
    first = shm("gap", "blind", "solve", trial, "--jobs", 1)
    assert first.code == 0
    assert "2 cases are answered; 2 without a diagnosis" in first.out
    assert (trial / "answers.sha256").read_text().strip() in first.out
    second = shm("gap", "blind", "solve", trial, "--left-out", key, "--jobs", 1)
    assert second.code == 0
    assert (trial / "left_out.sha256").exists()
    scored = shm("gap", "blind", "score", trial, "--json", "--html", trial / "page.html")
    assert scored.code == 0
    assert scored.document["schema"] == "shm.blind_score/1"
    assert "<html" in (trial / "page.html").read_text()


def test_score_refuses_answers_or_a_key_that_were_changed(shm: Shm, trial: Path) -> None:
    assert shm("gap", "blind", "solve", trial, "--jobs", 1).code == 0
    key = trial.with_name("trial.key.json")
    other = trial.with_name("other.key.json")
    other.write_text(key.read_text().replace('"seed": 3', '"seed": 4'))
    ended = shm("gap", "blind", "score", trial, "--key", other)
    assert ended.code == 3
    assert "not the key of" in ended.err
    answer = next((trial / "answers").glob("*.json"))
    answer.write_text(answer.read_text() + " ")
    ended = shm("gap", "blind", "score", trial)
    assert ended.code == 3
    assert "changed after they were sealed" in " ".join(ended.err.split())
    assert ended.out == ""


def test_score_waits_for_complete_answers(shm: Shm, trial: Path) -> None:
    ended = shm("gap", "blind", "score", trial)
    assert ended.code == 4
    assert "shm gap blind solve" in " ".join(ended.err.split())


def test_a_missing_key_or_trial_is_said_with_a_remedy(shm: Shm, trial: Path) -> None:
    trial.with_name("trial.key.json").unlink()
    ended = shm("gap", "blind", "solve", trial, "--left-out", trial / "none.json")
    assert ended.code == 3
    assert "there is no key at" in " ".join(ended.err.split())
    ended = shm("gap", "blind", "solve", trial.parent)
    assert ended.code == 3
    assert "shm gap blind make" in " ".join(ended.err.split())
