"""The key: what it keeps, who may read it, and how a wrong one is found out."""

from __future__ import annotations

import math
import os
import stat
from pathlib import Path

import pytest

from shm.errors import BadInput
from tests.benchmarks.blind.layout import Trial, key_beside, read_trial
from tests.benchmarks.blind.sealing import key_of, read_key, write_key
from tests.benchmarks.blind.truth import TrueCase, TrueEffect

CASES = (
    TrueCase(
        "c0001",
        "one",
        "two planes",
        (
            TrueEffect(
                "rotational_end_flexibility",
                "deck end",
                {"log10_k1": 6.5, "log10_k2": math.inf},
                7.25,
            ),
        ),
        7.25,
        4.1e5,
        ("rotational_end_flexibility",),
    ),
    TrueCase("c0002", "none", "shapes", (), 0.0, 5e5, ("sag",)),
)


def test_a_key_comes_back_as_it_was_written(tmp_path: Path) -> None:
    write_key(tmp_path / "k.json", CASES, 17)
    assert read_key(tmp_path / "k.json") == (CASES, 17)


@pytest.mark.skipif(os.name != "posix", reason="file modes")
def test_only_its_owner_may_read_a_key(tmp_path: Path) -> None:
    write_key(tmp_path / "k.json", CASES, 17)
    assert stat.S_IMODE((tmp_path / "k.json").stat().st_mode) == 0o600


def test_the_same_truth_never_has_the_same_sha256_twice(tmp_path: Path) -> None:
    first = write_key(tmp_path / "a.json", CASES, 17)
    assert first != write_key(tmp_path / "b.json", CASES, 17)


def test_a_key_is_never_written_over_another(tmp_path: Path) -> None:
    write_key(tmp_path / "k.json", CASES, 17)
    with pytest.raises(FileExistsError):
        write_key(tmp_path / "k.json", CASES, 18)


def test_the_key_of_a_trial_is_known_by_its_sha256(tmp_path: Path) -> None:
    sha256 = write_key(tmp_path / "k.json", CASES, 17)
    trial = Trial(tmp_path, ("c0001", "c0002"), sha256)
    assert key_of(trial, tmp_path / "k.json") == (CASES, 17)
    text = (tmp_path / "k.json").read_text().replace("7.25", "9.25")
    (tmp_path / "k.json").write_text(text)
    with pytest.raises(BadInput, match="or changed since"):
        key_of(trial, tmp_path / "k.json")


def test_what_is_no_key_is_refused_with_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="there is no key"):
        read_key(tmp_path / "none.json")
    (tmp_path / "other.json").write_text('{"schema": "shm.modes/1"}')
    with pytest.raises(BadInput, match=r"shm\.blind_key/1"):
        read_key(tmp_path / "other.json")
    (tmp_path / "half.json").write_text('{"schema": "shm.blind_key/1", "cases": [{}], "seed": 1}')
    with pytest.raises(BadInput, match="not a whole key"):
        read_key(tmp_path / "half.json")


def test_the_key_lies_beside_the_trial_by_default(tmp_path: Path) -> None:
    assert key_beside(tmp_path / "trial") == tmp_path / "trial.key.json"


def test_a_folder_that_is_no_trial_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"blind_trial\.py make"):
        read_trial(tmp_path)
