"""`shm report`: periods and PDF, of a hanger and of the bridge."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.store import Workspace
from tests.cli.conftest import Shm
from tests.helpers.pdf_words import Pdf


def test_the_suffix_pdf_gives_a_pdf_with_origin(
    shm: Shm, bridge: Workspace, tmp_path: Path
) -> None:
    out = tmp_path / "r.PDF"
    ended = shm("--workspace", bridge.folder, "report", "--hanger", 3, "--out", out)
    assert (ended.code, ended.out) == (0, "")
    told = Pdf.parse(out.read_bytes()).words
    assert "Hanger 3 ● Alert" in told
    assert "t2.modes.json" in told
    assert "SHA-256 of that file" in told
    assert "band_low_hz" not in told  # the settings are an appendix of the page


def test_a_pdf_is_not_shown_in_a_terminal(
    shm: Shm, bridge: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shm_cli.report.on_a_terminal", lambda: True)
    ended = shm("--workspace", bridge.folder, "report", "--hanger", 3, "--format", "pdf")
    assert ended.code == 2
    assert "--out FILE.pdf" in ended.err


def test_a_period_keeps_what_lies_in_it(shm: Shm, bridge: Workspace) -> None:
    call = ("--workspace", bridge.folder, "report", "--hanger", 3, "--json")
    whole = shm(*call).document
    second = whole["trend"][1]["time"]
    document = shm(*call, "--since", second).document
    assert [row["test"] for row in document["trend"]] == ["t1", "t2"]
    assert document["period"]["since"] == second
    assert "In the period" in document["summary"]
    assert document["posterior"] == whole["posterior"]


def test_a_period_without_a_test_names_the_latest(shm: Shm, bridge: Workspace) -> None:
    for what in (("--hanger", 3), ("--bridge",)):
        ended = shm("--workspace", bridge.folder, "report", *what, "--since", "2026-07-01")
        assert ended.code == 4
        assert "t2" in ended.err
        assert "2026-06-30" in ended.err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--hanger", 3, "--since", "soon"), "90d"),
        (("--hanger", 3, "--test", "t1", "--since", "90d"), "either --test or --since"),
        (("--since", "90d"), "--bridge"),
    ],
)
def test_a_call_that_is_off_says_how_it_is_meant(
    shm: Shm, bridge: Workspace, arguments: tuple[object, ...], told: str
) -> None:
    ended = shm("--workspace", bridge.folder, "report", *arguments)
    assert ended.code == 2
    assert told in ended.err
