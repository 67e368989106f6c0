"""Hold each default that results rest on, by its name: assumptions, settings, options."""

from __future__ import annotations

import json
import re

import pytest

from tests.contracts.write_defaults_golden import GOLDEN, OPTIONS, ROOT, list_defaults

HELD = json.loads(GOLDEN.read_text(encoding="utf-8"))
WRITE = "python tests/contracts/write_defaults_golden.py"


def test_every_default_is_in_the_golden_file() -> None:
    assert list(list_defaults()) == list(HELD), f"Run {WRITE}"


def test_every_class_of_options_is_held() -> None:
    sources = (path.read_text(encoding="utf-8") for path in (ROOT / "shm").rglob("*.py"))
    found = {name for text in sources for name in re.findall(r"^class (\w+Options)\b", text, re.M)}
    assert found <= {kind.__name__ for kind in OPTIONS}, "Add it to OPTIONS of the writer."


@pytest.mark.parametrize("name", HELD)
def test_default_is_that_of_the_golden_file(name: str) -> None:
    made, held = list_defaults().get(name), HELD[name]
    assert made == held, f"{name} is {made}, not {held}. If that is meant: {WRITE}, and CHANGELOG."
