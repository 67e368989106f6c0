"""How much a file and its sidecar may hold, and where a sidecar may stand."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import h5py
import numpy as np
import pytest

from shm.errors import BadInput
from shm.pipeline.lineage import read_limits
from shm.read import Limits, peek, read
from shm.read.limits import limited
from shm.settings import Settings
from tests.helpers.written import refused

HEAD = "# sampling_rate_hz: 512\nforce,acc_1\n"


@pytest.fixture
def csv(tmp_path: Path) -> Path:
    path = tmp_path / "test.csv"
    path.write_text(HEAD + "1,2\n" * 50)
    return path


def test_each_limit_is_a_setting_of_its_name() -> None:
    assert read_limits(Settings()) == Limits()
    assert read_limits(Settings(max_samples=99)) == Limits(max_samples=99)
    assert {each.name for each in fields(Limits)} <= {each.name for each in fields(Settings)}


def test_a_record_longer_than_allowed_is_refused_and_seen_in_a_peek(csv: Path) -> None:
    with limited(Limits(max_samples=49)):
        refused(csv, "50 samples are more than the 49 of setting")
        assert "setting max_samples" in " ".join(peek(csv).problems)
    assert read(csv)


def test_a_long_array_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    """24 MB of zeros in some kB, within what is read at once."""
    path = tmp_path / "test.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("acc_1", data=np.zeros(3_000_000), compression="gzip")
    with limited(Limits(max_samples=1000)), pytest.raises(BadInput, match="3000000 samples"):
        read(path)


@pytest.mark.parametrize("text", ["# a: b\n" * 500 + HEAD, "x" * 3000 + HEAD, f"{'a,' * 2000}b\n"])
def test_a_heading_without_end_is_refused(csv: Path, text: str) -> None:
    csv.write_text(text + "1,2\n" * 50)
    with limited(Limits(max_header_bytes=2000)), pytest.raises(BadInput, match="max_header_bytes"):
        read(csv)


def test_a_long_sidecar_is_refused(csv: Path) -> None:
    csv.with_suffix(".toml").write_text("# long\n" * 400)
    with limited(Limits(max_header_bytes=2000)), pytest.raises(BadInput) as refusal:
        read(csv)
    assert Path(refusal.value.file).name == "test.toml"


@pytest.mark.parametrize("text", ["a = " + "[" * 100_000, "a = " + "9" * 5000, "a = 1" + "\x00"])
def test_a_sidecar_that_breaks_its_parser_is_refused(csv: Path, text: str) -> None:
    csv.with_suffix(".toml").write_text(text)
    refused(csv, "not a readable TOML file")


def test_a_sidecar_may_not_be_a_link_to_another_folder(csv: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "secret.toml").write_text("hanger = 3\n")
    csv.with_suffix(".toml").symlink_to(elsewhere / "secret.toml")
    refused(csv, "is a link out of its folder")
    look = peek(csv)
    assert look.hanger is None
    assert any("is a link out of its folder" in problem for problem in look.problems)
    (tmp_path / "common.toml").write_text("hanger = 3\n")
    csv.with_suffix(".toml").unlink()
    csv.with_suffix(".toml").symlink_to("common.toml")
    assert read(csv).hanger == 3
