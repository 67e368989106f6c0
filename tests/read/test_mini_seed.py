"""miniSEED of seismic recorders: channels by their SEED id, counts that a sidecar gives a worth."""

from __future__ import annotations

import shutil
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from shm.errors import BadInput
from shm.read import peek, read, sidecar_path
from shm.values import Channel, Recording
from tests.helpers.written import mini_seed_names, recorded, refused, write, write_counts

START = datetime(2026, 5, 1, 10, 0, 0, 1000, tzinfo=UTC)
RATE = 200.0
COUNTS = np.random.default_rng(1).integers(-100_000, 100_000, (2, 4000)).astype(float)
NAMES = mini_seed_names(2)
SIDECAR = f"""
hanger = 3
[channel.{NAMES[0]}]
unit = "m/s2"
calibration = 2e-6
plane = "transverse"
x_m = 3.0
[channel.{NAMES[1]}]
unit = "mg"
calibration = 1e-4
"""


def described() -> Recording:
    return Recording("", (Channel("a", "acceleration", COUNTS[0]),), RATE, 3, START)


def a_file(folder: Path, version: int = 2, sidecar: str = SIDECAR) -> Path:
    path = folder / "h3.mseed"
    write_counts(path, COUNTS, described(), version)
    if sidecar:
        sidecar_path(path).write_text(sidecar)
    return path


@pytest.mark.parametrize("version", [2, 3])
def test_channels_are_named_by_their_seed_id_and_worth_what_the_sidecar_says(
    tmp_path: Path, version: int
) -> None:
    path = a_file(tmp_path, version)
    found = recorded(path)
    assert (found.sampling_rate_hz, found.time, found.hanger) == (RATE, START, 3)
    assert [channel.name for channel in found.channels] == ["XX_HGR3_00_HN1", "XX_HGR3_00_HN2"]
    assert (found.channels[0].plane, found.channels[0].x_m) == ("transverse", 3.0)
    assert np.allclose(found.channels[0].values, 2e-6 * COUNTS[0], rtol=1e-12)
    assert np.allclose(found.channels[1].values, 1e-4 * 9.80665e-3 * COUNTS[1], rtol=1e-12)
    seen = peek(path)
    assert (seen.format, seen.samples, seen.problems) == ("miniSEED", 4000, ())


@pytest.mark.parametrize("sidecar", ["", SIDECAR.replace("calibration = 2e-6\n", "")])
def test_counts_of_unknown_worth_are_refused(tmp_path: Path, sidecar: str) -> None:
    path = a_file(tmp_path, sidecar=sidecar)
    with pytest.raises(BadInput, match="holds counts, and nobody says what one is worth") as caught:
        read(path)
    assert caught.value.channel == NAMES[0]
    assert f"[channel.{NAMES[0]}]" in caught.value.remedy
    assert any("nobody says what one is worth" in each for each in peek(path).problems)


def test_what_is_missing_is_nan(tmp_path: Path) -> None:
    path = tmp_path / "h3.mseed"
    rows = COUNTS.copy()
    rows[0, 1000:1500] = rows[1, :3] = np.nan
    write_counts(path, rows, described())
    sidecar_path(path).write_text(SIDECAR)
    found = recorded(path)
    values = np.array([channel.values for channel in found.channels])
    assert np.array_equal(np.isnan(values), np.isnan(rows))
    assert np.allclose(values[0], 2e-6 * rows[0], rtol=1e-12, equal_nan=True)


def test_a_file_that_is_cut_off_or_of_different_rates_is_refused(tmp_path: Path) -> None:
    path = a_file(tmp_path)
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    refused(path, "cannot be read")
    other = tmp_path / "other.mseed"
    write(Recording("", described().channels, 100.0, 3, START + timedelta(hours=1)), other)
    path.write_bytes(whole + other.read_bytes())
    refused(path, r"different sampling rates \(100, 200\)")


def test_without_its_extra_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = a_file(tmp_path)
    monkeypatch.setitem(sys.modules, "pymseed", None)
    refused(path, r"extra `miniseed`.*shm\[miniseed\]")


def test_a_name_with_another_suffix_is_told_what_it_is(tmp_path: Path) -> None:
    shutil.copy(a_file(tmp_path), tmp_path / "h3.csv")
    refused(tmp_path / "h3.csv", "the content is miniSEED")
