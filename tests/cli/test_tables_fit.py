"""A table fits the terminal, narrow or wide, and loses nothing by it."""

from __future__ import annotations

import pytest

from shm.store import Workspace
from shm_cli.common import show_rows
from tests.cli.conftest import Shm

WIDTHS = (80, 200)


def widest(text: str) -> int:
    return max(len(line) for line in text.splitlines())


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(
    "line",
    ["status", "alerts", "drift --hanger 3 --all", "db check", "report --hanger 3", "status --of 1",
     "predict beam2 --hanger 3 --set log10_k1=8 --set log10_k2=8 --set log10_k3=8 "
     "--set log10_k4=8 --sweep theta_F=0.9:1.1:2 --modes 9"],
)  # fmt: skip
def test_what_a_command_shows_fits(
    shm: Shm, bridge: Workspace, monkeypatch: pytest.MonkeyPatch, line: str, width: int
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    ended = shm.at(bridge).done(line)
    rows = "\n".join(row for row in ended.out.splitlines() if not row.startswith(SENTENCES))
    assert widest(rows) <= width


SENTENCES = ("hanger 3", "hangers", "waiting: ", "Test bridge: ", "Beam 2: ")
"""Lines of running text, which the terminal itself wraps."""


def test_wide_table_is_list(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    headings = [f"quantity_{number}" for number in range(9)]
    rows = [[f"value_{number}" for number in range(9)], ["other", *("" for _ in range(8))]]
    monkeypatch.setenv("COLUMNS", "80")
    show_rows("many columns", headings, rows)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["quantity_8", "value_8"] in lines
    assert ["quantity_0", "other"] in lines
    assert sum(line[:1] == ["quantity_8"] for line in lines) == 1


def test_file_gets_table(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    rows = [[str(number) for number in range(8)]]
    show_rows("wide", [f"a heading {number}" for number in range(8)], rows)
    assert widest(capsys.readouterr().out) > 80
