"""docs/recordings.md: its examples are run, its files peeked into."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

from shm.modes_document import load_modes
from shm.read import FORMATS, peek, read, sidecar_path
from shm.read.content import MOST_MEMBERS
from shm.read.header import CHANNEL_KEYS, KEYS
from shm.read.limits import Limits
from shm.read.logger_words import unit_of
from shm.values import FrequencyResponse, Recording
from tests.helpers.written import recorded

PAGE = (Path(__file__).parents[2] / "docs" / "recordings.md").read_text(encoding="utf-8")


def blocks(kind: str) -> list[str]:
    found = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    return [text for of, text in found if of == kind]


def test_the_texts_are_read(tmp_path: Path) -> None:
    record, response = [text for text in blocks("") if text.startswith("# hanger")]
    for name, text in (("record.csv", record), ("response.csv", response)):
        head, row = text.rsplit("\n...", 1)[0].rsplit("\n", 1)
        cells = row.split(",")
        lines = [",".join([str(i), *cells[1:]]) for i in range(20)]
        (tmp_path / name).write_text("\n".join([head, *lines]))
        assert peek(tmp_path / name).problems == ()
    assert isinstance(read(tmp_path / "record.csv"), Recording)
    assert isinstance(read(tmp_path / "response.csv"), FrequencyResponse)


def test_the_sidecars_are_read(tmp_path: Path, recording: Recording) -> None:
    whole, volts, analysers = blocks("toml")
    assert set(tomllib.loads(analysers)["channel"]) == {"Time_chan_1", "Time_chan_2"}
    path = tmp_path / "test.csv"
    head = "# sampling_rate_hz: 9\nforce,acc_1,acc_2,acc_3\n"
    path.write_text(head + "1,2,3,4\n" * 20)
    sidecar_path(path).write_text(whole)
    assert peek(path).problems == ()
    found = recorded(path)
    assert found.hanger == 3
    assert [c.name for c in found.channels] == ["force", "acc_1", "acc_2"]
    assert [c.plane for c in found.channels[1:]] == ["transverse", "longitudinal"]
    sidecar_path(path).write_text(volts)
    assert [c.full_scale for c in peek(path).channels[:2]] == [2200.0, 50.0]
    assert [c.calibration for c in peek(path).channels[:2]] == [227.0, 10.0]


def test_the_modal_tests_are_read(tmp_path: Path) -> None:
    (document,) = blocks("json")
    path = tmp_path / "t1.modes.json"
    path.write_text(document)
    (test,) = load_modes(path)
    assert [mode.plane for mode in test.modes] == ["transverse", "longitudinal"]
    assert json.loads(document)["hanger"] == test.hanger


@pytest.mark.parametrize("key", [*KEYS, *CHANNEL_KEYS])
def test_page_of_recordings_names_key(key: str) -> None:
    assert re.search(rf"\b{key}\b", PAGE), f"add the key {key} to docs/recordings.md"


def test_the_page_names_every_format_unit_and_limit() -> None:
    for suffix in [suffix for known in FORMATS for suffix in known.suffixes]:
        assert f"`{suffix}`" in PAGE, f"add {suffix} to the formats of docs/recordings.md"
    units = re.search(r"Units: (.*?) for forces; (.*?) for\s+accelerations", PAGE, re.DOTALL)
    assert units is not None
    named = re.sub(r"\(also (.*?)\)", r", \1", f"{units[1]}, {units[2]}")
    assert all(unit_of(unit) for unit in re.split(r",\s*", named) if unit.strip())
    for limit in (
        f"1 to {Limits().max_channels} acc",
        f"{Limits().bytes_at_once >> 20} MB",
        f"{MOST_MEMBERS} f",
    ):
        assert limit in PAGE.replace("\n", " ")
