"""Hundreds of damaged and hostile files: each is read or refused in words, and none does harm.

`tests/benchmarks/fuzz_readers.py` does the same to twenty thousand.
"""

from __future__ import annotations

import resource
from pathlib import Path

import numpy as np
import pytest

from shm.errors import BadInput
from shm.read import sandbox
from shm.read.sandbox import reading_process
from tests.helpers.mutations import Sample, damaged, harmful_samples, light, whole_samples

FILES = 140
SMALL = sandbox.Limits(parse_memory_bytes=2**26)


def what_comes_of(path: Path) -> BadInput | None:
    """The refusal of a file, None where it is read."""
    verb = sandbox.load_modes if path.name.endswith(".modes.json") else sandbox.read_test
    try:
        found = verb(path, SMALL)
    except BadInput as refusal:
        return refusal
    assert found
    return None


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> list[Sample]:
    return whole_samples(tmp_path_factory.mktemp("whole") / "files")


@pytest.fixture(scope="module")
def harmful(tmp_path_factory: pytest.TempPathFactory) -> list[Sample]:
    return harmful_samples(tmp_path_factory.mktemp("harmful") / "files", 20_000_000)


def test_every_whole_file_is_read(whole: list[Sample], tmp_path: Path) -> None:
    for number, sample in enumerate(whole):
        assert what_comes_of(sample.lay(tmp_path, f"test{number}")) is None, sample.name


def test_every_harmful_file_is_refused_by_a_reader_that_lives(
    harmful: list[Sample], tmp_path: Path
) -> None:
    for number, sample in enumerate(harmful):
        refusal = what_comes_of(sample.lay(tmp_path, f"test{number}"))
        assert refusal is not None, sample.name
        assert refusal.remedy
        assert "crash" not in refusal.message, f"{sample.name}: {refusal}"


def test_damaged_files_are_refused_in_words(
    whole: list[Sample], harmful: list[Sample], tmp_path: Path
) -> None:
    rng, samples = np.random.default_rng(20260501), light([*whole * 3, *harmful])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    read = refused = 0
    for number in range(FILES):
        sample = damaged(samples, rng)
        path = sample.lay(tmp_path, f"test{number}")
        refusal = what_comes_of(path)
        read += refusal is None
        refused += refusal is not None
        if refusal is not None:
            assert refusal.message, sample.name
            assert refusal.remedy, sample.name
            assert Path(refusal.file).name.startswith(path.name.split(".")[0]) or (
                path.suffix == ".zip"
            ), f"{sample.name}: {refusal}"
    assert read > FILES // 40
    assert refused > FILES // 2
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000
    assert reading_process._known[0].process.poll() is None
