"""The manual's page of effects is the one that the catalogue makes now."""

from __future__ import annotations

from pathlib import Path

import pytest

from docs.effects_page import effects_page
from shm.models.effects import EFFECTS

PAGE = Path(__file__).resolve().parents[2] / "docs" / "effects.md"


def test_the_page_is_what_the_catalogue_makes() -> None:
    assert PAGE.read_text(encoding="utf-8") == effects_page(), "Run `make docs`."


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effects_section_says_all_that_an_engineer_asks(name: str) -> None:
    section = effects_page().split(f"\n## {name}\n")[1].split("\n## ")[0]
    for what in ("| parameter |", "- Where:", "- Shown by:", "- Easily taken for:", "- Source:"):
        assert section.count(what) == 1
    assert EFFECTS[name].source in section
