"""A file of modes with a sidecar beside it: heeded, or refused where modes cannot have it."""

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest

import shm
from shm.errors import BadInput
from shm.read import sandbox


@pytest.fixture
def modes(tmp_path: Path) -> Path:
    """Two tests of hanger 3 without time or temperature."""
    tests = [
        {"id": name, "modes": [{"plane": "transverse", "order": 1, "frequency_hz": 5.8}]}
        for name in ("a", "b")
    ]
    file = tmp_path / "sent.modes.json"
    file.write_text(json.dumps({"schema": "shm.modes/1", "hanger": 3, "tests": tests}))
    return file


def only_first(modes: Path) -> None:
    document = json.loads(modes.read_text())
    modes.write_text(json.dumps({**document, "tests": document["tests"][:1]}))


def test_what_a_sidecar_says_goes_before_the_document(modes: Path) -> None:
    modes.with_suffix(".toml").write_text("hanger = 5\ntemperature_c = 12.5\n")
    for found in (shm.load_modes(modes), sandbox.load_modes(modes)):
        assert [(test.hanger, test.temperature_c) for test in found] == [(5, 12.5), (5, 12.5)]
        assert [test.id for test in found] == ["a", "b"]


def test_a_time_is_that_of_a_single_test(modes: Path) -> None:
    modes.with_suffix(".toml").write_text("time = 2026-05-01T10:00:00Z\n")
    with pytest.raises(BadInput, match="one time is said of 2 tests"):
        shm.load_modes(modes)
    only_first(modes)
    assert shm.load_modes(modes)[0].time == datetime(2026, 5, 1, 10, tzinfo=UTC)


@pytest.mark.parametrize(
    "said", ["sampling_rate_hz = 512", '[channel.acc_1]\nunit = "g"', 'plane = "transverse"']
)
def test_what_only_samples_have_is_refused(modes: Path, said: str) -> None:
    sidecar = modes.with_suffix(".toml")
    sidecar.write_text(said)
    with pytest.raises(BadInput) as refused:
        shm.load_modes(modes)
    assert str(refused.value.file) == str(sidecar)


def test_a_temperature_of_no_bridge_is_refused(modes: Path) -> None:
    document = json.loads(modes.read_text())
    document["tests"][1]["temperature_c"] = 282
    modes.write_text(json.dumps(document))
    with pytest.raises(BadInput, match="temperature_c = 282 is no temperature outdoors"):
        shm.load_modes(modes)


def test_a_misspelt_key_is_refused_and_those_of_others_are_left_alone(modes: Path) -> None:
    modes.with_suffix(".toml").write_text("temprature_c = 12.0\n")
    with pytest.raises(BadInput, match="unknown key temprature_c") as refused:
        shm.load_modes(modes)
    assert "Write temperature_c" in refused.value.remedy
    modes.with_suffix(".toml").write_text('operator = "Ann"\nshoes = "brown"\n')
    assert [test.operator for test in shm.load_modes(modes)] == ["Ann", "Ann"]
