"""Hold layouts, looks, values, refusals and exit codes of reading.

Golden files are by `write_read_golden.py`. A fingerprint of a layout is the key of a logger's
profile in a workspace: where one changed, each logger would have to be imported again.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.contracts import read_calls as calls


def golden(name: str) -> dict[str, Any]:
    """Return a golden document."""
    found: dict[str, Any] = json.loads((calls.FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return found


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return calls.sound_files(tmp_path_factory.mktemp("sound"))


@pytest.mark.parametrize("name", golden("files"))
def test_layout_look_and_values_of_a_file(sound: dict[str, Path], name: str) -> None:
    assert calls.noted(sound[name]) == golden("files")[name]


def test_every_format_is_in_the_golden_file(sound: dict[str, Path]) -> None:
    assert sound.keys() == golden("files").keys()
    assert all(not each["look"][0]["problems"] for each in golden("files").values())


def test_refusals_with_place_and_remedy(tmp_path: Path) -> None:
    found = calls.refusals(tmp_path)
    assert found == golden("refusals")
    assert all(each["message"] != "read" and each["remedy"] for each in found.values())


def test_exit_codes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert calls.exit_codes(tmp_path, monkeypatch) == golden("exit_codes")
