"""The page of effects says all of every effect."""

from __future__ import annotations

import json

import pytest

from docs.command_pages import effects_page
from shm.models.effects import EFFECTS
from shm_cli.main import run


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effects_section_says_all_that_an_engineer_asks(name: str) -> None:
    section = effects_page().split(f"\n## {name}\n")[1].split("\n## ")[0]
    for what in ("| parameter |", "- Where:", "- Shown by:", "- Easily taken for:", "- Source:"):
        assert section.count(what) == 1
    assert EFFECTS[name].source in section


def test_the_command_prints_what_the_page_says_of_an_effect(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["gap", "effects", "point_mass"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert EFFECTS["point_mass"].source.split(",")[0] in printed
    assert "mass_kg" in printed
    assert run(["gap", "effects", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["effects"]
    assert [each["effect"] for each in listed] == list(EFFECTS)
    assert all(each["parameters"] and each["places"] for each in listed)
