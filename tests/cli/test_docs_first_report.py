"""docs/first_report.md is followed as it stands, up to a report of each kind."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from tests.cli.conftest import Shm
from tests.helpers.command_lines import fenced_commands, words_of
from tests.helpers.painting import unpaint

PAGE = Path(__file__).resolve().parents[2] / "docs" / "first_report.md"
COMMANDS = [line for line in fenced_commands(PAGE) if not line.endswith("--help")]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the reader is: with the description; fewer samples and blank figures, to be quick."""
    described = re.search(r"^```toml\n(.*?)^```$", PAGE.read_text(), re.M | re.S)
    assert described is not None
    (tmp_path / "mill.toml").write_text(described[1])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SHM_SAMPLES", "200")
    unpaint(monkeypatch)
    return tmp_path


@pytest.mark.slow
def test_the_page_leads_to_a_report_that_holds_the_planted_tension(
    shm: Shm, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: dict[str, str] = {}
    for line in COMMANDS:
        ended = shm(*_globbed(words_of(line)))
        assert ended.code == 0, f"{line}: {ended.err}"
        said[line] = ended.out
        if line.startswith("shm init"):
            assert "export SHM_WORKSPACE=mill" in PAGE.read_text()
            monkeypatch.setenv("SHM_WORKSPACE", "mill")
    assert (folder / "hanger1.pdf").read_bytes().startswith(b"%PDF")
    assert "<html" in (folder / "hanger1.html").read_text()
    report = shm("report", "--hanger", 1, "--json").document
    tension = report["posterior"]["tension_n"]
    assert tension["q05"] < 380e3 < tension["q95"]
    assert "done" in said["shm ingest tests/*.csv"]


def _globbed(words: list[str]) -> list[str]:
    """As a shell does it."""
    return [
        found
        for word in words
        for found in (sorted(str(path) for path in Path().glob(word)) if "*" in word else [word])
    ]


def test_a_page_of_more_than_one_shell_variable_would_need_more_of_this_test() -> None:
    assert re.findall(r"^export (\w+)=", PAGE.read_text(), re.M) == ["SHM_WORKSPACE"]
    assert "SHM_WORKSPACE" not in os.environ
