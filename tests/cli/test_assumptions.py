"""`shm settings --assumptions`, and what update, select and gap diagnose say of overridden rows."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.assumptions import DEFAULTS
from shm.store import Workspace
from tests.cli.conftest import Shm

QUICK = ("--samples", 100, "--json")


@pytest.fixture
def overridden(hanger_file: Path, tmp_path: Path) -> Path:
    """Hanger 3, whose owner has weighed the sensors."""
    path = tmp_path / "weighed.toml"
    text = hanger_file.read_text(encoding="utf-8")
    row = '[assumptions]\naccelerometer_mass_kg = {value = 0.2, reason = "weighed"}\n\n'
    path.write_text(row + text, encoding="utf-8")
    return path


def test_settings_lists_every_assumption(shm: Shm) -> None:
    listed = shm("settings", "--assumptions", "--json").document
    assert listed["schema"] == "shm.assumptions/1"
    assert list(listed["assumptions"]) == list(DEFAULTS)
    sensor = listed["assumptions"]["accelerometer_mass_kg"]
    assert (sensor["value"], sensor["sd"], sensor["unit"]) == (0.05, 0.05, "kg")
    assert sensor["from"] == "default"
    printed = shm("settings", "--assumptions").out
    assert all(f"{name} = " in printed for name in DEFAULTS)


def test_settings_says_what_a_bridge_overrides(shm: Shm, empty: Workspace) -> None:
    path = Path(empty.bridge.source)
    own = "[assumptions]\nend_restraint = [3, 1000]\n"
    path.write_text(own + path.read_text(encoding="utf-8"), encoding="utf-8")
    listed = shm("--workspace", empty.folder, "settings", "--assumptions", "--json").document
    ends = listed["assumptions"]["end_restraint"]
    assert (ends["lower"], ends["from"]) == (3.0, "bridge.toml")


def test_settings_of_one_hanger_are_assumptions_alone(shm: Shm, overridden: Path) -> None:
    ended = shm("settings", "--assumptions", "--hanger-file", overridden)
    assert "accelerometer_mass_kg = 0.2 ± 0.05 kg (bridge.toml)\n    weighed" in ended.out
    assert shm("settings", "--hanger-file", overridden).code == 2


def test_update_and_select_name_overridden_rows(
    shm: Shm, modes_file: Path, hanger_file: Path, overridden: Path
) -> None:
    calls = (("update", "--model", "beam1"), ("select", "--models", "beam1"))
    for verb, *model in calls:
        document = shm(verb, modes_file, "--hanger-file", overridden, *model, *QUICK).document
        (name,) = document["assumptions"]
        assert name == "accelerometer_mass_kg"
        assert document["assumptions"][name]["reason"] == "weighed"
        plain = shm(verb, modes_file, "--hanger-file", hanger_file, *model, *QUICK).document
        assert "assumptions" not in plain


def test_update_tells_overridden_rows_in_words(
    shm: Shm, modes_file: Path, hanger_file: Path, overridden: Path
) -> None:
    model = ("--model", "beam1", "--samples", 100)
    assert (
        "accelerometer_mass_kg = 0.2"
        in shm("update", modes_file, "--hanger-file", overridden, *model).out
    )
    assert "ssum" not in shm("update", modes_file, "--hanger-file", hanger_file, *model).out


def test_misspelled_assumption_ends_with_a_hint(
    shm: Shm, modes_file: Path, overridden: Path
) -> None:
    text = overridden.read_text(encoding="utf-8")
    overridden.write_text(text.replace("accelerometer_mass_kg", "acelerometer_mass_kg"))
    ended = shm("update", modes_file, "--hanger-file", overridden, "--model", "beam1")
    assert ended.code == 3
    assert "Did you mean accelerometer_mass_kg?" in ended.err
    assert "line 2" in ended.err
