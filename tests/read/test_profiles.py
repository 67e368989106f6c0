"""What is kept of one logger beside the archive: written, found again, and added to a sidecar."""

from __future__ import annotations

import tomllib
from datetime import UTC, datetime
from pathlib import Path

import pytest

from shm.errors import BadInput
from shm.read.base import Layout
from shm.read.profiles import (
    FOLDER,
    any_profile,
    completed,
    profile_for,
    save_profile,
)
from shm.read.sidecar import sidecar_text

LAYOUT = Layout("0123456789ab", "logger text", ("Time [s]", "A 1"))
SAID = {
    "hanger": 3,
    "sampling_rate_hz": 200.0,
    "temperature_c": 4.0,
    "channel": {"A 1": {"plane": "transverse", "x_m": 2.52}},
}
KEPT = {key: SAID[key] for key in ("hanger", "sampling_rate_hz", "channel")}


def test_a_profile_is_kept_by_its_layout_without_what_holds_for_one_file(tmp_path: Path) -> None:
    assert not any_profile(tmp_path)
    assert profile_for(LAYOUT, tmp_path) is None
    made = save_profile(SAID, LAYOUT, tmp_path)
    assert made.path == tmp_path / FOLDER / "logger-text-time-s-012345.toml"
    assert made == profile_for(LAYOUT, tmp_path)
    assert (made.fingerprint, made.described, made.roams) == (LAYOUT.fingerprint, KEPT, False)
    assert any_profile(tmp_path)
    assert profile_for(Layout("other", "logger text", ()), tmp_path) is None
    document = tomllib.loads(made.path.read_text())
    assert document == {
        "fingerprint": "0123456789ab",
        "format": "logger text",
        "columns": ["Time [s]", "A 1"],
        **KEPT,
    }
    assert made.path.read_text().startswith("# What the files of one logger")


@pytest.mark.parametrize(
    ("layout", "name"),
    [
        (Layout("f" * 9, "csv", ()), "csv-csv-ffffff.toml"),
        (Layout("f" * 9, "?", ("Ü",)), "logger-ffffff.toml"),
        (Layout("f" * 9, "csv", ("a" * 60,)), f"csv-{'a' * 36}-ffffff.toml"),
    ],
)
def test_a_profile_has_a_name_of_every_layout(layout: Layout, name: str, tmp_path: Path) -> None:
    assert save_profile({}, layout, tmp_path).path.name == name


def test_a_logger_that_moved_to_another_hanger_says_none_from_then_on(tmp_path: Path) -> None:
    first = save_profile(SAID, LAYOUT, tmp_path)
    assert not save_profile(SAID, LAYOUT, tmp_path).roams
    assert not save_profile({"sampling_rate_hz": 100.0}, LAYOUT, tmp_path).roams
    save_profile(SAID, LAYOUT, tmp_path)
    moved = save_profile({**SAID, "hanger": 4}, LAYOUT, tmp_path)
    without = {key: KEPT[key] for key in ("sampling_rate_hz", "channel")}
    assert (moved.path, moved.roams, moved.described) == (first.path, True, without)
    assert profile_for(LAYOUT, tmp_path) == moved
    again = save_profile(SAID, LAYOUT, tmp_path)
    assert again.roams
    assert "hanger" not in again.described
    assert save_profile({"hanger": 1}, Layout("x", "y", ()), tmp_path, roams=True).described == {}


def test_a_hanger_written_into_the_profile_of_a_logger_that_moves_is_not_taken(
    tmp_path: Path,
) -> None:
    path = save_profile({}, LAYOUT, tmp_path, roams=True).path
    path.write_text(path.read_text() + "hanger = 3\nsampling_rate_hz = 9.0\n")
    found = profile_for(LAYOUT, tmp_path)
    assert found is not None
    assert found.described == {"sampling_rate_hz": 9.0}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("fingerprint = ", "not a readable TOML file"),
        ("fingerprint = 1", "is no profile of a logger"),
        ('fingerprint = "a"\nchannel = 2', "is no profile of a logger"),
        ('fingerprint = "a"\n[channel.b]\nx_m = 1\nplan = 2', "'plan' is not a key of a channel"),
        ('fingerprint = "a"\nchannel.b = 5', "'5' is not a key of a channel"),
    ],
)
def test_a_damaged_profile_is_named(text: str, said: str, tmp_path: Path) -> None:
    path = save_profile({}, LAYOUT, tmp_path).path
    path.write_text(text)
    with pytest.raises(BadInput, match=said) as refused:
        profile_for(LAYOUT, tmp_path)
    assert str(refused.value).startswith(path.name)
    assert refused.value.remedy


def test_the_own_sidecar_comes_before_the_name_and_the_name_before_the_profile() -> None:
    assert completed(SAID, LAYOUT, {}) == KEPT
    assert completed(SAID, LAYOUT, {}, "hanger5_a.csv")["hanger"] == 5
    assert completed(SAID, LAYOUT, {"hanger": 6}, "hanger5_a.csv")["hanger"] == 6
    own = {"temperature_c": 9.0, "channel": {"A 1": {"x_m": 1.0}, "A 2": {"unit": "g"}}}
    whole = completed(SAID, LAYOUT, own)
    assert whole["temperature_c"] == 9.0
    assert whole["channel"] == {"A 1": {"plane": "transverse", "x_m": 1.0}, "A 2": {"unit": "g"}}
    assert completed({}, LAYOUT, {"hanger": 2}) == {"hanger": 2}


def test_what_the_file_says_itself_the_profile_does_not_say_in_its_stead() -> None:
    has_entry = Layout("a", "b", ("c",), hanger=7, has_rate=True)
    assert completed(SAID, has_entry, {}) == {"channel": KEPT["channel"]}
    listed = completed(SAID, LAYOUT, {"x_m": [1.0]})
    assert listed["channel"] == {"A 1": {"plane": "transverse"}}


def test_a_sidecar_is_written_so_that_toml_reads_the_same() -> None:
    said = {
        "flag": True,
        "started_at": datetime(2026, 5, 6, 7, 8, 9, tzinfo=UTC),
        "list": ["a", 1.5],
        "number": -2,
        "channel": {'a "b"\\': {"unit": "m/s²", "x_m": 0.5}},
    }
    text = sidecar_text(said)
    assert text.endswith("\n")
    assert not text.endswith("\n\n")
    read = tomllib.loads(text)
    assert str(read.pop("started_at")).startswith("2026-05-06")
    assert read == {key: said[key] for key in said if key != "started_at"}
    assert tomllib.loads(sidecar_text({"a": "b\x07c\ud800"})) == {"a": "b c "}
