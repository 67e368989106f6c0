"""What stands in the pages beside commands: descriptions, sidecars, documents, equations."""

from __future__ import annotations

import importlib.util
import re
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from sphinx.errors import SphinxError

from tests.helpers.pages import DOCS, PAGES, name_of


def blocks(page: str, kind: str) -> list[str]:
    text = (DOCS / page).read_text()
    return re.findall(rf"^```{kind}\n(.*?)^```$", text, re.M | re.S)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_description_of_a_page_is_toml(page: Path) -> None:
    for block in blocks(f"{name_of(page)}.md", "toml"):
        if "# ..." not in block:
            assert tomllib.loads(block)


@pytest.fixture(scope="module")
def drawn_math() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "drawn_math", DOCS / "extensions" / "drawn_math.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_equation_of_the_physics_can_be_drawn(drawn_math: ModuleType) -> None:
    text = (DOCS / "physics.md").read_text()
    displayed = re.findall(r"\$\$(.+?)\$\$", text, re.S)
    lines = [line for block in displayed for line in block.split(r"\\")]
    inline = re.findall(r"(?<!\$)\$([^$\n]+)\$(?!\$)", re.sub(r"\$\$.+?\$\$", "", text, flags=re.S))
    assert len(lines) > 10
    assert len(inline) > 30
    for equation in (*lines, *inline):
        drawn = drawn_math.drawing(equation, 1.0)
        assert drawn.count("<svg") == 1
        assert 'fill="currentColor"' in drawn


def test_an_equation_that_cannot_be_drawn_is_named(drawn_math: ModuleType) -> None:
    with pytest.raises(SphinxError, match="frobnicate"):
        drawn_math.drawing(r"\frobnicate{x}", 1.0)
