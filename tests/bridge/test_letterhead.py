"""The table `[report]` of bridge.toml, and the logo that it names."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.bridge.description import NO_LETTERHEAD, letterhead_of
from shm.errors import BadInput
from shm.report.paper import read_logo


def test_a_missing_logo_is_named(tmp_path: Path) -> None:
    found = letterhead_of({"report": {"logo": "a.png"}}, tmp_path / "bridge.toml")
    assert "a.png" in read_logo(found.logo).fault


def test_a_logo_of_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no PNG or JPEG"):
        letterhead_of({"report": {"logo": "a.gif"}}, tmp_path / "bridge.toml")


def test_an_empty_text_says_nothing_and_what_cannot_be_shown_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bridge.toml"
    assert letterhead_of({"report": {"organisation": " "}}, path) == NO_LETTERHEAD
    assert letterhead_of({"report": {"organisation": " A "}}, path).organisation == "A"
    with pytest.raises(BadInput, match=r"organisation = 'a\\x1b' is not a text"):
        letterhead_of({"report": {"organisation": "a\x1b"}}, path)
